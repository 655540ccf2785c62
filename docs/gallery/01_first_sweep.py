r"""
A first sweep
=============

A building of three storeys stands beside a rigid stop. The ground shakes with the acceleration
:math:`A \sin \Omega\tau`; the amplitude *A* is raised in small steps and lowered again. Once a
forcing period, always at the same phase, the displacements are noted: the *stroboscopic points*.
"""

from pathlib import Path

from shell import shell

Path("first.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0   # of the stop to a storey
damping_ratio = 0.05       # of every mode

[sweep]
omega = 0.445              # the first natural frequency
amplitude = {from = 0.005, to = 0.25, step = 0.0025}
""")

# %%
# What does the job compute? ``describe`` answers before anything is spent.
shell("hpcsweep describe first.toml")

# %%
# On two ranks; with ``srun`` on a cluster it is the same.
shell("mpirun -n 2 hpcsweep run first.toml -o first.h5")
shell("hpcsweep summary first.h5")

# %%
# The orbit diagram: the displacement of each floor, once a forcing period, against the amplitude.
# One point at an amplitude is a motion that repeats itself every period, two points one that does
# so every second period. The stop is at 1.
shell("hpcsweep plot first.h5 -o first.png")
