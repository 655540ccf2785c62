r"""Strides: several steps of free flight at once, in modes.

Without contacts and with a diagonal Gamma a mode q'' = -Lambda q - Gamma q' + g G(t) moves by
itself, and a stride of 2^l steps h of free flight is linear in its state and in the pairs (s, c) of
the forcing::

    (q, q') -> (q, q') + D (q, q') + P (s, c),        (s, c) -> R (s, c).

D and P of one step are the sums of the terms of `spectral` beyond the first; what is small beside 1
is stored apart from it, so that nothing adds up over many steps. Of twice that length they are

    2 D + D D,        P + D P + P R.

A stride takes n (8 + 8 H) products, where a step of terms takes 24 n (4 + H), and those of the rows
of contacts: where these are at its end, and a bound of their fourth derivatives. With r = q'''',

    r'' + Gamma r' + Lambda r = g G'''',

the root of r'^2 + Lambda r^2 grows no faster than |g G''''| (Gamma >= 0), hence

    |r(t)| <= sqrt(r(0)^2 + r'(0)^2 / Lambda) + t |g| max |G''''| / sqrt(Lambda),

r(0) and r'(0) linear in the state and the pairs, and a row is bounded by the sum of its modes. So
long as slow modes carry the motion the proof that no contact is reached (`search`) holds over many
steps of the fastest.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, modulus, root, store
from hpcsweep.solvers.flow.state.tables import ZERO
from hpcsweep.solvers.flow.step.spectral import N_FREE

TINY = 1e-300
NONE = -1
"""In place of the number of lengths of a structure whose modes are not all bounded so."""


@inlined
def _rates_of(pair, model):
    """Return the rates of a pair of the forcing: s' = rise c, c' = -fall s."""
    if model.ramp.shape[0] > 0:
        return 1.0, 0.0
    rate = model.harmonics[pair, 0] * model.omega
    return rate, rate


@inlined
def _start_of(unit, model):
    """Return one unit of q, q' or a number of the pairs: q, q', s, c, and the rates of its pair."""
    rise, fall = (0.0, 0.0) if unit < 2 else _rates_of((unit - 2) // 2, model)
    sine = 1.0 if unit >= 2 and unit % 2 == 0 else 0.0
    cosine = 1.0 if unit >= 2 and unit % 2 == 1 else 0.0
    q, v = 1.0 if unit == 0 else 0.0, 1.0 if unit == 1 else 0.0
    return q, v, sine, cosine, rise, fall


@kernel
def _write_step(j, unit, h, model, spectrum, out):
    """Write what one step makes of a unit in mode j, as far as it changes, into out[:, unit, j]."""
    square, rate, share = spectrum.squares[j], spectrum.rates[j], spectrum.forcing[j]
    q, v, s, c, rise, fall = _start_of(unit, model)
    out[0, unit, j] = out[1, unit, j] = 0.0
    for k in range(1, N_FREE):
        part = h / k
        q, v = part * v, part * (share * s + rate * v - square * q)
        s, c = part * rise * c, -part * fall * s
        out[0, unit, j] += q
        out[1, unit, j] += v


@kernel
def _write_bends(j, unit, model, spectrum, out):
    """Write q'''' and q''''' / sqrt(Lambda) of a unit in mode j into out[:, unit, j]."""
    square, rate, share = spectrum.squares[j], spectrum.rates[j], spectrum.forcing[j]
    q, v, s, c, rise, fall = _start_of(unit, model)
    for _ in range(4):
        q, v = v, share * s + rate * v - square * q
        s, c = rise * c, -fall * s
    out[0, unit, j], out[1, unit, j] = q, v / math.sqrt(square)


@kernel
def _write_turns(length, model, out):
    """Write what the pairs of the forcing make of themselves in that time."""
    for number in range(0, out.shape[0], 2):
        rise, fall = _rates_of(number // 2, model)
        angle = rise * length
        sine, cosine = (math.sin(angle), math.cos(angle)) if fall > 0.0 else (angle, 1.0)
        out[number, 0], out[number, 1] = cosine, sine
        out[number + 1, 0], out[number + 1, 1] = -sine if fall > 0.0 else 0.0, cosine


@kernel
def _double(j, before, turns, out):
    """Write what twice a stride makes of mode j; `turns` are those of the pairs over it."""
    a, b, c, d = before[0, 0, j], before[0, 1, j], before[1, 0, j], before[1, 1, j]
    out[0, 0, j], out[0, 1, j] = 2.0 * a + (a * a + b * c), 2.0 * b + b * (a + d)
    out[1, 0, j], out[1, 1, j] = 2.0 * c + c * (a + d), 2.0 * d + (b * c + d * d)
    for unit in range(2, before.shape[1]):
        first = unit - unit % 2
        q, v = before[0, unit, j], before[1, unit, j]
        column = unit % 2
        for i in range(2):
            turned = before[i, first, j] * turns[first - 2, column]
            turned += before[i, first + 1, j] * turns[first - 1, column]
            moved = (a * q + b * v) if i == 0 else (c * q + d * v)
            out[i, unit, j] = turned + (moved + before[i, unit, j])


@kernel
def have_strides(h, model, spectrum, strides):
    """Write the tables of all strides, if they are not; return the number of their lengths."""
    if strides.count[0] != 0:
        return max(strides.count[0], 0)
    n, units = spectrum.to_modes.shape[0], strides.bends.shape[1]
    strides.count[0] = strides.steps.shape[0] if spectrum.damping.shape[0] == 0 else NONE
    for j in range(n):
        if not (spectrum.squares[j] > 0.0 and spectrum.rates[j] <= 0.0):
            strides.count[0] = NONE
    if strides.count[0] == NONE:
        return 0
    for level in range(strides.steps.shape[0]):
        _write_turns(h * 2.0**level, model, strides.turns[level])
    for j in range(n):
        for unit in range(units):
            _write_step(j, unit, h, model, spectrum, strides.steps[0])
            _write_bends(j, unit, model, spectrum, strides.bends)
        for level in range(1, strides.steps.shape[0]):
            _double(j, strides.steps[level - 1], strides.turns[level - 1], strides.steps[level])
    return strides.count[0]


@kernel
def look(modes, bounds, spectrum, edges, out):
    """Write distances past the edges, then speeds, of contacts in free flight; bounds behind them.

    The bounds are those of the rows by `bounds`, those of the modes. Rows of `edges`: the sign of
    the way to the edge of the layer, and what the distance past it is for a row at 0; -1 beyond the
    last contact.
    """
    n, width, stops = spectrum.to_modes.shape[0], spectrum.stops.shape[1], spectrum.stops
    half = spectrum.squares.shape[0]
    for first in range(0, width, LANES):
        value, speed, bound = load(ZERO, 0), load(ZERO, 0), load(ZERO, 0)
        for j in range(n):
            share = load(stops, j * width + first)
            value = fma(share, modes[j], value)
            speed = fma(share, modes[half + j], speed)
            bound = fma(modulus(share), bounds[j], bound)
        sign = load(edges, first)
        store(out, first, fma(sign, value, load(edges, width + first)))
        store(out, width + first, sign * speed)
        store(out, 2 * width + first, bound)


@kernel
def stride(level, h, modes, pairs, model, spectrum, strides, after, turned, bounds):
    """Take a stride of that length from `modes` and `pairs` to `after` and `turned`.

    Bounds of the fourth derivatives of the modes are written into `bounds`.
    """
    half, units = spectrum.squares.shape[0], strides.bends.shape[1]
    flat, steps, bends = units * half, strides.steps, strides.bends
    to, size = 2 * level * flat, 0.0
    for number in range(0, units - 2, 2):
        rise, fall = _rates_of(number // 2, model)
        s, c = pairs[number], pairs[number + 1]
        size += (rise * fall) ** 2 * (abs(s) + abs(c))
        for i in range(number, number + 2):
            turn = strides.turns[level, i]
            turned[i] = fma(turn[0], s, turn[1] * c)
    for p in range(0, half, LANES):
        q, v = load(modes, p), load(modes, half + p)
        moved = fma(load(steps, to + p), q, load(steps, to + half + p) * v)
        pushed = fma(load(steps, to + flat + p), q, load(steps, to + flat + half + p) * v)
        bend = fma(load(bends, p), q, load(bends, half + p) * v)
        rise = fma(load(bends, flat + p), q, load(bends, flat + half + p) * v)
        for i in range(units - 2):
            at = (2 + i) * half + p
            moved = fma(load(steps, to + at), pairs[i], moved)
            pushed = fma(load(steps, to + flat + at), pairs[i], pushed)
            bend = fma(load(bends, at), pairs[i], bend)
            rise = fma(load(bends, flat + at), pairs[i], rise)
        store(after, p, q + moved)
        store(after, half + p, v + pushed)
        driven = modulus(load(spectrum.forcing, p)) / (root(load(spectrum.squares, p)) + TINY)
        grown = driven * (size * h)
        store(bounds, p, root(fma(bend, bend, rise * rise)) + grown)
