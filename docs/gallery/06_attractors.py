"""
Attractors that coexist, and their shares
=========================================

A sweep meets the attractor its path leads to. A study of ``attractors`` starts from many states of
a box and reports all motions that they reach, each with its share of the box and a confidence
interval.
"""

from pathlib import Path

from shell import shell

import hpcsweep

Path("attractors.toml").write_text("""\
[study]
kind = "attractors"
starts = 150
displacement = [-1.0, 1.0]
velocity = [-1.0, 1.0]
seed = 1

[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = 0.445
amplitude = {from = 0.09, to = 0.24, count = 16}
""")
shell("mpirun -n 2 hpcsweep run attractors.toml -o attractors.h5")
shell("hpcsweep plot attractors.h5 -o attractors.png")

# %%
# The shares, stacked: which part of the starts goes where.
shell("hpcsweep plot attractors.h5 --kind shares -o attractors-shares.png")

# %%
# In Python, at a point:
found = hpcsweep.open_results("attractors.h5").sel(amplitude=0.12, method="nearest").squeeze()
for k in range(int(found.n_attractors)):
    each = found.isel(attractor=k)
    print(
        f"P{int(each.orbit_period)}: {float(each.share):.1%} of the starts "
        f"({float(each.share_low):.1%} to {float(each.share_high):.1%})"
    )
