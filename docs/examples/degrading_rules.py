"""How the three rules of a slider that degrades load again, under one protocol of cycles.

python docs/examples/degrading_rules.py PICTURE.png draws a backbone with what its keys mean, and
the loops of each rule, and prints what is left of the strength.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import hpcsweep
from hpcsweep.model.backbone import RULES

BACKBONE = {"theta_p": 3.0, "theta_pc": 9.0, "residual": 0.15, "hardening": 0.04}
CYCLIC = {"theta_u": 16.0, "Lambda": 50.0}
PINCHES = {"kappa_f": 0.3, "kappa_d": 0.3}
AMPLITUDES = np.repeat([1.5, 2.5, 4.0, 6.0], 2)


def slider(rule: str = "bilinear", **more: float) -> hpcsweep.Slider:
    """Return a slider that yields at the force 1 and the elongation 1."""
    kappas = PINCHES if rule == "pinching" else {}
    backbone = hpcsweep.Backbone(**BACKBONE, rule=rule, **kappas, **more)
    return hpcsweep.Slider((1.0,), stiffness=1.0, strength=1.0, backbone=backbone)


def explained(axis, path: np.ndarray, force: np.ndarray) -> None:
    """Draw a first loading up to the loss of all force, with the keys."""
    axis.plot(path, force, "k")
    capping = force.max()
    bottom = path[force >= BACKBONE["residual"] + 1e-9].max()
    yielded, capped = 1.0, 1.0 + BACKBONE["theta_p"]
    zero = capped + BACKBONE["theta_pc"]
    axis.plot([bottom, zero], [BACKBONE["residual"], 0.0], "k:", lw=1)
    for x, top in ((yielded, 1.0), (capped, capping)):
        axis.plot([x, x], [0.0, top], color="0.6", lw=0.8, ls="--")
    for left, right, name in ((yielded, capped, "theta_p"), (capped, zero, "theta_pc")):
        arrow = {"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0}
        axis.annotate("", (left, -0.12), (right, -0.12), arrowprops=arrow)
        axis.text((left + right) / 2, -0.17, name, ha="center", va="top")
    axis.text(0.9, 1.03, "F", ha="right", va="bottom")
    axis.text(capped + 0.2, capping, "F_c")
    axis.text(13.4, BACKBONE["residual"] + 0.03, "residual F", ha="center", va="bottom")
    axis.text(CYCLIC["theta_u"], -0.17, "theta_u", ha="center", va="top")
    axis.set(title="backbone", xlim=(0, 18), xticks=range(0, 18, 4), ylim=(-0.4, 1.35))


def main() -> None:
    """Draw, and print."""
    figure, axes = plt.subplots(2, 2, figsize=(8.4, 6.4), layout="constrained")
    path = np.linspace(0.0, 17.0, 1701)
    explained(axes[0, 0], path, slider(**CYCLIC).path(path))
    turns = np.append(0.0, np.outer(AMPLITUDES, [1.0, -1.0]).ravel())
    path = np.append(0.0, np.linspace(turns[:-1], turns[1:], 201)[1:].T.ravel())
    first = np.linspace(0.0, AMPLITUDES[-1], 701)
    for rule, axis in zip(RULES, axes.ravel()[1:], strict=True):
        force = slider(rule, **CYCLIC).path(path)
        for side in (1.0, -1.0):
            axis.plot(side * first, side * slider(rule).path(first), "k", lw=0.8, ls="--")
        axis.plot(path, force, lw=1.0)
        axis.set(title=rule, xlim=(-7, 7), ylim=(-1.3, 1.3))
        print(f"{rule}: {force[-400:].max():.2f} F in the last cycle")
    for axis in axes.ravel():
        axis.axhline(0.0, color="0.8", lw=0.8, zorder=0)
        axis.set(xlabel="elongation k / F", ylabel="force / F")
    figure.savefig(sys.argv[1], dpi=90)


if __name__ == "__main__":
    main()
