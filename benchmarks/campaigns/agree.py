"""Compare two campaign files made with other versions of the libraries: agree.py A.h5 B.h5.

Such files are not equal to the last bit. A chaotic run amplifies a difference in the last bit to
its own size within its window, and a run that settles one period earlier stores the points of its
orbit in another order. What must agree is every run's outcome, orbit period and contact set, and
of the periodic ones the numbers, and the points as sets.
"""

import sys
from pathlib import Path

import h5py
import numpy as np

EXACT = ("outcome", "orbit_period", "contact")
NUMBERS = ("drift", "modal_norm", "lyapunov")
TOLERANCE = 1e-8
"""Absolute, of numbers up to 5. Between numba 0.62, numpy 2.0 and numba 0.68, numpy 2.4 drifts and
modal norms of jobs/ci.toml agreed to 5e-12, Lyapunov exponents to 1e-9: theirs is the mean over
forty periods of the logarithm of a growth that contacts close to grazing make large."""


def disagreements(left: Path, right: Path) -> tuple[list[str], dict[str, float], int]:
    """Compare two files.

    Returns
    -------
    wrong : list of str
        What does not agree.
    largest : dict
        Largest difference of each quantity over the periodic runs.
    n_periodic : int
    """
    runs = [_runs(path) for path in (left, right)]
    a, b = runs
    wrong = [name for name in EXACT if not np.array_equal(a[name], b[name])]
    periodic = (a["orbit_period"] > 0) & (b["orbit_period"] > 0)
    largest = {}
    for name in NUMBERS:
        apart = np.abs(a[name][periodic] - b[name][periodic])
        both = np.isnan(a[name][periodic]) & np.isnan(b[name][periodic])
        largest[name] = float(np.where(both, 0.0, apart).max(initial=0.0))
    pairs = zip(a["poincare"][periodic], b["poincare"][periodic], strict=True)
    largest["points"] = max((_set_distance(*pair) for pair in pairs), default=0.0)
    wrong += [name for name, apart in largest.items() if not apart <= TOLERANCE]
    return wrong, largest, int(periodic.sum())


def _runs(path: Path) -> dict[str, np.ndarray]:
    with h5py.File(path, "r", locking=False) as file:
        return {name: file[name][...] for name in (*EXACT, *NUMBERS, "poincare")}


def _set_distance(left: np.ndarray, right: np.ndarray) -> float:
    """Hausdorff distance of two sets of points, shapes (k, 2n), unused rows NaN."""
    left, right = (points[~np.isnan(points).any(axis=1)] for points in (left, right))
    between = np.abs(left[:, None, :] - right[None, :, :]).max(axis=2)
    return float(max(between.min(axis=0).max(), between.min(axis=1).max()))


if __name__ == "__main__":
    first, second = map(Path, sys.argv[1:])
    wrong, largest, n_periodic = disagreements(first, second)
    apart = ", ".join(f"{name} {value:.1e}" for name, value in largest.items())
    print(f"{first.name} and {second.name}: {n_periodic} periodic runs, farthest apart: {apart}")
    if wrong or not n_periodic:
        sys.exit(f"they do not agree: {', '.join(wrong) or 'no periodic run'}")
