"""Forcing G(tau) by pairs: A sum_h a_h sin(h Omega tau + phi_h), or linear along a period.

The pair of a harmonic is its sine and cosine, advanced by a rotation; the pair of a ramp, after
those, is (G, G'), advanced by a shear.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import fma

SHORT_ANGLE = 0.03
"""Angle up to which four terms of the series of sine and cosine are exact (s^8 / 8! = 2e-17)."""

WIDE_ANGLE = 1.0
SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(9, -1, -1))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(9, -1, -1))
"""Descending orders; the truncation error is 1 / 20! = 4e-19."""


@inlined
def n_pairs(model):
    """Return how many numbers the pairs are."""
    return 2 * (model.harmonics.shape[0] + model.ramp.shape[0])


@inlined
def forcing_at(tau, amplitude, model, out, first):
    """Write A a_h sin(.) and A a_h cos(.) of each harmonic, or G and G', into out[first:]."""
    for h in range(model.harmonics.shape[0]):
        size = amplitude * model.harmonics[h, 1]
        angle = model.harmonics[h, 0] * model.omega * tau + model.harmonics[h, 2]
        out[first + 2 * h] = size * math.sin(angle)
        out[first + 2 * h + 1] = size * math.cos(angle)
    for k in range(model.ramp.shape[0]):
        at = first + 2 * (model.harmonics.shape[0] + k)
        out[at] = amplitude * fma(model.ramp[k, 1], tau, model.ramp[k, 0])
        out[at + 1] = amplitude * model.ramp[k, 1]


@inlined
def turn_forcing(x, first, tables, index):
    """Advance the pairs in x[first:], of harmonics or a ramp, over one step of table `index`."""
    rotation = tables.rotation
    for at in range(0, rotation.shape[1], 2):
        cosine = rotation[index, at]
        sine = rotation[index, at + 1]
        s = x[first + at]
        c = x[first + at + 1]
        x[first + at] = fma(s, cosine, c * sine)
        x[first + at + 1] = fma(c, cosine, -s * sine)
    if rotation.shape[1] == 0:
        x[first] = fma(tables.h[index], x[first + 1], x[first])


@inlined
def short_turn(s):
    """Return sine and cosine of an angle, or of Lanes, of at most `SHORT_ANGLE`."""
    q = s * s
    sine = s * fma(q, fma(q, fma(q, -1.0 / 5040.0, 1.0 / 120.0), -1.0 / 6.0), 1.0)
    cosine = fma(q, fma(q, fma(q, -1.0 / 720.0, 1.0 / 24.0), -0.5), 1.0)
    return sine, cosine


@inlined
def _turn(s):
    """Return sine and cosine of an angle of at most `WIDE_ANGLE`."""
    q = s * s
    sine, cosine = SINE[0], COSINE[0]
    for k in range(1, len(SINE)):
        sine = fma(q, sine, SINE[k])
        cosine = fma(q, cosine, COSINE[k])
    return s * sine, cosine


@inlined
def forcing_after(s, tau, amplitude, x, first, model, out):
    """Write the pairs at tau from those in x[first:] at tau - s, 0 <= s, with their rounding.

    `out` may be x, if `first` is 0.
    """
    fastest = 0.0
    for k in range(model.harmonics.shape[0]):
        fastest = max(fastest, model.harmonics[k, 0] * model.omega * s)
    if fastest > WIDE_ANGLE:
        forcing_at(tau, amplitude, model, out, 0)
        return
    for k in range(model.harmonics.shape[0]):
        turned, kept = _turn(model.harmonics[k, 0] * model.omega * s)
        sine, cosine = x[first + 2 * k], x[first + 2 * k + 1]
        out[2 * k] = fma(turned, cosine, kept * sine)
        out[2 * k + 1] = fma(-turned, sine, kept * cosine)
    for k in range(model.ramp.shape[0]):
        at = 2 * (model.harmonics.shape[0] + k)
        value, rate = x[first + at], x[first + at + 1]
        out[at] = fma(rate, s, value)
        out[at + 1] = rate


@inlined
def total_forcing(pairs, first, model):
    """Return G of the pairs."""
    ground = 0.0
    for k in range(model.harmonics.shape[0]):
        ground += pairs[first + 2 * k]
    for k in range(model.ramp.shape[0]):
        ground += pairs[first + 2 * (model.harmonics.shape[0] + k)]
    return ground


@inlined
def forcing_rate(pairs, first, model):
    """Return dG/dtau of the pairs."""
    rate = 0.0
    for k in range(model.harmonics.shape[0]):
        rate += model.harmonics[k, 0] * model.omega * pairs[first + 2 * k + 1]
    for k in range(model.ramp.shape[0]):
        rate += pairs[first + 2 * (model.harmonics.shape[0] + k) + 1]
    return rate


@kernel
def steepest_forcing(amplitude, model):
    """Bound |dG/dtau|."""
    rate = 0.0
    for k in range(model.harmonics.shape[0]):
        rate += model.harmonics[k, 0] * model.omega * abs(amplitude * model.harmonics[k, 1])
    for k in range(model.ramp.shape[0]):
        rate += abs(amplitude * model.ramp[k, 1])
    return rate
