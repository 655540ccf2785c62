"""Write peaks as a table of demands for loss tools: Pelicun, and PBE of SimCenter.

A demand is named event-type-location-direction: ``1-PID-2-1`` is the peak interstorey drift ratio
of storey 2, ``1-RID-2-1`` what is left of it, ``1-PFA-2-1`` the peak acceleration of the floor
above, ``1-PFA-0-1`` of the ground, ``1-SA_0.5-0-1`` the spectral acceleration at 0.5 s. The first
row holds the names, behind what is to be said of the table, the second the units, each other one a
realisation, i.e. a record.
"""

import csv
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.model import arguments

ACCELERATION_UNITS = ("mps2", "cmps2", "mmps2", "inps2", "ftps2", "g")
"""Names of units in Pelicun."""
COMPUTED = ("=", "+", "-", "@", "\t", "\r")
"""With what texts begin that spreadsheets take for formulas."""


def as_cell(value: Any) -> Any:
    """Return a text behind an apostrophe where a spreadsheet would compute it; else the value."""
    return f"'{value}" if isinstance(value, str) and value.startswith(COMPUTED) else value


def write_demands(
    path: str | PathLike[str],
    drift_ratio: Any,
    floor_acceleration: Any,
    ground_acceleration: Any,
    unit: str = "mps2",
    event: int = 1,
    direction: int = 1,
    records: Sequence[str] = (),
    note: str = "",
    residual_drift: Any = None,
    spectral_acceleration: Mapping[float, Any] | None = None,
) -> None:
    """Write the demands of one building to a CSV file, a row a record.

    Parameters
    ----------
    path : path
        Path of the file, which is overwritten.
    drift_ratio : array_like, shape (records, storeys)
        Largest interstorey drift of each storey over its height, from the lowest up.
    floor_acceleration : array_like, shape (records, storeys)
        Largest absolute acceleration of the floor above each storey.
    ground_acceleration : array_like, shape (records,)
        Largest acceleration of the ground under the scaled record, of the slab on bearings.
    unit : str
        Unit of the accelerations: ``mps2``, ``cmps2``, ``mmps2``, ``inps2``, ``ftps2``, ``g``.
    event, direction : int
        Numbers in the names, from 1; the other horizontal direction is 2.
    records : sequence of str
        Names of the records, for the first column; they are numbered from 0 without them.
    note : str
        What the table is to tell of itself: its first cell, the name of the first column.
    residual_drift : array_like, shape (records, storeys), optional
        What is left of the drift of each storey over its height, at least 0.
    spectral_acceleration : mapping of float to array_like, shape (records,), optional
        Of the ground under the scaled record, by the period in seconds.

    Raises
    ------
    ValueError
        If shapes differ, or a value is not finite or below 0; nothing is written then.

    Examples
    --------
    One record, two storeys:

    >>> hpcsweep.write_demands("demands.csv", [[0.01, 0.02]], [[3.0, 4.0]], [2.0])
    >>> print(Path("demands.csv").read_text())
    ,1-PFA-0-1,1-PFA-1-1,1-PFA-2-1,1-PID-1-1,1-PID-2-1
    Units,mps2,mps2,mps2,rad,rad
    0,2.0,3.0,4.0,0.01,0.02
    <BLANKLINE>
    """
    file = Path(arguments.file_name("path", path))
    drift = arguments.rows("drift_ratio", drift_ratio)
    rowwise = arguments.words("records", records) or tuple(map(str, range(len(drift))))
    if len(rowwise) != len(drift):
        raise ValueError(f"records must have {len(drift)} names, has {len(rowwise)}")
    event = arguments.count("event", event, 1)
    direction = arguments.count("direction", direction, 1)
    arguments.choice("unit", unit, ACCELERATION_UNITS)
    arguments.instance("note", note, str)
    peaks = {
        "ground_acceleration": ("PFA", 0, np.ravel(ground_acceleration), unit),
        "floor_acceleration": ("PFA", 1, floor_acceleration, unit),
        "drift_ratio": ("PID", 1, drift, "rad"),
    }
    if residual_drift is not None:
        peaks["residual_drift"] = ("RID", 1, residual_drift, "rad")
    for period, values in (spectral_acceleration or {}).items():
        name = f"SA_{arguments.positive('spectral_acceleration', period):.4g}"
        peaks[f"spectral_acceleration, {name},"] = (name, 0, np.ravel(values), unit)
    demands = {}
    for name, (kind, first, values, its_unit) in peaks.items():
        values, shape = arguments.array(name, values), drift.shape if first else drift.shape[:1]
        if values.shape != shape:
            raise ValueError(f"{name} must have shape {shape}, has {values.shape}")
        for location, column in enumerate(np.atleast_2d(values.T), first):
            demands[f"{event}-{kind}-{location}-{direction}"] = its_unit, column
    for name, (_, column) in demands.items():
        wrong = column[~((column >= 0) & (column < np.inf))]
        if wrong.size:
            raise arguments.refused(name, "finite and at least 0", float(wrong[0]))
    units, columns = zip(*demands.values(), strict=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow([as_cell(note), *demands])
        table.writerow(["Units", *units])
        for name, realisation in zip(rowwise, np.transpose(columns).tolist(), strict=True):
            table.writerow([as_cell(name), *map(repr, realisation)])
