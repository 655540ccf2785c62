"""
The impact oscillator of Shaw and Holmes
========================================

A mass on a spring at rest on a rigid stop, Journal of Sound and Vibration 90 (1983) 129. A free
swing takes half of its natural period, so that motions of n forcing periods resonate at 2 n.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from shell import shell

import hpcsweep

Path("impact-oscillator.toml").write_text("""\
[structure]
sharpness = inf

[structure.matrices]
mass = [1.0]
stiffness = [[1.0]]

[[structure.contact]]
direction = [1.0]
gap = 0.0
stiffness = inf
restitution = 0.8

[sweep]
along = "omega"
omega = {from = 1.5, to = 9.0, step = 0.0125}
amplitude = 1.0
transient_cycles = 300
""")
shell("hpcsweep run impact-oscillator.toml -o impact-oscillator.h5")
shell("hpcsweep plot impact-oscillator.h5 --color period --dpi 100 -o impact-oscillator.png")

# %%
# The motion of period 1 doubles where a multiplier is -1. Its branch goes there past 2, where the
# impact passes phase 0.
structure = hpcsweep.load_job("impact-oscillator.toml").structure
point = hpcsweep.stroboscopic_points(structure, 1.0, 1.8, [-1.0, 0.0], 500)[-1]
branch = hpcsweep.branch(structure, 1.0, 1.8, point, 1, "omega", span=(1.5, 3.5))
print("doubling at", branch.special_value.values)


def closed(omega: float, e: float = 0.8) -> float:
    """Return what is 0 there: 1, the trace of the tangent map and its determinant, e squared."""
    cosine = np.cos(2 * np.pi / omega)
    trace = -2 * e * cosine + (1 + e) ** 2 * (1 - omega**2) * (1 + cosine) / 2
    return 1 + trace + e**2


print("closed form", brentq(closed, 2.5, 2.8))
