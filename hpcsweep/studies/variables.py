"""Variables of the results of runs over forcing amplitude and frequency."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass, Shakedown
from hpcsweep.model.observed import Measures
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies import quantities
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import COUNT, FINITE, VALID, Coordinate, Variable, code, count, real

RUN = ("direction", "omega", "amplitude")
"""Dimensions of a run."""
CYCLES = count("cycles", (), "forcing periods integrated", "forcing periods", failed=VALID)
OUTCOME = code(
    *("outcome", (), Outcome),
    "outcome: 1 complete, 2 non-finite, 3 step limit, 4 solver failed, 5 collapsed",
    failed=VALID,
)
SKIP_RULE = code(
    *("skip_rule", (), SkipRule),
    "rule that spared periods: 0 none, 1 linear, 2 converged, 3 newton",
    limits=COUNT,
    failed=VALID,
)
SPECTRUM = (
    quantities.LYAPUNOV_SPECTRUM,
    real(
        *("lyapunov_spectrum_error", ("exponent",), "rate"),
        "half their 95 % confidence intervals; of an orbit their rounding",
        optional=True,
    ),
    *(
        real(f"kaplan_yorke{end}", (), "1", f"Kaplan-Yorke dimension{which}", optional=True)
        for end, which in (
            ("", " of the stroboscopic points"),
            ("_low", " at the lower ends of the exponents"),
            ("_high", " at the upper ends of the exponents"),
        )
    ),
    count(
        *("spectrum_cycles", ()),
        "forcing periods over which the exponents were averaged, 0 of an orbit",
        "forcing periods",
    ),
)
"""All Lyapunov exponents, and what follows from them."""
RUN_VARIABLES = (
    quantities.POINTS,
    count("n_points", (), "number of stroboscopic points stored"),
    count("orbit_period", (), "orbit period, 0 if none was found", "forcing periods"),
    quantities.CONTACT,
    quantities.DRIFT,
    quantities.MODAL_NORM,
    *map(quantities.of_motions, quantities.MEASURES),
    *quantities.ROWS,
    *map(quantities.of_motions, ("ductility", "plastic", "slider_energy")),
    code(
        *("shakedown", (), Shakedown),
        "what the sliders do over the orbit: 1 elastic, none slips, 2 plastic, 3 ratcheting; 0 "
        "without an orbit",
        limits=COUNT,
    ),
    quantities.LYAPUNOV,
    real("lyapunov_low", (), "rate", "its 95 % confidence interval, lower end", None),
    real("lyapunov_high", (), "rate", "its 95 % confidence interval, upper end", None),
    *SPECTRUM,
    code(
        *("motion", (), MotionClass),
        "motion: 1 no contact, 2 periodic, 3 long period, 4 quasi-periodic, 5 chaotic, "
        "6 undecided, 7 failed",
        failed=VALID,
    ),
    code(
        *("window_class", (), MotionClass),
        "what the window shows by itself, as of motion: 1 no contact, 2 repeats, 5 chaotic, "
        "6 undecided; 0 without a window",
        limits=COUNT,
    ),
    count(
        *("window_period", ()),
        "period after which the points of the window repeat, 0 if they do not, -1 if no whole "
        "window was integrated",
        "forcing periods",
        None,
    ),
    count(
        *("classification_cycles", ()),
        "forcing periods integrated after the window until the motion was classified",
        "forcing periods",
    ),
    count(
        *("band_cycles", ()),
        "forcing periods for which chaos of its band was followed, up to this run of a path",
        "forcing periods",
    ),
    real(
        "final_state",
        ("state",),
        quantities.STATES,
        "state after the last period",
        FINITE,
        failed=VALID,
    ),
    CYCLES,
    OUTCOME,
    SKIP_RULE,
)
OF_SLIDERS = ("ductility", "plastic", "slider_energy", "shakedown")
ALWAYS = ("orbit_period", "final_state", "cycles", "outcome", "skip_rule")
STOREY_HEIGHT = real("storey_height", ("storey",), "length", "height of each storey", by_part=True)
AMPLITUDE = ("acceleration", "forcing amplitude A")
OMEGA = ("frequency", "forcing frequency Omega")
"""Units and long names."""


def run_variables(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return the variables of each run, in the order of the file."""
    wanted = set(ALWAYS) | set(settings.metrics) | set(OF_SLIDERS if structure.sliders else ())
    if "poincare" in wanted:
        wanted.add("n_points")
    if "lyapunov_spectrum" in wanted:
        wanted |= {each.name for each in SPECTRUM}
    if settings.rows:
        wanted |= {each.name for each in quantities.ROWS}
    if settings.classify_cycles is not None:
        wanted.add("window_period")
        if "lyapunov" in wanted:
            wanted |= {"lyapunov_low", "lyapunov_high"}
    if settings.classify_cycles:
        wanted |= {"motion", "window_class", "classification_cycles", "band_cycles"}
    wanted -= without_contacts(structure)
    return [variable for variable in RUN_VARIABLES if variable.name in wanted]


