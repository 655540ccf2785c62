r"""Response spectra of ground-motion records: exact peaks of oscillators of many periods.

An oscillator of frequency w and damping ratio z < 1, at rest at t = 0, obeys

    u'' + 2 z w u' + w^2 u = -a(t),     a(t) = a_j + b_j (t - t_j) between samples j and j + 1.

With s = -z w + i w sqrt(1 - z^2), a root of s^2 + 2 z w s + w^2, the complex q = u' - conj(s) u
obeys an equation of first order, q' = s q - a(t), and gives the state back:

    u = Im q / w_d,     u' = Im(s q) / w_d,     w_d = Im s.

Its exact solution between two samples is, t from the first of them,

    q(t) = exp(s t) q_j - t phi_1(s t) a_j - t^2 phi_2(s t) b_j,
    phi_1(x) = (exp(x) - 1) / x,     phi_2(x) = (exp(x) - 1 - x) / x^2,

one multiplication a sample: a linear filter (Nigam and Jennings 1969 have the same recursion in u
and u'). Between samples u is largest in size where u' = 0. There q = p(t) + c exp(s t) with the
particular p = a / s + b / s^2, so that u'' = Im(s^2 c exp(s t)) / w_d vanishes at equidistant
times: they cut the step into pieces in which u' is monotone and has at most one root. Since |u''|
<= w R, R = |c| w / w_d, after a sample, no step can hold a larger |u| than its ends plus w R dt^2 /
8; few steps remain to be searched.
"""

import copy
import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import array, instance, number, refused, wrong
from hpcsweep.model.record import Record

SMALL = 0.5
"""|x| below which phi_2 is summed: above, its subtraction costs two digits at most."""
TERMS = 15
"""Of that sum: 0.5^15 / 17! is below 1e-19."""
ITERATIONS = 60
"""Of a bracketed Newton iteration; it is at its root to rounding after six or so."""
BATCH = 2**16
"""Samples, or pieces of steps, of all oscillators at a time: a megabyte each array."""
DAMPING_RATIO = 0.05
"""Of the spectra of codes and of published records."""
ANGLES = 180
"""Directions, one a degree."""
TOGETHER = 2**20
"""Samples of all directions at a time."""
SHORTEST, LONGEST = 0.01, 1e6
"""Periods in steps of the record: shorter oscillators stand still, longer ones do not move."""


class ResponseSpectrum(NamedTuple):
    """A response spectrum, one number a period, in the structure's units."""

    displacement: np.ndarray
    """Largest |u| relative to the ground, shape (p,)."""
    velocity: np.ndarray
    """Pseudo-velocity w D, w = 2 pi / T, shape (p,)."""
    acceleration: np.ndarray
    """Pseudo-acceleration w^2 D, shape (p,); over 1 g it is what codes call Sa."""


