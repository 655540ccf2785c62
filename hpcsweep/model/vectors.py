"""Read vectors, matrices and directions that a user gives."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hpcsweep.model import arguments
from hpcsweep.model.arguments import finite, number, refused, wrong

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
Shares = tuple[tuple[str, float], ...]
"""Names of coordinates of a model, each with its share of a direction."""


def vector(
    name: str,
    value: Any,
    size: int | None,
    what: str = "entries",
    parts: Sequence[str] = (),
    read: Callable[[str, Any], float] = number,
) -> Vector:
    """Read a sequence of numbers, of a given size if not None; `parts` are names of its entries."""
    entries = listed(value)
    if entries is None:
        raise refused(name, "a list of numbers", value)
    if size is not None and len(entries) != size:
        raise wrong(name, f"must have {size} {what}, has {len(entries)}")
    names = [f"{name}.{part}" for part in parts] or [name] * len(entries)
    return tuple(map(read, names, entries))


def one_or_each(
    name: str, value: Any, count: int, what: str, limits: tuple[str, float, float]
) -> float | Vector:
    """Read one number, or a sequence with one for each of `count`, within limits."""
    value = arguments.plain(value)
    if not hasattr(value, "__len__") or isinstance(value, str | bytes):
        return number(name, value, *limits)

    words = f"numbers, one per {what}"
    return vector(name, value, count, words, read=lambda part, entry: number(part, entry, *limits))


def each(name: str, value: Any, count: int, what: str) -> Vector:
    """Read a number for each of `count`, from one number or a sequence."""
    value = arguments.plain(value)
    if hasattr(value, "__len__"):
        return vector(name, value, count, f"numbers, one per {what}")
    return (number(name, value),) * count


def matrix(name: str, value: Any, shape: tuple[int | None, int | None]) -> Matrix:
    """Read a matrix of finite numbers, row by row."""
    if isinstance(value, np.ndarray) and value.dtype == float and value.ndim == 2 and value.size:
        sizes = tuple(size or len(value) for size in shape)
        if value.shape == sizes and np.isfinite(value).all():
            return tuple(map(tuple, value.tolist()))
    rows = listed(value)
    if rows is None or not rows or any(listed(row) is None for row in rows):
        raise refused(name, "a list of rows of numbers", value)
    n_rows, n_columns = shape
    if n_rows is not None and len(rows) != n_rows:
        raise wrong(name, f"must have {n_rows} rows, one per mass, has {len(rows)}")
    width = len(rows) if n_columns is None else n_columns
    return tuple(vector(name, row, width, "entries in each row", read=finite) for row in rows)


def direction_of(name: str, direction: Any, refusal: str) -> Any:
    """Read a direction that is not 0: numbers, or names of coordinates of a model, as `Shares`."""
    direction = shares_of(direction)
    if is_named(direction):
        read: Any = tuple((key, finite(f"{name}.{key}", value)) for key, value in direction)
        sizes = tuple(share for _, share in read)
    else:
        read = sizes = vector(name, direction, None, read=finite)
    if not any(sizes):
        raise wrong(name, f"must not be 0: {refusal}")
    return read


def shares_of(direction: Any) -> Any:
    """Return a direction that names coordinates of a model as `Shares`, another one unchanged."""
    if isinstance(direction, str | int) and not isinstance(direction, bool):
        name = str(direction)
        direction = {name.removeprefix("-"): -1.0 if name.startswith("-") else 1.0}
    if isinstance(direction, Mapping):
        return tuple((str(key), share) for key, share in direction.items())
    return direction


def is_named(direction: Any) -> bool:
    """Return whether a direction names coordinates of a model."""
    return isinstance(direction, tuple) and bool(direction) and isinstance(direction[0], tuple)


def listed(value: Any) -> list | None:
    """Return the items of a sequence, or None if it is not one; a set has no order."""
    if np.ma.is_masked(value):
        return None
    if isinstance(value, np.ndarray):
        return list(value) if value.ndim else None
    return list(value) if isinstance(value, list | tuple) else None
