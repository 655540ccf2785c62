"""Statistics over the stripes of an incremental dynamic analysis: fractiles and capacities.

A stripe is one scale of the records: one response of each. Fractiles are counted, not fitted: that
of the part p of n values is the smallest of them that at least p n values do not exceed, so it is
one of the values, and means the same of responses at a scale, and of capacities, some of which are
infinite; a median, of an even number the mean of the middle two, is never called a fractile.
The capacity of a record is the smallest scale whose response reaches a threshold: where
the line through its responses at the two stripes that bracket the threshold does, the response at
the scale 0 being 0. Beyond a collapse the response is infinite, and the capacity the middle between
the stripes before and after. A curve of a structure that pounds may fall below the threshold again
and rise once more: later crossings are counted, so that such a curve is not mistaken for a simple
one.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import array, count, finite, number, positive, refused

PARTS = (0.16, 0.5, 0.84)
"""Of fractiles: the middle, and what is a standard deviation from it in a normal distribution."""
ROUNDED = 1e-9
"""By which p n may exceed a whole number through rounding."""


class Capacity(NamedTuple):
    """Capacities of records at one threshold, each of shape (...)."""

    scale: np.ndarray
    """Smallest scale whose response reaches the threshold, interpolated linearly between `below`
    and `above`; inf where none does, NaN where a response below it is not known."""
    below: np.ndarray
    """Stripe before it, which does not reach it; 0 where that is the first, the last stripe where
    none does."""
    above: np.ndarray
    """First stripe that reaches it, inf where none does."""
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

    Examples
    --------
    >>> hpcsweep.fractiles([1.0, 2.0, 3.0, 4.0, math.inf])
    array([ 1.,  3., inf])
    """
    responses = array("values", values)
    if not responses.ndim:
        raise refused("values", "an array of one axis or more", values)
    axis = count("axis", axis, -responses.ndim, responses.ndim - 1)
    if not responses.shape[axis]:
        raise ValueError(f"values must have an entry along the axis, have shape {responses.shape}")
    ordered = np.moveaxis(np.sort(responses, axis=axis), axis, 0)
    n_known = np.count_nonzero(~np.isnan(ordered), axis=0)
    counted = []
    for part in np.atleast_1d(array("parts", parts)).tolist():
        part = number("parts", part, "from 0 to 1", 0.0, 1.0)
        place = np.maximum(np.ceil(part * n_known - ROUNDED).astype(int), 1) - 1
        counted.append(np.take_along_axis(ordered, place[None], axis=0)[0])
    return np.array(counted)


def response_fractiles(values: Any, parts: Sequence[float] = PARTS) -> np.ndarray:
    """Count fractiles of responses that meet those of capacities: smallest as `fractiles`, or next.

    The fractile p of the responses at a scale reaches a threshold where the fractile 1 - p of the
    capacities is at most that scale: where p n is whole it is the value after that of `fractiles`.

    Parameters
    ----------
    values : array_like, shape (records, ...)
    parts : sequence of floats

    Returns
    -------
    ndarray, shape (p, ...)
    """
    return -fractiles(-array("values", values), [1.0 - part for part in parts])


def median_band(values: Any) -> np.ndarray:
    """Return the median of the records between the fractiles 16 and 84 %.

    Of an even number the median is the mean of the middle two, which need not be one of the values.

    Parameters
    ----------
    values : array_like, shape (records, ...)

    Returns
    -------
    ndarray, shape (3, ...)
    """
    low, middle, high = fractiles(values)
    return np.array([low, 0.5 * (middle + response_fractiles(values, (0.5,))[0]), high])


def capacity(scales: Any, responses: Any, threshold: float) -> Capacity:
    """Find the smallest scale at which each record's response reaches a threshold.

    Responses are taken as linear in the scale between stripes, and as 0 at the scale 0.

    Parameters
    ----------
    scales : array_like, shape (s,)
        Of the stripes, above 0 and increasing, in any intensity measure.
    responses : array_like, shape (..., s)
        Of each record, NaN where it is not known, infinite where the structure has collapsed.
    threshold : float
        Reached by a response that is at least as large.

    Returns
    -------
    Capacity

    Raises
    ------
    ValueError
        If shapes differ, or scales do not increase.

    References
    ----------
    Vamvatsikos and Cornell, Earthquake Engineering & Structural Dynamics 31 (2002) 491.

    Examples
    --------
    >>> responses = [[1.0, 2.0, 5.0], [0.5, 1.0, 2.0]]
    >>> found = hpcsweep.capacity([1.0, 2.0, 4.0], responses, threshold=1.5)
    >>> found.scale
    array([1.5, 3. ])
    """
    stripes, curves = array("scales", scales), array("responses", responses)
    if stripes.ndim != 1 or stripes.size == 0 or not np.all(np.diff(stripes, prepend=0.0) > 0):
        raise ValueError("scales must be above 0 and increase, one after the other")
    if curves.ndim == 0 or curves.shape[-1] != stripes.size:
        raise ValueError(
            f"responses must have the {stripes.size} scales as their last axis, "
            f"have shape {curves.shape}"
        )
    threshold = finite("threshold", threshold)
    reached = curves >= threshold
    any_reached = reached.any(axis=-1)
    first = np.where(any_reached, reached.argmax(axis=-1), stripes.size)[..., None]
    unknown = np.isnan(curves) & (np.arange(stripes.size) < first)

    def around(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the values at the stripes before and at the first that reaches it."""
        low, high = (np.take_along_axis(values, first + k, axis=-1)[..., 0] for k in (0, 1))
        return low, high

    ends = np.zeros((*curves.shape[:-1], 1))
    low, high = around(np.concatenate([ends, curves, ends + math.inf], axis=-1))
    below, above = around(np.concatenate([ends, ends + stripes, ends + math.inf], axis=-1))
    # a response of 0 at the scale 0 may be the threshold itself
    part = np.clip((threshold - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    part = np.where(np.isinf(high), 0.5, part)
    with np.errstate(invalid="ignore"):
        scale = np.where(any_reached, below + part * (above - below), math.inf)
    scale = np.where(unknown.any(axis=-1), math.nan, scale)
    crossings = np.count_nonzero(np.diff(reached, axis=-1), axis=-1)
    later = crossings - (any_reached & (first[..., 0] > 0))
    return Capacity(scale, below, above, later)


def linear_capacity(scale: float, responses: Any, threshold: float) -> Capacity:
    """Return the exact capacities of responses that are proportional to the scale.

    Parameters
    ----------
    scale : float
        Above 0.
    responses : array_like, shape (...)
        Of each record at that scale, at least 0, NaN where it is not known.
    threshold : float
        Above 0.
    """
    largest = np.asarray(responses, float)
    with np.errstate(divide="ignore"):
        exact = positive("threshold", threshold) * scale / largest
    return Capacity(exact, np.minimum(exact, scale), exact, np.zeros(largest.shape, int))
