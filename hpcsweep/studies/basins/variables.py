"""Variables of the results of a study of basins: a run is a row of starts, or one of them."""

from dataclasses import replace

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.studies.settings import MEASURES, SweepSettings
from hpcsweep.studies.variable import CONTACT_SET, Variable
from hpcsweep.studies.variables import (
    AMPLITUDE,
    CYCLES,
    OMEGA,
    OUTCOME,
    STATES,
    measures_of_each,
)

RUN = ("direction", "row", "amplitude")
"""Dimensions of a row."""
START_RUN = ("direction", "row", "column")
"""Dimensions of a start."""
EACH = (*RUN, "attractor")
OF_LABEL = (
    "attractor that a start goes to: its attractor_id; -1 undecided, -2 failed, -3 one that is "
    "not listed"
)
ROW_AMPLITUDE = Variable("forcing_amplitude", ("row",), "<f8", *AMPLITUDE)
ROW_OMEGA = Variable("omega", ("row",), "<f8", *OMEGA)
COMMIT = Variable("commit", ("direction", "row", "block"), "<u8", "1", "checksum of a block")
ORDINATE = Variable("ordinate", ("row",), "<f8", STATES, "second component of a row's starts")
VARIABLES = (
    Variable("label", (*RUN, "column"), "<i1", "1", OF_LABEL),
    Variable("attractor_id", EACH, "<i4", "1", "number of the attractor, 0 for none"),
    Variable(
        "motion_class",
        EACH,
        "<i1",
        "1",
        "motion: 2 periodic, 4 quasi-periodic, 5 chaotic",
        MotionClass,
    ),
    Variable("hits", EACH, "<i4", "1", "starts of the row that go to the attractor"),
    Variable("orbit_period", EACH, "<i4", "forcing periods", "orbit period, 0 if it is no orbit"),
    Variable("multiplier", EACH, "<f8", "1", "modulus of the largest Floquet multiplier"),
    Variable("lyapunov", EACH, "<f8", "rate", "largest Lyapunov exponent"),
    Variable("contact", EACH, "<u8", "1", "contact set, bit k - 1 for contact k", CONTACT_SET),
    Variable("drift", EACH, "<f8", "A / Omega^2", "normalised peak interstorey drift"),
    Variable("modal_norm", (*EACH, "mode"), "<f8", "1", "mean modal norm free of contact"),
    *measures_of_each(EACH),
    Variable("point", (*EACH, "state"), "<f8", STATES, "a stroboscopic point"),
    Variable("n_undecided", RUN, "<i4", "1", "starts of the row that were not classified"),
    Variable("n_failed", RUN, "<i4", "1", "starts of the row whose integration failed"),
    Variable("n_elsewhere", RUN, "<i4", "1", "starts of the row that went to none of the list"),
    replace(CYCLES, dims=RUN),
    replace(OUTCOME, dims=RUN),
)
START_COMMIT = replace(COMMIT, long_name="checksum of a start")
START_VARIABLES = (
    Variable("label", START_RUN, "<i1", "1", OF_LABEL),
    replace(CYCLES, dims=START_RUN),
    replace(OUTCOME, dims=START_RUN),
)
OPTIONAL = ("contact", "drift", "modal_norm", *MEASURES)
"""Variables that a job may leave out."""


def basin_variables(settings: SweepSettings) -> list[Variable]:
    """Return the variables of each row, in the order of the file."""
    out = set(OPTIONAL) - set(settings.metrics)
    return [variable for variable in VARIABLES if variable.name not in out]


def is_of_attractors(variable: Variable) -> bool:
    """Return whether a variable of a row has a value for each attractor."""
    return variable.dims[: len(EACH)] == EACH


def listed_variables(settings: SweepSettings) -> list[Variable]:
    """Return the variables of the attractors that a refined map lists for each row.

    They are those of a row, but for its own `hits`.
    """
    return [
        replace(variable, dims=(*START_RUN[:2], *variable.dims[len(RUN) :]))
        for variable in basin_variables(settings)
        if is_of_attractors(variable) and variable.name != "hits"
    ]
