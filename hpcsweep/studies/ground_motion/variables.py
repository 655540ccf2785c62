"""Variables of a study of records, and how each scales with a motion."""

from dataclasses import replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.record_response import Energy, Response
from hpcsweep.studies import variables
from hpcsweep.studies.ground_motion.floors import FLOOR_SPECTRUM, RUN
from hpcsweep.studies.settings import MEASURES, SweepSettings
from hpcsweep.studies.variable import ANY, EITHER, FINITE, SIZE, Coordinate, Variable, count, real
from hpcsweep.studies.variables import STATES, measure_coordinates, named


class Collapse(IntEnum):
    """What has become of the structure."""

    STANDS = 0
    COLLAPSED = 1


class Peak(NamedTuple):
    """A variable of the results, and its field of a response."""

    variable: Variable
    field: str
    """Of a `Response`."""
    power: int
    """Of the scale, with which it grows where gaps grow with the scale ..."""

    @property
    def linear_power(self) -> int:
        """... and of a motion without contacts and slips, where nothing else grows."""
        return 1 if self.field == "ductility" else self.power


def _peak(
    name: str, dim: str, units: str, power: int, long_name: str, limits=SIZE, field="", **rules
) -> Peak:
    made = count if name in ("impacts", "excursions", "collapsed") else real
    rules |= {"units": units, "long_name": long_name, "limits": limits}
    return Peak(made(name, (*RUN, *dim.split()), **rules), field or name, power)


def _time(name: str, dim: str, field: str, long_name: str) -> Peak:
    return _peak(f"{name}_time", dim, "time", 0, long_name, field=f"{field}_time")


PEAKS = (
    _peak("storey_drift", "storey", "length", 1, "peak drift of each storey", field="drift"),
    _peak("displacement", "floor", "length", 1, "peak displacement of each floor"),
    _peak(
        "floor_acceleration", "floor", "acceleration", 1, "peak absolute acceleration of each floor"
    ),
    _peak("contact_force", "stop", "force", 1, "peak force of each contact", field="force"),
    _peak("impacts", "stop", "1", 0, "closings of each contact"),
    _peak("impact_velocity", "stop", "velocity", 1, "largest closing speed"),
    _peak("impulse", "stop", "impulse", 1, "impulse of each contact", FINITE),
    _peak("contact_time", "stop", "time", 0, "time each contact is closed"),
    _peak("dissipated", "stop", "energy", 2, "energy that each contact has taken", FINITE),
    _peak("ductility", "slider", "1", 0, "peak elongation of each slider over that of yielding"),
    _peak("slider_force", "slider", "force", 1, "peak force of each slider"),
    _peak("plastic", "slider", "length", 1, "lasting elongation of each slider", FINITE),
    _peak("plastic_path", "slider", "length", 1, "sum of its changes"),
    _peak("excursions", "slider", "1", 0, "how often each slider has slipped"),
    _peak("slider_energy", "slider", "energy", 2, "energy that each slider has dissipated"),
    _peak(
        *("collapsed", "", "1", 0, "1 if the motion has collapsed and ended", EITHER),
        flags=Collapse,
    ),
    _peak("collapse_time", "", "time", 0, "when it has collapsed, NaN: not", optional=True),
    _peak(
        *("residual_drift", "storey", "length", 1, "lasting drift of each storey; NaN: collapsed"),
        FINITE,
        optional=True,
    ),
    _peak("residual", "floor", "length", 1, "displacement left at the end"),
    _peak("final_state", "state", STATES, 1, "state at the end of the tail", FINITE),
)
TIMES = (
    _time("storey_drift", "storey", "drift", "time of peak drift"),
    _time("displacement", "floor", "displacement", "time of peak displacement"),
    _time("floor_acceleration", "floor", "acceleration", "time of its peak"),
    _time("contact_force", "stop", "force", "time of peak force"),
)
ELASTIC = "elastic motion without contacts"
ALONE = (
    *(
        _peak(
            *(f"{v.name}_alone", v.dims[-1], v.units, 1, f"{v.long_name}, {ELASTIC}"),
            field=field,
            failed=ANY,
        )
        for v, field, _ in PEAKS[:3]
    ),
    _peak(
        *("gap_needed", "stop", "length", 1, "gap that would not have closed"),
        field="reach",
        failed=ANY,
    ),
)
"""Of the motion without contacts, in which nothing yields or slips."""
BASES = (_peak("base_shear", "building", "force", 1, "peak reaction of the base of each building"),)
ENERGIES = (
    _peak("energies", "energy", "energy", 2, "energies at the end", FINITE, field="energy"),
)
OUTCOME = replace(variables.OUTCOME, dims=RUN)
SKIP_RULE = replace(
    variables.SKIP_RULE,
    dims=RUN,
    long_name="rule that spared a computation: 1 linear, below first contact and slip",
)
HISTORY = tuple(
    real(f"history_{name}", (*RUN, "time", dim), units, long_name, None)
    for name, dim, units, long_name in (
        ("displacement", "floor", "length", "displacement of each floor"),
        ("velocity", "floor", "velocity", "velocity of each floor, relative to the ground"),
        ("force", "stop", "force", "force of each contact"),
        ("slider_force", "slider", "force", "force of each slider"),
    )
)
"""The motion itself, where ``output.history`` gives a step; NaN past the end of a record."""
GROUPS = {"times": TIMES, "alone": ALONE, "base_shear": BASES, "energy": ENERGIES}
"""Peaks that a job may leave out, or wants, by the keys of its table ``output``."""

