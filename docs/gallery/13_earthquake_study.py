"""
Incremental dynamic analysis as a job
=====================================

A suite of ground motions, each scaled to a row of intensities, for two buildings at two distances:
one job, one file, any number of ranks. Runs that follow from others are not computed again: below
first contact the response is proportional to the scale, and equal ratios of gap to scale are one
motion.
"""

from pathlib import Path

import numpy as np
from shell import shell

import hpcsweep

Path("pair.toml").write_text("""\
[study]
kind = "records"

[[building]]
name = "A"
mass = [2.5e5, 2.5e5, 2.5e5]
storey_stiffness = 3e8
storey_height = 3.2

[[building]]
name = "B"
mass = [2.5e5, 2.5e5, 2.5e5, 2.5e5, 2.5e5]
storey_stiffness = 2e8
storey_height = 3.2

[pounding]
gap = 0.04
stiffness = 2e9

[units]
length = "m"
mass = "kg"
time = "s"

[records]
synthetic = {count = 12, seed = 1, duration = 20.0}
scale = {by = "sa", period = 0.78, from = 0.5, to = 12.0, count = 24}

[vary]
"pounding.gap" = [0.02, 0.04]
""")
shell("mpirun -n 2 hpcsweep run pair.toml -o pair.h5")
shell("hpcsweep summary pair.h5")

# %%
# The curves of all records, with their counted fractiles.
shell("hpcsweep plot pair.h5 --at gap=0.04 -o pair.png")

# %%
# One page for the browser, with both distances: curves, fragility and profiles, linked by the
# record that is pointed at.
shell("hpcsweep explore pair.h5")

# %%
# Largest drift ratio of building B, in per cent, with pounding and without: the median of the
# records at three intensities (Sa at 0.78 s, m/s^2).
results = hpcsweep.open_results("pair.h5")
storeys = [name for name in results.storey.values if name.startswith("B")]
drift = results[["storey_drift", "storey_drift_alone"]].sel(storey=storeys).max("storey")
ratio = 100 * drift.median("record").sel(scale=[3.0, 6.0, 12.0]) / 3.2
print(ratio.to_dataframe().unstack("gap").round(2))

# %%
# A portfolio: 80 such pairs, a line of a table each, in one job and one file. All are shaken with
# the same spectral acceleration at their own longest period, and compared in one picture, a point a
# pair. Small gaps and soft buildings go together with large forces.
stiffness, gap = np.random.default_rng(1).uniform((1e8, 0.005), (4e8, 0.06), (80, 2)).T
lines = [f"{k:.4g},{0.7 * k:.4g},{g:.3f}" for k, g in zip(stiffness, gap, strict=True)]
keys = "building[0].storey_stiffness,building[1].storey_stiffness,pounding.gap"
Path("pairs.csv").write_text("\n".join([keys, *lines]))
Path("portfolio.toml").write_text("""\
extends = "pair.toml"

[records]
scale = {by = "sa", period = "T1", values = [4.0]}

[vary]
rows = "pairs.csv"
"pounding.gap" = "unset"
""")
shell("hpcsweep run portfolio.toml")
shell("hpcsweep plot portfolio.h5 --kind portfolio --response force --colour pounding.gap")