def without_contacts(structure: Structure) -> set[str]:
    """Return the variables that a structure without contacts has no values of."""
    return set() if structure.all_contacts else set(quantities.CONTACT_MEASURES)


def empty_results(
    variables: list[Variable], structure: Structure, n_runs: int, **sizes: int
) -> Rows:
    """Allocate the results of `n_runs` runs, as for failed ones.

    Parameters
    ----------
    variables : list of Variable
        Of a run.
    structure : Structure
        Gives the sizes of states, modes, storeys, floors, contacts and sliders.
    n_runs : int
    **sizes
        Those of other dimensions.

    Returns
    -------
    dict of str to ndarray
        By name, first axis the run.
    """
    n = structure.n_floors
    n_contacts, n_storeys = len(structure.all_contacts), len(structure.drift_rows)
    sizes |= {"mode": n, "exponent": 2 * n, "floor": n, "stop": n_contacts, "storey": n_storeys}
    sizes |= {"state": structure.state_units.size, "slider": len(structure.sliders)}
    return {
        each.name: np.full((n_runs, *(sizes[d] for d in each.dims)), each.missing, each.dtype)
        for each in variables
    }


def store_measures(rows: Rows, structure: Structure, measures: Measures | None) -> None:
    """Store measures, if there are any, in rows of results. Contacts out of reach have none."""
    if measures is None:
        return
    numbers = [*structure.all_contacts]
    places = [numbers.index(number) for number in structure.contact_numbers]
    for name in rows.keys() & set(quantities.MEASURES):
        if name not in quantities.CONTACT_MEASURES:
            rows[name][:] = getattr(measures, name)
        else:
            rows[name][:] = 0.0
            rows[name][:, places] = getattr(measures, name)


def storey_heights(structure: Structure) -> list[tuple[Variable, np.ndarray]]:
    """Return the heights of the storeys as a variable, where they are known."""
    heights = structure.names.storey_heights
    return [(STOREY_HEIGHT, np.array(heights))] if heights else []


def percent_of_height(results) -> np.ndarray | None:
    """Return 100 over the height of each storey, None where results hold no heights.

    The product with a drift is its ratio to the height, in percent.
    """
    return 100.0 / results["storey_height"].values if "storey_height" in results else None


def numbered(count: int, long_name: str, first: int = 0) -> Coordinate:
    """Return the coordinate of a dimension with consecutive numbers."""
    return Coordinate(np.arange(first, first + count, dtype="<i4"), "1", long_name)


def named(names: list[str] | tuple[str, ...], long_name: str) -> Coordinate:
    """Return the coordinate of a dimension with names."""
    return Coordinate(np.array(names, object), "1", long_name)


