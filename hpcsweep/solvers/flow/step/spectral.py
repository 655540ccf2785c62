r"""Linear motion of large structures in the modes of the free one: without a table of each set.

A contact set of R rows has a table of 64 R^2 numbers for polynomials alone, which takes the time of
hundreds of steps to build, is met once or twice, and is read from memory at each event. From
`LARGE` rows on steps need none. In modal coordinates q of the free structure, u = Phi q, the
springs of a set c are of low rank, one for each contact that is closed,

    q'' = -Lambda q - Gamma q' + Phi^-1 f G - sum_c (beta_k x_k + drag_k x_k') Phi^-1 e_k,

so that a term of the Taylor series of all modes about the start of a step,

    Q_(k+1) = h Q'_k / (k + 1),        Q'_(k+1) = h / (k + 1) (q'' of the terms k),

takes the time of n (2 + 2 |c|) products where Gamma = Phi^-1 D Phi is diagonal (modal and Rayleigh
damping), and n^2 more where it is not. A slider that slips is one more term, of the opposite sign.

What a step costs beyond these terms are the states at its ends, 2 n^2 products each, and the rows
that are looked at: the terms of a row are those of the modes times its shares of them, economised
to the polynomials that all searches use (`series`). So all that is searched and measured along a
step is the same. That a row need not be looked at follows from the states at both ends and a bound
of |y''''| by the terms of the modes, of absolute accelerations likewise; where a contact may close,
the bound is that of its row's own polynomial. Both are of this motion.

Steps have the length h = theta / w of tables, w a bound of |lambda| of the set: the square of w is
at most the largest eigenvalue of the free structure and the largest sum of a row of sqrt(kappa_k
kappa_l) |d_k M^-1 d_l| over closed contacts. The terms theta^k / k! grow to 7 at theta = 3.6, which
costs three bits; those beyond `N_FREE` and `N_CLOSED` are below 3e-16 and 3e-17.

The tangent map multiplies column by column, without a matrix. That of free flight with a diagonal
Gamma is known in closed form for any time.
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
    store,
    total,
)
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state
from hpcsweep.solvers.flow.state.tables import FEW, N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.workspace import N_CLOSED
from hpcsweep.solvers.flow.step.forcing import n_pairs
from hpcsweep.solvers.flow.step.polynomials import FOURTH, fourth_derivative
from hpcsweep.solvers.flow.step.series import about_start

N_FREE = 24
"""Terms of a step of free flight."""
STATE, TANGENT = range(2)
"""Places of terms: of the present step, and of a tangent vector along it."""
ABOUT_START = about_start(N_CLOSED)
"""(N_CLOSED, N_COEFFICIENTS): (s / h)^k as polynomials in sigma = 2 s / h - 1."""
BY_POWER = np.ascontiguousarray(ABOUT_START.T)
FALLING = np.array([[math.perm(k, m) for k in range(N_CLOSED)] for m in (4, 5)], float)
"""Of the terms of displacements in their fourth, of speeds in their fifth derivative."""
NEARLY_CRITICAL = 1e-3
"""Square of an angle below which its sine and cosine are series."""


@kernel
def _dot(a, i, b, j, size):
    """Return the sum of the products of a[i:] and b[j:], flat; the size is one of `LANES`."""
    even, odd = load(ZERO, 0), load(ZERO, 0)
    pairs = size - size % (2 * LANES)
    for p in range(0, pairs, 2 * LANES):
        even = fma(load(a, i + p), load(b, j + p), even)
        odd = fma(load(a, i + p + LANES), load(b, j + p + LANES), odd)
    if pairs < size:
        even = fma(load(a, i + pairs), load(b, j + pairs), even)
    return total(even + odd)


@kernel
def modes_of(z, half, spectrum, out):
    """Write the modal coordinates and speeds of a state of so many rows."""
    n, width = spectrum.to_modes.shape
    for p in range(0, width, LANES):
        combine(out, p, ZERO, 0, 1.0, spectrum.to_modes, p, width, z, 0, n)
        combine(out, width + p, ZERO, 0, 1.0, spectrum.to_modes, p, width, z, half, n)


@inlined
def _next_forcing(rate, model, pairs):
    """Return a term of the forcing, and make pairs those of the next one."""
    ground = 0.0
    for k in range(0, pairs.shape[0], 2):
        sine, cosine = pairs[k], pairs[k + 1]
        ground += sine
        rise, fall = rate, 0.0
        if model.ramp.shape[0] == 0:
            rise = fall = rate * model.harmonics[k // 2, 0] * model.omega
        pairs[k], pairs[k + 1] = rise * cosine, -fall * sine
    return ground


@kernel
def write_forcing(h, x, first, model, out):
    """Write the polynomial of G along a step of length h from the pairs in x[first:]."""
    pairs = local_vector(n_pairs(model))
    copy_state(x[first : first + pairs.shape[0]], pairs)
    for p in range(N_COEFFICIENTS):
        out[p] = 0.0
    for k in range(N_CLOSED):
        ground = _next_forcing(h / (k + 1), model, pairs)
        for p in range(N_COEFFICIENTS):
            out[p] += ground * ABOUT_START[k, p]


@inlined
def _add_pushes(key, at, constant, model, spectrum, modal, x):
    """Add what contacts and sliders do by the terms at a place of all, flat, to those that follow.

    `constant` tells whether they have what does not depend on the terms.
    """
    width, contacts, terms = spectrum.squares.shape[0], model.contacts, modal.terms
    m, n_sliders, to = contacts.row.shape[0], model.elements.stiffness.shape[0], at + 3 * width
    for k in range(m):
        if key & contact_bit(k) == np.uint64(0):
            continue
        row, sign = contacts.row[k] * width, contacts.sign[k]
        push = contacts.beta[k] * sign * _dot(spectrum.shapes, row, terms, at, width)
        if contacts.edges[k, DRAG] > 0.0:
            rise = _dot(spectrum.shapes, row, terms, at + width, width)
            push += contacts.edges[k, DRAG] * sign * rise
        if constant:
            push -= contacts.beta[k] * contacts.gap[k]
        _add(terms, to, -push, spectrum.kicks, k * width, width)
    for j in range(n_sliders):
        push = x[x.shape[0] - 1 - n_sliders + j] if constant else 0.0
        if key & contact_bit(m + j) != np.uint64(0):
            push += _dot(spectrum.slides, j * width, terms, at, width)
        if push != 0.0:
            _add(terms, to, push, spectrum.kicks, (m + j) * width, width)


@kernel
def _write_terms(key, place, h, forced, model, spectrum, modal, x):
    """Write the terms that follow those of the start, with or without what acts from outside."""
    width = spectrum.squares.shape[0]
    pairs, terms, half = local_vector(n_pairs(model)), modal.terms, 2 * model.stiffness.shape[0]
    for k in range(pairs.shape[0]):
        pairs[k] = x[half + k] if forced else 0.0
    for term in range(modal.count[0] - 1):
        rate, at = h / (term + 1), (place * terms.shape[1] + term) * 2 * width
        to = at + 2 * width
        ground = _next_forcing(rate, model, pairs)
        for p in range(0, width, LANES):
            speed = load(terms, at + width + p)
            store(terms, to + p, speed * rate)
            force = fma(load(spectrum.forcing, p), ground, load(spectrum.rates, p) * speed)
            store(terms, to + width + p, force - load(spectrum.squares, p) * load(terms, at + p))
        for j in range(spectrum.damping.shape[0]):
            drag = _dot(spectrum.damping, j * width, terms, at + width, width)
            terms[place, term + 1, width + j] -= drag
        _add_pushes(key, at, forced and term == 0, model, spectrum, modal, x)
        for p in range(0, width, LANES):
            store(terms, to + width + p, load(terms, to + width + p) * rate)


@inlined
def _add(out, o, factor, table, t, size):
    """Add a multiple of table[t:] to out[o:], flat."""
    for p in range(0, size, LANES):
        store(out, o + p, fma(load(table, t + p), factor, load(out, o + p)))


@kernel
def write_modal_row(row, half, spectrum, modal, rows):
    """Write the polynomial of a row, of `half` rows of displacements and as many of speeds."""
    width, count, values = spectrum.squares.shape[0], modal.count[0], local_vector(N_CLOSED)
    first, i = (width, row - half) if row >= half else (0, row)
    for k in range(count):
        values[k] = _dot(spectrum.shapes, i * width, modal.terms, 2 * k * width + first, width)
    _write_polynomial(row, count, values, rows)


@inlined
def _write_polynomial(row, count, values, rows):
    """Write that with so many terms."""
    for p in range(0, N_COEFFICIENTS, LANES):
        at, about = row * N_COEFFICIENTS + p, ABOUT_START
        combine(rows, at, ZERO, 0, 1.0, about, p, N_COEFFICIENTS, values, 0, count)


@kernel
def write_modes(modal, rows):
    """Write the polynomials of the modal coordinates along the present step."""
    values = local_vector(N_CLOSED)
    for j in range(rows.shape[0]):
        for k in range(modal.count[0]):
            values[k] = modal.terms[STATE, k, j]
        _write_polynomial(j, modal.count[0], values, rows)


@kernel
def write_accelerations(s, h, count, spectrum, modal, out):
    """Write y'' of the first `count` rows at time s, and its rate, `LANES` of each in turns."""
    width, ratio, rate = spectrum.squares.shape[0], s / h, 1.0 / h
    bends = local_vector(2 * width)
    for p in range(0, width, LANES):
        rise, bend = load(ZERO, 0), load(ZERO, 0)
        for k in range(modal.count[0] - 1, 0, -1):
            term = load(modal.terms, (2 * k + 1) * width + p) * (k * rate)
            bend = fma(bend, ratio, rise)
            rise = fma(rise, ratio, term)
        store(bends, p, rise)
        store(bends, width + p, bend * rate)
    for i in range(count):
        at = i + i // LANES * LANES
        out[at] = _dot(spectrum.shapes, i * width, bends, 0, width)
        out[at + LANES] = _dot(spectrum.shapes, i * width, bends, width, width)


@kernel
def bound_by_terms(order, h, count, spectrum, modal, out):
    """Bound |d^4/ds^4| of y, `order` 4, or of y'', 5, of the first `count` rows on the step."""
    width = spectrum.squares.shape[0]
    first, bounds = (order - 4) * width, local_vector(width)
    for p in range(0, width, LANES):
        value = load(ZERO, 0)
        for k in range(order, modal.count[0]):
            term = modulus(load(modal.terms, 2 * k * width + first + p))
            value = fma(term, FALLING[order - 4, k], value)
        store(bounds, p, value * h**-order)
    for i in range(count):
        value = load(ZERO, 0)
        for p in range(0, width, LANES):
            value = fma(modulus(load(spectrum.shapes, i * width + p)), load(bounds, p), value)
        out[i] = total(value)


@kernel
def bound_rows(h, spectrum, step):
    """Write ``step.bounds`` of all rows, if they are not, by the bounds of the modes."""
    modal = step.spectral
    if modal.count[1] == 0:
        modal.count[1] = 1
        bound_by_terms(4, h, spectrum.shapes.shape[0], spectrum, modal, step.bounds)


@kernel
def _evaluate(place, ratio, modal, out):
    """Write the modal coordinates and speeds at that part of a step."""
    size, terms = out.shape[0], modal.terms
    first = place * terms.shape[1] * size
    for p in range(0, size, LANES):
        value = load(terms, first + (modal.count[0] - 1) * size + p)
        for k in range(modal.count[0] - 2, -1, -1):
            value = fma(value, ratio, load(terms, first + k * size + p))
        store(out, p, value)


@kernel
def write_rows(modes, spectrum, out):
    """Write all rows of a state by its modal coordinates and speeds."""
    (n, rows), (half, width) = spectrum.columns.shape, spectrum.shapes.shape
    wide = local_vector(rows)
    for part in range(2):
        for p in range(0, rows, LANES):
            combine(wide, p, ZERO, 0, 1.0, spectrum.columns, p, rows, modes, part * width, n)
        copy_state(wide[:half], out[part * half :])


@kernel
def modal_step(index, tau, end, model, tables, step):
    """Expand a step of table `index` from ``step.x`` at tau; its modes at the end go to ``end``.

    Where a step begins at the end of the last one, in time and set, its modes are those there.
    """
    spectrum, modal, half = tables.spectrum, step.spectral, step.z_end.shape[0] // 2
    key, h = tables.keys[index], tables.h[index]
    if continues(index, tau, modal):
        copy_state(modal.end, modal.terms[STATE, 0])
    else:
        modes_of(step.x, half, spectrum, modal.terms[STATE, 0])
    modal.chain[0], modal.chain[1] = end, index
    modal.count[0], modal.count[1] = N_FREE if key == np.uint64(0) else N_CLOSED, 0
    _write_terms(key, STATE, h, True, model, spectrum, modal, step.x)
    _evaluate(STATE, 1.0, modal, modal.end)


@kernel
def bound_contacts(h, model, spectrum, step):
    """Write ``step.bounds`` of the rows of contacts along the present step."""
    modal, rows = step.spectral, model.contacts.row
    count, m = modal.count[0], rows.shape[0]
    if m <= FEW:
        for k in range(m):
            row, half = rows[k], step.z_end.shape[0] // 2
            write_modal_row(row, half, spectrum, modal, step.rows)
            step.bounds[row] = fourth_derivative(step.rows[row : row + 1], h)
        return
    (n, width), flat = spectrum.stops.shape, modal.terms.shape[2]
    sums = local_matrix(N_CLOSED + 1, LANES)
    for first in range(0, width, LANES):
        for k in range(count):
            at, stops = k * LANES, spectrum.stops
            combine(sums, at, ZERO, 0, 1.0, stops, first, width, modal.terms, k * flat, n)
        bound, last = load(ZERO, 0), N_CLOSED * LANES
        for p in range(4, N_COEFFICIENTS):
            combine(sums, last, ZERO, 0, 1.0, sums, 0, LANES, BY_POWER, p * N_CLOSED, count)
            bound = fma(modulus(load(sums, last)), FOURTH[p], bound)
        store(sums, last, bound * (2.0 / h) ** 4)
        for k in range(first, min(first + LANES, m)):
            step.bounds[rows[k]] = sums[N_CLOSED, k - first]


@kernel
def spectral_step(index, tau, end, model, tables, step):
    """Expand a step of table `index` from tau to `end`; write ``step.wide``."""
    modal_step(index, tau, end, model, tables, step)
    write_rows(step.spectral.end, tables.spectrum, step.wide)


@kernel
def ends_of_contacts(model, spectrum, modes, wide):
    """Write into `wide` where contacts are in a state of modes."""
    places, width = model.contacts.places, spectrum.squares.shape[0]
    for k in range(places.shape[0]):
        row = model.contacts.row[k] * width
        wide[places[k, 0]] = _dot(spectrum.shapes, row, modes, 0, width)
        wide[places[k, 1]] = _dot(spectrum.shapes, row, modes, width, width)


@inlined
def continues(index, tau, modal):
    """Return whether ``modal.end`` are the modes at tau, in the set of table `index`."""
    return tau > 0.0 and modal.chain[0] == tau and modal.chain[1] == index


@kernel
def modal_state(s, h, spectrum, modal, out):
    """Write the state at time s of the present step, of length h."""
    modes = local_vector(2 * spectrum.squares.shape[0])
    _evaluate(STATE, s / h, modal, modes)
    write_rows(modes, spectrum, out)


@kernel
def spectral_tangent(index, s, n_steps, tangent, model, tables, modal):
    """Multiply `tangent` by exp(M s) to the power `n_steps` of table `index`, in place."""
    spectrum, half = tables.spectrum, tangent.shape[0] // 2
    key, h = tables.keys[index], tables.h[index]
    exact = key == np.uint64(0) and spectrum.damping.shape[0] == 0
    width = spectrum.squares.shape[0]
    vector, e, moved = local_vector(2 * half), local_matrix(4, width), local_vector(2 * width)
    if exact:
        _write_exponential(s * n_steps, spectrum, e)
    kept = modal.count[0]
    modal.count[0] = N_FREE if key == np.uint64(0) else N_CLOSED
    for column in range(tangent.shape[1]):
        for i in range(2 * half):
            vector[i] = tangent[i, column]
        if exact:
            modes_of(vector, half, spectrum, modal.terms[TANGENT, 0])
            for p in range(0, width, LANES):
                first = modal.terms.shape[1] * 2 * width + p
                q, v = load(modal.terms, first), load(modal.terms, first + width)
                store(moved, p, fma(load(e, p), q, load(e, width + p) * v))
                more = load(e, 3 * width + p) * v
                store(moved, width + p, fma(load(e, 2 * width + p), q, more))
            write_rows(moved, spectrum, vector)
        else:
            for _ in range(n_steps):
                modes_of(vector, half, spectrum, modal.terms[TANGENT, 0])
                _write_terms(key, TANGENT, h, False, model, spectrum, modal, vector)
                _evaluate(TANGENT, s / h, modal, moved)
                write_rows(moved, spectrum, vector)
        for i in range(2 * half):
            tangent[i, column] = vector[i]
    modal.count[0] = kept


@kernel
def _write_exponential(t, spectrum, out):
    """Write exp of a time t of each mode of free flight: q of q and of q', q' of both."""
    for j in range(out.shape[1]):
        square, half = spectrum.squares[j], -0.5 * spectrum.rates[j]
        inner = square - half * half
        angle = inner * t * t
        if abs(angle) < NEARLY_CRITICAL:
            cosine = 1.0 - angle * (0.5 - angle * (1.0 / 24.0 - angle / 720.0))
            sine = 1.0 - angle * (1.0 / 6.0 - angle * (1.0 / 120.0 - angle / 5040.0))
            decay = math.exp(-half * t)
            cosine, sine = cosine * decay, sine * t * decay
        elif inner > 0.0:
            decay, w = math.exp(-half * t), math.sqrt(inner)
            cosine, sine = decay * math.cos(w * t), decay * math.sin(w * t) / w
        else:
            w = math.sqrt(-inner)
            slow, fast = math.exp((w - half) * t), math.exp(-(w + half) * t)
            cosine, sine = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
        out[0, j], out[1, j] = fma(half, sine, cosine), sine
        out[2, j], out[3, j] = -square * sine, fma(-half, sine, cosine)
