"""
A map computed only where something happens
===========================================

Most of a map is made of areas in which neighbours move alike. ``refine`` computes the map coarsely,
cuts the cells whose points differ, and infers the rest. An audit draws inferred points at random
and computes them, until a confidence interval of the share of wrong ones lies below ``wrong``.
"""

from pathlib import Path

from shell import shell

import hpcsweep

Path("adaptive.toml").write_text("""\
[study]
kind = "points"
refine = {levels = 3, on = ["class", "contact"], wrong = 0.02}

[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = {from = 0.25, to = 0.75, count = 97}
amplitude = {from = 0.01, to = 0.35, count = 97}
classify_cycles = 2000

[output]
lyapunov = true
poincare = false
""")
shell("mpirun -n 2 hpcsweep run adaptive.toml -o adaptive.h5")

# %%
# Each point says where its value comes from. The last look of the audit gives the interval.
results = hpcsweep.open_results("adaptive.h5")
source = results.source
print(f"computed: {float((source != 2).mean()):.1%} of {source.size} points")
print(results.audit.dropna("look").to_pandas())

# %%
# Outlined are the cells whose inside is inferred.
shell("hpcsweep plot adaptive.h5 --kind map --cells -o adaptive.png")
