"""A curve of special points in the plane of two parameters as a dataset."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from hpcsweep.api.branches import MAX_STEPS, dataset_of, span_of
from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution
from hpcsweep.dynamics.continuation.events import Kind, locate
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.locus import Locus
from hpcsweep.dynamics.continuation.plane import KINDS, SMALLEST, step_of_locus
from hpcsweep.model import observed
from hpcsweep.model.arguments import choice, count, finite, items, positive, refused
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import CURVES
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.store import meanings
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variables import RUN_VARIABLES, empty_results, store_measures

if TYPE_CHECKING:
    import xarray


def curve(
    structure: Structure,
    special: Any,
    parameters: tuple[str, str] = ("amplitude", "omega"),
    span: Any = ((0.0, 1.0), (0.0, 1.0)),
    steps: int = 400,
    largest_step: float = 0.05,
    measure: str | None = None,
    limit: float | None = None,
) -> "xarray.Dataset":
    """Follow a special point, or where a measure equals a limit, in the plane of two parameters.

    Parameters
    ----------
    structure : Structure
        Of the branch on which the special point lies.
    special : xarray.Dataset
        A fold, doubling, torus or grazing of a result of `branch`: ``found.isel(special=k)``. With
        `measure` the result, or a part of its steps.
    parameters : (str, str)
        Two different ones, as `branch` has them. The curve is followed fastest where the solver
        need not be made anew: with the forcing frequency, if at all, as the second.
    span : ((float, float), (float, float))
        Lowest and highest value of each.
    steps : int
        Largest number of points on either side of the special point.
    largest_step : float
        Largest step between neighbouring points, in units of the state and of the spans.
    measure : str, optional
        ``drift``, ``storey_drift``, ``displacement``, ``floor_acceleration`` or ``contact_force``.
        Largest over an orbit, and over storeys, floors or contacts; in the units of a job's output.
    limit : float, optional
        Value of the measure on the curve, which begins at the first step of the branch that
        reaches it.

    Returns
    -------
    xarray.Dataset
        As that of `branch`, over ``step``: ``value`` (step, parameter), ``point`` (step, state),
        ``orbit`` (step, turn, state), ``multiplier`` (step, number, complex), ``contact`` (bit k -
        1 for contact k) and ``drift``. Over ``special``, where the curve ends or meets others, or,
        along that of a limit, where a special point is, in order: ``special_kind``
        (`dynamics.continuation.plane.Meeting`), ``special_value``, ``special_point``,
        ``special_orbit``, ``special_multiplier`` and ``special_step`` (of the point after it).
        Attributes ``begins`` and ``ends`` say why the curve goes no further.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the special point is not found, or a solver fails.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory*, 9 and 10.

    Examples
    --------
    The grazing of a linear oscillator, A^2 = (1 - Omega^2)^2 + (2 zeta Omega)^2:

    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> branch = hpcsweep.branch(stop, 0.05, 1.0, [0.5, 0.0], period=1, span=(0.02, 0.2))
    >>> curve = hpcsweep.curve(stop, branch.isel(special=0), span=((0.05, 0.2), (0.9, 1.1)))
    >>> amplitude, omega = curve.value.values.T
    >>> bool(np.allclose(amplitude, np.hypot(1.0 - omega**2, 0.1 * omega), rtol=1e-12))
    True
    """
    CURVES.demand(structure)
    kind = None if measure is not None else _kind(special)
    period = _period(special)
    along = ForcedMap(structure, *map(special.attrs.get, ("amplitude", "omega", "parameter")))
    level = math.nan if kind else finite("limit", limit)
    if kind is None:
        points, value = first_at(along, special, str(measure), level)
    else:
        points = special["special_orbit"].values / along.units
        value = float(special["special_value"])
    home, amplitude, omega = along.at(value)
    names = items("parameters", parameters, "two different ones")
    if len(names) != 2 or names[0] == names[1]:
        raise refused("parameters", "two different ones", parameters)
    forced = ForcedMap(home, amplitude, omega, tuple(names))
    spans = _spans(span, forced)
    scale = np.array([high - low for low, high in spans])
    if kind is None:
        measured = measure_of(forced, str(measure))
        locus = Locus(forced, period, scale, spans, None, (), lambda *at: measured(*at) - level)
    else:
        change = tuple(special["contact_change"].values.tolist())
        locus = Locus(forced, period, scale, spans, kind, change)
    n_steps, largest = count("steps", steps, 1, MAX_STEPS), positive("largest_step", largest_step)
    limits = Limits(-np.inf, np.inf, n_steps, largest, SMALLEST)
    try:
        start = locus.start(points, forced.value)
    except NotConvergedError as error:
        raise ArithmeticError(f"no curve begins at the special point: {error}") from None
    arc = follow(locus, start, limits, step=step_of_locus)
    followed = {"kind": kind.name.lower()} if kind else {"kind": measure, "limit": limit}
    return dataset_of(arc, forced, _variables(arc, forced), followed)


def _variables(arc: Arc, forced: ForcedMap) -> dict[str, Any]:
    """Return the variables of a curve besides its orbits."""
    states = [arc.curve.split(solution.y) for solution in arc.points]
    there = [arc.curve.split(special.at.y) for _, special in arc.specials]
    seen = [forced.observe(*state) for state in states]
    drift = [
        float(normalised_drift(observation.peak_drift, *forced.at(value)[1:]))
        for observation, (_, value) in zip(seen, states, strict=True)
    ]

    kinds = [special.kind.value for _, special in arc.specials]

    def first(orbits: list) -> np.ndarray:
        return np.array([x[0] * forced.units for x, _ in orbits]).reshape(-1, forced.size)

    def values(orbits: list) -> np.ndarray:
        return np.array([value for _, value in orbits], float).reshape(-1, 2)

    return {
        "parameter": list(forced.parameters),
        "value": (("step", "parameter"), values(states)),
        "point": (("step", "state"), first(states)),
        "contact": ("step", np.array([observation.contact for observation in seen], np.uint64)),
        "drift": ("step", np.array(drift), {"units": "A / Omega^2"}),
        "special_value": (("special", "parameter"), values(there)),
        "special_point": (("special", "state"), first(there)),
        "special_step": ("special", np.array([place for place, _ in arc.specials], int)),
        "special_kind": ("special", np.array(kinds, str)),
    }


def _period(special: Any) -> int:
    """Return the period of the orbits of a branch, along one number alone."""
    if special.attrs.get("formulas"):
        raise ValueError("special must be of a branch without formulas: a curve has two numbers")
    return int(special.attrs["period"])


def _kind(special: Any) -> Kind:
    """Return the kind of a special point of a result of `branch`."""
    variables = getattr(special, "data_vars", {})
    if "special_kind" not in variables or special["special_kind"].ndim:
        raise ValueError("special must be one special point of a branch: found.isel(special=k)")
    name = meanings(special["special_kind"]).item()
    if name not in KINDS:
        raise ValueError(f"special must be one of {', '.join(KINDS)}, is {name}")
    return KINDS[name]


def _spans(span: Any, forced: ForcedMap) -> tuple[tuple[float, float], tuple[float, float]]:
    """Read the spans of both parameters; they must hold the special point."""
    if np.shape(span) != (2, 2):
        raise ValueError("span must be two pairs, lowest and highest value of each parameter")
    first, second = map(span_of, span, forced.parameters, forced.value)
    return first, second


MEASURED = ("drift", *(quantity.name for quantity in observed.PEAKS))
"""Measures of which an orbit has one largest value."""


def measure_of(forced: ForcedMap, name: str) -> Callable[[np.ndarray, Any], float]:
    """Return the function of an orbit, shape (p, N), and of the parameter that is a measure.

    Raises
    ------
    ValueError
        If there is no measure of that name.
    """
    settings = SweepSettings(metrics=frozenset({choice("measure", name, MEASURED)}))
    wanted = [variable for variable in RUN_VARIABLES if variable.name == name]

    def measure(points: np.ndarray, value: Any) -> float:
        structure, amplitude, omega = forced.at(value)
        seen = forced.observe(points, value, settings.measures)
        if name == "drift":
            return float(normalised_drift(seen.peak_drift, amplitude, omega))
        rows = empty_results(wanted, structure, 1)
        store_measures(rows, structure, seen.measures)
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
    points, values = branch["orbit"].values / forced.units, branch["value"].values.tolist()
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
