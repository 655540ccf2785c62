"""
Chaos and its exponent
======================

Two motions that start a hair apart part exponentially in chaos; the rate is the largest Lyapunov
exponent. The tangent map gives it, not differences, and it comes with a confidence interval.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from shell import shell

import hpcsweep

structure = hpcsweep.Structure(n_floors=1, stiffness_ratio=29.0, damping_ratio=0.01)
amplitude, omega = 0.4, 0.9

# %%
# Follow two motions with states that differ by 1e-9 of a gap.
start = np.zeros(2)
near = start + 1e-9
one = hpcsweep.stroboscopic_points(structure, amplitude, omega, start, 120)
two = hpcsweep.stroboscopic_points(structure, amplitude, omega, near, 120)
distance = np.linalg.norm(one - two, axis=1)

# %%
# The exponent, from a job of a single point.
Path("chaos.toml").write_text(f"""\
[study]
kind = "points"

[structure]
n_floors = 1
stiffness_ratio = 29.0
damping_ratio = 0.01

[sweep]
omega = {omega}
amplitude = {amplitude}

[output]
lyapunov = true
""")
shell("hpcsweep run chaos.toml -o chaos.h5")
run = hpcsweep.open_results("chaos.h5").squeeze()
print(f"{hpcsweep.meanings(run.motion).values}: exponent {float(run.lyapunov):.4f},")
print(f"between {float(run.lyapunov_low):.4f} and {float(run.lyapunov_high):.4f}")

# %%
# The distance grows at that rate in the long run, slower or faster for some periods, until the
# motions have nothing in common. The dashed line starts where they are nearest.
period = 2 * np.pi / omega
time = period * np.arange(1, 121)
figure, axis = plt.subplots(figsize=(7, 3.2), layout="constrained")
axis.semilogy(time / period, distance, "k.-", lw=0.5, label="two motions")
nearest = np.argmin(distance)
line = distance[nearest] * np.exp(float(run.lyapunov) * (time - time[nearest]))
axis.semilogy(time / period, line, "C0--", label="exp(λτ)")
axis.set_ylim(1e-10, 10)
axis.set_xlabel("forcing periods")
axis.set_ylabel("distance of the states")
axis.legend()
plt.show()
