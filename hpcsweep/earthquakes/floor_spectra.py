r"""Response spectra of the floors of a structure under a record, by which equipment is designed.

An oscillator on a floor, whose mass is nothing beside that of the floor, obeys the equation of
`hpcsweep.earthquakes.spectrum` with the absolute acceleration a(t) of the floor in the place of the
ground's. States of the structure are exact at all knots: the ends of equal steps, and of pieces
that close in on what changes, contacts and sliders (`hpcsweep.solvers.instants`). Over a piece of
length L, with x = t / L,

    q(L) = exp(s L) q(0) - int_0^L exp(s (L - t)) a(t) dt.

Of a(t) four numbers are known, a(0), a(L), and from velocities and displacements int_0^1 a dx and
int_0^1 (1 - x) a dx. The integral is that of the cubic which has them, sum_i c_i x^i, hence
L sum_i c_i i! phi_{i+1}(s L), phi_k(y) = sum_j y^j / (j + k)!. What it misses has no moments of
order 0 and 1, so that even where a has a kink the error is of order (s L)^2 of that of the cubic.
Steps are short beside the periods of oscillators and of the structure (`OSCILLATOR`, `STRUCTURE`).

Largest values are those of the polynomial of degree five that has u, u' and u'' at both ends.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, ResponseSpectrum, read_oscillators
from hpcsweep.model.arguments import callback, finite, items, refused
from hpcsweep.model.record import Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.history import SAME_STEP, refined
from hpcsweep.solvers.offers import FORCES
from hpcsweep.solvers.response import arguments

OSCILLATOR, STRUCTURE = 0.12, 0.25
"""Largest angle by which an oscillator, and the highest mode of a structure, turns in a step."""
MAX_PARTS = 64
"""Of a sample interval, for modes that are higher than what the samples of a record move."""
SPREAD = 4.0
"""Periods, over the shortest, that share a march."""
MISSED = 1e-7
"""Part of the peak of the ground that a piece in which something changes may miss, see there."""
SHORTEST = 0.5
"""Shortest period in steps of the record."""
TERMS = 12
"""Of phi_k, where |s L| is at most `OSCILLATOR`."""
FADED = 30.0
"""Powers of e by which an oscillator has faded over a block, whose sums are taken at once."""
ROUNDS = 8
"""Of Newton's method for a largest value; it is at rounding after four."""
MOMENTS = np.linalg.inv(
    np.array([[1, 0, 0, 0], [1, 1, 1, 1], [1, 1 / 2, 1 / 3, 1 / 4], [1 / 2, 1 / 6, 1 / 12, 0.05]])
)
"""Coefficients of a cubic from its values at 0 and 1, and its moments of 1 and 1 - x."""


