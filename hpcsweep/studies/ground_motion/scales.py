"""Read what a job says of scales, factors and columns of records, and what one g is."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from hpcsweep.earthquakes import units
from hpcsweep.earthquakes.intensity import COMPONENTS, MEASURES, OWN_PERIODS, Measure
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO
from hpcsweep.studies.ground_motion import variables

SCALES = 1e-250, 1e250
"""Smallest and largest scale."""
MAX_SCALES = 1_000_000
SCALED_BY = {"sa": ("period",), "avgsa": ("periods",), "target": ("periods",)}
"""Keys of ``scale`` that a measure needs."""
RANGE = ("values", "from", "to", "count", "step")
OF_TARGET = "target", "least"
DEFAULT_SCALE = {"by": "factor", "values": [1.0]}
RECORD, COLUMN = "record", re.compile(r"[A-Za-z]\w{0,40}")
"""Column of `records.columns` that names the records, and names of others."""


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
    allowed = ["by", *needed, *(("damping_ratio",) if needed else ()), *RANGE]
    allowed += {"target": [*OF_TARGET, "unit"], "factor": ["factors"], "pgv": []}.get(by, ["unit"])
    paired = bool(values.table("records").get("pairs"))
    values.check_keys("records.scale", table, allowed + ["components"] * paired)
    components = table.get("components", next(iter(COMPONENTS))) if paired else ""
    if paired:
        values.choice("records.scale.components", components, COMPONENTS)
        if not needed and COMPONENTS[components] is not None:
            raise values.error("records.scale.components", components, "is of spectra: by sa")
    unit, known = table.get("unit", units.OWN), (units.OWN, "g")
    is_g = values.choice("records.scale.unit", unit, known) == "g"
    g = read_gravity(values) if is_g else 1.0
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
    if not grid and (by == "target" or "factors" in table):
        grid = {"values": [1.0]}
    if "values" in grid and len(grid) > 1:
        raise values.error("records.scale.values", grid["values"], "goes without from and to")
    name = "records.scale.values" if "values" in grid else "records.scale"
    scale = values.numbers(name, grid.get("values", grid), True, MAX_SCALES)
    for end in (scale[0], scale[-1]):
        values.positive(name, float(end), *SCALES)
    least = values.within("records.scale.least", table.get("least", 0.0), 0.0, 1.0)
    ratio = ratio if needed else Measure.damping_ratio
    if by != "target":
        return Measure(by, periods, ratio, components=components, unit="g" * is_g), g * scale
    target = tuple((g * _target(values, table.get("target"), np.array(periods))).tolist())
    return Measure(by, periods, ratio, target, least, components), scale


def _target(values: Any, given: Any, periods: np.ndarray) -> np.ndarray:
    """Read Sa of a target at periods: points, linear between, or a code's four numbers.

    PGA a on the ground and periods T_B, T_C, T_D: Sa = a (1 + 1.5 T / T_B) up to T_B, 2.5 a up to
    T_C, falling with 1 / T up to T_D and with 1 / T^2 beyond. With a = 0.4 S_DS, T_0, T_S, T_L it
    is that of ASCE 7, with a = a_g S the one of Eurocode 8 at 5 % damping.
    """
    key = "records.scale.target"
    if isinstance(given, dict):
        values.check_table(key, given, ("pga", "corners"), ("pga", "corners"))
        pga = values.positive(f"{key}.pga", given["pga"])
        corners = values.numbers(f"{key}.corners", given["corners"], True, 3)
        if corners.size != 3 or corners[0] <= 0:
            raise values.error(f"{key}.corners", given["corners"], "must be three periods above 0")
        b, c, d = corners
        falling = c / np.maximum(periods, c) * d / np.maximum(periods, d)
        return pga * np.minimum(1.0 + 1.5 * periods / b, 2.5) * falling
    limit = 'must be {pga = 0.3, corners = [0.15, 0.5, 2.0]}, [[0.1, 0.7], ...] or "target.csv"'
    period, ordinate = values.pairs(key, given, given, limit).T
    if not (np.all(np.diff(period) > 0) and ordinate.min() > 0):
        raise values.error(key, given, "must have periods that ascend, and Sa above 0")
    if not period[0] <= periods[0] <= periods[-1] <= period[-1]:
        reach = f"must reach from {periods[0]:g} to {periods[-1]:g}, the periods of the scale"
        raise values.error(key, given, reach)
    return np.interp(periods, period, ordinate)


def read_factors(values: Any, names: Sequence[str]) -> tuple[float, ...]:
    """Read the factor of each record, a list in their order, or the name of a column."""
    key = "records.scale.factors"
    given = values.get("records.scale")["factors"]
    columns = dict(read_columns(values, names))
    if isinstance(given, str):
        given = columns.get(values.choice(key, given, columns))
    if not isinstance(given, list | tuple) or len(given) != len(names):
        limit = f"must be {len(names)} numbers, one of each record, or the name of their column"
        raise values.error(key, given, limit)
    return tuple(values.positive(key, number) for number in given)


def read_columns(values: Any, names: Sequence[str]) -> list[tuple[str, tuple[float, ...]]]:
    """Read what the rows of ``records.columns`` say of records, by the names of the columns."""
    key = "records.columns"
    rows = values.table("records").get("columns", [])
    if not isinstance(rows, list) or not all(isinstance(r, dict) and RECORD in r for r in rows):
        raise values.error(key, rows, f"must be a CSV file with a column {RECORD}")
    by_name = {str(row[RECORD]): row for row in rows}
    read = []
    for column in [name for name in (rows[0] if rows else ()) if name != RECORD]:
        if not COLUMN.fullmatch(column):
            raise values.error(key, column, "must be a name of letters, digits and _")
        if missing := [name for name in names if name not in by_name]:
            raise values.error(key, missing[0], "must be the record of a row, is none")
        read.append(
            (column, tuple(values.number(f"{key}.{column}", by_name[n][column]) for n in names))
        )
    return read


def read_units(values: Any) -> tuple[str, str, float]:
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
    length, time, standard = read_units(values)
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
