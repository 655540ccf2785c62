"""How smooth may a stop be? Special points of Figure 3's branch of period 1 against sharpness.

`python jobs/attractors/smoothing.py` follows the branch from below the first contact, and from a
motion with contact, for each sharpness, and prints where its folds, doublings, torus and grazings
lie, and how far each is from that of the sharp stop. Then the same of the closed branch of period
6 just above the first contact, also of softer and stiffer stops.
"""

import numpy as np

import hpcsweep

OMEGA, SPAN = 0.445, (0.005, 0.25)
SHARPNESS = (np.inf, 1e6, 3e5, 1e5, 3e4, 1e4, 3e3, 1e3, 1e2)
STARTS = (0.01, 0.05)
SIX_FROM, SIX_TO, SIX_STEP, SIX_SPAN = 0.01655, 0.0169, 2e-5, (0.015, 0.019)


def branch_from(structure: hpcsweep.Structure, amplitude: float):
    """Return the branch through the motion that is reached from rest."""
    rest = [0.0] * (2 * structure.n_floors)
    point = hpcsweep.stroboscopic_points(structure, amplitude, OMEGA, rest, 1000)[-1]
    return hpcsweep.branch(structure, amplitude, OMEGA, point, 1, span=SPAN)


def branch_of_six(structure: hpcsweep.Structure):
    """Return the branch of the first motion of period 6 that rest leads to, or None."""
    rest = [0.0] * (2 * structure.n_floors)
    for amplitude in np.arange(SIX_FROM, SIX_TO, SIX_STEP):
        points = hpcsweep.stroboscopic_points(structure, amplitude, OMEGA, rest, 4000)
        apart = [np.abs(points[-1] - points[-1 - turns]).max() for turns in (1, 2, 3, 6)]
        if apart[3] < 1e-9 and min(apart[:3]) > 1e-6:
            return hpcsweep.branch(structure, amplitude, OMEGA, points[-1], 6, span=SIX_SPAN)
    return None


def main() -> None:
    """Print the special points."""
    sharp: dict[str, np.ndarray] = {}
    for sharpness in SHARPNESS:
        structure = hpcsweep.Structure(sharpness=sharpness)
        for start in STARTS:
            found = branch_from(structure, start)
            kinds = hpcsweep.meanings(found.special_kind).values
            values = found.special_value.values
            ends = " to ".join(
                f"A = {found.value.values[place]:.6f} ({found.attrs[name]})"
                for place, name in ((0, "begins"), (-1, "ends"))
            )
            print(f"sharpness {sharpness:g}, from A = {start:g}: {ends}")
            for kind in ("grazing", "fold", "torus", "doubling"):
                places = np.sort(values[kinds == kind])
                line = f"  {kind:9}" + " ".join(f"{place:.10f}" for place in places)
                sharp.setdefault(kind, places)
                if np.isfinite(sharpness) and places.size == sharp[kind].size:
                    away = np.abs(places - sharp[kind])
                    line += "   away " + " ".join(f"{one:.1e}" for one in away)
                print(line)
    for stiffness_ratio in (300.0, 1000.0, 3000.0):
        for sharpness in (np.inf, 1e6, 1e5, 3e4, 1e4):
            structure = hpcsweep.Structure(3, stiffness_ratio, sharpness)
            found = branch_of_six(structure)
            told = "no orbit of period 6"
            if found is not None:
                kinds = hpcsweep.meanings(found.special_kind).values
                pairs = zip(kinds, found.special_value.values, strict=True)
                told = f"{found.attrs['ends']}: " + " ".join(f"{k} {v:.10f}" for k, v in pairs)
            print(f"stiffness ratio {stiffness_ratio:g}, sharpness {sharpness:g}, {told}")


if __name__ == "__main__":
    main()
