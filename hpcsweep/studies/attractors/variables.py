"""Variables of the results of studies of attractors, and of basins, by row of starts or start."""

from dataclasses import replace
from enum import IntEnum

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import CLOSING
from hpcsweep.studies import quantities, variables
from hpcsweep.studies.attractors.search import MAX_ATTRACTORS, UNSTORED
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import ANY, FINITE, VALID, Variable, code, count, real

EACH = ("attractor",)
SLOTS = {"attractor": "attractor_id"}
LIFETIME = {
    "transient_lifetime": "mean lifetime",
    "transient_lifetime_low": "lower end of the mean lifetime",
    "transient_lifetime_high": "upper end of the mean lifetime",
}
TRANSIENT = (
    count("n_transient", (), "starts that were transient chaos, wherever they end", failed=VALID),
    *(
        real(name, (), "forcing periods", f"{which} of transient chaos", None, failed=ANY)
        for name, which in LIFETIME.items()
    ),
)
"""Outcome of the tests of lifetimes (`hpcsweep.dynamics.lifetime`)."""
ATTRACTOR = (
    count("attractor_id", EACH, "identity along the amplitudes, 0 for none"),
    code("motion", EACH, MotionClass, "motion: 2 periodic, 4 quasi-periodic, 5 chaotic"),
    count("hits", EACH, "starts that reached the attractor"),
    real("share", EACH, "1", "share of the box of starts", None),
    real("share_low", EACH, "1", "lower end of the share's confidence interval", None),
    real("share_high", EACH, "1", "upper end of the share's confidence interval", None),
    count("orbit_period", EACH, "orbit period, 0 if it is no orbit", "forcing periods"),
    real("multiplier", EACH, "1", "modulus of the largest Floquet multiplier", None),
    quantities.LYAPUNOV.along(EACH),
    real("lyapunov_low", EACH, "rate", "lower end of the exponent's interval", None),
    real("lyapunov_high", EACH, "rate", "upper end of the exponent's interval", None),
    *(variable.along(EACH) for variable in variables.SPECTRUM),
    quantities.CONTACT.along(EACH),
    quantities.DRIFT.along(EACH),
    quantities.MODAL_NORM.along(EACH),
    *(
        replace(quantities.of_motions(name), optional=True).along(EACH)
        for name in quantities.MEASURES
    ),
    *(variable.along(EACH) for variable in quantities.ROWS),
    *(
        variable.along(EACH)
        for variable in variables.RUN_VARIABLES
        if variable.name in variables.OF_SLIDERS
    ),
    count("families", EACH, "dimensions of the family of orbits that is the attractor"),
    real("point", (*EACH, "state"), quantities.STATES, "a stroboscopic point", FINITE),
)
"""Variables of an attractor."""
VARIABLES = (
    count("n_attractors", (), "attractors found, more than stored if too many", failed=VALID),
    *ATTRACTOR,
    count("n_points", EACH, "number of stroboscopic points stored"),
    real("poincare", (*EACH, "cycle", "state"), quantities.STATES, "stroboscopic points", None),
    count("n_undecided", (), "starts that were not classified", failed=VALID),
    *TRANSIENT,
    count("n_failed", (), "starts whose integration failed", failed=VALID),
    count("n_elsewhere", (), "starts that reached attractors not stored", failed=VALID),
    count("last_id", (), "largest identity given on the path so far", failed=VALID),
    variables.CYCLES,
    variables.OUTCOME,
)
OF_SPECTRUM = tuple(each.name for each in variables.SPECTRUM)
OF_ROWS = tuple(each.name for each in quantities.ROWS)
OPTIONAL = ("contact", "drift", "modal_norm", *quantities.MEASURES, *OF_SPECTRUM, *OF_ROWS)
"""Variables that a job may leave out."""
RUN = ("direction", "row", "amplitude")
"""Dimensions of a row."""
START_RUN = ("direction", "row", "column")
"""Dimensions of a start."""
OF_LABEL = (
    "attractor that a start goes to: its attractor_id; -1 undecided, -2 failed, -3 one that is "
    "not listed"
)
ROW_AMPLITUDE = Variable("forcing_amplitude", ("row",), "<f8", *variables.AMPLITUDE)
ROW_OMEGA = Variable("omega", ("row",), "<f8", *variables.OMEGA)
ORDINATE = real("ordinate", ("row",), quantities.STATES, "second component of a row's starts")
OWN = {
    "attractor_id": "number of the attractor, 0 for none",
    "hits": "starts of the row that go to the attractor",
}
"""Long names of what is otherwise in studies of attractors."""
NOT_HERE = (
    *("share", "share_low", "share_high", "lyapunov_low", "lyapunov_high"),
    *(*OF_SPECTRUM, *OF_ROWS),
)
NUMBERS = range(1, int(MAX_ATTRACTORS.limits[1]) + 1)
Label = IntEnum(  # type: ignore[misc]
    "Label", {**UNSTORED, **{f"attractor_{number}": number for number in NUMBERS}}
)
LABEL = code("label", ("column",), Label, OF_LABEL, failed=ANY)
BASIN_VARIABLES = (
    LABEL,
    *(
        replace(v, long_name=OWN.get(v.name, v.long_name))
        for v in ATTRACTOR
        if v.name not in NOT_HERE
    ),
    count("n_undecided", (), "starts of the row that were not classified", failed=VALID),
    count("n_failed", (), "starts of the row whose integration failed", failed=VALID),
    count("n_elsewhere", (), "starts of the row that went to none of the list", failed=VALID),
    variables.CYCLES,
    variables.OUTCOME,
)
START_VARIABLES = [replace(LABEL, dims=()), variables.CYCLES, variables.OUTCOME]


def attractor_variables(
    settings: SweepSettings, structure: Structure, every: tuple[Variable, ...] = VARIABLES
) -> list[Variable]:
    """Return those of the variables of each point that a job has, in the order of the file."""
    out = set(OPTIONAL) - set(settings.metrics) | variables.without_contacts(structure)
    if "lyapunov_spectrum" in settings.metrics:
        out -= set(OF_SPECTRUM)
    if settings.rows:
        out -= set(OF_ROWS)
    if CLOSING.of(structure):
        out |= {*variables.OF_SLIDERS, "families"}
    return [variable for variable in every if variable.name not in out]


def basin_variables(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return the variables of each row, in the order of the file."""
    return attractor_variables(settings, structure, BASIN_VARIABLES)


def of_attractors(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return those variables of a row that have a value for each attractor."""
    return [each for each in basin_variables(settings, structure) if "attractor" in each.dims]


def listed_variables(settings: SweepSettings, structure: Structure) -> list[Variable]:
    """Return the variables of the attractors that a refined map lists for each row.

    They are those of a row, but for its own `hits`.
    """
    return [
        variable.along(START_RUN[:2])
        for variable in of_attractors(settings, structure)
        if variable.name != "hits"
    ]