def state_names(structure: Structure) -> list[str]:
    """Return the names of the components of a state: u_1 .. v_n, of buildings u_A1 ..., and p."""
    of_floors = [f"{letter}_{floor}" for letter in "uv" for floor in structure.floor_names]
    return of_floors + [f"p_{name}" for name in structure.slider_names]


def states(structure: Structure, size: int | None = None) -> Coordinate:
    """Make the coordinate of the components of a state, or of the first `size` of them."""
    return named(state_names(structure)[:size], "state component")


def slider_names(structure: Structure) -> dict[str, Coordinate]:
    """Return the dimension of the sliders, if there are any."""
    return {"slider": named(structure.slider_names, "slider")} if structure.sliders else {}


def measure_coordinates(structure: Structure, settings: SweepSettings) -> dict[str, Coordinate]:
    """Return the dimensions of the requested measures: storeys, floors, contacts, exponents."""
    made = {}
    if "lyapunov_spectrum" in settings.metrics:
        made["exponent"] = numbered(2 * structure.n_floors, "Lyapunov exponent", first=1)
    if "storey_drift" in settings.metrics:
        made["storey"] = named(structure.storey_names, "storey")
    if not settings.metrics.isdisjoint(quantities.FLOOR_MEASURES):
        made["floor"] = named(structure.floor_names, "floor")
    contacts = set(quantities.CONTACT_MEASURES) - without_contacts(structure)
    if not settings.metrics.isdisjoint(contacts):
        made["stop"] = named(tuple(structure.contact_names.values()), "contact")
    if settings.rows:
        made["coordinate"] = named(settings.rows, "row of displacements")
        made["harmonic"] = numbered(settings.n_harmonics, "harmonic of the forcing", first=1)
    return made


NOT_TESTED = -1
"""Window period of a run without a window of its own."""


EXPONENTS = ("lyapunov", "lyapunov_low", "lyapunov_high")
"""Variables of the largest Lyapunov exponent per unit of time, and of its interval."""


def empty_rows(structure: Structure, n_runs: int, settings: SweepSettings) -> Rows:
    """Allocate the results of `n_runs` runs, as for failed runs.

    Returns
    -------
    dict of str to ndarray
        The variables requested by `settings.metrics`, first axis the run.
    """
    variables = run_variables(settings, structure)
    return empty_results(
        variables, structure, n_runs, **settings.sizes, point=settings.stored_points
    )


def store(
    rows: Rows,
    structure: Structure,
    omega: float,
    amplitudes: np.ndarray | float,
    result: Mapping[str, Any],
) -> None:
    """Write results of k complete runs into `rows`, k rows as allocated by `empty_rows`.

    Parameters
    ----------
    rows : dict of str to ndarray
    structure : Structure
    omega : float
    amplitudes : ndarray, shape (k,), or float
    result : mapping
        The variables by their names, as far as they are stored as they are; ``points``, the
        stroboscopic points to store: the first ``n_points``, the others NaN; ``peak_drift`` and
        ``measures`` as in an `Observation`. Of several runs each with an additional first axis.
    """
    rows["outcome"][:] = Outcome.COMPLETE
    for name in rows.keys() & result.keys():
        rows[name][:] = result[name]
    points = result["points"]
    if "poincare" in rows:
        most = min(points.shape[-2], rows["poincare"].shape[1])
        rows["poincare"][:, :most] = points[..., :most, :]
    if "drift" in rows:
        rows["drift"][:] = normalised_drift(result["peak_drift"], amplitudes, omega)
    store_measures(rows, structure, result["measures"])


def store_failure(rows: Rows, end: np.ndarray, cycles: int, outcome: Outcome) -> None:
    """Write the outcome of a failed run and its last state, of a collapse rest, into its row."""
    rows["cycles"][:] = cycles
    rows["outcome"][:] = outcome
    rows["final_state"][:] = 0.0 if outcome is Outcome.COLLAPSED else end
    if "motion" in rows:
        rows["motion"][:] = MotionClass.FAILED
