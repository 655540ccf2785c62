r"""Synthetic ground motions: white noise under an envelope, filtered by the ground.

Noise n_j, independent, of mean 0 and variance 1, is multiplied by an envelope e(t), and passes two
filters, that of Kanai and Tajimi, ground that resonates, and the high-pass of Clough and Penzien:

    H(s) = (2 z_g w_g s + w_g^2) / (s^2 + 2 z_g w_g s + w_g^2)  *  s^2 / (s^2 + 2 z_f w_f s + w_f^2)

at s = 2 / dt (1 - 1/z) / (1 + 1/z), the bilinear transform: H(i 2/dt tan(w dt/2)) at frequency w.
The envelope grows as (t / t_1)^2, is 1 from t_1 to t_2 and decays exponentially to 1 % (Jennings,
Housner and Tsai 1968); noise ends there, after 0.9 of the duration.

Under e = 1 the motion is stationary, with the power spectral density S(w) = c |H|^2, two-sided,
where c is chosen so that its standard deviation is `rms`. Under any e, with the Fourier transform
A(w) = dt sum a_j exp(-i w j dt),

    E |A(w)|^2 = 2 pi S(w) dt sum e_j^2.

H has a double zero at z = 1. So the ground's velocity and displacement, of the acceleration that is
linear between samples, come back to 0 when the filters have come to rest. What is left of both at
the last sample, since the duration is finite, is taken away by adding s (1 - s) (p + q s), s the
part of the duration: a baseline of less than a hundredth of the peak.

Bits: noise is made of the bits of PCG64, which numpy promises not to change: 12 uniform numbers of
53 bits, added. All else is + - * / and square roots in a fixed order, correctly rounded sums, and
one exponential that is rounded to 12 digits. So a record is the same to the last bit with any
version of numpy and on any machine of IEEE arithmetic, and does not depend on how many are made.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.model.arguments import choice, count, number, positive
from hpcsweep.model.record import MAX_SAMPLES, Record

MAX_RECORDS = 1000
UNIFORMS = 12
"""Uniform numbers whose sum has variance 1."""
NOISY = 0.9
"""Fraction of the duration with noise; in the rest the ground comes to rest."""
LEFT = 0.01
"""Envelope where noise ends."""


class Soil(NamedTuple):
    """Filters of the ground; frequencies in radians per time."""

    frequency: float
    damping: float
    highpass_frequency: float
    highpass_damping: float


SOILS = {
    "firm": Soil(15.0, 0.6, 1.5, 0.6),
    "medium": Soil(10.0, 0.4, 1.0, 0.6),
    "soft": Soil(5.0, 0.2, 0.5, 0.6),
}
"""Of Der Kiureghian and Neuenhofer (Earthquake Engng Struct. Dyn. 21 (1992) 713), in rad/s."""

DOUBLINGS = 40
"""Of the samples over which the variance of a filter is summed: 2^40 are a hundred years."""

Filter = tuple[float, float, float, float, float]
"""b_0, b_1, b_2 and a_1, a_2 of (b_0 + b_1 / z + b_2 / z^2) / (1 + a_1 / z + a_2 / z^2)."""


def synthetic_records(
    n: int,
    seed: int = 0,
    dt: float = 0.01,
    duration: float = 30.0,
    rms: float = 1.0,
    soil: str | Soil = "firm",
    rise: float = 0.1,
    strong: float = 0.4,
) -> list[Record]:
    """Make a suite of synthetic ground motions, the same for the same arguments.

    Parameters
    ----------
    n : int
        Number of records; record i is the same whatever it is.
    seed : int
        At least 0.
    dt, duration : float
        Time between samples, and of the last sample.
    rms : float
        Standard deviation of the acceleration while the envelope is 1, in the structure's units;
        peaks are about three times as large.
    soil : str or Soil
        ``firm``, ``medium``, ``soft``, where time is in seconds; or frequencies in radians per time
        and damping ratios of the two filters.
    rise, strong : float
        Parts of the duration in which the envelope grows, and stays 1; 0.8 together at most.

    Returns
    -------
    list of Record
        Named ``synthetic-seed-number``. Velocity and displacement of the ground end at 0.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Clough and Penzien, *Dynamics of Structures*, 27; soils of Der Kiureghian and Neuenhofer,
    Earthquake Engineering & Structural Dynamics 21 (1992) 713.

    Examples
    --------
    >>> hpcsweep.synthetic_records(2, seed=1, duration=20.0)[0].name
    'synthetic-1-1'
    """
    n, seed = count("n", n, 1, MAX_RECORDS), count("seed", seed, 0, 2**63 - 1)
    dt, duration = positive("dt", dt), positive("duration", duration)
    steps = count("duration / dt", round(min(duration / dt, 1e9)), 100, MAX_SAMPLES - 1)
    filters = _filters(_soil(soil), dt)
    rise = number("rise", rise, "from 0.001 to 0.8", 0.001, 0.8)
    strong = number("strong", strong, f"from 0 to 0.8 - rise, {0.8 - rise:g}", 0.0, 0.8 - rise)
    envelope = _envelope(steps, rise, strong)
    noise = np.array([_noise(seed, i, steps + 1) for i in range(n)]).T * envelope[:, None]
    gain = positive("rms", rms) / _deviation(filters)
    motion = gain * _filtered(_filtered(noise, filters[0]), filters[1])
    return [Record(_at_rest(motion[:, i]), dt, f"synthetic-{seed}-{i + 1}") for i in range(n)]


def _soil(soil: str | Soil) -> Soil:
    """Take a soil by its name, or its four numbers."""
    if isinstance(soil, tuple) and len(soil) == len(Soil._fields):
        named = zip(Soil._fields, soil, strict=True)
        return Soil(*(positive(f"soil.{name}", value) for name, value in named))
    return SOILS[choice("soil", soil, SOILS)]


def _filters(soil: Soil, dt: float) -> tuple[Filter, Filter]:
    """Return the two filters of the ground in discrete time."""
    ground = 2.0 * soil.damping * soil.frequency, soil.frequency * soil.frequency
    high = (
        2.0 * soil.highpass_damping * soil.highpass_frequency,
        soil.highpass_frequency * soil.highpass_frequency,
    )
    return _bilinear(0.0, *ground, *ground, dt), _bilinear(1.0, 0.0, 0.0, *high, dt)


def _bilinear(n2: float, n1: float, n0: float, d1: float, d0: float, dt: float) -> Filter:
    """Turn (n2 s^2 + n1 s + n0) / (s^2 + d1 s + d0) into a filter of samples."""
    k = 2.0 / dt
    kk = k * k
    a0 = kk + d1 * k + d0
    return (
        (n2 * kk + n1 * k + n0) / a0,
        2.0 * (n0 - n2 * kk) / a0,
        (n2 * kk - n1 * k + n0) / a0,
        2.0 * (d0 - kk) / a0,
        (kk - d1 * k + d0) / a0,
    )


def _filtered(x: np.ndarray, by: Filter) -> np.ndarray:
    """Filter the columns of x, shape (samples, records), from rest.

    scipy's filter would do, but its compiler is free to fuse products with sums.
    """
    b0, b1, b2, a1, a2 = by
    y = np.empty_like(x)
    first = two = np.zeros(x.shape[1])
    for row, sample in zip(y, x, strict=True):
        row[:] = b0 * sample + first
        first = b1 * sample - a1 * row + two
        two = b2 * sample - a2 * row
    return y


def _deviation(filters: tuple[Filter, Filter]) -> float:
    """Return the standard deviation of filtered noise of variance 1.

    With x' = A x + b n, y = c x + d n the variance of x is P = A P A^T + b b^T, summed by doubling:
    P + A P A^T and A^2 in place of P and A. Plain sums, since libraries round them as they like.
    """

    def step(x: list[float], n: float) -> tuple[list[float], float]:
        after = []
        for (b0, b1, b2, a1, a2), first, two in zip(filters, x[::2], x[1::2], strict=True):
            y = b0 * n + first
            after += [b1 * n - a1 * y + two, b2 * n - a2 * y]
            n = y
        return after, n

    columns = [step([1.0 if i == k else 0.0 for i in range(4)], 0.0) for k in range(4)]
    b, d = step([0.0] * 4, 1.0)
    matrix, c = np.array([column for column, _ in columns]).T, np.array([[y for _, y in columns]])
    variance = np.outer(b, b)
    for _ in range(DOUBLINGS):
        variance = variance + _product(_product(matrix, variance), matrix.T)
        matrix = _product(matrix, matrix)
    return math.sqrt(_product(_product(c, variance), c.T)[0, 0] + d * d)


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the product of matrices, each entry of it rounded once."""
    return np.array([[math.fsum(row * column) for column in right.T] for row in left])


