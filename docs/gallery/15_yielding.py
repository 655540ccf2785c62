"""
A frame that yields, and the same frame on bearings
===================================================

Storeys of a frame yield at a drift of 0.5 % of their height. Between two changes of a spring the
motion is linear, and each moment at which a storey yields or stops yielding is found to rounding.
The same frame on friction pendulums stays elastic, as long as its slab does not hit the moat wall.
"""

import matplotlib.pyplot as plt
import numpy as np

import hpcsweep

frame = {
    "mass": [2.4e5, 2.4e5, 2.4e5, 1.8e5],
    "storey_stiffness": [1.6e8, 1.6e8, 1.4e8, 1.2e8],
    "storey_height": [3.6, 3.0, 3.0, 3.0],
}
yields = {"yield_drift": [0.018, 0.015, 0.015, 0.015], "hardening": 0.03}
bearings = {"slab_mass": 3e5, "radius": 2.24, "friction": 0.06, "wall_stiffness": 2e9}
structures = {
    "elastic": hpcsweep.Building(**frame).structure,
    "yielding": hpcsweep.Building(**frame, **yields).structure,
    "isolated, moat 40 cm": hpcsweep.Building(
        **frame, **yields, isolation={**bearings, "gap": 0.4}
    ).structure,
    "isolated, moat 10 cm": hpcsweep.Building(
        **frame, **yields, isolation={**bearings, "gap": 0.1}
    ).structure,
}
record = hpcsweep.synthetic_records(3, seed=1, duration=30.0)[2]
scale = 5.0 / record.peak
found = {name: hpcsweep.response(one, record, scale) for name, one in structures.items()}
for name, one in found.items():
    roof, ratio = one.floor_acceleration[-1], 100 * (one.drift / frame["storey_height"]).max()
    print(f"{name}: roof {roof:.1f} m/s^2, drift {ratio:.2f} %, {one.impacts.sum()} impacts")

# %%
# Hysteresis: the force of each storey's slider against its drift; the lower two yield most.
seen = hpcsweep.history(structures["yielding"], record, scale)
stretch = seen.displacement @ structures["yielding"].slider_directions.T
figure, axes = plt.subplots(1, 4, figsize=(9, 2.8), sharey=True, layout="constrained")
for storey, axis in enumerate(axes):
    axis.plot(100 * stretch[:, storey], seen.slider_force[:, storey] / 1e6, lw=0.8)
    ductility = found["yielding"].ductility[storey]
    axis.set(title=f"storey {storey + 1}, ductility {ductility:.1f}", xlabel="drift  [cm]")
axes[0].set_ylabel("force  [MN]")
plt.show()

# %%
# Drift and floor acceleration over the height. Where the slab hits the wall the isolation is lost:
# the lowest storey drifts farther, and the floor above it shakes twice as hard, as on the ground.
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), sharey=True, layout="constrained")
for name, one in found.items():
    left.plot(100 * one.drift / frame["storey_height"], np.arange(1, 5), "o-", label=name)
    right.plot(one.floor_acceleration[-4:], np.arange(1, 5), "o-", label=name)
left.set(xlabel="peak drift ratio  [%]", ylabel="storey, floor", yticks=range(1, 5), xlim=(0, None))
right.set(xlabel="peak floor acceleration  [m/s²]", xlim=(0, None))
figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=8)
plt.show()
