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
from hpcsweep.earthquakes.intensity import ISOLATED_PERIOD, Facts, Measure, nearest, rounded
from hpcsweep.earthquakes.sources import Chosen, Files, Synthetic, checked_record
from hpcsweep.earthquakes.synthetic import MAX_RECORDS, SOILS
from hpcsweep.model.isolation import isolated_period
from hpcsweep.model.plausibility import implausible
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.history import SAME_STEP, WHOLE, steps_in
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.ground_motion import scales, variables
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
        "`ft/s2`, `structure`, or `file`, the one that each file names",
        "g",
    ),
    Key(
        "gravity",
        "one g in the units of the structure, which must fit `units`",
        told="by `units`, or 9.80665",
    ),
    Key("dt", "time in seconds between samples, for files that do not say it"),
    Key("channel", "which channel of acceleration of files with several, from 1 on"),
    Key(
        "arias",
        "two shares of the Arias intensity, such as `[0.0005, 0.9995]`, between which records are "
        "kept",
        told="whole",
    ),
    Key(
        "sequence",
        'in place of single records: `[["a", 30.0, "b"]]`, names and the rest between two, with '
        "the state kept ([suites](earthquakes.md#suites-of-codes))",
        told="none",
    ),
    Key("pairs", 'components that have one factor: `[["a-EW", "a-NS"]]`', told="none"),
    Key(
        "columns",
        "CSV file with a column `record` and columns of numbers, such as `magnitude`, that the "
        "file of results holds",
        told="none",
    ),
    Key("tail", 'time of free motion after each record, or `"until rest"`', 0.0),
    Key(
        "scale",
        'table: `by` an intensity measure, `"factor"`, `"pga"`, `"pgv"`, `"sa"` with `period`, '
        'a number, `"T1"`, the longest of each structure, or `"isolated"`, that while bearings '
        'slide, or `"avgsa"` with `periods`, both with `damping_ratio`, or `"target"` '
        "([how](earthquakes.md#suites-of-codes)); and the intensities, above 0, a range or "
        '`values`, with `unit = "g"` in g',
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
    Key("base_shear", QUANTITIES["base_shear"].long_name, told="true where the structure yields"),
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
MAX_MEASURES = 500_000
"""Measures of records by the longest periods of structures."""
MAX_INSTANTS = 10 * MAX_SAMPLES
"""Of the histories."""
REST = "until rest"
LEFT = 1e-3
"""Part of a free motion, or less, that is left when it is said to rest."""
SUITE = {"count": int, "seed": int, "dt": float, "duration": float, "rms": float, "soil": str}


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
    columns : tuple of (str, tuple of float)
        What `records.columns` says of each record.
    """

    structure: Structure
    initial_state: np.ndarray
    settings: SweepSettings
    block_size: int
    suite: tuple[Facts, ...]
    source: Files | Synthetic | Chosen
    measure: Measure
    scale: np.ndarray
    tail: float
    storey_height: tuple[float, ...]
    gravity: float
    history: float
    floors: variables.FloorSpectra
    numbers: tuple[int, ...] = ()
    columns: tuple[tuple[str, tuple[float, ...]], ...] = ()

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
        return {
            "record": self.suite[record].name,
            "scale": float(self.intensities(self.scale)[0][at]),
        }

    def intensities(self, scales: Any, units: str | None = None) -> tuple[Any, str]:
        """Return scales and their unit, in g where that is asked for, or given so in the job."""
        quantity = self.measure.quantity
        if "g" in (units, self.measure.unit) and quantity == "acceleration":
            return scales / self.gravity, "g"
        return scales, unit_of(self.structure, quantity)

    @cached_property
    def instants(self) -> dict[str, Coordinate]:
        """Instants of the longest record and its tail; empty if no histories are stored."""
        if not self.history:
            return {}
        longest = _longest(self.suite) + self.tail
        values = self.history * np.arange(math.floor(longest / self.history + SAME_STEP) + 1)
        return {"time": Coordinate(values, "time", "time since the first sample")}


def read_source(values: Any, paths: tuple[str, ...] = ()) -> Files | Synthetic | Chosen:
    """Read the source of the records; `paths` are those of the files found.

    Raises
    ------
    JobError
    """
    source, table = _read_source(values, paths), values.table("records")
    if not {"arias", "sequence"} & {*table}:
        return source
    arias: tuple[float, ...] = ()
    if "arias" in table:
        given, limit = table["arias"], "must be two shares from 0 to 1, as [0.0005, 0.9995]"
        arias = tuple(values.spans("records.arias", given, [given], limit)[0].tolist())
        if not 0.0 <= arias[0] < arias[1] <= 1.0:
            raise values.error("records.arias", given, limit)
    listed = table.get("sequence", [])
    for each in listed if isinstance(listed, list) else [listed]:
        is_list = isinstance(each, list) and len(each) % 2 and len(each) > 1
        if not is_list or not all(isinstance(name, str) for name in each[::2]):
            limit = 'must be names with times between them, [["a", 30.0, "b"]]'
            raise values.error("records.sequence", listed, limit)
        for rest in each[1::2]:
            values.within("records.sequence", rest, 0.0, MAX_SAMPLES)
    return Chosen(source, arias, tuple(map(tuple, listed)))


def _read_source(values: Any, paths: tuple[str, ...]) -> Files | Synthetic:
    table = values.table("records")
    if "files" in table and "synthetic" in table:
        limit = "does not go with records.synthetic: one of the two must go"
        raise values.error("records.files", table["files"], limit)
    if "files" in table:
        unit: Any = values.get("records.unit", "g")
        try:
            if unit not in units.NO_UNITS:
                units.acceleration_unit("unit", unit)
        except ValueError:
            limit = f"must be one of {', '.join(units.UNITS)}"
            raise values.error("records.unit", unit, limit) from None
        dt = values.positive("records.dt", table["dt"]) if "dt" in table else None
        channel = table.get("channel")
        if channel is not None:
            values.whole("records.channel", channel, 1, MAX_FILES)
        return Files(
            paths, unit, scales.read_gravity(values), dt, scales.read_units(values)[1], channel
        )
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
    return Synthetic(**read, time=scales.read_units(values)[1])


def read_tail(values: Any, suite: tuple[Facts, ...], structure: Structure) -> float:
    """Read the time of free motion after each record.

    Until rest: until the free motion without contacts has decayed to `LEFT` in its slowest mode.
    """
    longest = MAX_SAMPLES * min(facts.dt for facts in suite)
    tail = values.get("records.tail", 0.0)
    if tail != REST:
        return values.within("records.tail", tail, 0.0, longest)
    if values.get("output.history", False) is not False:
        raise values.error("records.tail", tail, "does not go with output.history: give a time")
    from hpcsweep.solvers.linear import slowest_decay  # scipy, which other jobs need not

    rate = -slowest_decay(structure)
    if not -math.log(LEFT) <= rate * longest:
        decays = f"decays by exp(-{rate:.3g} t): must decay to {LEFT:g} in {longest:g}"
        second = units.seconds_in(structure.unit_names.time or "s")
        mistaken = "".join(f"; {told}" for told in implausible(structure, second))
        raise values.error("records.tail", tail, f"{decays}, or tail be a time{mistaken}")
    return rounded(-math.log(LEFT) / rate)


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
            sought = (
                own_period(structure, scales.read_scale(values)[0]) if structure else periods[0]
            )
            at = nearest(periods, sought)
            records = [{**record, "measure": record["measure"][at]} for record in records]
        facts = tuple(Facts(**record) for record in records)
        if not all(each.is_sound for each in facts):
            raise TypeError
        is_scaled = all(isinstance(each.measure, float) and each.measure > 0 for each in facts)
        in_order = "sequence" in values.table("records") or len(paths) in (0, len(facts))
        if not facts or not is_scaled or not in_order:
            raise TypeError
    except (TypeError, KeyError, ValueError, AttributeError, IndexError):
        limit = "must be as hpcsweep wrote it; delete records.found to look for the records again"
        raise values.error("records.found", stored, limit) from None
    return facts, paths


def _longest(suite: tuple[Facts, ...]) -> float:
    """Return the duration of the longest record."""
    return max((facts.samples - 1) * facts.dt for facts in suite)