def spectrum(
    record: Record, periods: Any, damping_ratio: float = DAMPING_RATIO, at_samples: bool = False
) -> ResponseSpectrum:
    """Compute the response spectrum of a record.

    Oscillators start at rest and are integrated to the last sample, exactly for an acceleration
    that is linear between samples. Later oscillations are not: records end quietly.

    Parameters
    ----------
    record : Record
    periods : array_like, shape (p,)
        Natural periods T without damping, from dt / 100 to 1e6 dt.
    damping_ratio : float
        From 0, below 1.
    at_samples : bool
        Take the largest displacement at the samples, as published spectra do, and not over
        continuous time. Of a sinusoid of period T, samples miss 1 - cos(pi dt / T) at most.

    Returns
    -------
    ResponseSpectrum
        Displacement, pseudo-velocity and pseudo-acceleration, each of shape (p,), in the units of
        the record.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Chopra, *Dynamics of Structures*, 5.2 and 6.4 to 6.6.

    Examples
    --------
    A sudden acceleration of 1 for half a period doubles the static displacement, (T / (2 pi))^2:

    >>> step = hpcsweep.Record(np.ones(301), dt=0.01)
    >>> spectrum = hpcsweep.spectrum(step, [1.0, 2.0], damping_ratio=0.0)
    >>> spectrum.acceleration.round(12)
    array([2., 2.])
    """
    omegas, ratio = read_oscillators(record, periods, damping_ratio)
    displacement = np.empty_like(omegas)
    n_pieces = math.ceil(record.dt * omegas.max(initial=0.0) / math.pi)
    size = max(BATCH // (record.n_samples * max(n_pieces, 1)), 1)
    for first in range(0, omegas.size, size):
        batch = slice(first, first + size)
        oscillators = Oscillators(record.acceleration, record.dt, omegas[batch], ratio)
        displacement[batch] = oscillators.peaks(bool(at_samples))
    return ResponseSpectrum(displacement, omegas * displacement, omegas**2 * displacement)


def pair_spectrum(
    first: Record,
    second: Record,
    periods: Any,
    damping_ratio: float = DAMPING_RATIO,
    percentile: float = 50.0,
) -> ResponseSpectrum:
    """Compute the spectrum of two horizontal components, rotated to `ANGLES` directions: RotDnn.

    Of each period the percentile over the directions of the largest displacements, over continuous
    time; RotD50 by default, with 100 that of the direction in which it is largest.

    Parameters
    ----------
    first, second : Record
        At right angles, with equal steps; the shorter one goes on with 0.
    periods, damping_ratio
        As of `spectrum`.
    percentile : float
        From 0 to 100.

    Returns
    -------
    ResponseSpectrum

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Boore, Bulletin of the Seismological Society of America 100 (2010) 1830.

    Examples
    --------
    Of equal components the largest response is sqrt(2) that of each:

    >>> step = hpcsweep.Record(np.ones(301), dt=0.01)
    >>> spectrum = hpcsweep.pair_spectrum(step, step, [1.0], damping_ratio=0.0, percentile=100.0)
    >>> spectrum.acceleration.round(6)
    array([2.828427])
    """
    omegas, ratio = read_oscillators(first, periods, damping_ratio)
    if instance("second", second, Record).dt != first.dt:
        raise refused("second", f"at steps of {first.dt!r}, as the first", second.dt)
    part = number("percentile", percentile, "from 0 to 100", 0.0, 100.0)
    size, displacement = max(first.n_samples, second.n_samples), np.empty((ANGLES, omegas.size))
    samples = [np.pad(each.acceleration, (0, size - each.n_samples)) for each in (first, second)]
    angles = np.array_split(math.pi / ANGLES * np.arange(ANGLES), -(-ANGLES * size // TOGETHER))
    for k in range(omegas.size):
        one, other = (Oscillators(each, first.dt, omegas[k : k + 1], ratio) for each in samples)
        displacement[:, k] = np.hstack([one.turned(other, some).peaks() for some in angles])
    rotated = np.percentile(displacement, part, axis=0)
    return ResponseSpectrum(rotated, omegas * rotated, omegas**2 * rotated)


def read_oscillators(
    record: Record, periods: Any, damping_ratio: float, shortest: float = SHORTEST
) -> tuple[np.ndarray, float]:
    """Take natural periods, so many steps of a record at least, and a damping ratio.

    Returns
    -------
    ndarray, shape (p,), and float
        Natural frequencies, and the damping ratio.
    """
    instance("record", record, Record)
    wanted = periods_of(periods, record.dt, (shortest * record.dt, LONGEST * record.dt))
    ratio = number("damping_ratio", damping_ratio, "from 0 to below 1", 0.0, math.nextafter(1, 0))
    return 2.0 * math.pi / wanted, ratio


def periods_of(values: Any, dt: float, limits: tuple[float, float]) -> np.ndarray:
    """Take natural periods within limits, shape (p,)."""
    periods = array("periods", values)
    if periods.ndim != 1:
        raise wrong("periods", f"must have one dimension, has shape {periods.shape}")
    least, most = limits
    for period in periods.tolist():
        if not least <= period <= most:
            limit = f"from {least:g} to {most:g} with samples every {dt:g}"
            raise refused("periods", limit, period)
    return periods


def phi_1(x: np.ndarray) -> np.ndarray:
    """Evaluate (exp(x) - 1) / x of complex numbers, 1 at 0."""
    x = np.asarray(x, complex)
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0)


def phi_2(x: np.ndarray) -> np.ndarray:
    """Evaluate (exp(x) - 1 - x) / x^2 of complex numbers, 1/2 at 0."""
    x = np.asarray(x, complex)
    small = np.abs(x) < SMALL
    near = np.where(small, x, 0.0)
    total = np.zeros_like(x)
    for k in range(TERMS, 1, -1):
        total = total * near + 1.0 / math.factorial(k)
    far = np.where(small, 1.0, x)
    return np.where(small, total, (np.expm1(far) - far) / far**2)


class Oscillators:
    """Oscillators of one damping ratio under a record, from rest.

    Parameters
    ----------
    acceleration : ndarray, shape (m,)
    dt : float
    omegas : ndarray, shape (p,)
        w > 0, radians per time.
    damping_ratio : float
        z, at least 0 and below 1.
    """

    def __init__(
        self, acceleration: np.ndarray, dt: float, omegas: np.ndarray, damping_ratio: float
    ):
        self.acceleration, self.dt = acceleration, dt
        self.roots = omegas * complex(-damping_ratio, math.sqrt(1.0 - damping_ratio**2))
        self.slopes = np.diff(acceleration) / dt
        self.q = self._filtered()

    def _filtered(self) -> np.ndarray:
        """Return q at the samples, shape (m, p).

        Blocks of some sqrt(m) samples are filtered side by side, each from rest; then what the
        block before ends with is added.
        """
        x, n = self.roots * self.dt, self.slopes.size
        length = math.isqrt(n) + 1
        n_blocks = -(-n // length)
        forces = np.zeros((2, n_blocks * length))
        forces[:, :n] = self.acceleration[:-1], self.slopes
        a, b = forces.reshape(2, n_blocks, length, 1)
        q = a * (-self.dt * phi_1(x))
        q += b * (-(self.dt**2) * phi_2(x))
        turn = np.exp(x)
        for k in range(1, length):
            q[:, k] += turn * q[:, k - 1]
        free = np.exp(np.arange(1, length + 1)[:, None] * x)
        for before, block in pairwise(q):
            block += free * before[-1]
        return np.concatenate((np.zeros((1, x.size)), q.reshape(-1, x.size)[:n]))

    def turned(self, other: "Oscillators", angles: np.ndarray) -> "Oscillators":
        """Return one under this record and another, at a right angle, in directions (k,)."""
        made, c, s = copy.copy(self), np.cos(angles), np.sin(angles)
        made.roots = np.repeat(self.roots, angles.size)
        for name in ("acceleration", "slopes", "q"):
            own, of_other = (getattr(each, name).reshape(-1, 1) for each in (self, other))
            setattr(made, name, own * c + of_other * s)
        return made

    @property
    def displacement(self) -> np.ndarray:
        """Displacement u at the samples, shape (m, p)."""
        return self.q.imag / self.roots.imag

    @property
    def velocity(self) -> np.ndarray:
        """Velocity u' at the samples, shape (m, p)."""
        return (self.roots * self.q).imag / self.roots.imag

    def peaks(self, at_samples: bool = False) -> np.ndarray:
        """Return the largest |u| of each, over continuous time or at the samples, shape (p,)."""
        u = np.abs(self.displacement)
        largest = u.max(axis=0)
        if at_samples:
            return largest
        a, b, s, w = self.acceleration, self.slopes, self.roots, np.abs(self.roots)
        curve = w * w / s.imag * (self.dt**2 / 8.0)
        most = np.abs(self.q.real).max(axis=0) + s.imag * largest
        most += np.abs(a).max() / w + np.abs(b).max(initial=0.0) / w**2
        high = u > largest - curve * most  # a first choice, without c of each step
        at, k = np.nonzero(high[:-1] | high[1:])
        a, b = (np.broadcast_to(x.reshape(len(x), -1), (len(x), s.size))[at, k] for x in (a, b))
        motion = Motions(s[k], self.q[at, k], a, b)
        bulge = curve[k] * np.abs(motion.free)
        chosen = np.maximum(u[at, k], u[at + 1, k]) + bulge > largest[k]
        motion, k = motion.of(chosen), k[chosen]
        if k.size:
            ends, step = _monotone_pieces(motion.s, motion.free, self.dt)
            turns, extrema = motion.of(step).extrema(ends, self.dt)
            np.maximum.at(largest, k[step][turns], extrema)
        return largest


class Motions(NamedTuple):
    """Motions within steps: their roots s, and q, a and b at the beginnings, shape (k,) each."""

    s: np.ndarray
    q: np.ndarray
    a: np.ndarray
    b: np.ndarray

    def of(self, chosen: np.ndarray) -> "Motions":
        """Return some of them."""
        return Motions(*(values[chosen] for values in self))

    @property
    def free(self) -> np.ndarray:
        """The c of the free motion c exp(s t)."""
        return self.q - self.a / self.s - self.b / self.s**2

    def after(self, t: np.ndarray) -> np.ndarray:
        """Evaluate q a time t after the beginnings."""
        x = self.s * t
        return np.exp(x) * self.q - t * phi_1(x) * self.a - t * t * phi_2(x) * self.b

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Evaluate u'."""
        return (self.s * self.after(t)).imag / self.s.imag

    def extrema(self, ends: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return which have a root of u' between ends, shape (k, 2), and their |u| at it."""
        first = self.velocity(ends[:, 0])
        turns = first * self.velocity(ends[:, 1]) < 0
        turning, (low, high), first = self.of(turns), ends[turns].T, first[turns]
        s, _, a, b = turning
        t = 0.5 * (low + high)
        for _ in range(ITERATIONS):
            state = turning.after(t)
            v = (s * state).imag / s.imag
            before = (v < 0) == (first < 0)
            low, high = np.where(before, t, low), np.where(before, high, t)
            rate = 2.0 * s.real * v - np.abs(s) ** 2 * state.imag / s.imag - a - b * t
            newton = t - np.divide(v, rate, out=np.full_like(v, np.inf), where=rate != 0)
            is_root = np.abs(newton - t) <= 1e-10 * dt
            inside = is_root | ((newton > low) & (newton < high))
            t = np.where(inside, newton, 0.5 * (low + high))
            if is_root.all():
                break
        return turns, np.abs(turning.after(t).imag) / s.imag


def _monotone_pieces(s: np.ndarray, c: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Cut steps where u'' = 0; return ends of the pieces, shape (pieces, 2), and their steps."""
    apart = math.pi / s.imag
    first = np.mod(-np.angle(s**2 * c) / s.imag, apart)
    n_cuts = math.ceil(dt / apart.min())
    cuts = first[:, None] + apart[:, None] * np.arange(n_cuts)
    edges = np.hstack([np.zeros((len(c), 1)), np.minimum(cuts, dt), np.full((len(c), 1), dt)])
    pieces = np.stack([edges[:, :-1], edges[:, 1:]], axis=-1).reshape(-1, 2)
    return pieces, np.repeat(np.arange(len(c)), n_cuts + 1)
