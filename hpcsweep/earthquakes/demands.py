"""Write peaks as a table of demands for loss tools: Pelicun, and PBE of SimCenter.

A demand is named event-type-location-direction: ``1-PID-2-1`` is the peak interstorey drift ratio
of storey 2, ``1-PFA-2-1`` the peak acceleration of the floor above it, ``1-PFA-0-1`` of the ground.
The first row holds the names, behind what is to be said of the table, the second the units, each
other one a realisation, i.e. a record.
"""

import csv
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.model.arguments import choice, count, file_name, instance, refused, rows, words

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
    file = Path(file_name("path", path))
    drift = rows("drift_ratio", drift_ratio)
    floors = rows("floor_acceleration", floor_acceleration)
    ground = rows("ground_acceleration", np.reshape(ground_acceleration, (-1, 1)))
    if floors.shape != drift.shape:
        raise ValueError(f"floor_acceleration must have shape {drift.shape}, has {floors.shape}")
    if len(ground) != len(drift):
        raise ValueError(f"ground_acceleration must have shape ({len(drift)},), has {len(ground)}")
    rowwise = words("records", records) or tuple(map(str, range(len(drift))))
    if len(rowwise) != len(drift):
        raise ValueError(f"records must have {len(drift)} names, has {len(rowwise)}")
    event, direction = count("event", event, 1), count("direction", direction, 1)
    choice("unit", unit, ACCELERATION_UNITS)
    instance("note", note, str)
    peaks = ("PFA", 0, np.hstack([ground, floors]), unit), ("PID", 1, drift, "rad")
    demands = {
        f"{event}-{kind}-{location}-{direction}": (its_unit, column)
        for kind, first, values, its_unit in peaks
        for location, column in enumerate(values.T, first)
    }
    for name, (_, column) in demands.items():
        wrong = column[~((column >= 0) & (column < np.inf))]
        if wrong.size:
            raise refused(name, "finite and at least 0", float(wrong[0]))
    units, columns = zip(*demands.values(), strict=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow([as_cell(note), *demands])
        table.writerow(["Units", *units])
        for name, realisation in zip(rowwise, np.transpose(columns).tolist(), strict=True):
            table.writerow([as_cell(name), *map(repr, realisation)])
