"""
A map over amplitude and frequency
==================================

Every point of the map is a run from rest. Points are independent of each other, so that a map
scales to as many ranks as it has points.
"""

from pathlib import Path

from shell import shell

Path("map.toml").write_text("""\
[study]
kind = "points"

[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = {from = 0.25, to = 0.75, count = 40}
amplitude = {from = 0.01, to = 0.35, count = 40}

[output]
lyapunov = true
poincare = false
""")
shell("mpirun -n 2 hpcsweep run map.toml -o map.h5")

# %%
# Classes of motion. The red line is the grazing amplitude, a closed form: left of it the linear
# motion touches nothing. Motions with impacts exist there, too: the start decides.
shell("hpcsweep plot map.h5 --kind map -o map.png")

# %%
# Any result can be the colour: here the drift.
shell("hpcsweep plot map.h5 --kind map --value drift -o map-drift.png")
