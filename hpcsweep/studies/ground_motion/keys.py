"""Read the table ``records`` of a job: the records, and their scales.

Facts about the records are established once, when the job is loaded (`hpcsweep.job.suites`), and
kept in it as ``records.found``: so a results file is read without the records themselves.
"""

import math
from typing import Any

import numpy as np

from hpcsweep.earthquakes.suite import MEASURES, Facts, Files, Measure, Synthetic
from hpcsweep.earthquakes.synthetic import MAX_RECORDS, SOILS
from hpcsweep.earthquakes.units import (
    NEAR,
    OWN,
    acceleration_unit,
    seconds_in,
    standard_gravity,
)
from hpcsweep.model.record import MAX_SAMPLES
from hpcsweep.solvers.response import SAME_STEP, WHOLE, steps_in
from hpcsweep.studies.study import Coordinate

KEYS = ("files", "synthetic", "unit", "gravity", "dt", "tail", "scale", "found")
MAX_FILES = 10_000
SCALED_BY = {"sa": ("period",), "avgsa": ("periods",)}
"""Keys of ``scale`` that a measure needs."""
RANGE = ("values", "from", "to", "count", "step")
SUITE = {"count": int, "seed": int, "dt": float, "duration": float, "rms": float, "soil": str}
DEFAULT_SCALE = {"by": "factor", "values": [1.0]}


def read_source(values: Any, paths: tuple[str, ...] = ()) -> Files | Synthetic:
    """Read the source of the records; `paths` are those of the files found.

    Raises
    ------
    JobError
    """
    given = values.table("records")
    if ("files" in given) == ("synthetic" in given):
        what = "either files or synthetic must be given"
        raise values.error("records", sorted(given), what)
    if "files" in given:
        unit: Any = values.get("records.unit", "g")
        try:
            if unit != OWN:
                acceleration_unit("unit", unit)
        except ValueError as error:
            limit = str(error).partition(", is ")[0].removeprefix("unit ")
            raise values.error("records.unit", unit, limit) from None
        dt = positive(values, "records.dt", given["dt"]) if "dt" in given else None
        return Files(paths, unit, read_gravity(values), dt, _units(values)[1])
    for key in ("unit", "dt"):
        if key in given:
            raise values.error(f"records.{key}", given[key], "goes with records.files")
    return _synthetic(values, given["synthetic"])


def _synthetic(values: Any, table: Any) -> Synthetic:
    if not isinstance(table, dict):
        limit = "must be a table such as {count = 20, seed = 1, rms = 1.0}"
        raise values.error("records.synthetic", table, limit)
    values.check_keys("records.synthetic", table, tuple(SUITE))
    read: dict[str, Any] = {}
    for key, kind in SUITE.items():
        name = f"records.synthetic.{key}"
        given = table.get(key, 1 if key == "count" else getattr(Synthetic, key, None))
        if kind is float:
            read[key] = positive(values, name, given)
        elif kind is str:
            if given not in SOILS:
                raise values.error(name, given, f"must be one of {', '.join(SOILS)}")
            read[key] = given
        else:
            least, most = (1, MAX_RECORDS) if key == "count" else (0, 2**63 - 1)
            read[key] = values.whole_in(name, given, least, most)
    steps = round(min(read["duration"] / read["dt"], 1e9))
    if not 100 <= steps < MAX_SAMPLES:
        limit = f"must be 100 to {MAX_SAMPLES - 1} times dt = {read['dt']:g}"
        raise values.error("records.synthetic.duration", read["duration"], limit)
    return Synthetic(**read, time=_units(values)[1])


def positive(values: Any, key: str, given: Any) -> float:
    """Read a finite number above 0."""
    number = values.number(key, given)
    if not 0 < number < math.inf:
        raise values.error(key, given, "must be finite and above 0")
    return number


def _units(values: Any) -> tuple[str, str, float]:
    """Read the structure's units of length and time, m and s where not named, and one g."""
    named = values.table("units")
    length, time = named.get("length", "m"), named.get("time", "s")
    if not isinstance(time, str) or seconds_in(time) is None:
        limit = "must be a known unit of time, as s or ms, since records are in seconds"
        raise values.error("units.time", time, limit)
    gravity = standard_gravity(length, time) if isinstance(length, str) else None
    if gravity is None:
        limit = "must be a known unit of length, as m or mm, since records have accelerations"
        raise values.error("units.length", length, limit)
    return length, time, gravity


