"""A branch of periodic orbits as a dataset: points, multipliers, special points."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from hpcsweep.dynamics.continuation.borders import catalogue_of, check_hardening
from hpcsweep.dynamics.continuation.branch import Arc, Limits
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.cycle import Solution
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.dynamics.continuation.periodic import find
from hpcsweep.job.formula import formula
from hpcsweep.model.arguments import count, finite_vector, instance, positive
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.offers import CLOSING
from hpcsweep.store.layout import attributes_of
from hpcsweep.studies.branches.runs import store_branches
from hpcsweep.studies.branches.variables import variables_of
from hpcsweep.studies.variables import empty_results, state_names

if TYPE_CHECKING:
    import xarray

MAX_STEPS = 100_000


def branch(
    structure: Structure,
    amplitude: float | str,
    omega: float | str,
    state: Any,
    period: int,
    parameter: str = "amplitude",
    span: tuple[float, float] = (0.0, 1.0),
    steps: int = 1000,
    largest_step: float = 0.05,
) -> "xarray.Dataset":
    """Follow the branch of periodic orbits through an orbit, stable and unstable, past folds.

    Parameters
    ----------
    structure : Structure
    amplitude, omega, state, period
        Of a nearby orbit, as in `orbit`; amplitude or frequency also a formula of the parameter,
        ``"0.7 * omega**2"``.
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
        The variables of a line of a file of branches, of one branch (``branch`` is of size 1): over
        ``step`` ``value`` of the parameter, ``point`` (step, state), ``multiplier_real`` and
        ``multiplier_imag`` (step, number), ``stable``, ``contact`` (bit k - 1 for contact k) and
        ``drift``; over ``special``, the special points in order, ``special_kind``,
        ``special_value``, ``special_point``, ``special_step`` (of the point after it), ``change``
        (closings or slips more) and ``criticality`` (of a doubling: 1 super-, -1 subcritical).
        `hpcsweep.meanings` puts codes into words. Of structures that yield ``ductility``,
        ``slider_energy`` (step, slider) and ``shakedown``, too, and multipliers of 0 in place of
        those of 1 along the family of an orbit. Besides ``orbit`` (step, turn, state) and
        ``special_orbit``, all points of the orbits, ``multiplier`` and ``special_multiplier``
        (complex), ``contact_change`` (special, stop), of sliders ``slip_change`` (special, slider),
        and ``leaving``, a point of the orbit of twice the period, or of the crossing branch, at
        ``leaving_value``. Attributes ``begins`` and ``ends`` say why the branch goes no further.

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
    >>> kind = hpcsweep.meanings(branch.special_kind)[0].item()
    >>> kind, round(float(branch.special_value[0]), 12)
    ('grazing', 0.1)
    """
    check_hardening(instance("structure", structure, Structure))
    ties = _ties(parameter, amplitude=amplitude, omega=omega)
    given: dict[str, Any] = {"amplitude": amplitude, "omega": omega}
    if ties:
        at = given.get(parameter, getattr(structure, parameter, None))
        given |= {name: of(**{parameter: at}) for name, of in ties.items()}
    forcing = given["amplitude"], given["omega"]
    forced, nearby = find(structure, *forcing, state, period, parameter, ties)
    if nearby.families and CLOSING.of(structure):
        raise ValueError("state is on one of many orbits: nothing keeps the place of a free motion")
    value = forced.value
    low, high = span_of(span, parameter, value)
    scale = high - low
    n_steps, largest = count("steps", steps, 1, MAX_STEPS), positive("largest_step", largest_step)
    catalogue = catalogue_of(forced, Limits(low, high, n_steps, largest), scale, nearby.period, 1)
    catalogue.add(nearby.points / forced.units, value)
    catalogue.grow()
    return _of_branch(catalogue, forced).assign_attrs(formulas=", ".join(ties))


def _ties(parameter: str, **given: Any) -> dict[str, Callable[..., float]]:
    """Return the formulas of a parameter among what is given of the forcing, by name."""
    ties = {}
    for name, text in given.items():
        if isinstance(text, str):
            if name == parameter:
                raise ValueError(f"{name} must be a number: the branch is along it, is {text!r}")
            try:
                ties[name] = formula(text, (parameter,))[0]
            except ValueError as error:
                raise ValueError(f"{name} {error}, is {text!r}") from None
    return ties


def span_of(span: Any, parameter: str, value: float) -> tuple[float, float]:
    """Return the validated span of a parameter, which must hold its value."""
    low, high = finite_vector("span", span, 2).tolist()
    if not low < high or not low <= value <= high:
        raise ValueError(f"span must hold {parameter} = {value:g}, is {low:g} to {high:g}")
    return low, high


def _of_branch(catalogue: Catalogue, forced: ForcedMap):
    """Turn the branch of a catalogue into a dataset; see `branch`."""
    arc, structure = catalogue.branches[0], forced.structure
    specials = [special for _, special in arc.specials]
    variables, held = variables_of(structure), (("branch",), ("step",), ("special",))
    kept = [variable for variable in variables if variable.dims[:1] in held]
    sizes = {"branch": 1, "step": len(arc.points), "special": len(specials)}
    every = [*kept, *(variable for variable in variables if variable.name == "n_branches")]
    rows = empty_results(every, structure, 1, **sizes, number=forced.size)
    store_branches(rows, forced, catalogue)
    stored = {v.name: (v.dims, rows[v.name][0], attributes_of(v, structure)) for v in kept}
    stored["value"][2]["long_name"] = forced.parameter
    leaving = np.full((len(specials), forced.size + 1), np.nan)
    change = np.zeros((len(specials), len(structure.contacts) + len(structure.sliders)), int)
    for k, special in enumerate(specials):
        change[k] = special.change or 0
        if special.leaving is not None:
            leaving[k] = special.leaving.y[[*range(forced.size), -1]]
    closings, slips = np.split(change, [len(structure.contacts)], axis=1)
    more = {
        "contact_change": (("special", "stop"), closings),
        "leaving": (("special", "state"), leaving[:, :-1] * forced.units),
        "leaving_value": ("special", leaving[:, -1] * arc.curve.scale),
        "stop": [structure.contact_names[k] for k in structure.contact_numbers],
    }
    if structure.sliders:
        more["slip_change"] = ("special", "slider"), slips
        more["slider"] = list(structure.slider_names)
    return dataset_of(arc, forced, stored | more, {"parameter": forced.parameter})


def dataset_of(arc: Arc, forced: ForcedMap, variables: dict, attributes: dict):
    """Turn a branch of a structure, or a curve over two parameters, into a dataset.

    Parameters
    ----------
    arc : Arc
    forced : ForcedMap
    variables, attributes : dict
        Besides the orbits and their multipliers.
    """
    import xarray

    curve, structure, units = arc.curve, forced.structure, forced.units
    length, speed = (unit_of(structure, kind) for kind in ("length", "velocity"))
    described = {"units": f"{length}; {speed}", "long_name": "stroboscopic points of the orbit"}
    floquet = {"units": "1", "long_name": "Floquet multipliers"}

    def along(dimension: str, prefix: str, solutions: list[Solution]) -> dict:
        """Return the orbits at the points of the curve."""
        size = len(solutions)
        points = np.array([curve.split(solution.y)[0] * units for solution in solutions])
        points = points.reshape(size, curve.period, forced.size)
        multipliers = np.array([solution.multipliers for solution in solutions], complex)
        multipliers = multipliers.reshape(size, forced.size)
        return {
            f"{prefix}orbit": ((dimension, "turn", "state"), points, described),
            f"{prefix}multiplier": ((dimension, "number"), multipliers, floquet),
        }

    specials = [special.at for _, special in arc.specials]
    place = {"amplitude": forced.amplitude, "omega": forced.omega}
    return xarray.Dataset(
        along("step", "", arc.points) | along("special", "special_", specials) | variables,
        coords={"state": state_names(structure)[: forced.size]},
        attrs=attributes
        | {"period": curve.period, **place, "begins": arc.ends[0], "ends": arc.ends[1]},
    )
