"""
Figure 3 of the paper, and hysteresis
=====================================

The orbit diagram at the first resonance that the study by Christopher, Dobson and Alexander (2020)
discusses. The damping is the one *as described*: it reproduces the text of the paper, which the
damping *as printed* (5 % in every mode) does not. Where the amplitudes of two attractors overlap,
the sweep up follows one and the sweep down the other; at the ends of the overlap each jumps.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from shell import shell

import hpcsweep

Path("figure3.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0
damping_ratio = [0.12622293348805766, 0.016077603302694768, 0.007699463209247604]

[sweep]
omega = 0.445
amplitude = {from = 0.035, to = 0.25, step = 0.001}

[output]
lyapunov = true
""")
shell("mpirun -n 2 hpcsweep run figure3.toml -o figure3.h5")
shell("hpcsweep plot figure3.h5 --color period -o figure3.png")

# %%
# Where are the two sweeps on different motions? Compare their periods.
results = hpcsweep.open_results("figure3.h5").isel(omega=0)
period = results.orbit_period
up, down = period.sel(direction="up"), period.sel(direction="down")
apart = (up != down) & (up > 0) & (down > 0)
print("amplitudes at which both sweeps repeat, with different periods:")
print(np.round(results.amplitude.values[apart.values], 4))

# %%
# Which of two coexisting motions is the worse one for the building? Look at the drift, the largest
# displacement between neighbouring floors: here it is larger on the way up, with fewer floors at
# the stop.
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for direction, marker, size in (("down", "C1v", 5), ("up", "C0.", 4)):
    drift = results.drift.sel(direction=direction)
    axis.plot(results.amplitude, drift, marker, ms=size, mew=0, label=f"sweep {direction}")
axis.set_xlabel("forcing amplitude A  [gaps ω₀²]")
axis.set_ylabel("drift δ = max |uᵢ − uᵢ₋₁| Ω²/A")
axis.legend()
plt.show()
