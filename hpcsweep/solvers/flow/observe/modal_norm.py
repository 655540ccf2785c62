"""Modal norms |q_j| / ||q|| integrated over linear segments free of contact.

Intervals are halved until the interpolant of q_j / ||q|| at Gauss nodes resolves it, and are narrow
where ||q|| nearly vanishes; the kinks of |q_j| are the sign changes of the interpolant.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    load,
    local_matrix,
    local_vector,
    modulus,
    negative,
    root,
    store,
    total,
)
from hpcsweep.solvers.flow.state.tables import (
    MODAL_NODES,
    MODAL_WEIGHTS,
    N_COEFFICIENTS,
    N_MODAL,
    ZERO,
)
from hpcsweep.solvers.flow.step.propagators import product
from hpcsweep.solvers.flow.step.step import expand_modal

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
ALL_CHANGES = 2 ** (N_MODAL + 1) - 1
PLACES = np.concatenate(([-1.0], MODAL_NODES, [1.0]))
TINY = 1e-300
"""Added to the square of ||q||, which may vanish."""


def _between_places() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Express the interpolant between two neighbouring `PLACES` by its values at the nodes.

    Between them, u in [-1, 1], it is a polynomial of degree `LANES` - 1, economised: over at most
    0.19, higher terms of a resolved interpolant are negligible.

    Returns
    -------
    local : ndarray, shape (N_MODAL + 1, N_MODAL, LANES)
        Coefficient of u^k per value at the nodes.
    before : ndarray, shape (N_MODAL + 1, N_MODAL)
        Integral from -1 to u = 0, likewise.
    half : ndarray, shape (N_MODAL + 1,)
        Length of u.
    """
    legendre, chebyshev = np.polynomial.legendre, np.polynomial.chebyshev
    middle, half = 0.5 * (PLACES[1:] + PLACES[:-1]), 0.5 * np.diff(PLACES)
    u = chebyshev.chebpts1(N_MODAL)
    series = np.linalg.inv(chebyshev.chebvander(u, N_MODAL - 1))[:LANES]
    powers = np.array(
        [np.pad(chebyshev.cheb2poly(row), (0, LANES))[:LANES] for row in np.eye(LANES)]
    )
    local = np.empty((N_MODAL + 1, N_MODAL, LANES))
    for place in range(N_MODAL + 1):
        values = legendre.legvander(middle[place] + half[place] * u, N_MODAL - 1)
        local[place] = (powers.T @ series @ values @ MODAL_TRANSFORM.T).T
    antiderivatives = np.array(
        [legendre.legval(middle, legendre.legint(row, lbnd=-1.0)) for row in np.eye(N_MODAL)]
    )
    return local, np.ascontiguousarray((MODAL_TRANSFORM @ antiderivatives).T), half


LOCAL, BEFORE, HALF = _between_places()


@inlined
def modal_norm_on_segment(segment, s, model, tables, tally, step):
    """Add the modal norms over the first `s` of a free step."""
    n, h = tally.modal.shape[0], segment.h
    tally.free_time[0] += s
    if n == 1:
        tally.modal[0] += s
        return
    nodes = local_vector(tables.modal.shape[2])
    # there is a table of free flight; with sliders that slip it is not
    if s == h and segment.key == np.uint64(0) and tables.modal.shape[1] > 0:
        product(tables.modal, 0, step.x, nodes)
        if _add_interval(s, False, n, tally, nodes):
            return
    count = N_COEFFICIENTS
    rows, powers = local_matrix(n, count), local_matrix(count, N_MODAL)
    expand_modal(segment, model, tables, step, rows)
    # halves, the left one first, until each is resolved
    left = 0.0
    length = 0.5 * s if s == h else s
    least = SHORTEST_INTERVAL * h
    while left < s:
        length = min(length, s - left)
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
                at = j * N_MODAL + node
                combine(nodes, at, ZERO, 0, 1.0, powers, node, N_MODAL, rows, j * count, count)
        if _add_interval(length, length <= least, n, tally, nodes):
            left = s if length >= s - left else left + length
            length *= 2.0
        else:
            length *= 0.5


