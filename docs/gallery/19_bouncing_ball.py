"""
A ball that bounces on a table
==============================

A free ball, gravity, a rigid table that shakes with the acceleration Gamma over gravity. Motions
with a bounce every n periods exist from Gamma = pi n (1 - e) / (1 + e) on.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hpcsweep

e, rates = 0.5, np.linspace(0.8, 4.6, 381)
table = hpcsweep.Contact((1.0,), 0.0, math.inf, restitution=e)


def bounced(gamma: float, state: np.ndarray) -> np.ndarray:
    """Return the last of 400 points, of the ball relative to the table, downwards."""
    gravity, shaking = (0, 1.0, math.pi / 2), (1, gamma, 0.0)
    ball = hpcsweep.Structure.from_matrices(
        [1.0], [[0.0]], [table], forcing=[1.0], harmonics=(gravity, shaking)
    )
    return hpcsweep.stroboscopic_points(ball, 1.0, 2 * math.pi, state, 400)[-60:]


# %%
# Below Gamma = 1 the ball rests. Above it is thrown: on the way up (blue) in hops that chatter to
# rest within the period. On the way down (red) the motion of period 1 lasts to its limit, 1.047.
# Motions of n periods begin at theirs, beside chaos.
figure, axis = plt.subplots(figsize=(8, 4.2), layout="constrained")
for way, colour in ((1, "C0"), (-1, "C3")):
    state = np.zeros(2)
    for gamma in rates[::way]:
        points = bounced(gamma, state)
        state = points[-1]
        axis.plot(np.full(len(points), gamma), -points[:, 0], ".", color=colour, ms=1, mew=0)
for n in range(1, 5):
    least = math.pi * n * (1 - e) / (1 + e)
    axis.axvline(least, color="k", lw=0.7, ls="--")
    axis.text(least, 0.94, f" n = {n}", fontsize=8, transform=axis.get_xaxis_transform())
axis.set(xlabel="Gamma", ylabel="height at phase 0  [gravity, periods²]")
plt.show()
