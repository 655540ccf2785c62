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
    n_steps, largest = count("steps", steps, 1, MAX_STEPS), positive("largest_step", largest_step)
    limits = Limits(low, high, n_steps, largest)
    catalogue = Catalogue(forced, limits, scale, found.period, 1, costly=forced.is_costly)
    catalogue.add(found.points / forced.units, value)
    catalogue.grow()
    return _of_branch(catalogue.branches[0].arc, forced)


def _of_branch(arc: Arc, forced: ForcedMap):
    """Turn a branch of a structure into a dataset; see `branch`."""
    structure = forced.structure
    specials = [special for _, special in arc.specials]
    leaving = np.full((len(specials), forced.size), np.nan)
    leaving_value = np.full(len(specials), np.nan)
    for k, special in enumerate(specials):
        if special.leaving is not None:
            leaving[k] = special.leaving.y[: forced.size] * forced.units
            leaving_value[k] = special.leaving.y[-1] * arc.curve.scale
    change = [special.change or (0,) * len(structure.contacts) for special in specials]
    return dataset_of(
        arc,
        forced,
        [special.kind.name.lower() for special in specials],
        {
            "stable": ("step", np.array([abs(one.multipliers[0]) < 1.0 for one in arc.points])),
            "change": (
                ("special", "contact_number"),
                np.array(change, int).reshape(len(specials), len(structure.contacts)),
            ),
            "criticality": ("special", np.array([one.criticality for one in specials], int)),
            "leaving": (("special", "state"), leaving),
            "leaving_value": ("special", leaving_value),
            "contact_number": [structure.contact_names[k] for k in structure.contact_numbers],
        },
        {"parameter": forced.parameter},
    )


def dataset_of(arc: Arc, forced: ForcedMap, kinds: list[str], variables: dict, attributes: dict):
    """Turn a branch of a structure, or a curve over two parameters, into a dataset.

    Parameters
    ----------
    arc : Arc
    forced : ForcedMap
    kinds : list of str
        Of the special points.
    variables, attributes : dict
        Further ones.
    """
    import xarray

    curve, structure, units = arc.curve, forced.structure, forced.units
    n, period, pair = structure.n_floors, curve.period, len(forced.parameters) == 2
    states = [curve.split(one.y) for one in arc.points]
    seen = [forced.observe(*state) for state in states]
    drift = [
        float(normalised_drift(one.peak_drift, *forced.at(value)[1:]))
        for one, (_, value) in zip(seen, states, strict=True)
    ]
    length, speed = (unit_of(structure, kind) for kind in ("length", "velocity"))
    described = {"units": f"{length}, {speed}", "long_name": "stroboscopic points"}
    named = {} if pair else {"long_name": forced.parameter}

    def along(dimension: str, prefix: str, solutions: list[Solution]) -> dict:
        """Return the orbits at the points of the curve, and the values of the parameter."""
        size, split = len(solutions), [curve.split(one.y) for one in solutions]
        points = np.array([x * units for x, _ in split]).reshape(size, period, 2 * n)
        multipliers = np.array([one.multipliers for one in solutions], complex)
        values = np.array([value for _, value in split], float)
        return {
            f"{prefix}point": ((dimension, "turn", "state"), points, described),
            f"{prefix}multiplier": (
                (dimension, "multiplier_number"),
                multipliers.reshape(size, 2 * n),
            ),
            f"{prefix}value": (
                (dimension, "parameter")[: 1 + pair],
                values.reshape((size, 2)[: 1 + pair]),
                named,
            ),
        }

    return xarray.Dataset(
        {
            **along("step", "", arc.points),
            "contact": ("step", np.array([one.contact for one in seen], np.uint64)),
            "drift": ("step", np.array(drift), {"units": "A / Omega^2"}),
            **along("special", "special_", [one.at for _, one in arc.specials]),
            "special_step": ("special", np.array([place for place, _ in arc.specials], int)),
            "special_kind": ("special", kinds),
            **variables,
        },
        coords={"state": [f"{letter}_{i}" for letter in "uv" for i in range(1, n + 1)]},
        attrs={
            **attributes,
            "period": period,
            "amplitude": forced.amplitude,
            "omega": forced.omega,
            "begins": arc.ends[0],
            "ends": arc.ends[1],
        },
    )
