"""Statistics over the stripes of an incremental dynamic analysis: fractiles and capacities.

A stripe is one scale of the records: one response of each. Fractiles are counted, not fitted: that
of the part p of n values is the smallest of them that at least p n values do not exceed, so it is
one of the values, and means the same of responses at a scale, and of capacities, some of which are
infinite. The capacity of a record is the smallest scale whose response reaches a threshold. A curve
of a structure that pounds may fall below the threshold again and rise once more: later crossings
are counted, so that such a curve is not mistaken for a simple one.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import array, count, finite, number, refused

PARTS = (0.16, 0.5, 0.84)
"""Of fractiles: the median, and what is a standard deviation from it in a normal distribution."""
ROUNDED = 1e-9
"""By which p n may exceed a whole number through rounding."""


class Capacity(NamedTuple):
    """Capacities of records at one threshold, each of shape (...)."""

    scale: np.ndarray
    """Smallest scale whose response reaches the threshold; inf where none does, NaN where a
    response below it is not known."""
    below: np.ndarray
    """Scale before it, which does not reach it; 0 where it is the first, the last scale where none
    does: the capacity for scales between the stripes lies between the two."""
    later_crossings: np.ndarray
    """How often the curve crosses the threshold after that, down and up; 0 of a simple curve."""


def fractiles(values: Any, parts: Sequence[float] = PARTS, axis: int = 0) -> np.ndarray:
    """Count fractiles of values along an axis, those that are NaN left out.

    Parameters
    ----------
    values : array_like, any shape
        Responses of the records at each scale, or capacities; may be infinite.
    parts : sequence of floats
        From 0 to 1, p of them.
    axis : int
        Over which they are counted, the records.

    Returns
    -------
    ndarray, shape (p, ...)
        Values among those given; NaN where all are.

    Raises
    ------
    ValueError
        If a part is none, or there is no such axis.
    """
    given = array("values", values)
    if not given.ndim:
        raise refused("values", "an array of one axis or more", values)
    axis = count("axis", axis, -given.ndim, given.ndim - 1)
    if not given.shape[axis]:
        raise ValueError(f"values must have an entry along the axis, have shape {given.shape}")
    own = np.moveaxis(np.sort(given, axis=axis), axis, 0)
    known = np.count_nonzero(~np.isnan(own), axis=0)
    found = []
    for part in np.atleast_1d(array("parts", parts)).tolist():
        part = number("parts", part, "from 0 to 1", 0.0, 1.0)
        place = np.maximum(np.ceil(part * known - ROUNDED).astype(int), 1) - 1
        found.append(np.take_along_axis(own, place[None], axis=0)[0])
    return np.array(found)


def capacity(scales: Any, responses: Any, threshold: float) -> Capacity:
    """Find the smallest scale at which each record's response reaches a threshold.

    Parameters
    ----------
    scales : array_like, shape (s,)
        Of the stripes, above 0 and increasing, in any intensity measure.
    responses : array_like, shape (..., s)
        Of each record, NaN where it is not known.
    threshold : float
        Reached by a response that is at least as large.

    Returns
    -------
    Capacity

    Raises
    ------
    ValueError
        If shapes differ, or scales do not increase.
    """
    own, curves = array("scales", scales), array("responses", responses)
    if own.ndim != 1 or own.size == 0 or not np.all(np.diff(own, prepend=0.0) > 0):
        raise ValueError("scales must be above 0 and increase, one after the other")
    if curves.ndim == 0 or curves.shape[-1] != own.size:
        raise ValueError(
            f"responses must have the {own.size} scales as their last axis, "
            f"have shape {curves.shape}"
        )
    reached = curves >= finite("threshold", threshold)
    any_reached = reached.any(axis=-1)
    first = np.where(any_reached, reached.argmax(axis=-1), own.size)
    ends = np.concatenate([[0.0], own, [math.inf]])
    unknown = np.isnan(curves) & (np.arange(own.size) < first[..., None])
    scale = np.where(unknown.any(axis=-1), math.nan, ends[first + 1])
    crossings = np.count_nonzero(np.diff(reached, axis=-1), axis=-1)
    later = crossings - (any_reached & (first > 0))
    return Capacity(scale, ends[first], later)
