"""Records and their scales, and how they are read from the table ``records`` of a job.

Facts about the records are established once, when the job is loaded (`hpcsweep.job.suites`), and
kept in it as ``records.found``: so a results file is read without the records themselves.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hpcsweep.earthquakes import units
from hpcsweep.earthquakes.intensity import (
    ISOLATED_PERIOD,
    MEASURES,
    OWN_PERIODS,
    Facts,
    Files,
    Measure,
    Synthetic,
    checked_record,
    nearest,
)
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO
from hpcsweep.earthquakes.synthetic import MAX_RECORDS, SOILS
from hpcsweep.model.isolation import isolated_period
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.history import SAME_STEP, WHOLE, steps_in
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.ground_motion import variables
from hpcsweep.studies.ground_motion.responses import RecordResponses
from hpcsweep.studies.keys import BLOCK, Key
from hpcsweep.studies.part import Part
from hpcsweep.studies.quantities import QUANTITIES
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import Coordinate

KEYS = (
    Key(
        "files",
        'files, folders or patterns, relative to the job file, such as `["*.AT2"]` '
        "([formats](earthquakes.md#a-record)); the stored job has the whole paths",
    ),
    Key(
        "synthetic",
        "in their place a suite to be made: `count`, `seed`, `dt`, `duration`, `rms`, `soil` "
        "([what it is](earthquakes.md#a-record))",
        told="1, 0, 0.01, 30, 1, firm",
    ),
    Key(
        "unit",
        "unit of the numbers in the files: `g`, `%g`, `mg`, `m/s2`, `cm/s2`, `mm/s2`, `in/s2`, "
        "`ft/s2`, `structure`",
        "g",
    ),
    Key(
        "gravity",
        "one g in the units of the structure, which must fit `units`",
        told="by `units`, or 9.80665",
    ),
    Key("dt", "time in seconds between samples, for files that do not say it"),
    Key("channel", "which channel of acceleration of files with several, from 1 on"),
    Key("tail", "time of free motion after each record", 0.0),
    Key(
        "scale",
        'table: `by` an intensity measure, `"factor"`, `"pga"`, `"pgv"`, `"sa"` with `period`, '
        'a number, `"T1"`, the longest of each structure, or `"isolated"`, that while bearings '
        'slide, or `"avgsa"` with `periods`, both with `damping_ratio`; and the intensities, above '
        "0, a range or `values`",
        told='`{by = "factor", values = [1.0]}`, 0.05',
    ),
    Key(
        "found",
        "names, checksums and measures of the records, which hpcsweep adds when it loads the job",
    ),
)
OUTPUT = (
    Key("times", "times of the peaks", True),
    Key(
        "alone",
        "peaks without contacts, and the gaps that would not have closed: of what yields a second "
        "run for each ([price](yielding.md#results)); peaks of the elastic motion of what has none",
        True,
    ),
    Key(
        "base_shear",
        QUANTITIES["base_shear"].long_name,
        told="true where the structure yields",
    ),
    Key("energy", f"{variables.ENERGY.long_name} ([which](yielding.md#results))", False),
    Key(
        "history",
        "step in time at which the motion itself is stored, of every run: a whole multiple or a "
        "whole part of the time between samples ([size and price](earthquakes.md#a-study))",
        told="none",
    ),
    Key(
        "floor_spectra",
        "table: `periods`, `damping_ratio` and `places`, names of floors, of response spectra of "
        "floors that are stored of every run ([price](earthquakes.md#floor-response-spectra))",
        told="none, 0.05, all",
    ),
    BLOCK,
)
MAX_FILES = 10_000
MAX_SCALES = 1_000_000
SCALES = 1e-250, 1e250
"""Smallest and largest scale."""
MAX_MEASURES = 500_000
"""Measures of records by the longest periods of structures."""
MAX_INSTANTS = 10 * MAX_SAMPLES
"""Of the histories."""
SCALED_BY = {"sa": ("period",), "avgsa": ("periods",)}
"""Keys of ``scale`` that a measure needs."""
RANGE = ("values", "from", "to", "count", "step")
SUITE = {"count": int, "seed": int, "dt": float, "duration": float, "rms": float, "soil": str}
DEFAULT_SCALE = {"by": "factor", "values": [1.0]}


@dataclass(frozen=True, eq=False)
class RecordGrid(Part):
    """Records at scales: the fields of a study, and its runs.

    Attributes
    ----------
    structure : Structure
    initial_state : ndarray, shape (2n,)
        Not used: runs start from the static equilibrium of the structure, `Structure.rest`.
    settings : SweepSettings
    block_size : int
        Scales that are committed together.
    suite : tuple of Facts
        Facts about each record.
    source : Files or Synthetic
        Source of their samples.
    measure : Measure
        Measure of the scales.
    scale : ndarray, shape (n_scales,)
        Ascending.
    tail : float
        Time of free motion after each record.
    storey_height : tuple of float
        Height of each storey; empty if unknown.
    gravity : float
        One g in the structure's units.
    history : float
        Step between the instants at which the motion is stored; 0: it is not.
    floors : FloorSpectra
        Spectra of floors that are stored.
    numbers : tuple of int
        Of the records in their source; empty: all.
    """

    structure: Structure
    initial_state: np.ndarray
    settings: SweepSettings
    block_size: int
    suite: tuple[Facts, ...]
    source: Files | Synthetic
    measure: Measure
    scale: np.ndarray
    tail: float
    storey_height: tuple[float, ...]
    gravity: float
    history: float
    floors: variables.FloorSpectra
    numbers: tuple[int, ...] = ()

    @cached_property
    def factor(self) -> np.ndarray:
        """Factor of each record at each scale, shape (n_records, n_scales)."""
        return self.scale / self.measures[:, None]

    @property
    def measures(self) -> np.ndarray:
        """Measure of each record as it is, shape (n_records,)."""
        return np.array([facts.measure for facts in self.suite])

    @cached_property
    def responses(self) -> RecordResponses:
        """Responses that compute the runs."""
        shapes = {each: tuple(self.dimensions[dim] for dim in each.dims) for each in self.of_run}
        run = self.structure, self.settings, self.tail
        return RecordResponses(*run, self.history, self.floors, shapes)

    def record(self, i: int) -> Record:
        """Return the samples of record i; errors are those of `checked_record`."""
        return checked_record(self.source, self.suite[i], self.numbers[i] if self.numbers else i)

    def describe(self, run: Place) -> dict[str, Any]:
        """Describe a run: ``record``, ``scale``."""
        record, at = run
        return {"record": self.suite[record].name, "scale": float(self.scale[at])}

    @cached_property
    def instants(self) -> dict[str, Coordinate]:
        """Instants of the longest record and its tail; empty if no histories are stored."""
        if not self.history:
            return {}
        longest = _longest(self.suite) + self.tail
        values = self.history * np.arange(math.floor(longest / self.history + SAME_STEP) + 1)
        return {"time": Coordinate(values, "time", "time since the first sample")}


def read_source(values: Any, paths: tuple[str, ...] = ()) -> Files | Synthetic:
    """Read the source of the records; `paths` are those of the files found.

    Raises
    ------
    JobError
    """
    table = values.table("records")
    if "files" in table and "synthetic" in table:
        limit = "does not go with records.synthetic: one of the two must go"
        raise values.error("records.files", table["files"], limit)
    if "files" in table:
        unit: Any = values.get("records.unit", "g")
        try:
            if unit != units.OWN:
                units.acceleration_unit("unit", unit)
        except ValueError:
            limit = f"must be one of {', '.join(units.UNITS)}"
            raise values.error("records.unit", unit, limit) from None
        dt = values.positive("records.dt", table["dt"]) if "dt" in table else None
        channel = table.get("channel")
        if channel is not None:
            values.whole("records.channel", channel, 1, MAX_FILES)
        return Files(paths, unit, read_gravity(values), dt, _units(values)[1], channel)
    if "synthetic" not in table:
        raise values.error("records", sorted(table), "must have files, or synthetic")
    for key in ("unit", "dt", "channel"):
        if key in table:
            raise values.error(f"records.{key}", table[key], "goes with records.files")
    return _synthetic(values, table["synthetic"])


def _synthetic(values: Any, table: Any) -> Synthetic:
    values.check_table("records.synthetic", table, tuple(SUITE), ())
    read: dict[str, Any] = {}
    for key, kind in SUITE.items():
        name = f"records.synthetic.{key}"
        value = table.get(key, 1 if key == "count" else getattr(Synthetic, key, None))
        if kind is float:
            read[key] = values.positive(name, value)
        elif kind is str:
            read[key] = values.choice(name, value, SOILS)
        else:
            least, most = (1, MAX_RECORDS) if key == "count" else (0, 2**63 - 1)
            read[key] = values.whole(name, value, least, most)
    steps = round(min(read["duration"] / read["dt"], 1e9))
    if not 100 <= steps < MAX_SAMPLES:
        limit = f"must be 100 to {MAX_SAMPLES - 1} times dt = {read['dt']:g}"
        raise values.error("records.synthetic.duration", read["duration"], limit)
    return Synthetic(**read, time=_units(values)[1])


def _units(values: Any) -> tuple[str, str, float]:
    """Read the structure's units of length and time, m and s where not named, and one g."""
    named = values.table("units")
    length, time = named.get("length", "m"), named.get("time", "s")
    if not isinstance(time, str) or units.seconds_in(time) is None:
        limit = "must be a known unit of time, as s or ms, since records are in seconds"
        raise values.error("units.time", time, limit)
    gravity = units.standard_gravity(length, time) if isinstance(length, str) else None
    if gravity is None:
        limit = "must be a known unit of length, as m or mm, since records have accelerations"
        raise values.error("units.length", length, limit)
    return length, time, gravity


