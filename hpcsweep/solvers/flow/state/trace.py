"""Points of a branch of periodic orbits, and workspace for following it; see `orbit.walk`.

With p points of size N of an orbit there are S = p N + 1 components of y.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile.places import zeros


class Point(NamedTuple):
    """A point of a branch; states are without the rows beyond n."""

    y: np.ndarray
    tangent: np.ndarray
    """(S,)"""
    inverse: np.ndarray
    """(S, S): of the bordered Jacobian."""
    matrices: np.ndarray
    """(p N, N): tangent maps, N rows each."""
    multipliers: np.ndarray
    """(N,) complex"""
    tests: np.ndarray
    """(3,): see `multipliers.FOLD`."""
    closings: np.ndarray
    """(m,) int: of each contact."""
    residual: np.ndarray
    """(1,)"""


class Trace(NamedTuple):
    """Points of a branch and workspace."""

    scale: float
    """Of the amplitude: the last component of y is A / scale."""
    length: float
    """Of a unit of the points in y, in kernel units."""
    amplitude_unit: float
    now: Point
    """Result of Newton's method, and where it begins."""
    last: Point
    """From which a step is taken; the end of a chord."""
    first: Point
    """The start of the branch; the beginning of a chord. Only y and tangent."""
    guess: np.ndarray
    border: np.ndarray
    """(S,): the hyperplane border . (y - guess) = 0."""
    bend: np.ndarray
    """(S,): turn of the tangent per length, at `last`."""
    move: np.ndarray
    misses: np.ndarray
    images: np.ndarray
    ahead: np.ndarray
    """(S,): workspace; of the images the last one is not used."""
    pivots: np.ndarray
    """(S,) int"""
    n_periods: np.ndarray
    """(1,) int: forcing periods integrated."""
    z: np.ndarray
    """(2R,)"""
    columns: np.ndarray
    """(2R, N)"""
    product: np.ndarray
    other: np.ndarray
    """(N, N)"""
    sizes: np.ndarray
    """(p,)"""
    walked: Point
    """Points that a walk has accepted, each array with one more axis, (K, ...), and none of
    `inverse` and `tests`."""


def _new_point(shape: tuple[int, int, int], k: tuple[int, ...] = ()) -> Point:
    p, n, m = shape
    size, once = p * n + 1, 0 if k else 1
    return Point(
        y=zeros(*k, size),
        tangent=zeros(*k, size),
        inverse=zeros(once * size, once * size),
        matrices=zeros(*k, p * n, n),
        multipliers=zeros(*k, n, dtype=complex),
        tests=zeros(3 * once),
        closings=zeros(*k, m, dtype=int),
        residual=zeros(*(k or (1,))),
    )


def new_trace(
    shape: tuple[int, int, int], size: int, k: int, units: tuple[float, float, float]
) -> Trace:
    """Allocate for shape (p, N, m), m contacts, kernel states of a size, k points of a walk.

    `units` are the first three values.
    """
    p, n, _ = shape
    vectors = [zeros(p * n + 1) for _ in range(7)]
    return Trace(
        *map(float, units),
        *(_new_point(shape), _new_point(shape), _new_point(shape)),
        *vectors,
        pivots=zeros(p * n + 1, dtype=int),
        n_periods=zeros(1, dtype=int),
        z=zeros(size),
        columns=zeros(size, n),
        product=zeros(n, n),
        other=zeros(n, n),
        sizes=zeros(p),
        walked=_new_point(shape, (k,)),
    )


TRACE = Arena(new_trace((1, 2, 1), 2, 1, (1.0, 1.0, 1.0)))
read_trace = TRACE.read
