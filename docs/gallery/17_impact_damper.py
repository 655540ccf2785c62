"""
An impact damper: the best clearance
====================================

In a machine at its resonance a free mass of a tenth strikes the walls of a cavity. At a rigid stop
the speed jumps by a coefficient of restitution. A motion depends on the clearance over the forcing
alone, so that a sweep along the amplitude is one along the clearance.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm
from shell import shell

import hpcsweep

mass, damping, gap, e = 0.1, 0.02, 0.5, 0.6
wall = f"gap = {gap}\nstiffness = inf\nrestitution = {e}\n"
Path("impact-damper.toml").write_text(f"""\
[structure]
sharpness = inf

[structure.matrices]
mass = [1.0, {mass}]
stiffness = [[1.0, 0.0], [0.0, 0.0]]
damping = [[{damping}, 0.0], [0.0, 0.0]]
forcing = [1.0, 0.0]

[[structure.contact]]
direction = [-1.0, 1.0]
{wall}
[[structure.contact]]
direction = [1.0, -1.0]
{wall}
[sweep]
omega = 1.0
amplitude = {{from = 0.005, to = 0.12, step = 0.001}}
transient_cycles = 1000

[output]
displacement = true
""")
shell("hpcsweep run impact-damper.toml -o impact-damper.h5")

# %%
# Two impacts a period, each half of it the mirror image of the other, are known in closed form: the
# free mass crosses from wall to wall with the speed w = -2 (x + gap) / pi, where x is the place of
# the machine at an impact. Momentum and restitution give the machine's speeds before and after it;
# its free motion and that by the forcing, whose size is the forcing over the damping, make up both.
closed = []
machine = np.array([[0.0, 1.0], [-1.0, -damping]])
parts = np.array([expm(machine * t) for t in np.linspace(0.0, np.pi, 11)])
turns = np.array([(np.cos(t), np.sin(t)) for t in np.linspace(0.0, np.pi, 11)])
for x in gap * np.linspace(-0.99, 3.0, 400):
    w = -2 * (x + gap) / np.pi
    before = -w * (1 - e + 2 * mass) / (1 + e)
    start = np.array([x, w * (1 - e) + e * before])
    forced = np.linalg.solve(parts[-1] + np.eye(2), parts[-1] @ start + [x, -before])
    amplitude = damping * np.linalg.norm(forced)
    moved = (parts @ (start - forced))[:, 0] + turns @ forced
    closed.append((2 * gap / amplitude, np.abs(moved).max() / amplitude))

# %%
# At a clearance of some 25 static deflections the amplitude is 2 of them in place of 50. There the
# sweeps lie on the closed form; beyond that the damper works by fits and starts.
runs = hpcsweep.open_results("impact-damper.h5").isel(omega=0)
figure, axis = plt.subplots(figsize=(8, 4.2), layout="constrained")
axis.plot(*np.transpose(closed), color="0.6", lw=1, label="two impacts a period, closed form")
for direction, marker in (("up", "^"), ("down", "v")):
    run = runs.sel(direction=direction)
    size = run.displacement.isel(floor=0) / run.amplitude
    axis.plot(2 * gap / run.amplitude, size, marker, ms=3, label=f"sweep {direction}")
axis.axhline(1 / damping, ls="--", lw=0.8, color="k", label="without the free mass")
axis.set(xlabel="clearance  [static deflections]", ylabel="largest displacement  [same]")
axis.set(xlim=(5, 100), ylim=(0, 55))
axis.legend()
plt.show()