def read_gravity(values: Any) -> float:
    """Read one g in the structure's units: by default it follows from their names."""
    length, time, standard = _units(values)
    value = values.get("records.gravity", standard)
    gravity = values.positive("records.gravity", value)
    if "length" in values.table("units") and abs(gravity / standard - 1.0) > units.NEAR:
        limit = f"one g is {standard:.10g} {length}/{time}^2, by the names in units"
        raise values.error("records.gravity", value, limit)
    return gravity


def known_gravity(values: Any, key: str, value: Any) -> float:
    """Read one g for weights, which nothing but its units or itself makes known."""
    if "length" not in values.table("units") and "gravity" not in values.table("records"):
        raise values.error(key, value, "needs one g: give [units] or records.gravity")
    return read_gravity(values)


def read_tail(values: Any, suite: tuple[Facts, ...]) -> float:
    """Read the time of free motion after each record."""
    longest = MAX_SAMPLES * min(facts.dt for facts in suite)
    return values.within("records.tail", values.get("records.tail", 0.0), 0.0, longest)


def read_history(values: Any, suite: tuple[Facts, ...], tail: float) -> float:
    """Read the step between the instants of the histories; 0 for none."""
    step = values.get("output.history", False)
    if step is False:
        return 0.0
    longest = _longest(suite) + tail
    step = values.positive("output.history", step, longest / MAX_INSTANTS, longest)
    for facts in suite:
        if not steps_in(facts.dt, step):
            raise values.error("output.history", step, f"{WHOLE.format(facts.dt)} of {facts.name}")
    return step