def floor_spectra(
    structure: Structure,
    record: Record,
    periods: Any,
    damping_ratio: float = DAMPING_RATIO,
    scale: float = 1.0,
    tail: float = 0.0,
    *,
    places: Sequence[str] | None = None,
    rtol: float = 1e-9,
    poll: Callable[[], None] | None = None,
) -> ResponseSpectrum:
    """Compute response spectra of the floors of a structure under a record.

    Oscillators start at rest, weigh nothing, and are integrated to the end of the tail, or to a
    collapse. Peaks are over continuous time.

    Parameters
    ----------
    structure, record, scale, tail
        Of `response`; all in the same units.
    periods : array_like, shape (p,)
        Natural periods T without damping, from dt / 2 to 1e6 dt.
    damping_ratio : float
        From 0, below 1.
    places : sequence of str, optional
        Names of m floors (``structure.floor_names``). Default: all.
    rtol, poll
        Of `history`.

    Returns
    -------
    ResponseSpectrum
        Displacement D relative to the floor, pseudo-velocity w D and pseudo-acceleration w^2 D,
        w = 2 pi / T, each of shape (m, p).

    Raises
    ------
    ValueError, ArithmeticError
        As `response`.

    Examples
    --------
    A floor under a harmonic ground motion in resonance shakes equipment of its own period:

    >>> sine = hpcsweep.Record(np.sin(0.1 * np.arange(630)), dt=0.1)
    >>> frame = hpcsweep.Structure.from_matrices([1.0], [[1.0]], [], damping_ratio=0.05)
    >>> spectra = hpcsweep.floor_spectra(frame, sine, [2.0, 2.0 * np.pi], damping_ratio=0.05)
    >>> spectra.acceleration.round(2)
    array([[10.69, 81.43]])
    """
    structure, record, tail = arguments(structure, record, tail)
    FORCES.demand(structure)
    scale, poll = finite("scale", scale), callback("poll", poll)
    omegas, ratio = read_oscillators(record, periods, damping_ratio, SHORTEST)
    names = [str(name) for name in structure.floor_names]
    places = names if places is None else items("places", places, "a sequence of floors")
    for place in places:
        if place not in names:
            raise refused("places", f"floors, of {', '.join(names)}", place)
    floors = [names.index(place) for place in places]
    least = min(structure.frequencies[-1] * record.dt / STRUCTURE, MAX_PARTS)
    turns = np.maximum(omegas * record.dt / OSCILLATOR, max(least, 1.0))
    displacement, left = np.empty((len(floors), len(omegas))), np.ones(len(omegas), bool)
    while left.any():
        parts = math.ceil(turns[left].max())
        now = left & (turns > parts / SPREAD)
        signals = _signals(structure, record, (scale, tail, rtol, poll), parts, floors)
        for row, signal in zip(displacement, signals, strict=True):
            for k in np.flatnonzero(now).tolist():
                if poll is not None:
                    poll()
                row[k] = signal.peak(float(omegas[k]), ratio)
        left &= ~now
    return ResponseSpectrum(displacement, omegas * displacement, omegas**2 * displacement)


def _signals(structure: Structure, record: Record, run: tuple, parts: int, floors: list[int]):
    """Generate the motions of floors under a record, with so many parts of each interval."""
    from hpcsweep.solvers.instants import InstantMap, accelerations

    scale, tail, rtol, poll = run
    dt, ground = record.dt / parts, refined(record, parts)
    last = ground.size - 1
    count = last + int(tail / dt + SAME_STEP)
    seen = InstantMap(structure, dt, rtol).follow(ground, scale, count, poll, MISSED)
    forces = structure.contact_forces(seen.states), seen.slider_force
    pushed = scale * np.interp(seen.place, np.arange(last + 1), ground, right=0.0)
    after = np.where(seen.place < last, pushed, 0.0)  # the ground falls still at the last sample
    moves = structure.shakes * structure.influence
    absolute = [
        accelerations(structure, seen.states, forces, g) + np.outer(g, moves)
        for g in (after, pushed)
    ]
    for floor in floors:
        u, v = seen.states[:, [floor, structure.n_floors + floor]].T
        shaken = [moves[floor] * g for g in (after[:-1], pushed[1:])]
        yield Signal(seen.place, dt, (u, v), [a[:, floor] for a in absolute], shaken)


