"""Variables of the results of a study of branches: a run is a line in the space of parameters."""

from enum import IntEnum

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.plane import Meeting
from hpcsweep.model.structure import Structure
from hpcsweep.studies.quantities import CONTACT, DRIFT, STATES
from hpcsweep.studies.variable import (
    COUNT,
    FINITE,
    POSITIVE,
    VALID,
    Variable,
    code,
    contacts,
    count,
    real,
)
from hpcsweep.studies.variables import AMPLITUDE, CYCLES, OMEGA, OUTCOME, RUN_VARIABLES

End = IntEnum(
    "End",
    "NONE END_OF_THE_SPAN MOST_STEPS CLOSED BIRTH HALVING NOT_FOLLOWED_ON OUT_OF_REACH KNOWN "
    "RESONANCE GRAZING BORDER CHATTER",
    start=0,
)
"""Why a branch goes no farther."""
Reason = IntEnum("Reason", "ON_A_BRANCH NO_ORBIT ANOTHER_ORBIT NO_ROOM", start=0)
"""Why a seed lies on no branch of the file."""
Origin = IntEnum("Origin", "NONE SEED LEAVING SEARCH", start=0)
"""How a branch was found."""
Stability = IntEnum("Stability", "UNSTABLE STABLE", start=0)
"""Whether all multipliers are inside the unit circle."""
Criticality = IntEnum("Criticality", "SUBCRITICAL NONE SUPERCRITICAL", start=-1)
"""Side to which what is born at a doubling goes."""
Met = IntEnum("Met", [meeting.name for meeting in Meeting])  # type: ignore[misc]
"""Numbers of the kinds of meetings in the file, from 1."""
RUN = ("direction", "line", "amplitude")
"""Dimensions of a line."""
BRANCH, STEP, SPECIAL, SEED = ("branch",), ("step",), ("special",), ("seed",)
SLOTS = {
    "branch": "branch_id",
    "step": "step_branch",
    "special": "special_branch",
    "seed": "seed_period",
    "curve": "curve_id",
    "curve_step": "curve_of_step",
    "meeting": "meeting_curve",
}
"""By dimension the variable that is above 0 where there is one."""
LINE_OMEGA = real("omega", ("line",), *OMEGA, None)
LINE_AMPLITUDE = real("forcing_amplitude", ("line",), *AMPLITUDE, None)
VARIABLES = (
    count("branch_id", BRANCH, "number of the branch, 0 for none"),
    count("branch_period", BRANCH, "period of its orbits", "forcing periods", POSITIVE),
    code("found_by", BRANCH, Origin, "found by: 1 a seed, 2 leaving another, 3 the search"),
    count("parent", BRANCH, "branch that it leaves, 0 for none"),
    code("begins", BRANCH, End, "why it does not go on before its first step"),
    code("ends", BRANCH, End, "why it does not go on after its last step"),
    count("step_branch", STEP, "branch of a point, 0 for none"),
    real("value", STEP, "1", "value of the parameter", None),
    code(
        *("stable", STEP, Stability, "1 where all multipliers are inside the unit circle"),
        limits=COUNT,
    ),
    CONTACT.along(STEP),
    DRIFT.along(STEP),
    real("point", (*STEP, "state"), STATES, "a stroboscopic point of the orbit", FINITE),
    real("multiplier_real", (*STEP, "number"), "1", "Floquet multipliers, real part", None),
    real("multiplier_imag", (*STEP, "number"), "1", "Floquet multipliers, imaginary", None),
    count("special_branch", SPECIAL, "branch of a special point, 0 for none"),
    code(
        "special_kind",
        SPECIAL,
        Kind,
        "special point: 1 fold, 2 doubling, 3 torus, 4 branch point, 5 grazing, 6 slip, 7 chatter",
    ),
    real("special_value", SPECIAL, "1", "value of the parameter at a special point", None),
    count("special_step", SPECIAL, "step after it, or of it"),
    real("special_point", (*SPECIAL, "state"), STATES, "a stroboscopic point there", None),
    code(
        "criticality", SPECIAL, Criticality, "of a doubling: 1 super-, -1 subcritical", limits=COUNT
    ),
    count("leads_to", SPECIAL, "branch that leaves there, 0 for none"),
    count("change", SPECIAL, "closings of contacts, or slips, more along the branch", limits=None),
    contacts("special_contact", SPECIAL, "contacts that graze, bit k - 1 of contact k"),
    count("seed_branch", SEED, "branch on which a seed lies, 0 for none"),
    code(
        "seed_reason",
        SEED,
        Reason,
        "why on none: 1 no orbit there, 2 Newton's method leads elsewhere, 3 no room",
        limits=COUNT,
    ),
    real("seed_value", SEED, "1", "value of the parameter of a seed", None),
    count("seed_period", SEED, "orbit period of a seed, 0 for none", "forcing periods"),
    real("seed_point", (*SEED, "state"), STATES, "a stroboscopic point of a seed", None),
    real("seed_distance", SEED, "1", "its distance from the orbit, units of the state", None),
    count("n_branches", (), "branches of the line", failed=VALID),
    count("n_seeds", (), "periodic motions of the files on the line", failed=VALID),
    count("n_covered", (), "of these, those that lie on a branch", failed=VALID),
    count("n_others", (), "motions of the files that are no orbit", failed=VALID),
    Variable("seeds_checksum", (), "<u8", "1", "checksum of the seeds"),
    CYCLES,
    OUTCOME,
)
OF_SLIDERS = tuple(
    variable.along(STEP)
    for variable in RUN_VARIABLES
    if variable.name in ("ductility", "slider_energy", "shakedown")
)


def variables_of(structure: Structure) -> tuple[Variable, ...]:
    """Return the variables of branches of a structure."""
    return (*VARIABLES, *(OF_SLIDERS if structure.sliders else ()))


CURVE, CURVE_STEP, MEETING = ("curve",), ("curve_step",), ("meeting",)
CURVE_VARIABLES = (
    count("special_curve", SPECIAL, "curve on which it lies, 0 if none is followed"),
    count("curve_id", CURVE, "number of the curve, 0 for none"),
    code("curve_kind", CURVE, Kind, "special points on it, as special_kind"),
    count("curve_period", CURVE, "period of its orbits", "forcing periods", POSITIVE),
    code("curve_begins", CURVE, End, "why it does not go on before its first step"),
    code("curve_ends", CURVE, End, "why it does not go on after its last step"),
    count("curve_of_step", CURVE_STEP, "curve of a point, 0 for none"),
    real("curve_amplitude", CURVE_STEP, *AMPLITUDE, None),
    real("curve_omega", CURVE_STEP, *OMEGA, None),
    real("curve_point", (*CURVE_STEP, "state"), STATES, "a stroboscopic point there", None),
    Variable("curve_unstable", CURVE_STEP, "<i1", "1", "multipliers outside the unit circle"),
    count("meeting_curve", MEETING, "curve that meets another or ends, 0 for none"),
    code("meeting_kind", MEETING, Met, "what is there"),
    real("meeting_amplitude", MEETING, *AMPLITUDE, None),
    real("meeting_omega", MEETING, *OMEGA, None),
    count("n_curves", (), "curves of the line", failed=VALID),
)
