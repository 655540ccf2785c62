"""Variables of a study of records, and how each scales with a motion."""

from dataclasses import replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.floor_spectra import SHORTEST
from hpcsweep.earthquakes.intensity import Facts
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, LONGEST
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import FORCES, LINEAR
from hpcsweep.solvers.record_response import Energy
from hpcsweep.studies import variables
from hpcsweep.studies.quantities import MEASURES, QUANTITIES, STATES
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import ANY, EITHER, FINITE, Coordinate, Variable, count, real
from hpcsweep.studies.variables import measure_coordinates, named

RUN = ("record", "scale")
"""Dimensions of a run."""
MAX_PERIODS = 1000
FLOOR_SPECTRUM = real(
    *("floor_spectrum", ("place", "period"), "acceleration"),
    "pseudo-acceleration of oscillators on floors, see hpcsweep.floor_spectra",
)


class FloorSpectra(NamedTuple):
    """Floor spectra that are stored of every run; none without periods."""

    periods: tuple[float, ...] = ()
    damping_ratio: float = DAMPING_RATIO
    places: tuple[str, ...] = ()

    @property
    def dimensions(self) -> dict[str, Coordinate]:
        """Dimensions of the variable; empty if it is not stored."""
        if not self.periods:
            return {}
        what = f"natural period of oscillators of {100 * self.damping_ratio:g} % damping"
        return {
            "place": named(self.places, "floor whose response spectrum is stored"),
            "period": Coordinate(np.array(self.periods), "time", what),
        }


def read_floor_spectra(values: Any, suite: tuple[Facts, ...], structure: Structure) -> FloorSpectra:
    """Read the floor spectra that are stored of every run.

    Raises
    ------
    JobError
    """
    key = "output.floor_spectra"
    table = values.get(key, False)
    if table is False:
        return FloorSpectra()
    if not FORCES.of(structure):
        raise values.error(key, table, f"must be false {FORCES.lacks}")
    if not isinstance(table, dict):
        limit = 'must be a table such as {periods = [0.1, 0.2, 0.5, 1.0], places = ["A3"]}'
        raise values.error(key, table, limit)
    values.check_keys(key, table, FloorSpectra._fields)
    periods = values.numbers(f"{key}.periods", table.get("periods"), True, MAX_PERIODS)
    for facts in suite:
        for period in periods[[0, -1]].tolist():
            values.positive(f"{key}.periods", period, SHORTEST * facts.dt, LONGEST * facts.dt)
    names = tuple(map(str, structure.floor_names))
    places = table.get("places", [*names])
    if not isinstance(places, list) or not places or len({*places}) < len(places):
        raise values.error(f"{key}.places", places, "must be names of floors, each once")
    for place in places:
        values.choice(f"{key}.places", place, names)
    damping = table.get("damping_ratio", DAMPING_RATIO)
    ratio = read_damping_ratio(values, f"{key}.damping_ratio", damping)
    return FloorSpectra(tuple(periods.tolist()), ratio, tuple(places))


def read_damping_ratio(values: Any, key: str, value: Any) -> float:
    """Take a damping ratio."""
    ratio = values.number(key, value)
    if not 0 <= ratio < 1:
        raise values.error(key, ratio, "must be from 0 to below 1")
    return ratio


class Collapse(IntEnum):
    """What has become of the structure."""

    STANDS = 0
    COLLAPSED = 1


BESIDE = {"alone": "motion without contacts", "elastic": "elastic motion"}
"""The motion beside which that of a structure is set, by the ending of its variables: of the
structure without its contacts, or of one that has none without yielding."""


def _time(name: str, source: str, meaning: str) -> Variable:
    return real(f"{name}_time", QUANTITIES[name].dims, "time", meaning, source=f"{source}_time")


def _beside(variable: Variable, kind: str = "alone") -> Variable:
    """Return a quantity of the motion beside, one of `BESIDE`."""
    long_name, name = f"{variable.long_name}, {BESIDE[kind]}", f"{variable.name}_{kind}"
    beside = replace(variable, name=name, source=variable.name, long_name=long_name)
    return replace(beside, failed=ANY, tallied=False)