class Signal:
    """The motion of a floor at p knots.

    Parameters
    ----------
    place, dt : ndarray, shape (p,), and float
        Times over dt, and dt.
    state : pair of ndarray, shape (p,)
        Displacement and velocity relative to the ground.
    absolute : pair of ndarray, shape (p,)
        Acceleration, just after and just before each knot.
    ground : pair of ndarray, shape (p - 1,)
        What the base gives it, at both ends of each piece, along which that is linear.
    """

    def __init__(self, place, dt, state, absolute, ground):
        parts, self.kind = np.unique(np.diff(place), return_inverse=True)  # 1, 1/2, 1/4, ...
        self.time, self.lengths, self.absolute = dt * place, dt * parts, absolute
        self.span = self.lengths[self.kind]
        mean = np.diff(state[1]) / self.span + 0.5 * (ground[0] + ground[1])
        first = (np.diff(state[0]) / self.span - state[1][:-1]) / self.span
        first += ground[0] / 3.0 + ground[1] / 6.0
        self.known = np.stack((absolute[0][:-1], absolute[1][1:], mean, first), axis=-1)

    def peak(self, omega: float, ratio: float) -> float:
        """Return the largest |u| of an oscillator."""
        s = omega * complex(-ratio, math.sqrt(1.0 - ratio**2))
        q = self._filtered(s)
        u, v = q.imag / s.imag, (s * q).imag / s.imag
        a, z = (-pushed - 2.0 * ratio * omega * v - omega**2 * u for pushed in self.absolute)
        size, curve = np.abs(u), np.maximum(np.abs(a), np.abs(z))
        largest = float(size.max())
        bulge = 0.125 * self.span**2 * (curve[:-1] + curve[1:])
        higher = np.maximum(size[:-1], size[1:]) + bulge > largest
        (at,) = np.nonzero(higher & (v[:-1] * v[1:] < 0.0))
        if not at.size:
            return largest
        h = self.span[at]
        low = u[at], v[at] * h, a[at] * h**2
        high = u[at + 1], v[at + 1] * h, z[at + 1] * h**2
        return max(largest, float(np.abs(_extremum(low, high)).max()))

    def _filtered(self, s: complex) -> np.ndarray:
        """Return q at the knots, from 0."""
        weights = np.array([_weights(s, length) for length in self.lengths.tolist()])
        commonest = int(np.bincount(self.kind).argmax())
        added = (self.known @ weights[commonest].view(float).reshape(4, 2)).view(complex)[:, 0]
        (other,) = np.nonzero(self.kind != commonest)
        added[other] = (self.known[other] * weights[self.kind[other]]).sum(axis=1)
        q, first = np.zeros(self.time.size, complex), 0
        while first < added.size:
            end = self.time[first] + (FADED / -s.real if s.real else math.inf)
            last = max(int(np.searchsorted(self.time, end)), first + 2)
            turned = np.exp(s * (self.time[first:last] - self.time[first]))
            sums = np.cumsum(added[first : last - 1] / turned[1:])
            q[first + 1 : last] = turned[1:] * (q[first] + sums)
            first = last - 1
        return q


def _weights(s: complex, length: float) -> np.ndarray:
    """Return what each number known of a(t) adds to q over a piece, shape (4,)."""
    y = s * length
    phi = [sum(y**j / math.factorial(j + k) for j in range(TERMS)) for k in range(1, 5)]
    return -length * np.array([phi[0], phi[1], 2.0 * phi[2], 6.0 * phi[3]]) @ MOMENTS


def _extremum(low, high) -> np.ndarray:
    """Return extrema of polynomials of degree five with u, u' and u'' at 0 and at 1."""
    (u0, v0, a0), (u1, v1, a1) = low, high
    rest = u1 - u0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    third = 10.0 * rest[0] - 4.0 * rest[1] + 0.5 * rest[2]
    fourth = -15.0 * rest[0] + 7.0 * rest[1] - rest[2]
    fifth = 6.0 * rest[0] - 3.0 * rest[1] + 0.5 * rest[2]
    powers = np.array([u0, v0, 0.5 * a0, third, fourth, fifth])
    slopes = powers[1:] * np.arange(1, 6)[:, None]
    curves = slopes[1:] * np.arange(1, 5)[:, None]
    x = v0 / (v0 - v1)
    for _ in range(ROUNDS):
        slope, curve = (np.polynomial.polynomial.polyval(x, p, False) for p in (slopes, curves))
        x = np.clip(x - np.divide(slope, curve, out=np.zeros_like(x), where=curve != 0), 0.0, 1.0)
    return np.polynomial.polynomial.polyval(x, powers, False)
