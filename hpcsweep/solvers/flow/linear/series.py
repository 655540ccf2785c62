r"""Motion along a step as a Taylor series about its start: without a table.

Sliders make up to 2^L sets, many of which a motion meets once, where a table takes the time of
hundreds of steps. The field y'' = A x of a set (`write_field`) is enough for the terms of the
series, U_k = y^(k) h^k / k! and V_k = h^k / k! d^k y' / dt^k, of all rows at once:

    U_(k+1) = h V_k / (k + 1),        V_(k+1) = h / (k + 1) (A (U_k, V_k) + what acts from outside).

They end where two in a row are below rounding; a step too long for that is halved, and term k is
then 2^-k of what it was. All rows are economised to polynomials, as those of tables are (`tables`).
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, modulus, negative, store
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.linear.polynomials import fourth_derivative
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state
from hpcsweep.solvers.flow.state.tables import ECONOMISATION, N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.workspace import N_TERMS

IN_SERIES = -2
"""In place of the table of a segment: all its rows are expanded."""
NEGLIGIBLE = 1e-17
"""Size of a term, in the largest of the first ones, from which on they are left out."""


def about_start(count: int) -> np.ndarray:
    """Return (s / h)^k, k < `count`, as polynomials in sigma = 2 s / h - 1, a row each."""
    powers = [[math.comb(k, p) * 0.5**k for p in range(count)] for k in range(count)]
    return np.array(powers) @ ECONOMISATION[:count]


ABOUT_START = about_start(N_TERMS)
"""(N_TERMS, N_COEFFICIENTS)"""


@kernel
def write_field(key, model, out):
    """Write y'' of all rows in the augmented state, (N, padded R), for a set."""
    n_rows = model.stiffness.shape[0]
    contacts, elements = model.contacts, model.elements
    last = out.shape[0] - 1
    loads = last - elements.stiffness.shape[0]
    for i in range(n_rows):
        for j in range(n_rows):
            out[j, i] = -model.stiffness[i, j]
            out[n_rows + j, i] = -model.damping[i, j]
        for pair in range(2 * n_rows, loads, 2):
            out[pair, i], out[pair + 1, i] = model.forcing[i], 0.0
        out[last, i] = 0.0
    for k in range(contacts.row.shape[0]):
        if key & contact_bit(k) != np.uint64(0):
            row = contacts.row[k]
            for i in range(n_rows):
                push = contacts.beta[k] * contacts.kick[k, i]
                out[row, i] -= push * contacts.sign[k]
                drag = contacts.edges[k, DRAG] * contacts.kick[k, i]
                out[n_rows + row, i] -= drag * contacts.sign[k]
                out[last, i] += push * contacts.gap[k]
    for j in range(elements.stiffness.shape[0]):
        slips = key & contact_bit(contacts.row.shape[0] + j) != np.uint64(0)
        for i in range(n_rows):
            push = elements.stiffness[j] * elements.kick[j, i]
            out[loads + j, i] = push
            if slips and push != 0.0:
                for k in range(elements.reach.shape[1]):
                    out[k, i] += push * elements.reach[j, k]


@kernel
def accelerations_of(key, model, work):
    """Evaluate y'' of the augmented state ``work.series.x`` for a set into ``work.series.a``."""
    series = work.series
    _renew(key, model, series)
    width = series.a.shape[0]
    for i in range(0, width, LANES):
        combine(series.a, i, ZERO, 0, 1.0, series.field, i, width, series.x, 0, series.x.shape[0])


@inlined
def _renew(key, model, series):
    """Write the field of a set, if it is not there."""
    if series.key[0] != key or series.key[1] == np.uint64(0):
        write_field(key, model, series.field)
        series.key[0], series.key[1] = key, np.uint64(1)


@kernel
def expand_series(key, h, model, work):
    """Expand all rows by the series of a step of at most h from ``work.x``; write ``work.bounds``.

    Returns
    -------
    float
        Its length.
    """
    series, terms, size = work.series, work.series.terms, work.expanded.shape[0]
    _renew(key, model, series)
    start = size // 2
    copy_state(work.x[:size], terms[0])
    limit = 0.0
    count = 1
    while count < 3 or (count < N_TERMS and not _converged(count, start, limit, terms)):
        _write_term(count, h, work.x, series, size)
        if count <= 2:
            for i in range(start, size):
                limit = max(limit, NEGLIGIBLE * max(abs(terms[0, i]), abs(terms[count, i])))
        count += 1
    while not _converged(count, start, limit, terms):
        h, limit = 0.5 * h, 0.5 * limit
        for k in range(count):
            for i in range(size):
                terms[k, i] *= 0.5**k
    for row in range(size):
        work.expanded[row] = True
        for p in range(0, N_COEFFICIENTS, LANES):
            value = load(ZERO, 0)
            for k in range(count):
                value = fma(load(ABOUT_START, k * N_COEFFICIENTS + p), terms[k, row], value)
            store(work.rows, row * N_COEFFICIENTS + p, value)
    for i in range(start):
        work.bounds[i] = fourth_derivative(work.rows[i : i + 1], h)
    return h


@inlined
def _write_term(count, h, x, series, size):
    """Write a term, behind those that there are."""
    terms, field, flat, width = series.terms, series.field, series.terms.shape[1], series.a.shape[0]
    before, rate, half = (count - 1) * flat, h / count, size // 2
    for i in range(0, width, LANES):
        store(terms, before + flat + i, load(terms, before + half + i) * rate)
    for i in range(0, width, LANES):
        at = before + flat + half + i
        if count == 1:
            combine(terms, at, ZERO, 0, 1.0, field, i, width, x, 0, x.shape[0])
        else:
            combine(terms, at, ZERO, 0, 1.0, field, i, width, terms, before, size)
        if count == 2:
            slope = load(field, size * width + i) * (h * x[size + 1])
            store(terms, at, load(terms, at) + slope)
        store(terms, at, load(terms, at) * rate)


@inlined
def _converged(count, start, limit, terms):
    """Return whether the speeds of the last two terms are at most a limit, or no numbers."""
    flat = terms.shape[1]
    for k in range(count - 2, count):
        for i in range(k * flat + start, (k + 1) * flat, LANES):
            if negative(limit - modulus(load(terms, i))) != 0:
                return False
    return True
