"""Motion along a linear step as polynomials in sigma = 2 s / h - 1, from the tables."""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, modulus, total
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO

FOURTH = np.array([math.perm(p, 4) for p in range(N_COEFFICIENTS)], float)
"""Factors of the coefficients in the fourth derivative by sigma."""


@kernel
def expand_row(poly, index, row, x, out):
    """Write the polynomial of one component along a step from x."""
    start = (index * poly.shape[1] + row) * poly.shape[2] * N_COEFFICIENTS
    for p in range(0, N_COEFFICIENTS, LANES):
        at = start + p
        combine(out, p, ZERO, 0, 1.0, poly, at, N_COEFFICIENTS, x, 0, x.shape[0])


@inlined
def evaluate(coefficients, sigma):
    """Evaluate a polynomial of a step at sigma, a number or Lanes."""
    value = sigma * 0.0
    for p in range(N_COEFFICIENTS - 1, -1, -1):
        value = fma(value, sigma, coefficients[p])
    return value


@inlined
def evaluate_rows(rows, h, s, out):
    """Evaluate the state at time s of the step whose polynomials are `rows`."""
    sigma = s * (2.0 / h) - 1.0
    square = sigma * sigma
    fourth = square * square
    for row in range(out.shape[0]):
        value = 0.0
        for p in range(N_COEFFICIENTS - 4, -1, -4):
            low = fma(rows[row, p + 1], sigma, rows[row, p])
            high = fma(rows[row, p + 3], sigma, rows[row, p + 2])
            value = fma(value, fourth, fma(high, square, low))
        out[row] = value


@inlined
def _cubic(rows, row, p, sigma, square):
    """Evaluate the cubic of four consecutive coefficients, and its first two derivatives."""
    c0, c1, c2, c3 = rows[row, p], rows[row, p + 1], rows[row, p + 2], rows[row, p + 3]
    value = fma(fma(c3, sigma, c2), square, fma(c1, sigma, c0))
    slope = fma(3.0 * c3, square, fma(2.0 * c2, sigma, c1))
    return value, slope, fma(6.0 * c3, sigma, 2.0 * c2)


@kernel
def value_slope_bend(rows, row, h, s):
    """Evaluate polynomial `row` of a step and its first two time derivatives at time s of the step.

    Four coefficients at a time, so that few operations wait for each other.

    Parameters
    ----------
    rows : ndarray, shape (any, N_COEFFICIENTS)
        Coefficients in sigma = 2 s / h - 1, ascending.
    """
    rate = 2.0 / h
    sigma = s * rate - 1.0
    square = sigma * sigma
    fourth = square * square
    cubic = 4.0 * sigma * square
    value, slope, bend = _cubic(rows, row, N_COEFFICIENTS - 4, sigma, square)
    for p in range(N_COEFFICIENTS - 8, -1, -4):
        low, low_slope, low_bend = _cubic(rows, row, p, sigma, square)
        lower = fma(value, 12.0 * square, low_bend)
        bend = fma(bend, fourth, fma(2.0 * slope, cubic, lower))
        slope = fma(slope, fourth, fma(value, cubic, low_slope))
        value = fma(value, fourth, low)
    return value, slope * rate, bend * (rate * rate)


@inlined
def values_and_slopes(rows, row, h, s):
    """Evaluate polynomial `row` of a step and its time derivative at times s of the step, Lanes.

    Even part E and odd part O are evaluated separately: with q = sigma^2 the value is E(q) + sigma
    O(q), and its derivative by sigma 2 sigma E'(q) + O(q) + 2 q O'(q).
    """
    rate = 2.0 / h
    sigma = fma(s, rate, -1.0)
    square = sigma * sigma
    last = N_COEFFICIENTS - 2
    even_slope = square * 0.0 + rows[row, last]
    odd_slope = square * 0.0 + rows[row, last + 1]
    even = fma(even_slope, square, rows[row, last - 2])
    odd = fma(odd_slope, square, rows[row, last - 1])
    for p in range(last - 4, -1, -2):
        even_slope = fma(even_slope, square, even)
        odd_slope = fma(odd_slope, square, odd)
        even = fma(even, square, rows[row, p])
        odd = fma(odd, square, rows[row, p + 1])
    slope = fma(2.0 * sigma, fma(odd_slope, sigma, even_slope), odd)
    return fma(sigma, odd, even), slope * rate


@kernel
def integral(rows, row, h, s):
    """Integrate polynomial `row` of a step over its first s; arguments as `value_slope_bend`."""
    sigma = s * (2.0 / h) - 1.0
    upper = lower = 0.0
    for p in range(N_COEFFICIENTS - 1, -1, -1):
        part = rows[row, p] / (p + 1.0)
        upper = fma(upper, sigma, part)
        lower = part - lower
    return 0.5 * h * fma(upper, sigma, lower)


@kernel
def value_and_slope(rows, row, h, s):
    """Evaluate like `value_slope_bend`, without the second derivative."""
    value, slope, _ = value_slope_bend(rows, row, h, s)
    return value, slope


@inlined
def fourth_derivative(rows, h):
    """Bound |d^4/ds^4| of polynomial 0 on the step by the moduli of its coefficients."""
    bound = modulus(load(rows, 0)) * load(FOURTH, 0)
    for p in range(LANES, N_COEFFICIENTS, LANES):
        bound = fma(modulus(load(rows, p)), load(FOURTH, p), bound)
    rate = 2.0 / h
    return total(bound) * ((rate * rate) * (rate * rate))
