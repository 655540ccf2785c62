"""Modal norms |q_j| / ||q|| integrated over linear segments free of contact.

They are integrated on intervals that are halved until the interpolant of q_j / ||q|| at Gauss nodes
resolves it, narrow where ||q|| nearly vanishes; the kinks of |q_j| are the sign changes of the
interpolant.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.vectors import (
    LANES,
    combine,
    fma,
    load,
    modulus,
    negative,
    root,
    store,
    total,
)
from hpcsweep.solvers.flow.polynomials import expand_rows
from hpcsweep.solvers.flow.tables import (
    MODAL_NODES,
    MODAL_WEIGHTS,
    N_COEFFICIENTS,
    N_MODAL,
    ZERO,
    product,
)

MODAL_TOLERANCE = 1e-5
"""Largest tail of the interpolant of q_j / ||q|| on an interval that counts as resolved. The norms
are then right to about 1e-10 (measured: 8e-10 with a tolerance of 1e-4, 5e-12 with 1e-6)."""
SHORTEST_INTERVAL = 1e-9
"""Part of a step below which an interval counts as resolved in any case."""
ZERO_TOLERANCE = 1e-4
"""Of a sign change, on [-1, 1]; the integral of the modulus depends on its cube."""
MODAL_TRANSFORM = np.ascontiguousarray(
    (
        (np.arange(N_MODAL)[:, None] + 0.5)
        * np.polynomial.legendre.legvander(MODAL_NODES, N_MODAL - 1).T
        * MODAL_WEIGHTS
    ).T
)
"""Row: node; column: coefficient of the Legendre series."""
SUMMARY = np.zeros((N_MODAL, LANES))
"""Row: node; columns: the first and the last two of these coefficients, the series at -1 and 1."""
MEAN, LAST, BUT_LAST, LEFT, RIGHT = range(5)
SUMMARY[:, MEAN] = MODAL_TRANSFORM[:, 0]
SUMMARY[:, LAST], SUMMARY[:, BUT_LAST] = MODAL_TRANSFORM[:, -1], MODAL_TRANSFORM[:, -2]
SUMMARY[:, LEFT] = MODAL_TRANSFORM @ (-1.0) ** np.arange(N_MODAL)
SUMMARY[:, RIGHT] = MODAL_TRANSFORM.sum(axis=1)
ALL_NEGATIVE = 2 ** (N_MODAL + 2) - 1
PLACES = np.concatenate(([-1.0], MODAL_NODES, [1.0]))
TINY = 1e-300
"""Added to the square of ||q||, which may vanish."""
_K = np.arange(N_MODAL + 1)
LEGENDRE_UP, LEGENDRE_DOWN = (2 * _K + 1) / (_K + 1), _K / (_K + 1)
"""Of the recurrence P_(k+1) = up_k s P_k - down_k P_(k-1)."""
LEGENDRE_INTEGRAL = 1 / (2 * _K + 1)


@inlined
def modal_norm_on_segment(index, x, s, model, tables, tally, work):
    """Add the modal norms over the first `s` of a free step that starts at x."""
    n = tally.modal.shape[0]
    h = tables.h[index]
    tally.free_time[0] += s
    if n == 1:
        tally.modal[0] += s
        return
    if s == h:
        product(tables.modal, 0, x, work.modal_nodes)
        if _add_interval(s, False, n, tally, work):
            return
    expand_rows(tables.poly, index, x, work.rows, work.expanded, n)
    for j in range(n):
        for p in range(0, N_COEFFICIENTS, LANES):
            row = j * N_COEFFICIENTS + p
            combine(
                work.modal_rows,
                row,
                ZERO,
                0,
                1.0,
                work.rows,
                p,
                N_COEFFICIENTS,
                model.modal_transform,
                j * model.modal_transform.shape[1],
                n,
            )
    # halves, the left one first, until each is resolved
    left = 0.0
    length = 0.5 * s if s == h else s
    least = SHORTEST_INTERVAL * h
    while left < s:
        length = min(length, s - left)
        powers = work.modal_powers
        middle, half = (2.0 * left + length) / h - 1.0, length / h
        for node in range(0, N_MODAL, LANES):
            sigma = fma(load(MODAL_NODES, node), half, middle)
            power = sigma
            store(powers, node, 1.0)
            for p in range(1, N_COEFFICIENTS):
                store(powers, p * N_MODAL + node, power)
                power = power * sigma
        for j in range(n):
            for node in range(0, N_MODAL, LANES):
                combine(
                    work.modal_nodes,
                    j * N_MODAL + node,
                    ZERO,
                    0,
                    1.0,
                    powers,
                    node,
                    N_MODAL,
                    work.modal_rows,
                    j * N_COEFFICIENTS,
                    N_COEFFICIENTS,
                )
        if _add_interval(length, length <= least, n, tally, work):
            left = s if length >= s - left else left + length
            length *= 2.0
        else:
            length *= 0.5


@kernel
def _add_interval(length, accept, n, tally, work):
    """Integrate |q_j| / ||q|| over an interval from its nodes, if they resolve it.

    f_j = q_j / ||q|| is interpolated by Legendre polynomials at the nodes; it is resolved if their
    last two coefficients are below `MODAL_TOLERANCE`. |f_j| is then integrated between the sign
    changes of the interpolant.

    Returns
    -------
    bool
        Whether it was added; always if `accept`.
    """
    f = work.modal_nodes
    summary = work.modal_summary
    for node in range(0, N_MODAL, LANES):
        square = load(f, node) * load(f, node) + TINY
        for at in range(N_MODAL + node, n * N_MODAL, N_MODAL):
            square = fma(load(f, at), load(f, at), square)
        size = 1.0 / root(square)
        for at in range(node, n * N_MODAL, N_MODAL):
            store(f, at, load(f, at) * size)
    for j in range(n):
        start = j * N_MODAL
        combine(summary, 0, ZERO, 0, 1.0, SUMMARY, 0, LANES, f, start, N_MODAL)
        if max(abs(summary[LAST]), abs(summary[BUT_LAST])) > MODAL_TOLERANCE:
            if not accept:
                return False
            mean = 0.0
            for node in range(0, N_MODAL, LANES):
                mean += total(load(MODAL_WEIGHTS, node) * modulus(load(f, start + node)))
            work.modal_part[j] = 0.5 * mean
            continue
        signs = np.int64(summary[LEFT] < 0.0) | np.int64(summary[RIGHT] < 0.0) << (N_MODAL + 1)
        for node in range(0, N_MODAL, LANES):
            signs |= negative(load(f, start + node)) << (node + 1)
        if signs == 0 or signs == ALL_NEGATIVE:
            work.modal_part[j] = abs(summary[MEAN])
        else:
            work.modal_part[j] = 0.5 * _integral_of_modulus(f, start, summary, work.modal_series)
    for j in range(n):
        tally.modal[j] += length * work.modal_part[j]
    return True


@kernel
def _integral_of_modulus(f, start, summary, c):
    """Integrate the modulus of a Legendre series over [-1, 1]; f[start:] are its node values.

    It is that of the series between its zeros. At s beside a zero the antiderivative at the zero is
    F(s) - f(s)^2 / (2 f'(s)), up to the cube of the distance. `c` is workspace.
    """
    for k in range(0, N_MODAL, LANES):
        combine(c, k, ZERO, 0, 1.0, MODAL_TRANSFORM, k, N_MODAL, f, start, N_MODAL)
    fa = summary[LEFT]
    whole, done = 0.0, 0.0
    for place in range(1, N_MODAL + 2):
        fb = f[start + place - 1] if place <= N_MODAL else summary[RIGHT]
        if fa * fb < 0.0:
            a, b = PLACES[place - 1], PLACES[place]
            s = b - fb * (b - a) / (fb - fa)
            integral = 0.0
            for _ in range(60):
                value, slope, integral = _series(c, s)
                if value * fb > 0.0:
                    b = s
                else:
                    a = s
                step = -value / slope if slope != 0.0 else math.inf
                if abs(step) < ZERO_TOLERANCE or b - a < ZERO_TOLERANCE:
                    if abs(step) < ZERO_TOLERANCE:
                        integral += 0.5 * value * step
                    break
                s = s + step if a < s + step < b else 0.5 * (a + b)
            whole += abs(integral - done)
            done = integral
        fa = fb
    return whole + abs(2.0 * c[0] - done)


@inlined
def _series(c, s):
    """Evaluate a Legendre series and its slope at s, and its integral from -1.

    P'_(k+1) = P'_(k-1) + (2 k + 1) P_k; the antiderivative of P_k is
    (P_(k+1) - P_(k-1)) / (2 k + 1), 0 at -1.
    """
    before, current = 1.0, s
    slope_before, slope_current = 0.0, 1.0
    value = c[0]
    slope = 0.0
    integral = c[0] * (s + 1.0)
    for k in range(1, N_MODAL):
        following = fma(LEGENDRE_UP[k] * s, current, -LEGENDRE_DOWN[k] * before)
        slope_following = fma(2.0 * k + 1.0, current, slope_before)
        value = fma(c[k], current, value)
        slope = fma(c[k], slope_current, slope)
        integral = fma(c[k] * LEGENDRE_INTEGRAL[k], following - before, integral)
        before, current = current, following
        slope_before, slope_current = slope_current, slope_following
    return value, slope, integral