FACTS = (
    real("pga", ("record",), "acceleration", "peak ground acceleration", None),
    real("pgv", ("record",), "velocity", "peak ground velocity", None),
    real("pgd", ("record",), "length", "peak ground displacement", None),
    real("arias", ("record",), "velocity", "Arias intensity", None),
    real("duration", ("record",), "time", "significant duration, 5 to 95 %", None),
    count("samples", ("record",), "number of samples"),
    real("dt", ("record",), "time", "time between two samples", None),
)
"""What is known of each record, by the fields of its `Facts`."""
FACTOR = real("factor", RUN, "1", "by which the acceleration is multiplied", by_part=True)


def _absent(structure: Structure) -> set[str]:
    """Return the dimensions that a structure does not have, and variables of what it has not.

    The motion without contacts that is known is that in which nothing slips.
    """
    absent = set() if structure.contacts else {"stop"}
    if structure.collapse_drift is None:
        absent |= {"collapsed", "collapse_time"}
    return absent | ({"slider", "residual_drift"} if LINEAR.of(structure) else {"gap_needed"})


def peaks_of(structure: Structure, settings: SweepSettings) -> tuple[list[Peak], list[Peak]]:
    """Return the peaks of a response, and of the motion without contacts, that a file holds."""
    absent = _absent(structure)

    def held(peaks) -> list[Peak]:
        return [p for p in peaks if absent.isdisjoint((p.variable.dims[-1], p.variable.name))]

    groups = {name: held(peaks) for name, peaks in GROUPS.items() if name in settings.metrics}
    own = [peak for name in ("base_shear", "energy", "times") for peak in groups.get(name, [])]
    return held(PEAKS) + own, groups.get("alone", [])


def response_variables(
    structure: Structure, settings: SweepSettings, history: bool, spectra: bool
) -> list[Variable]:
    """Return the variables of a run, in the order of the file, with what is asked for besides."""
    own, alone = peaks_of(structure, settings)
    motion = [one for one in HISTORY if one.dims[-1] not in _absent(structure)]
    peaks = [peak.variable for peak in own + alone]
    asked = (*(motion if history else ()), *((FLOOR_SPECTRUM,) if spectra else ()))
    return [*peaks, *asked, OUTCOME, SKIP_RULE]


def place_coordinates(structure: Structure, settings: SweepSettings) -> dict[str, Coordinate]:
    """Return the dimensions storey, floor and, where there are contacts, stop."""
    made = measure_coordinates(structure, replace(settings, metrics=frozenset(MEASURES)))
    made["slider"] = named(structure.slider_names, "slider")
    if "base_shear" in settings.metrics:
        made["building"] = named(structure.building_names, "building")
    if "energy" in settings.metrics:
        made["energy"] = named(Energy._fields, "kind of energy, see hpcsweep.response")
    return {name: one for name, one in made.items() if one.values.size}


def pack(response: Response, reach: np.ndarray, peaks: list[Peak]) -> np.ndarray:
    """Return the numbers of a response in one row, peak by peak."""
    fields = [reach if p.field == "reach" else getattr(response, p.field) for p in peaks]
    return np.concatenate([np.empty(0), *(np.ravel(values).astype(float) for values in fields)])
