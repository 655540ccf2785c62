"""
Basins of attraction
====================

Which start goes to which attractor? A study of ``basins`` follows every point of a slice of the
state space, here the first and the second floor displaced, all else at rest.
"""

from pathlib import Path

from shell import shell

Path("basins.toml").write_text("""\
[study]
kind = "basins"
components = ["u_1", "u_2"]
horizontal = {from = -1.0, to = 1.0, count = 100}
vertical = {from = -1.0, to = 1.0, count = 100}

[structure]
n_floors = 3
stiffness_ratio = 1000.0
damping_ratio = [0.1262, 0.0161, 0.0077]

[sweep]
omega = 0.445
amplitude = 0.128
""")
shell("mpirun -n 2 hpcsweep run basins.toml -o basins.h5")
shell("hpcsweep summary basins.h5")

# %%
# Each pixel is a run of its own. Where colours mix down to single pixels the end of a motion
# cannot be told from its beginning in practice.
shell("hpcsweep plot basins.h5 -o basins.png")
