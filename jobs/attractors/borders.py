"""Borders of the regions of a map against the curves of folds, doublings, tori and grazings.

`python jobs/attractors/borders.py MAP CURVES` takes the results of a sweep over A and Omega and a
file of branches with curves. Two neighbouring runs of the map, along A or along Omega, have a
border between them if their motion, orbit period or contact set differs. It is on a curve if one
passes between the two. As a control it prints of how many of all neighbours that is so.
"""

import sys
from itertools import pairwise
from typing import Any

import numpy as np

import hpcsweep
from hpcsweep.dynamics.classify import MOTION

SHORT = 2
"""Longest period of the orbits whose curves are followed."""


def crossed(at: np.ndarray, other: np.ndarray, curves: list[np.ndarray]) -> np.ndarray:
    """Return which neighbours along `other`, at each value of `at`, a curve passes between.

    Parameters
    ----------
    at, other : ndarray, shapes (m,) and (n,)
        Values of the axes of a map, ascending.
    curves : list of ndarray, shape (k, 2)
        Points (at, other) along each.

    Returns
    -------
    ndarray of bool, shape (m, n - 1)
    """
    found = np.zeros((at.size, other.size - 1), bool)
    for curve in curves:
        for (x, y), (next_x, next_y) in pairwise(curve):
            inside = np.flatnonzero((at - x) * (at - next_x) <= 0.0)
            if inside.size and next_x != x:
                place = y + (at[inside] - x) / (next_x - x) * (next_y - y)
                cell = np.searchsorted(other, place) - 1
                held = (cell >= 0) & (cell < other.size - 1)
                found[inside[held], cell[held]] = True
    return found


def compare(map_file: str, curve_file: str) -> dict[str, tuple[int, int]]:
    """Return, by kind of neighbours, how many there are and how many of these have a curve."""
    runs = hpcsweep.open_results(map_file).isel(direction=0).sortby("omega")
    omega, amplitude = runs["omega"].values, runs["amplitude"].values
    period, contact = runs["orbit_period"].values, runs["contact"].values
    kind = runs[MOTION].values if MOTION in runs else np.where(period > 0, 1, 0)
    curves = curves_of(hpcsweep.open_results(curve_file))
    passed = (
        crossed(omega, amplitude, [curve[:, ::-1] for curve in curves]),
        crossed(amplitude, omega, curves).T,
    )
    counts: dict[str, np.ndarray] = {}
    for axis, between in ((1, passed[0]), (0, passed[1])):
        differs = sum(np.diff(x.astype(np.int64), axis=axis) != 0 for x in (kind, period, contact))
        short = (period > 0) & (period <= SHORT) | (contact == 0)
        both = np.minimum(*(np.delete(short, end, axis=axis) for end in (0, -1)))
        for name, chosen in (
            ("all neighbours", np.ones_like(both)),
            ("neighbours that differ", differs > 0),
            (f"of these, both of period {SHORT} at most", (differs > 0) & both),
            ("of these, others", (differs > 0) & ~both),
        ):
            one = np.array([chosen.sum(), (chosen & between).sum()])
            counts[name] = counts.get(name, 0) + one
    return {name: (int(a), int(b)) for name, (a, b) in counts.items()}


def curves_of(results: Any) -> list[np.ndarray]:
    """Return the points (A, Omega) along each curve of a file, shape (k, 2)."""
    step = results["curve_of_step"].values[0, :, 0]
    at = [results[f"curve_{name}"].values[0, :, 0] for name in ("amplitude", "omega")]
    return [
        np.array([x[line][step[line] == number] for x in at]).T
        for line in range(len(step))
        for number in range(1, int(step[line].max()) + 1)
    ]


if __name__ == "__main__":
    for name, (count, on_curve) in compare(*sys.argv[1:3]).items():
        print(f"{name}: {count}, {on_curve} with a curve between ({on_curve / max(count, 1):.1%})")