def _noise(seed: int, i: int, size: int) -> np.ndarray:
    """Return noise of mean 0 and variance 1, shape (size,), for record i."""
    bits = np.random.PCG64(np.random.SeedSequence([seed, i]))
    uniform = (bits.random_raw(UNIFORMS * size) >> np.uint64(11)).astype(float) * 2.0**-53
    total = np.full(size, -0.5 * UNIFORMS)
    for numbers in uniform.reshape(UNIFORMS, size):
        total = total + numbers
    return total


def _envelope(steps: int, rise: float, strong: float) -> np.ndarray:
    """Return the envelope at all samples, shape (steps + 1,)."""
    j = np.arange(steps + 1)
    first, second, last = rise * steps, (rise + strong) * steps, NOISY * steps
    ratio = round(math.exp(math.log(LEFT) / (last - second)), 12)
    envelope = np.minimum(j / first, 1.0)
    envelope = envelope * envelope
    level = 1.0
    for k in range(math.floor(second) + 1, steps + 1):
        level *= ratio
        envelope[k] = level if k <= last else 0.0
    return envelope


def _at_rest(a: np.ndarray) -> np.ndarray:
    """Add the baseline with which velocity and displacement are 0 at the last sample."""
    steps = len(a) - 1
    j = np.arange(steps + 1)
    s = j / steps
    # contribution of a sample to final velocity and displacement, over dt and dt^2
    to_velocity = np.ones(steps + 1)
    to_velocity[[0, -1]] = 0.5
    to_displacement = (steps - j).astype(float)
    to_displacement[[0, -1]] = steps / 2.0 - 1.0 / 6.0, 1.0 / 6.0
    first = s * (1.0 - s)
    second = first * s

    def at_end(motion: np.ndarray) -> tuple[float, float]:
        ends = (to_velocity * motion, to_displacement * motion)
        return math.fsum(ends[0].tolist()), math.fsum(ends[1].tolist())

    (v1, d1), (v2, d2), (v, d) = at_end(first), at_end(second), at_end(a)
    determinant = v1 * d2 - v2 * d1
    p, q = (v2 * d - v * d2) / determinant, (v * d1 - v1 * d) / determinant
    return a + p * first + q * second