SPECTRUM_ALONE = _beside(FLOOR_SPECTRUM)
BASES = (QUANTITIES["base_shear"],)
COLLAPSE_TIME = real("collapse_time", (), "time", "when it has collapsed, NaN: not", optional=True)
PEAKS = (
    *(
        variable
        for name, variable in QUANTITIES.items()
        if name not in ("contact_share", "base_shear", "residual_drift")
    ),
    replace(
        count("collapsed", (), "1 if the motion has collapsed and ended", limits=EITHER),
        flags=Collapse,
    ),
    COLLAPSE_TIME,
    QUANTITIES["residual_drift"],
    real("residual", ("floor",), "length", "displacement left at the end"),
    real("final_state", ("state",), STATES, "state at the end of the tail", FINITE),
)
TIMES = (
    _time("storey_drift", "drift", "time of peak drift"),
    _time("displacement", "displacement", "time of peak displacement"),
    _time("floor_acceleration", "acceleration", "time of its peak"),
    _time("contact_force", "force", "time of peak force"),
)
LINEAR_PEAKS = "storey_drift", "displacement", "floor_acceleration"
ALONE = (
    *(_beside(QUANTITIES[name]) for name in (*LINEAR_PEAKS, "ductility", "residual_drift")),
    *(_beside(QUANTITIES[name], "elastic") for name in LINEAR_PEAKS),
    _beside(COLLAPSE_TIME),
    real(
        *("gap_needed", ("stop",), "length", "gap that would not have closed"),
        failed=ANY,
        source="reach",
    ),
)
"""Of the motion without contacts, or of the elastic one."""
ENERGY = real(*("energies", ("energy",), "energy", "energies at the end", FINITE), source="energy")
SKIP_RULE = replace(
    variables.SKIP_RULE,
    long_name="rule that spared a computation: 1 linear, below first contact and slip",
)
HISTORY = tuple(
    real(f"history_{name}", ("time", dim), units, long_name, None)
    for name, dim, units, long_name in (
        ("displacement", "floor", "length", "displacement of each floor"),
        ("velocity", "floor", "velocity", "velocity of each floor, relative to the ground"),
        ("force", "stop", "force", "force of each contact"),
        ("slider_force", "slider", "force", "force of each slider"),
    )
)
"""The motion itself, where ``output.history`` gives a step; NaN past the end of a record."""
GROUPS = {"times": TIMES, "alone": ALONE, "base_shear": BASES, "energy": (ENERGY,)}
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
    """Return dimensions, variables, and endings of variables, that a structure does not have."""
    absent = {"elastic"} if structure.contacts else {"stop", "alone"}
    if structure.collapse_drift is None:
        absent |= {"collapsed", "collapse_time"}
    rigid = structure.is_rigid.any()
    absent |= {"contact_force", "contact_force_time"} if rigid else {"simultaneous"}
    if all(slider.backbone is None for slider in structure.sliders):
        absent.add("strength_lost")
    linear = {"slider", "residual_drift", "elastic"}
    return absent | linear if LINEAR.of(structure) else absent


def peaks_of(
    structure: Structure, settings: SweepSettings
) -> tuple[list[Variable], list[Variable]]:
    """Return the peaks of a response, and of the motion beside it, that a file holds."""
    absent = _absent(structure)

    def held(peaks) -> list[Variable]:
        return [
            peak
            for peak in peaks
            if absent.isdisjoint((*peak.dims, peak.name, peak.source, peak.name.split("_")[-1]))
        ]

    groups = {name: held(peaks) for name, peaks in GROUPS.items() if name in settings.metrics}
    more = [peak for name in ("base_shear", "energy", "times") for peak in groups.get(name, [])]
    return held(PEAKS) + more, groups.get("alone", [])


def response_variables(
    structure: Structure, settings: SweepSettings, history: bool, spectra: bool
) -> list[Variable]:
    """Return the variables of a run, in the order of the file, with what is asked for besides."""
    peaks, alone = peaks_of(structure, settings)
    motion = [variable for variable in HISTORY if variable.dims[-1] not in _absent(structure)]
    asked = motion * history + [FLOOR_SPECTRUM] * spectra
    asked += [SPECTRUM_ALONE] * (spectra and bool(alone) and bool(structure.contacts))
    return [*peaks, *alone, *asked, variables.OUTCOME, SKIP_RULE]


def place_coordinates(structure: Structure, settings: SweepSettings) -> dict[str, Coordinate]:
    """Return the dimensions storey, floor and, where there are contacts, stop."""
    places = measure_coordinates(structure, replace(settings, metrics=frozenset(MEASURES)))
    places["slider"] = named(structure.slider_names, "slider")
    if "base_shear" in settings.metrics:
        places["building"] = named(structure.building_names, "building")
    if "energy" in settings.metrics:
        places["energy"] = named(Energy._fields, "kind of energy, see hpcsweep.response")
    return {name: each for name, each in places.items() if each.values.size}
