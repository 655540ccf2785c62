r"""Motion along a step as a Taylor series about its start: without a table.

Sliders make up to 2^L sets, many of which a motion meets once, where a table takes the time of
hundreds of steps. The field y'' = A x of a set (`write_field`) is enough for the terms of the
series, U_k = y^(k) h^k / k! and V_k = h^k / k! d^k y' / dt^k, of all rows at once:

    U_(k+1) = h V_k / (k + 1),        V_(k+1) = h / (k + 1) (A (U_k, V_k) + what acts from outside).

They end where two in a row are below rounding; a step too long for that is halved, and term k is
then 2^-k of what it was. Their sums are states within the step; what is searched is economised to
polynomials, as those of tables are (`tables`), row by row.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    greatest,
    load,
    local_matrix,
    local_vector,
    maximum,
    modulus,
    negative,
    store,
)
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state
from hpcsweep.solvers.flow.state.tables import ECONOMISATION, N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.workspace import N_TERMS
from hpcsweep.solvers.flow.step.constraint import constrain_field

ONLY_FREE, WHOLE = np.uint64(1), np.uint64(2)
"""What there is of fields: that of the empty set, or that of the present one, too."""
NEGLIGIBLE = 1e-17
"""Size of a term, in the largest of the first ones, from which on they are left out."""


def about_start(count: int) -> np.ndarray:
    """Return (s / h)^k, k < `count`, as polynomials in sigma = 2 s / h - 1, a row each."""
    powers = [[math.comb(k, p) * 0.5**k for p in range(count)] for k in range(count)]
    return np.array(powers) @ ECONOMISATION[:count]


ABOUT_START = about_start(N_TERMS)
"""(N_TERMS, N_COEFFICIENTS)"""
FOURTH_OF_TERMS = np.array([math.perm(k, 4) for k in range(N_TERMS)], float)
"""Factors of the terms in what bounds the fourth derivative, in steps."""


@kernel
def write_field(key, model, out):
    """Write y'' of all rows in the augmented state, (N, R) or more columns, for a set."""
    reactions = local_matrix(model.contacts.bounce.shape[0], out.shape[0])
    _write_free_field(model, out)
    slopes = local_vector(model.elements.stiffness.shape[0])
    slopes[:] = 0.0
    _add_set(key, slopes, model, out)
    constrain_field(key, model, out, reactions)


@kernel
def _write_free_field(model, out):
    """Write the field of the empty set."""
    n_rows = model.stiffness.shape[0]
    elements = model.elements
    last = out.shape[0] - 1
    loads = last - elements.stiffness.shape[0]
    for i in range(n_rows):
        for j in range(n_rows):
            out[j, i] = -model.stiffness[i, j]
            out[n_rows + j, i] = -model.damping[i, j]
        for pair in range(2 * n_rows, loads, 2):
            out[pair, i], out[pair + 1, i] = model.forcing[i], 0.0
        for j in range(elements.stiffness.shape[0]):
            out[loads + j, i] = elements.stiffness[j] * elements.kick[j, i]
        out[last, i] = 0.0


@kernel
def _add_set(key, slopes, model, out):
    """Add the contacts that push to the field of the empty set, and sliders that slip or soften."""
    n_rows = model.stiffness.shape[0]
    contacts, elements = model.contacts, model.elements
    last = out.shape[0] - 1
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
        if key & contact_bit(contacts.row.shape[0] + j) == np.uint64(0):
            continue
        taken = elements.stiffness[j] * (1.0 - slopes[j])
        for k in range(elements.reach.shape[1]):
            if elements.reach[j, k] == 0.0:
                continue
            for i in range(n_rows):
                out[k, i] += taken * elements.kick[j, i] * elements.reach[j, k]


@kernel
def accelerations_of(x, key, model, series, out):
    """Evaluate y'' of all rows, padded, in an augmented state for a set."""
    renew(key, model, series)
    width = out.shape[0]
    for i in range(0, width, LANES):
        combine(out, i, ZERO, 0, 1.0, series.field, i, width, x, 0, x.shape[0])


@inlined
def renew(key, model, series):
    """Write the field of a set, if it is not there."""
    if series.key[0] != key or series.key[1] != WHOLE:
        if series.key[1] < ONLY_FREE:
            _write_free_field(model, series.free)
        for at in range(0, series.free.size, LANES):
            store(series.field, at, load(series.free, at))
        _add_set(key, series.slope, model, series.field)
        constrain_field(key, model, series.field, series.reactions)
        series.key[0], series.key[1] = key, WHOLE


@kernel
def expand_series(key, h, model, step):
    """Write the terms of a step of at most h from ``step.x``, and ``step.bounds``.

    Returns
    -------
    float
        Its length.
    """
    series, terms, size = step.series, step.series.terms, step.expanded.shape[0]
    renew(key, model, series)
    start, flat = size // 2, terms.shape[1]
    copy_state(step.x[:size], terms[0])
    _write_term(1, h, step.x, series, size)
    _write_term(2, h, step.x, series, size)
    largest = load(ZERO, 0)
    for k in range(3):
        for i in range(0, series.field.shape[1], LANES):
            largest = greatest(largest, modulus(load(terms, k * flat + start + i)))
    limit, count = NEGLIGIBLE * maximum(largest), 3
    while count < N_TERMS and not _converged(count, start, limit, series):
        _write_term(count, h, step.x, series, size)
        count += 1
    while not _converged(count, start, limit, series):
        h, limit = 0.5 * h, 0.5 * limit
        for k in range(count):
            for i in range(size):
                terms[k, i] *= 0.5**k
    series.count[0] = count
    for row in range(size):
        step.expanded[row] = False
    rate = 1.0 / (h * h)
    for i in range(0, step.bounds.shape[0], LANES):
        bound = load(ZERO, 0)
        for k in range(4, count):
            bound = fma(modulus(load(terms, k * flat + i)), FOURTH_OF_TERMS[k], bound)
        store(step.bounds, i, bound * (rate * rate))
    return h


@kernel
def expand_term_row(row, series, out):
    """Write the polynomial of a row along the present step into its row of `out`."""
    for p in range(0, N_COEFFICIENTS, LANES):
        value = load(ZERO, 0)
        for k in range(series.count[0]):
            power = load(ABOUT_START, k * N_COEFFICIENTS + p)
            value = fma(power, series.terms[k, row], value)
        store(out, row * N_COEFFICIENTS + p, value)


@kernel
def sum_series(ratio, series, wide, out):
    """Write the state at that part of the present step, padded, then without that."""
    terms, flat = series.terms, series.terms.shape[1]
    for i in range(0, wide.shape[0], LANES):
        value = load(ZERO, 0)
        for k in range(series.count[0] - 1, -1, -1):
            value = fma(value, ratio, load(terms, k * flat + i))
        store(wide, i, value)
    for row in range(out.shape[0]):
        out[row] = wide[row]


@inlined
def _write_term(count, h, x, series, size):
    """Write a term, behind those that there are."""
    terms, field, early = series.terms, series.field, local_vector(LANES)
    flat, width = terms.shape[1], field.shape[1]
    before, rate, half = (count - 1) * flat, h / count, size // 2
    for i in range(0, width, LANES):
        store(terms, before + flat + i, load(terms, before + half + i) * rate)
    slope = h * rate * x[size + 1]
    for i in range(0, width, LANES):
        at = before + flat + half + i
        if count == 1:
            combine(terms, at, ZERO, 0, rate, field, i, width, x, 0, x.shape[0])
        elif count == 2:
            store(early, 0, load(field, size * width + i) * slope)
            combine(terms, at, early, 0, rate, field, i, width, terms, before, size)
        else:
            combine(terms, at, ZERO, 0, rate, field, i, width, terms, before, size)


@inlined
def _converged(count, start, limit, series):
    """Return whether the speeds of the last two terms are at most a limit, or no numbers."""
    terms, flat = series.terms, series.terms.shape[1]
    for k in range(count - 2, count):
        for i in range(0, series.field.shape[1], LANES):
            if negative(limit - modulus(load(terms, k * flat + start + i))) != 0:
                return False
    return True
