"""
A finite element model: a strip that hits a stop
================================================

A steel strip of 40 beam elements, clamped at its root, hits a stop at three quarters of its length.
Its 80 coordinates become six: four modes, and what flexibility behind the stop and what mass is
left, with an error that is told.
"""

from pathlib import Path

import numpy as np
from shell import shell

n, length, bending, mass = 40, 0.3, 2.1e11 * 0.02 * 0.002**3 / 12, 7850 * 0.02 * 0.002  # m, kg, s
h = length / n
a, b = 6 * h, 2 * h * h
k = np.array([[12, a, -12, a], [a, 2 * b, -a, b], [-12, -a, 12, -a], [a, b, -a, 2 * b]])
K, M = np.zeros((2 * n + 2, 2 * n + 2)), np.zeros(2 * n + 2)
for i in range(0, 2 * n, 2):
    K[i : i + 4, i : i + 4] += bending / h**3 * k
    M[[i, i + 2]] += mass * h / 2
names = [f"{node}.{what}" for node in range(1, n + 1) for what in ("UY", "RZ")]
np.savez("strip.npz", K=K[2:, 2:], M=M[2:], names=names)

Path("strip.toml").write_text("""\
[units]
length = "m"
mass = "kg"
time = "s"

[structure]
sharpness = inf
damping_ratio = 0.01

[structure.model]
file = "strip.npz"
influence = "UY"
outputs = ["40.UY"]
reduce = {error = 1e-3}

[[structure.contact]]
direction = "30.UY"
gap = 0.001
stiffness = 1e5

[sweep]
frequency = 24.0
amplitude = {from = 0.1, to = 12.0, count = 120}

[output]
displacement = true
floor_acceleration = true
contact_force = true
""")
shell("hpcsweep describe strip.toml")

# %%
# Up and down the amplitudes at a frequency above the first one; the results name tip and stop.
shell("mpirun -n 2 hpcsweep run strip.toml -o strip.h5")
shell("hpcsweep plot strip.h5 --floor 1 --floor 2 --dpi 90 -o strip.png")
