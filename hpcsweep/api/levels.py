"""Measures of periodic orbits, and where along a branch one reaches a limit."""

from collections.abc import Callable
from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Curve, Solution
from hpcsweep.dynamics.continuation.events import locate
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.model.arguments import choice
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.rows import store_measures
from hpcsweep.studies.variables import RUN_VARIABLES, empty_results

PEAKS = ("drift", "storey_drift", "displacement", "acceleration", "contact_force")
"""Measures of which an orbit has one largest value."""


def measure_of(forced: ForcedMap, name: str) -> Callable[[np.ndarray, Any], float]:
    """Return the function of an orbit, shape (p, N), and of the parameter that is a measure.

    Raises
    ------
    ValueError
        If there is no measure of that name.
    """
    settings = SweepSettings(metrics=frozenset({choice("measure", name, PEAKS)}))
    wanted = [variable for variable in RUN_VARIABLES if variable.name == name]

    def measure(points: np.ndarray, value: Any) -> float:
        structure, amplitude, omega = forced.at(value)
        seen = forced.observe(points, value, settings.measures)
        if name == "drift":
            return float(normalised_drift(seen.peak_drift, amplitude, omega))
        rows = empty_results(wanted, structure, 1)
        store_measures(rows, structure, seen.measures[None])
        return float(np.nanmax(rows[name]))

    return measure


def first_at(forced: ForcedMap, branch: Any, name: str, limit: float) -> tuple[np.ndarray, float]:
    """Return the first orbit of a branch at which a measure equals a limit, and the parameter.

    Parameters
    ----------
    forced : ForcedMap
        Along the parameter of the branch.
    branch : xarray.Dataset
        Result of `hpcsweep.branch`, or steps of it.
    name : str
    limit : float

    Raises
    ------
    ValueError
        If the measure passes the limit between no two steps.
    """
    if "step" not in getattr(branch, "dims", ()):
        raise ValueError("special must be a result of branch where measure is given")
    measure = measure_of(forced, name)
    points, values = branch["point"].values / forced.units, branch["value"].values.tolist()
    held = np.array([measure(x, value) for x, value in zip(points, values, strict=True)])
    passed = np.flatnonzero(np.diff(held >= limit))
    if not passed.size:
        low, high = held.min(), held.max()
        raise ValueError(f"limit must be between {low:g} and {high:g}, is {limit:g}")
    curve = Curve(forced, points.shape[1], float(np.ptp(values)) or 1.0)
    ends = [curve.join(points[k], values[k]) for k in (passed[0], passed[0] + 1)]
    chord = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    first, last = (curve.solve(y, chord) for y in ends)

    def side(point: Solution) -> float:
        return measure(*curve.split(point.y)) - limit

    return curve.split(locate(curve, first, last, side)[0].y)
