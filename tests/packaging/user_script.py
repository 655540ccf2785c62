"""A user's own script: `.ci/package` has mypy check it against the installed package."""

import numpy as np

import hpcsweep


def largest_drift(path: str) -> float:
    """Return the largest drift of a results file."""
    with hpcsweep.open_results(path) as results:
        return float(results["drift"].max())


def main() -> None:
    """Print what a structure does."""
    structure = hpcsweep.Structure(n_floors=2, stiffness_ratio=300.0, damping_ratio=0.05)
    found = hpcsweep.attractors(structure, 0.3, 0.9, starts=8)
    points: np.ndarray = hpcsweep.stroboscopic_points(structure, 0.3, 0.9, np.zeros(4), 5)
    record = hpcsweep.Record(np.sin(np.arange(200.0)), dt=0.02)
    response: hpcsweep.Response = hpcsweep.response(structure, record)
    print(found, points.shape, response.drift, largest_drift("results.h5"))


main()
