"""Variables of a study of records, and how each scales with a motion."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Response
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import MEASURES, SweepSettings
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import STATES, measure_coordinates

RUN = ("record", "scale")
"""Dimensions of a run."""
COMMIT = Variable("commit", ("record", "block"), "<u8", "1", "checksum of a block")


class Peak(NamedTuple):
    """A variable of the results, and its field of a response."""

    variable: Variable
    field: str
    """Of a `Response`."""
    power: int
    """Of the scale, with which it grows where gaps grow with the scale."""


def _peak(name: str, field: str, dim: str, units: str, power: int, long_name: str) -> Peak:
    kind = "<i4" if field == "impacts" else "<f8"
    return Peak(Variable(name, (*RUN, dim), kind, units, long_name), field, power)


PEAKS = (
    _peak("storey_drift", "drift", "storey", "length", 1, "peak drift of each storey"),
    _peak("displacement", "displacement", "floor", "length", 1, "peak displacement of each floor"),
    _peak(
        *("floor_acceleration", "floor_acceleration", "floor", "acceleration", 1),
        "peak absolute acceleration of each floor",
    ),
    _peak("contact_force", "force", "stop", "force", 1, "peak force of each contact"),
    _peak("impacts", "impacts", "stop", "1", 0, "closings of each contact"),
    _peak("impact_velocity", "impact_velocity", "stop", "velocity", 1, "largest closing speed"),
    _peak("impulse", "impulse", "stop", "impulse", 1, "impulse of each contact"),
    _peak("contact_time", "contact_time", "stop", "time", 0, "time each contact is closed"),
    _peak("dissipated", "dissipated", "stop", "energy", 2, "energy that each contact has taken"),
    _peak("residual", "residual", "floor", "length", 1, "displacement left at the end"),
    _peak("final_state", "final_state", "state", STATES, 1, "state at the end of the tail"),
)
TIMES = (
    _peak("storey_drift_time", "drift_time", "storey", "time", 0, "time of peak drift"),
    _peak(
        "displacement_time", "displacement_time", "floor", "time", 0, "time of peak displacement"
    ),
    _peak(
        "floor_acceleration_time",
        "acceleration_time",
        "floor",
        "time",
        0,
        "time of its peak",
    ),
    _peak("contact_force_time", "force_time", "stop", "time", 0, "time of peak force"),
)
ALONE = (
    *(
        peak._replace(
            variable=replace(
                peak.variable,
                name=f"{peak.variable.name}_alone",
                long_name=f"{peak.variable.long_name}, without contacts",
            )
        )
        for peak in PEAKS[:3]
    ),
    Peak(
        Variable("gap_needed", (*RUN, "stop"), "<f8", "length", "gap that would not have closed"),
        "reach",
        1,
    ),
)
"""Of the motion without contacts."""
OUTCOME = Variable(
    "outcome",
    RUN,
    "<i1",
    "1",
    "outcome: 1 complete, 2 non-finite, 3 step limit, 4 solver failed",
    Outcome,
)
SKIP_RULE = Variable(
    "skip_rule",
    RUN,
    "<i1",
    "1",
    "rule that spared a computation: 1 linear, below first contact",
    SkipRule,
)
HISTORY = (
    Variable(
        *("history_displacement", (*RUN, "time", "floor"), "<f8", "length"),
        "displacement of each floor",
    ),
    Variable(
        *("history_velocity", (*RUN, "time", "floor"), "<f8", "velocity"),
        "velocity of each floor, relative to the ground",
    ),
    Variable(
        *("history_force", (*RUN, "time", "stop"), "<f8", "force"),
        "force of each contact",
    ),
)
"""The motion itself, where ``output.history`` gives a step; NaN past the end of a record."""
GROUPS = {"times": TIMES, "alone": ALONE}
"""Peaks that a job may leave out, by the keys of its table ``output``."""

FACTS = (
    Variable("pga", ("record",), "<f8", "acceleration", "peak ground acceleration"),
    Variable("pgv", ("record",), "<f8", "velocity", "peak ground velocity"),
    Variable("pgd", ("record",), "<f8", "length", "peak ground displacement"),
    Variable("arias", ("record",), "<f8", "velocity", "Arias intensity"),
    Variable("duration", ("record",), "<f8", "time", "significant duration, 5 to 95 %"),
    Variable("samples", ("record",), "<i4", "1", "number of samples"),
    Variable("dt", ("record",), "<f8", "time", "time between two samples"),
)
"""What is known of each record, by the fields of its `Facts`."""
FACTOR = Variable("factor", RUN, "<f8", "1", "by which the acceleration is multiplied")


def peaks_of(structure, settings: SweepSettings) -> tuple[list[Peak], list[Peak]]:
    """Return the peaks of a response, and of the motion without contacts, that a file holds."""

    def held(peaks) -> list[Peak]:
        return [p for p in peaks if structure.contacts or p.variable.dims[-1] != "stop"]

    groups = {name: held(peaks) for name, peaks in GROUPS.items() if name in settings.metrics}
    return held(PEAKS) + groups.get("times", []), groups.get("alone", [])


def response_variables(structure, settings: SweepSettings, history: bool) -> list[Variable]:
    """Return the variables of a run, in the order of the file, with or without its history."""
    own, alone = peaks_of(structure, settings)
    motion = [one for one in HISTORY if structure.contacts or one.dims[-1] != "stop"]
    peaks = [peak.variable for peak in own + alone]
    return [*peaks, *(motion if history else ()), OUTCOME, SKIP_RULE]


def place_coordinates(structure, settings: SweepSettings) -> dict[str, Coordinate]:
    """Return the dimensions storey, floor and, where there are contacts, stop."""
    made = measure_coordinates(structure, replace(settings, metrics=frozenset(MEASURES)))
    return {name: one for name, one in made.items() if one.values.size}


def pack(response: Response, reach: np.ndarray, peaks: list[Peak]) -> np.ndarray:
    """Return the numbers of a response in one row, peak by peak."""
    fields = [reach if p.field == "reach" else getattr(response, p.field) for p in peaks]
    return np.concatenate([np.empty(0), *(np.asarray(values, float) for values in fields)])