@kernel
def _add_interval(length, accept, n, tally, f):
    """Integrate |q_j| / ||q|| over an interval from q at its nodes, f, if they resolve it.

    f_j = q_j / ||q|| is interpolated by Legendre polynomials at the nodes; it is resolved if their
    last two coefficients are below `MODAL_TOLERANCE`. |f_j| is then integrated between the sign
    changes of the interpolant.

    Returns
    -------
    bool
        Whether it was added; always if `accept`.
    """
    summary, parts = local_vector(LANES), local_vector(n)
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
            parts[j] = 0.5 * mean
            continue
        signs = np.int64(summary[LEFT] < 0.0) | np.int64(summary[RIGHT] < 0.0) << (N_MODAL + 1)
        for node in range(0, N_MODAL, LANES):
            signs |= negative(load(f, start + node)) << (node + 1)
        changes = (signs ^ (signs >> 1)) & ALL_CHANGES
        if changes == 0:
            parts[j] = abs(summary[MEAN])
        else:
            whole = _integral_of_modulus(f, start, changes, summary)
            parts[j] = 0.5 * whole
    for j in range(n):
        tally.modal[j] += length * parts[j]
    return True


@kernel
def _integral_of_modulus(f, start, changes, summary):
    """Integrate the modulus of the interpolant over [-1, 1]; f[start:] are its node values.

    It is that of the interpolant between its zeros. There is one beside `PLACES`[k] where bit k of
    `changes` is set; with F the antiderivative F(u) - f(u)^2 / (2 f'(u)) is its value at a zero
    near u, up to the cube of the distance.
    """
    whole, done, c = 0.0, 0.0, local_vector(LANES)
    place = 0
    while changes != 0:
        if changes & 1 != 0:
            combine(c, 0, ZERO, 0, 1.0, LOCAL, place * N_MODAL * LANES, LANES, f, start, N_MODAL)
            left = f[start + place - 1] if place > 0 else summary[LEFT]
            right = f[start + place] if place < N_MODAL else summary[RIGHT]
            integral = HALF[place] * _integral_to_zero(c, left, right, ZERO_TOLERANCE / HALF[place])
            row = place * N_MODAL
            for node in range(0, N_MODAL, LANES):
                integral += total(load(BEFORE, row + node) * load(f, start + node))
            whole += abs(integral - done)
            done = integral
        changes >>= 1
        place += 1
    return whole + abs(2.0 * summary[MEAN] - done)


@inlined
def _integral_to_zero(c, left, right, tolerance):
    """Integrate a polynomial from 0 to its zero in [-1, 1], by Newton's method.

    Parameters
    ----------
    c : ndarray, shape (LANES,)
        Its coefficients, ascending.
    left, right : float
        Its values at both ends, of different sign.
    tolerance : float
        Of the zero.
    """
    a, b = -1.0, 1.0
    u = (left + right) / (left - right)
    integral = 0.0
    for _ in range(60):
        square = u * u
        fourth = square * square
        low = fma(fma(c[3], u, c[2]), square, fma(c[1], u, c[0]))
        high = fma(fma(c[7], u, c[6]), square, fma(c[5], u, c[4]))
        value = fma(high, fourth, low)
        low = fma(fma(4.0 * c[4], u, 3.0 * c[3]), square, fma(2.0 * c[2], u, c[1]))
        high = fma(7.0 * c[7], square, fma(6.0 * c[6], u, 5.0 * c[5]))
        slope = fma(high, fourth, low)
        low = fma(fma(0.25 * c[3], u, (1.0 / 3.0) * c[2]), square, fma(0.5 * c[1], u, c[0]))
        high = fma((1.0 / 6.0) * c[5], u, 0.2 * c[4])
        high = fma(fma(0.125 * c[7], u, (1.0 / 7.0) * c[6]), square, high)
        integral = u * fma(high, fourth, low)
        if value * right > 0.0:
            b = u
        else:
            a = u
        step = -value / slope if slope != 0.0 else math.inf
        if abs(step) < tolerance:
            return integral + 0.5 * value * step
        if b - a < tolerance:
            return integral
        u = u + step if a < u + step < b else 0.5 * (a + b)
    return integral