def read_scale(values: Any) -> tuple[Measure, np.ndarray]:
    """Read the measure by which records are scaled, and its values, ascending.

    Raises
    ------
    JobError
    """
    table = values.get("records.scale", DEFAULT_SCALE)
    if not isinstance(table, dict):
        limit = 'must be a table such as {by = "pga", from = 0.5, to = 5.0, count = 10}'
        raise values.error("records.scale", table, limit)
    by = values.choice("records.scale.by", table.get("by", "factor"), MEASURES)
    needed = SCALED_BY.get(by, ())
    allowed = ("by", *needed, *(("damping_ratio",) if needed else ()), *RANGE)
    values.check_keys("records.scale", table, allowed)
    periods: tuple[float | str, ...] = ()
    for key in needed:
        if key == "period" and table.get(key) in OWN_PERIODS:
            periods = (table[key],)
            continue
        most = 1 if key == "period" else variables.MAX_PERIODS
        listed = values.numbers(f"records.scale.{key}", table.get(key), True, most)
        if listed.min() <= 0:
            raise values.error(f"records.scale.{key}", table[key], "must be above 0")
        periods = tuple(listed.tolist())
    damping = table.get("damping_ratio", DAMPING_RATIO)
    ratio = variables.read_damping_ratio(values, "records.scale.damping_ratio", damping)
    grid = {key: table[key] for key in RANGE if key in table}
    if "values" in grid and len(grid) > 1:
        raise values.error("records.scale.values", grid["values"], "goes without from and to")
    name = "records.scale.values" if "values" in grid else "records.scale"
    scale = values.numbers(name, grid.get("values", grid), True, MAX_SCALES)
    for end in (scale[0], scale[-1]):
        values.positive(name, float(end), *SCALES)
    return Measure(by, periods, ratio if needed else Measure.damping_ratio), scale


def own_period(structure: Structure, measure: Measure) -> float:
    """Return the period by which a structure is scaled if not by a number; inf: it has none."""
    if measure.own_period == ISOLATED_PERIOD:
        return isolated_period(structure) or math.inf
    return structure.longest_period


def read_found(
    values: Any, structure: Structure | None = None
) -> tuple[tuple[Facts, ...], tuple[str, ...]]:
    """Read the facts about the records, measured for a structure if any, and the paths of files.

    Raises
    ------
    JobError
        If it is not as `hpcsweep.job.suites` writes it.
    """
    stored = values.get("records.found")
    paths = tuple(map(str, values.table("records").get("files", ())))
    try:
        records = stored["records"] if isinstance(stored, dict) else stored
        if isinstance(stored, dict):
            periods = stored["periods"]
            sought = own_period(structure, read_scale(values)[0]) if structure else periods[0]
            at = nearest(periods, sought)
            records = [{**record, "measure": record["measure"][at]} for record in records]
        facts = tuple(Facts(**record) for record in records)
        if not all(each.is_sound for each in facts):
            raise TypeError
        is_scaled = all(isinstance(each.measure, float) and each.measure > 0 for each in facts)
        if not facts or not is_scaled or len(paths) not in (0, len(facts)):
            raise TypeError
    except (TypeError, KeyError, ValueError, AttributeError, IndexError):
        limit = "must be as hpcsweep wrote it; delete records.found to look for the records again"
        raise values.error("records.found", stored, limit) from None
    return facts, paths


def _longest(suite: tuple[Facts, ...]) -> float:
    """Return the duration of the longest record."""
    return max((facts.samples - 1) * facts.dt for facts in suite)
