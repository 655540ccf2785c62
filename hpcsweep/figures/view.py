"""What of a figure is written, and how finely: limits of its axes, and pixels an inch."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hpcsweep.figures.style import PlotError

DPI = 200
"""Pixels an inch, unless `viewing` says other."""
SAME, NEAR = 1e-6, 0.05
"""Share of values by which those differ that are drawn as equal, and of the axis around them."""


class View(NamedTuple):
    """Pixels an inch, and the requested limits of the axes x and y."""

    dpi: int = DPI
    limits: Mapping[str, tuple[float, float]] = MappingProxyType({})


WHOLE = View()
_view: ContextVar[View] = ContextVar("view", default=WHOLE)


@contextmanager
def viewing(dpi: int | None = None, **limits: Sequence[float] | None) -> Iterator[None]:
    """Draw the figures of a block with `dpi` pixels an inch, and limit `x` and `y` of all panels.

    Raises
    ------
    PlotError
        If limits are not finite and ascending.
    """
    asked = {name: (ends[0], ends[1]) for name, ends in limits.items() if ends is not None}
    for name, ends in asked.items():
        if not -np.inf < ends[0] < ends[1] < np.inf:
            limit = "must be two finite numbers, the lower one first"
            raise PlotError(f"--{name}lim {ends[0]:g} {ends[1]:g}: {limit}")
    before = _view.set(View(dpi or _view.get().dpi, asked))
    try:
        yield
    finally:
        _view.reset(before)


def visible(name: str, low: float, high: float) -> tuple[float, float]:
    """Return the part of a range that requested limits of an axis, "x" or "y", leave.

    Raises
    ------
    PlotError
        If that is nothing.
    """
    ends = _view.get().limits.get(name, (low, high))
    if ends[1] < low or high < ends[0]:
        limit = f"must hold a part of {low:.6g} to {high:.6g}, where all is drawn"
        raise PlotError(f"--{name}lim {ends[0]:g} {ends[1]:g}: {limit}")
    first, last = np.clip(ends, low, high).tolist()
    return first, last


def _limit(figure) -> None:
    """Set the requested limits of all panels; refuse them where units differ, or nothing is."""
    panels = [axis for axis in figure.axes if axis.get_label() != "<colorbar>"]
    for name, ends in _view.get().limits.items():
        words = filter(None, (getattr(axis, f"get_{name}label")() for axis in panels))
        units = {text.partition("  [")[2].rstrip("]") for text in words}
        if len(units) > 1:
            raise PlotError(f"--{name}lim: the panels show different quantities on that axis")
        drawn = []
        for axis in panels:
            if getattr(axis, f"get_{name}scale")() == "log" and ends[0] <= 0:
                raise PlotError(f"--{name}lim {ends[0]:g}: must be above 0 on a logarithmic axis")
            drawn += getattr(axis, f"get_{name}lim")()
            axis.set(**{f"{name}lim": ends})
        if drawn:
            visible(name, min(drawn), max(drawn))


def apart(low: float, high: float) -> tuple[float, float]:
    """Return the ends of an axis, far apart where the values between them differ by rounding."""
    size = max(abs(low), abs(high))
    margin = 0.0 if abs(high - low) > SAME * size else NEAR * size
    return low - margin, high + margin


def _part(figure) -> None:
    """Draw values that differ by rounding as equal; keys and frequencies of maps may be near."""
    from matplotlib.collections import QuadMesh

    for axis in figure.axes:
        is_map = any(isinstance(collection, QuadMesh) for collection in axis.collections)
        if not is_map and axis.get_label() != "<colorbar>" and axis.get_yscale() == "linear":
            axis.set_ylim(*apart(*axis.get_ylim()))


def save(figure, path: Path) -> None:
    """Write a figure to disk, in the requested limits, and free it."""
    from matplotlib import pyplot

    try:
        _part(figure)
        _limit(figure)
        figure.savefig(path, dpi=_view.get().dpi)
    except PlotError:
        raise
    except ValueError as error:
        raise PlotError(f"{path}: {error}") from None
    finally:
        pyplot.close(figure)
