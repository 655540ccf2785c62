"""What does a stiff stop tend to? Figure 3 against the stiffness, beside rigid stops of e = 1.

`python jobs/attractors/rigid_limit.py` computes the sweeps of Figure 3, damping as printed, with
sharp stops of stiffness ratios from 1e2 to 1e6 and with rigid ones, and follows the branch of
period 1. It prints how long an impact of the top floor takes at A = 0.05, times sqrt(beta) / pi,
drifts, how many runs have the period and the contacts of the rigid stop, and where special points
lie, and draws rigid-limit.png.
"""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np

import hpcsweep

OMEGA, SPAN, AMPLITUDES = 0.445, (0.005, 0.25), (0.05, 0.2)
STIFFNESS = (1e2, 1e3, 1e4, 1e5, 1e6, math.inf)
JOB = Path(__file__).parents[1] / "paper" / "figure3.toml"
POINTS = {
    "torus": (0.0172, "torus"),
    "floor 2 grazes": (0.0900, "grazing"),
    "doubling": (0.1385, "doubling"),
    "lower fold": (0.2123, "fold"),
    "floor 1 grazes": (0.2415, "grazing"),
}
REACH = 0.03


def sweeps_of(beta: float):
    """Compute the sweeps of Figure 3 at a stiffness ratio."""
    path = f"rigid-limit-{beta:g}.h5"
    keys = {"structure.stiffness_ratio": beta, "structure.sharpness": "inf"}
    keys |= {"output.impacts": "true", "output.contact_share": "true"}
    if beta == math.inf:
        keys["structure.restitution"] = 1.0
    command = [sys.executable, "-m", "hpcsweep", "run", str(JOB), "-o", path]
    subprocess.run(command + [f"--set={key}={value}" for key, value in keys.items()], check=True)
    return hpcsweep.open_results(path).isel(omega=0)


def specials_of(beta: float) -> dict[str, float]:
    """Return where the special points of the branch of period 1 lie, NaN of those not found."""
    structure = hpcsweep.Structure(
        3, beta, math.inf, damping_ratio=0.05, restitution=1.0 if beta == math.inf else None
    )
    found: list[tuple[str, float]] = []
    for start in (0.06, 0.2):
        point = hpcsweep.stroboscopic_points(structure, start, OMEGA, [0.0] * 6, 600)[-1]
        branch = hpcsweep.branch(structure, start, OMEGA, point, 1, span=SPAN)
        kinds = hpcsweep.meanings(branch.special_kind).values.tolist()
        found += zip(kinds, branch.special_value.values.tolist(), strict=True)
        for end, why in zip(branch.value.values[[0, -1]], ("begins", "ends"), strict=True):
            found += [("grazing", float(end))] if branch.attrs[why] == "grazing" else []
    return {
        name: min(
            (value for kind, value in found if kind == wanted and abs(value - near) < REACH),
            key=lambda value, near=near: abs(value - near),
            default=math.nan,
        )
        for name, (near, wanted) in POINTS.items()
    }


def main() -> None:
    """Print the table and draw the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sweeps = {beta: sweeps_of(beta) for beta in STIFFNESS}
    specials = {beta: specials_of(beta) for beta in STIFFNESS}
    rigid, limits = sweeps[math.inf], specials[math.inf]
    print("beta    contact  drift at", *AMPLITUDES, " equal ", *POINTS)
    for beta, runs in sweeps.items():
        up = runs.sel(direction="up").sel(amplitude=list(AMPLITUDES), method="nearest")
        equal = (runs.orbit_period == rigid.orbit_period) & (runs.contact == rigid.contact)
        lasts = up.contact_share[0, -1] * 2 * math.pi / OMEGA / up.impacts[0, -1]
        told = "rigid  " if beta == math.inf else f"{float(lasts) * math.sqrt(beta) / math.pi:7.4f}"
        drifts = " ".join(f"{drift:8.5f}" for drift in up.drift.values)
        places = " ".join(f"{value:9.6f}" for value in specials[beta].values())
        print(f"{beta:<7g} {told}  {drifts}  {float(equal.mean()):6.3f}  {places}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    stiff = np.array(STIFFNESS[:-1])
    for name in POINTS:
        away = [abs(specials[beta][name] - limits[name]) for beta in stiff]
        left.loglog(stiff, away, "o-", ms=4, label=name)
    left.loglog(stiff, 0.2 / np.sqrt(stiff), "--", color="0.5", label=r"$0.2\,\beta^{-1/2}$")
    left.set(xlabel=r"stiffness ratio $\beta$", ylabel="distance in $A$ from that of a rigid stop")
    left.legend(fontsize=7)
    for beta, colour, size in ((math.inf, "0.75", 8), (1e3, "C0", 2), (1e5, "C1", 2)):
        runs = sweeps[beta].sel(direction="up")
        name = "rigid" if beta == math.inf else rf"$\beta = 10^{{{round(math.log10(beta))}}}$"
        drift = runs.drift.where(runs.orbit_period > 0)
        right.plot(runs.amplitude, drift, ".", ms=size, color=colour, label=name, mew=0)
    right.set(xlabel="forcing amplitude $A$", ylabel=r"drift  [$A / \Omega^2$], periodic motions")
    right.legend(fontsize=7, markerscale=2)
    figure.savefig("rigid-limit.png", dpi=100)


if __name__ == "__main__":
    main()
