"""
Collapse of a frame that degrades
=================================

The margin against collapse of an archetype, as FEMA P695 asks for it: 44 components of ground
motion, each scaled until the frame falls over, and the median intensity at which it does over that
of the maximum considered earthquake, the *collapse margin ratio*. Storeys lose strength beyond a
drift of 2.5 %, more of it in each cycle, and load again towards the largest drift so far.

The records are synthetic ones, all of one kind, since those of P695 may not be shipped: their
dispersion is half as large as that of recorded ones. With your own, ``records.files`` takes the
place of ``records.synthetic``, and nothing else changes.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from shell import shell

import hpcsweep

Path("archetype.toml").write_text("""\
study.kind = "records"
units = {length = "m", mass = "kg", time = "s"}
records.synthetic = {count = 44, seed = 1, duration = 30.0}
records.scale = {by = "sa", period = "T1", from = 1.0, to = 25.0, count = 25}
[[building]]
mass = [2.4e5, 2.4e5, 2.4e5, 1.8e5]
storey_stiffness = [1.6e8, 1.6e8, 1.4e8, 1.2e8]
storey_height = 3.0
yield_drift = 0.015
hardening = 0.03
p_delta = true
collapse_drift = 0.3
backbone = {rule = "peak-oriented", theta_p = 0.06, theta_pc = 0.24, Lambda = 1.8}
""")
shell("hpcsweep run archetype.toml -o archetype.h5")
shell("hpcsweep fragility archetype.h5 --collapse")
shell("hpcsweep plot archetype.h5 --kind ida -o archetype-1-ida.png")
shell("hpcsweep plot archetype.h5 --kind fragility --collapse -o archetype-2-fragility.png")

# %%
# The maximum considered earthquake of seismic design category D has Sa = 0.9 g / T at most, 0.3 g /
# T at least (FEMA P695, chapter 6). The ratios are without the factor for the shape of spectra,
# which is for recorded motions.


def fitted(results):
    """Return the fragility of collapse: a capacity is the middle between two stripes."""
    found = hpcsweep.capacity(results.scale.values, results.collapsed.values, threshold=0.5)
    return hpcsweep.capacity_fragility(found)


period = hpcsweep.load_job("archetype.toml").structure.longest_period
fit = fitted(hpcsweep.open_results("archetype.h5"))
for name, at_1_second in (("D_max", 0.9), ("D_min", 0.3)):
    considered = at_1_second * 9.81 / period
    print(f"{name}: {considered:.1f} m/s^2, margin {fit.median / considered:.2f}")

# %%
# Loops of a record: the lowest storey is capped, loses strength along the falling branch, and falls
# over late, by what P-Delta takes.
shell("hpcsweep plot archetype.h5 --kind hysteresis --record synthetic-1-3 --scale 12 -o loops.png")

# %%
# What the margin depends on: the same frame with a third and with three times the plastic drift
# until capping, without deterioration by cycles, and without capping: P-Delta alone.
Path("variants.toml").write_text("""\
extends = "archetype.toml"
records.scale = {by = "sa", period = "T1", from = 3.0, to = 30.0, count = 10}
[vary]
rows = [
    {"building[0].backbone.theta_p" = 0.02, "building[0].backbone.Lambda" = 1.8},
    {"building[0].backbone.theta_p" = 0.06, "building[0].backbone.Lambda" = 1.8},
    {"building[0].backbone.theta_p" = 0.06, "building[0].backbone.Lambda" = 1e6},
    {"building[0].backbone.theta_p" = 0.18, "building[0].backbone.Lambda" = 1.8},
    {"building[0].backbone.theta_p" = 1e6, "building[0].backbone.Lambda" = 1e6},
]
""")
shell("hpcsweep run variants.toml -o variants.h5")
variants = hpcsweep.open_results("variants.h5")
words = ["capping at 1.2 %", "at 2.5 %", "at 2.5 %, cycles take nothing", "at 6.5 %", "no capping"]
figure, axis = plt.subplots(figsize=(8.6, 3.6), layout="constrained")
intensity = np.linspace(0.1, 30.0, 300)
for structure, label in zip(variants.structure, words, strict=True):
    fit = fitted(variants.sel(structure=structure))
    axis.plot(intensity, fit.probability(intensity), label=f"{label}: {fit.median:.1f}")
axis.set(xlabel="Sa(T1; 5 %)  [m/s²]", ylabel="probability of collapse", xlim=(0, 30), ylim=(0, 1))
figure.legend(loc="outside right center", title="median", fontsize=9)
plt.show()
