"""A branch of periodic orbits as a dataset: points, multipliers, special points."""

from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.branch import Arc, Limits
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.cycle import Solution
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.periodic import find
from hpcsweep.model.arguments import count, finite_vector, positive
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.records import normalised_drift

MAX_STEPS = 100_000


def branch(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    period: int,
    parameter: str = "amplitude",
    span: tuple[float, float] = (0.0, 1.0),
    steps: int = 1000,
    largest_step: float = 0.05,
):
    """Follow the branch of periodic orbits through an orbit, stable and unstable, past folds.

    Parameters
    ----------
    structure : Structure
    amplitude, omega, state, period
        Of a nearby orbit, as in `orbit`.
    parameter : {"amplitude", "omega", "stiffness_ratio", "gap", "sharpness", "damping_ratio"}
        Parameter that changes along the branch.
    span : (float, float)
        Lowest and highest value of the parameter.
    steps : int
        Largest number of points on either side of the orbit.
    largest_step : float
        Largest step between neighbouring points, in units of the state and of the span.

    Returns
    -------
    xarray.Dataset
        Over ``step``: ``value`` of the parameter, ``point`` (step, turn, state), ``multiplier``
        (step, mode, complex), ``stable``, ``contact`` (bit k - 1 for contact k) and ``drift``. Over
        ``special``, the special points in order: ``special_kind``, ``special_value``,
        ``special_point``, ``special_multiplier``, ``special_step`` (of the point after it),
        ``change`` (closings that contacts gain, special, contact), ``criticality`` (of a period
        doubling: 1 super-, -1 subcritical) and ``leaving``, a point of the orbit of twice the
        period, or of the crossing branch, at ``leaving_value``. Attributes ``begins`` and ``ends``
        say why the branch goes no further.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If there is no orbit near the state, or a solver fails.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory*, 4 and 5; di Bernardo, Budd, Champneys and
    Kowalczyk, *Piecewise-smooth Dynamical Systems*, 7.

    Examples
    --------
    At resonance the orbit without contact touches the stop where A / (2 zeta) = 1:

    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> branch = hpcsweep.branch(stop, 0.05, 1.0, [0.5, 0.0], period=1, span=(0.02, 0.2))
    >>> str(branch.special_kind.values[0]), round(float(branch.special_value[0]), 12)
    ('grazing', 0.1)
    """
    low, high = finite_vector("span", span, 2).tolist()
    forced, found = find(structure, amplitude, omega, state, period, parameter)
    value = forced.value
    if not low < high or not low <= value <= high:
        raise ValueError(f"span must hold {parameter} = {value:g}, is {low:g} to {high:g}")
    scale = high - low
    limits = Limits(low, high, *read_steps(steps, largest_step))
    catalogue = Catalogue(forced, limits, scale, found.period, 1, costly=forced.is_costly)
    catalogue.add(found.points / forced.units, value)
    catalogue.grow()
    return dataset_of(catalogue.branches[0].arc, forced)


def read_steps(steps: int, largest_step: float) -> tuple[int, float]:
    """Read the number of steps of a branch or curve, and the largest."""
    return count("steps", steps, 1, MAX_STEPS), positive("largest_step", largest_step)


def dataset_of(arc: Arc, forced: ForcedMap):
    """Turn a branch of a structure into a dataset; see `branch`."""
    import xarray

    curve = arc.curve
    structure, units = forced.structure, forced.units
    n = structure.n_floors
    specials = [one for _, one in arc.specials]
    no_change = (0,) * len(structure.contacts)
    leaving = np.full((len(specials), 2 * n), np.nan)
    leaving_value = np.full(len(specials), np.nan)
    for k, one in enumerate(specials):
        if one.leaving is not None:
            leaving[k], leaving_value[k] = one.leaving.y[: 2 * n] * units, one.leaving.y[-1]
    variables, coordinates, attributes = parts_of(arc, forced)
    stable = [abs(one.multipliers[0]) < 1.0 for one in arc.points]
    return xarray.Dataset(
        {
            **variables,
            "value": ("step", values_of(curve, arc.points), {"long_name": forced.parameter}),
            "stable": ("step", np.array(stable)),
            "special_kind": ("special", [one.kind.name.lower() for one in specials]),
            "special_value": (
                "special",
                values_of(curve, [one.at for one in specials]),
                {"long_name": forced.parameter},
            ),
            "change": (
                ("special", "contact_number"),
                np.array([one.change or no_change for one in specials], int).reshape(
                    len(specials), len(no_change)
                ),
            ),
            "criticality": ("special", np.array([one.criticality for one in specials], int)),
            "leaving": (("special", "state"), leaving),
            "leaving_value": ("special", leaving_value * curve.scale),
        },
        coords={
            **coordinates,
            "contact_number": [structure.contact_names[k] for k in structure.contact_numbers],
        },
        attrs={"parameter": forced.parameter, **attributes},
    )


def values_of(curve, points: list[Solution]) -> np.ndarray:
    """Return the value of the parameter, or the pair of values, at each point of a curve."""
    return np.array([curve.split(one.y)[1] for one in points], float)


def parts_of(arc: Arc, forced: ForcedMap) -> tuple[dict, dict, dict]:
    """Return what datasets of branches and curves have: variables, coordinates, attributes."""
    curve, structure, units = arc.curve, forced.structure, forced.units
    n, period = structure.n_floors, curve.period
    states = [curve.split(one.y) for one in arc.points]
    seen = [forced.observe(*state) for state in states]
    drift = [
        float(normalised_drift(one.peak_drift, *forced.at(value)[1:]))
        for one, (_, value) in zip(seen, states, strict=True)
    ]
    specials = [one.at for _, one in arc.specials]
    length, speed = (unit_of(structure, kind) for kind in ("length", "velocity"))
    attributes = {"units": f"{length}, {speed}", "long_name": "stroboscopic points"}

    def points_of(found: list[Solution]) -> np.ndarray:
        points = [curve.split(one.y)[0] * units for one in found]
        return np.array(points).reshape(len(found), period, 2 * n)

    def multipliers_of(found: list[Solution]) -> np.ndarray:
        return np.array([one.multipliers for one in found], complex).reshape(len(found), 2 * n)

    variables = {
        "point": (("step", "turn", "state"), points_of(arc.points), attributes),
        "multiplier": (("step", "multiplier_number"), multipliers_of(arc.points)),
        "contact": ("step", np.array([one.contact for one in seen], np.uint64)),
        "drift": ("step", np.array(drift), {"units": "A / Omega^2"}),
        "special_point": (("special", "turn", "state"), points_of(specials), attributes),
        "special_multiplier": (("special", "multiplier_number"), multipliers_of(specials)),
        "special_step": ("special", np.array([place for place, _ in arc.specials], int)),
    }
    begins, ends = arc.ends
    return (
        variables,
        {"state": [f"{letter}_{i}" for letter in "uv" for i in range(1, n + 1)]},
        {
            "period": period,
            "amplitude": forced.amplitude,
            "omega": forced.omega,
            "begins": begins,
            "ends": ends,
        },
    )
