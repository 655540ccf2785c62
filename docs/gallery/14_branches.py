"""
Branches over the orbit diagram
===============================

A sweep sees what attracts. A branch follows an orbit on where it has lost its stability, round
folds and through grazings, and so explains where the motions of a diagram come from and why they
end.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from shell import shell

import hpcsweep

Path("branches.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = 0.445
amplitude = {from = 0.005, to = 0.25, count = 246}
""")
shell("hpcsweep run branches.toml -o branches.h5")

# %%
# Two orbits from the sweep: one of period 1 near A = 0.06, one of period 2 near A = 0.11. Each is
# followed in both directions.
structure = hpcsweep.load_job("branches.toml").structure
sweeps = hpcsweep.open_results("branches.h5").isel(omega=0)
branches = []
for amplitude, period in ((0.06, 1), (0.11, 2)):
    run = sweeps.sel(direction="up").sel(amplitude=amplitude, method="nearest")
    assert int(run.orbit_period) == period
    point, amplitude = run.poincare.values[0], float(run.amplitude)
    branches.append(hpcsweep.branch(structure, amplitude, 0.445, point, period, span=(0.005, 0.25)))
    special = branches[-1][["special_value"]]
    special = special.assign(kind=hpcsweep.meanings(branches[-1].special_kind)).to_dataframe()
    print(f"period {period}\n{special.to_string(index=False)}\n")

# %%
# Where a sweep leaves a motion, its branch goes on, unstable.
figure, axis = plt.subplots(figsize=(8, 4.5), layout="constrained")
u = sweeps.poincare.sel(state="u_3")
runs = axis.plot(
    sweeps.amplitude, u.stack(all=["direction", "point"]), ".", color="0.75", ms=9, mew=0
)
runs[0].set_label("sweeps")
for branch, colour in zip(branches, ("C0", "C1"), strict=True):
    points = branch.orbit.sel(state="u_3").values
    stable = branch.stable.values[:, None] > 0
    axis.plot(branch.value, points, color=colour, lw=0.7)
    lines = axis.plot(branch.value, np.where(stable, points, np.nan), color=colour, lw=2)
    lines[0].set_label(f"period {points.shape[1]} (thin: unstable)")
axis.set(xlabel="forcing amplitude A  [gaps ω₀²]", ylabel="u₃ at phase 0  [gaps]")
axis.legend()
plt.show()
