"""Variables of the results of a study of branches: a run is a line in the space of parameters."""

from dataclasses import replace
from enum import IntEnum

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.meetings import Meeting
from hpcsweep.studies.variable import CONTACT_SET, Variable
from hpcsweep.studies.variables import AMPLITUDE, CYCLES, OMEGA, OUTCOME, STATES


class End(IntEnum):
    """Why a branch goes no farther."""

    NONE = 0
    END_OF_THE_SPAN = 1
    MOST_STEPS = 2
    CLOSED = 3
    BIRTH = 4
    HALVING = 5
    NOT_FOLLOWED_ON = 6
    OUT_OF_REACH = 7
    KNOWN = 8
    RESONANCE = 9
    GRAZING = 10


class Reason(IntEnum):
    """Why a seed lies on no branch of the file."""

    ON_A_BRANCH = 0
    NO_ORBIT = 1
    ANOTHER_ORBIT = 2
    NO_ROOM = 3


class Origin(IntEnum):
    """How a branch was found."""

    NONE = 0
    SEED = 1
    LEAVING = 2
    SEARCH = 3


class Criticality(IntEnum):
    """Side to which what is born at a doubling goes."""

    SUBCRITICAL = -1
    NONE = 0
    SUPERCRITICAL = 1


Met = IntEnum("Met", [one.name for one in Meeting])  # type: ignore[misc]
"""Numbers of the kinds of meetings in the file, from 1."""
RUN = ("direction", "line", "amplitude")
"""Dimensions of a line."""
BRANCH, STEP = (*RUN, "branch"), (*RUN, "step")
SPECIAL, SEED = (*RUN, "special"), (*RUN, "seed")
COMMIT = Variable("commit", ("direction", "line", "block"), "<u8", "1", "checksum of a block")
LINE_OMEGA = Variable("omega", ("line",), "<f8", *OMEGA)
LINE_AMPLITUDE = Variable("forcing_amplitude", ("line",), "<f8", *AMPLITUDE)
VARIABLES = (
    Variable("branch_id", BRANCH, "<i4", "1", "number of the branch, 0 for none"),
    Variable("branch_period", BRANCH, "<i4", "forcing periods", "period of its orbits"),
    Variable(
        "found_by",
        BRANCH,
        "<i1",
        "1",
        "found by: 1 a seed, 2 leaving another, 3 the search",
        Origin,
    ),
    Variable("parent", BRANCH, "<i4", "1", "branch that it leaves, 0 for none"),
    Variable("begins", BRANCH, "<i1", "1", "why it does not go on before its first step", End),
    Variable("ends", BRANCH, "<i1", "1", "why it does not go on after its last step", End),
    Variable("step_branch", STEP, "<i4", "1", "branch of a point, 0 for none"),
    Variable("value", STEP, "<f8", "1", "value of the parameter"),
    Variable("stable", STEP, "<i1", "1", "1 where all multipliers are inside the unit circle"),
    Variable("contact", STEP, "<u8", "1", "contact set, bit k - 1 for contact k", CONTACT_SET),
    Variable("drift", STEP, "<f8", "A / Omega^2", "normalised peak interstorey drift"),
    Variable("point", (*STEP, "state"), "<f8", STATES, "a stroboscopic point of the orbit"),
    Variable("multiplier_real", (*STEP, "number"), "<f8", "1", "Floquet multipliers, real part"),
    Variable("multiplier_imag", (*STEP, "number"), "<f8", "1", "Floquet multipliers, imaginary"),
    Variable("special_branch", SPECIAL, "<i4", "1", "branch of a special point, 0 for none"),
    Variable(
        "special_kind",
        SPECIAL,
        "<i1",
        "1",
        "special point: 1 fold, 2 doubling, 3 torus, 4 branch point, 5 grazing",
        Kind,
    ),
    Variable("special_value", SPECIAL, "<f8", "1", "value of the parameter at a special point"),
    Variable("special_step", SPECIAL, "<i4", "1", "step after it, or of it"),
    Variable("special_point", (*SPECIAL, "state"), "<f8", STATES, "a stroboscopic point there"),
    Variable(
        "criticality", SPECIAL, "<i1", "1", "of a doubling: 1 super-, -1 subcritical", Criticality
    ),
    Variable("leads_to", SPECIAL, "<i4", "1", "branch that leaves there, 0 for none"),
    Variable("change", SPECIAL, "<i4", "1", "closings of contacts more along the branch"),
    Variable(
        "special_contact",
        SPECIAL,
        "<u8",
        "1",
        "contacts that graze, bit k - 1 of contact k",
        CONTACT_SET,
    ),
    Variable("seed_branch", SEED, "<i4", "1", "branch on which a seed lies, 0 for none"),
    Variable(
        "seed_reason",
        SEED,
        "<i1",
        "1",
        "why on none: 1 no orbit there, 2 Newton's method leads elsewhere, 3 no room",
        Reason,
    ),
    Variable("seed_value", SEED, "<f8", "1", "value of the parameter of a seed"),
    Variable("seed_period", SEED, "<i4", "forcing periods", "orbit period of a seed, 0 for none"),
    Variable("seed_point", (*SEED, "state"), "<f8", STATES, "a stroboscopic point of a seed"),
    Variable("seed_distance", SEED, "<f8", "1", "its distance from the orbit, units of the state"),
    Variable("n_branches", RUN, "<i4", "1", "branches of the line"),
    Variable("n_seeds", RUN, "<i4", "1", "periodic motions of the files on the line"),
    Variable("n_covered", RUN, "<i4", "1", "of these, those that lie on a branch"),
    Variable("n_others", RUN, "<i4", "1", "motions of the files that are no orbit"),
    Variable("seeds_checksum", RUN, "<u8", "1", "checksum of the seeds"),
    replace(CYCLES, dims=RUN),
    replace(OUTCOME, dims=RUN),
)
CURVE, CURVE_STEP, MEETING = (*RUN, "curve"), (*RUN, "curve_step"), (*RUN, "meeting")
CURVE_VARIABLES = (
    Variable("special_curve", SPECIAL, "<i4", "1", "curve on which it lies, 0 if none is followed"),
    Variable("curve_id", CURVE, "<i4", "1", "number of the curve, 0 for none"),
    Variable("curve_kind", CURVE, "<i1", "1", "special points on it, as special_kind", Kind),
    Variable("curve_period", CURVE, "<i4", "forcing periods", "period of its orbits"),
    Variable("curve_begins", CURVE, "<i1", "1", "why it does not go on before its first step", End),
    Variable("curve_ends", CURVE, "<i1", "1", "why it does not go on after its last step", End),
    Variable("curve_of_step", CURVE_STEP, "<i4", "1", "curve of a point, 0 for none"),
    Variable("curve_amplitude", CURVE_STEP, "<f8", *AMPLITUDE),
    Variable("curve_omega", CURVE_STEP, "<f8", *OMEGA),
    Variable("curve_point", (*CURVE_STEP, "state"), "<f8", STATES, "a stroboscopic point there"),
    Variable("curve_unstable", CURVE_STEP, "<i1", "1", "multipliers outside the unit circle"),
    Variable("meeting_curve", MEETING, "<i4", "1", "curve that meets another or ends, 0 for none"),
    Variable("meeting_kind", MEETING, "<i1", "1", "what is there", Met),
    Variable("meeting_amplitude", MEETING, "<f8", *AMPLITUDE),
    Variable("meeting_omega", MEETING, "<f8", *OMEGA),
    Variable("n_curves", RUN, "<i4", "1", "curves of the line"),
)