def read_gravity(values: Any) -> float:
    """Read one g in the structure's units: by default it follows from their names."""
    length, time, standard = _units(values)
    given = values.get("records.gravity", standard)
    gravity = positive(values, "records.gravity", given)
    if "length" in values.table("units") and abs(gravity / standard - 1.0) > NEAR:
        limit = f"one g is {standard:.10g} {length}/{time}^2, by the names in units"
        raise values.error("records.gravity", given, limit)
    return gravity


def read_tail(values: Any, found: tuple[Facts, ...]) -> float:
    """Read the time of free motion after each record."""
    longest = MAX_SAMPLES * min(one.dt for one in found)
    tail = values.number("records.tail", values.get("records.tail", 0.0))
    if not 0 <= tail <= longest:
        raise values.error("records.tail", tail, f"must be from 0 to {longest:g}")
    return tail


def read_history(values: Any, found: tuple[Facts, ...]) -> float:
    """Read the step between the instants of the histories; 0 for none."""
    step = values.get("output.history", False)
    if step is False:
        return 0.0
    step = positive(values, "output.history", step)
    for one in found:
        if not steps_in(one.dt, step):
            raise values.error("output.history", step, f"{WHOLE.format(one.dt)} of {one.name}")
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
    by = table.get("by", "factor")
    if by not in MEASURES:
        raise values.error("records.scale.by", by, f"must be one of {', '.join(MEASURES)}")
    needed = SCALED_BY.get(by, ())
    known = ("by", *needed, *(("damping_ratio",) if needed else ()), *RANGE)
    values.check_keys("records.scale", table, known)
    periods: tuple[float, ...] = ()
    for key in needed:
        listed = values.numbers_in(f"records.scale.{key}", table.get(key), ascending=True)
        if listed.min() <= 0 or (key == "period" and listed.size > 1):
            what = "one number above 0" if key == "period" else "numbers above 0"
            raise values.error(f"records.scale.{key}", table[key], f"must be {what}")
        periods = tuple(listed.tolist())
    ratio = values.number("records.scale.damping_ratio", table.get("damping_ratio", 0.05))
    if not 0 <= ratio < 1:
        raise values.error("records.scale.damping_ratio", ratio, "must be from 0 to below 1")
    grid = {key: table[key] for key in RANGE if key in table}
    if "values" in grid and len(grid) > 1:
        raise values.error("records.scale.values", grid["values"], "goes without from and to")
    scale = values.numbers_in("records.scale", grid.get("values", grid), ascending=True)
    if scale[0] <= 0:
        raise values.error("records.scale", float(scale[0]), "scales must be above 0")
    return Measure(by, periods, ratio if needed else Measure.damping_ratio), scale


def read_found(values: Any) -> tuple[tuple[Facts, ...], tuple[str, ...]]:
    """Read the facts about the records, and the paths of files.

    Raises
    ------
    JobError
        If it is not as `hpcsweep.job.suites` writes it.
    """
    found = values.get("records.found")
    paths = tuple(map(str, values.get("records.files", ())))
    try:
        facts = tuple(Facts(*(one[name] for name in Facts._fields)) for one in found)
        if not facts or not all(map(_is_sound, facts)) or len(paths) not in (0, len(facts)):
            raise TypeError
    except (TypeError, KeyError, AttributeError):
        limit = "must be as written by hpcsweep; take it away, and records are looked for again"
        raise values.error("records.found", found, limit) from None
    return facts, paths


def _is_sound(facts: Facts) -> bool:
    names, samples, numbers = facts[:2], facts.samples, facts[3:]
    return (
        all(isinstance(name, str) for name in names)
        and type(samples) is int
        and all(isinstance(number, float) for number in numbers)
        and facts.dt > 0
        and facts.measure > 0
    )


def instants(found: tuple[Facts, ...], tail: float, step: float) -> Coordinate:
    """Return the dimension of the histories: the instants of the longest record and its tail."""
    longest = max((one.samples - 1) * one.dt for one in found) + tail
    values = step * np.arange(math.floor(longest / step + SAME_STEP) + 1)
    return Coordinate(values, "time", "time since the first sample")


def scale_coordinate(measure: Measure, scale: np.ndarray) -> Coordinate:
    """Return the dimension of the scales."""
    return Coordinate(scale.astype("<f8"), measure.quantity, str(measure))
