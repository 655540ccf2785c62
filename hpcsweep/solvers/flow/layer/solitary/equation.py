r"""A step with one contact in its layer: its integral equation and its tables.

The integral equation of a step with one contact alone in its layer
-------------------------------------------------------------------
Let no other contact change, so that without the force of this one, or with its spring on all the
time, the motion is the linear one of a contact set, x' = M x. With it (variation of constants, e
what a unit impulse of the contact does)

    x(t) = exp(M t) x_0 - int_0^t exp(M (t - s)) e f(s) ds,      f = beta S(rho d) d - c d,

d the distance past the stop, c = 0 where the step starts before the stop and c = beta where it
starts beyond it, and M that of the set without or with the contact: a Volterra integral equation
for a single function. f is replaced by the polynomial through its values at the Gauss nodes c_j of
the step,

    d_j = d(exp(M c_j h) x_0) - sum_k W_jk f(d_k),

from `tables`, and solved by iteration: k iterations reduce an error of f to at most (h^2 |df/dd|)^k
/ (2 k)! of its size. The nodes make the state at the end right to the order of their rule, 2
N_NODES, as for the collocation of differential equations (exponential collocation: M. Hochbruck and
A. Ostermann, Appl. Numer. Math. 53 (2005) 323). All that is linear is exact.

The error of the Gauss rule is of the order of the square of that of the polynomial, which is
measured at both ends of the step, where f is known.

Tables of a step with one contact in its layer: responses to the state and to the force
---------------------------------------------------------------------------------------
For the linear motion exp(M s) of a contact set, the unit impulse e of the contact, and a step h,
with the Gauss nodes c_j of `solitary_rule` and their Lagrange polynomials l_k on [0, 1]::

    linear:    the distance at the nodes, d exp(M c_j h) x
    response:  its change by a unit force at node k, int_0^(c_j h) d exp(M (c_j h - s)) e l_k ds
    step:      the state at the end, exp(M h) x
    kick:      its change by a unit force at node k, w_k h exp(M (1 - c_k) h) e

exp(M s) is that of `flow.tables`, of degree 15 in s, so that the Gauss rule of as many nodes on
[0, c_j h] integrates the response exactly. The steps are h 2^(-l / 2), h the step of the table of c
and l = 0, 1, .., so that each table serves often.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, entry_point
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    greatest,
    load,
    maximum,
    modulus,
    store,
    total,
)
from hpcsweep.model.contact import contact_force, contact_forces, contact_stiffnesses
from hpcsweep.solvers.flow.linear.polynomials import evaluate
from hpcsweep.solvers.flow.rules.solitary_rule import (
    AT_END,
    AT_START,
    LAGRANGE,
    N_NODES,
    NODES,
    WEIGHTS,
)
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import distance, start
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO, forget

GOES_ON, CONVERGED, FAILED = range(3)
"""What `judged` says of an iteration."""
MAX_ITERATIONS = 60
ROUNDING = 2e-17
"""Remaining error of the distances (gaps): that of displacements about the gap is 1e-16."""
VARIED = 1e-13
"""Last change of a variation of the distances, relative."""
MEASURED = 0.1
"""Measured error of a step, over h times the square of the error of extrapolation to its ends (over
beta / rho): 0.05 to 0.3 where that is 1e-9, less where it is smaller."""
TINY = 1e-300


@inlined
def _forces(d, beta, rho, linear):
    """Evaluate f of Lanes; `linear` is the stiffness within the linear motion."""
    return fma(d, -linear, contact_forces(d, beta, rho))


@inlined
def less_responses(low, high, table, place, forces):
    """Return distances, in two registers, less the responses to `forces` at the nodes."""
    first = place * N_NODES * N_NODES
    low_odd, high_odd = load(ZERO, 0), load(ZERO, 0)
    for k in range(0, N_NODES, 2):
        at = first + k * N_NODES
        even, odd = -forces[k], -forces[k + 1]
        low = fma(load(table, at), even, low)
        high = fma(load(table, at + LANES), even, high)
        low_odd = fma(load(table, at + N_NODES), odd, low_odd)
        high_odd = fma(load(table, at + N_NODES + LANES), odd, high_odd)
    return low + low_odd, high + high_odd


@inlined
def largest_of(low, high):
    """Return the largest modulus."""
    return maximum(greatest(modulus(low), modulus(high)))


@inlined
def _state_at_end(place, x, width, responses, forces, out):
    """Write the state at the end of a step into `out`, of `width` components of x."""
    size, rows = x.shape[0], responses.step.shape[2]
    for row in range(0, rows, LANES):
        at = place * size * rows + row
        combine(out, row, ZERO, 0, 1.0, responses.step, at, rows, x, 0, width)
        at = place * N_NODES * rows + row
        combine(out, row, out, row, -1.0, responses.kick, at, rows, forces, 0, N_NODES)


@inlined
def take_step(contact, place, h, stiffness, linear, z, shared):
    """Take a step whose table is at `place`, from z and ``work.forcing``, to ``work.z_end``.

    Parameters
    ----------
    contact, place : int
    h : float
        Length of the step.
    stiffness : float
        Largest |df/dd| expected.
    linear : float
        Stiffness of the contact in the linear motion: 0 or beta.
    z : ndarray, shape (2R,)
    shared : Shared

    Returns
    -------
    float
        Estimated error of the velocity of the contact; inf if the iteration has not converged.
    """
    model, responses, work = shared.model, shared.responses, shared.work
    contacts, rho = model.contacts, model.rho
    beta, gap = contacts.beta[contact], contacts.gap[contact]
    solitary = work.solitary
    x, free, forces, distances = work.x, solitary.free, solitary.forces, solitary.x
    start(x, z, work.forcing)
    size = x.shape[0]
    first = place * size * N_NODES
    x0 = distance(contact, z, contacts)
    force = contact_force(x0, beta, rho) - linear * x0
    for block in range(0, N_NODES, LANES):
        combine(free, block, ZERO, 0, 1.0, responses.linear, first + block, N_NODES, x, 0, size)
        unforced = load(free, block) - gap
        store(free, block, unforced)
        t = load(NODES, block) * h
        store(distances, block, fma(t * t, -0.5 * force, unforced))
    low, high = load(distances, 0), load(distances, LANES)
    square = h * h * stiffness
    previous = math.inf
    for iteration in range(MAX_ITERATIONS):
        store(forces, 0, _forces(low, beta, rho, linear))
        store(forces, LANES, _forces(high, beta, rho, linear))
        old_low, old_high = low, high
        low, high = load(free, 0), load(free, LANES)
        low, high = less_responses(low, high, responses.response, place, forces)
        change = largest_of(low - old_low, high - old_high)
        outcome = judged(change, previous, iteration, square)
        if outcome == FAILED:
            return math.inf
        if outcome == CONVERGED:
            break
        previous = change
    else:
        return math.inf
    store(distances, 0, low)
    store(distances, LANES, high)
    low, high = _forces(low, beta, rho, linear), _forces(high, beta, rho, linear)
    store(forces, 0, low)
    store(forces, LANES, high)
    _state_at_end(place, x, size, responses, forces, work.wide)
    for i in range(z.shape[0]):
        work.z_end[i] = work.wide[i]
    x1 = distance(contact, work.z_end, contacts)
    end = contact_force(x1, beta, rho) - linear * x1
    return error_of_rule(h, low, high, force, end, beta / rho)


@inlined
def judged(change, previous, iteration, square):
    """Return whether an iteration for forces has `CONVERGED`, has `FAILED`, or `GOES_ON`.

    Parameters
    ----------
    change, previous : float
        Largest changes of a distance by this iteration, counted from 0, and by the one before.
    square : float
        h^2 times the largest |df/dd|.
    """
    if not change < math.inf:
        return FAILED
    # the next change is smaller by at least
    ratio = square / ((2 * iteration + 3) * (2 * iteration + 4))
    if change * min(ratio, 1.0) <= ROUNDING:
        return CONVERGED
    if ratio < 0.5 and change >= previous:
        return CONVERGED if change <= 100.0 * ROUNDING else FAILED
    return GOES_ON


@inlined
def error_of_rule(h, low, high, first, last, most):
    """Estimate the error of the integral of a force over a step by its nodes; see the module.

    Parameters
    ----------
    h : float
    low, high : Lanes
        The force at the nodes, `first` and `last` that at the ends.
    most : float
        Largest scale to which the error of extrapolation is compared.
    """
    early = total(fma(load(AT_START, 0), low, load(AT_START, LANES) * high))
    late = total(fma(load(AT_END, 0), low, load(AT_END, LANES) * high))
    extrapolated = max(abs(early - first), abs(late - last))
    scale = max(min(largest_of(low, high), most), TINY)
    return MEASURED * h * extrapolated * min(extrapolated / scale, 1.0)


@inlined
def solitary_tangent(contact, place, linear, model, responses, work, tangent):
    """Multiply `tangent` by the tangent map of the step that `take_step` has taken, in place."""
    rho, beta = model.rho, model.contacts.beta[contact]
    solitary = work.solitary
    x, free, forces = work.x, solitary.free, solitary.forces
    slope_low = contact_stiffnesses(load(solitary.x, 0), beta, rho) - linear
    slope_high = contact_stiffnesses(load(solitary.x, LANES), beta, rho) - linear
    size, width = x.shape[0], tangent.shape[0]
    first = place * size * N_NODES
    for column in range(tangent.shape[1]):
        for i in range(width):
            x[i] = tangent[i, column]
        for block in range(0, N_NODES, LANES):
            at = first + block
            combine(free, block, ZERO, 0, 1.0, responses.linear, at, N_NODES, x, 0, width)
        low, high = load(free, 0), load(free, LANES)
        for _ in range(MAX_ITERATIONS):
            store(forces, 0, slope_low * low)
            store(forces, LANES, slope_high * high)
            old_low, old_high = low, high
            low, high = load(free, 0), load(free, LANES)
            low, high = less_responses(low, high, responses.response, place, forces)
            change = largest_of(low - old_low, high - old_high)
            if not change > VARIED * largest_of(low, high):
                break
        store(forces, 0, slope_low * low)
        store(forces, LANES, slope_high * high)
        _state_at_end(place, x, width, responses, forces, work.wide)
        for i in range(width):
            tangent[i, column] = work.wide[i]


@inlined
def response_table(index, contact, level, packed, responses):
    """Return the table of such a step, without a call where it exists."""
    place = responses.place[index, contact, level]
    return place if place >= 0 else build_response(index, contact, level, packed)


@kernel
def impulse_row(poly, row, contact, model, out):
    """Write row `row` of exp(M s) e of a contact, coefficients in sigma, into `out`."""
    n, n_rows = model.modal_transform.shape[0], model.stiffness.shape[0]
    for p in range(N_COEFFICIENTS):
        out[p] = 0.0
        for i in range(n):
            out[p] += poly[row, n_rows + i, p] * model.contacts.kick[contact, i]


@entry_point(INT, INT, INT, INT, BYTES)
def build_response(index, contact, level, packed):
    """Build the table of a step; return its index.

    Parameters
    ----------
    index : int
        Index of the table of the contact set.
    contact : int
    level : int
        The step is that of the table over 2^(level / 2).
    packed : ndarray of bytes
        A packed `Shared`.
    """
    shared = read_shared(packed)
    model, responses = shared.model, shared.responses
    if responses.count[0] == responses.step.shape[0]:
        forget(responses)
    place = responses.count[0]
    responses.count[0] = place + 1
    poly = shared.tables.poly[index]
    contacts = model.contacts
    row, sign = contacts.row[contact], contacts.sign[contact]
    span = 2.0 * 2.0 ** (-0.5 * level)
    h = 0.5 * span * shared.tables.h[index]
    n_rows = poly.shape[0]
    linear, response = responses.linear[place], responses.response[place]
    step, kick = responses.step[place], responses.kick[place]
    impulse, values, column = responses.impulse, responses.values, responses.column
    for x in range(poly.shape[1]):
        for block in range(0, N_NODES, LANES):
            sigma = load(NODES, block) * span - 1.0
            store(linear, x * N_NODES + block, evaluate(poly[row, x], sigma) * sign)
        for i in range(n_rows):
            step[x, i] = evaluate(poly[i, x], span - 1.0)
    for i in range(n_rows):
        impulse_row(poly, i, contact, model, impulse)
        for block in range(0, N_NODES, LANES):
            later = evaluate(impulse, (1.0 - load(NODES, block)) * span - 1.0)
            store(values, block, later * load(WEIGHTS, block) * h)
        for k in range(N_NODES):
            kick[k, i] = values[k]
    impulse_row(poly, row, contact, model, impulse)
    for j in range(N_NODES):
        part = NODES[j]
        for block in range(0, N_NODES, LANES):
            later = evaluate(impulse, (1.0 - load(NODES, block)) * (span * part) - 1.0)
            store(values, block, later * load(WEIGHTS, block) * (sign * h * part))
        for block in range(0, N_NODES, LANES):
            at = j * N_NODES * N_NODES + block
            combine(column, block, ZERO, 0, 1.0, LAGRANGE, at, N_NODES, values, 0, N_NODES)
        for k in range(N_NODES):
            response[k, j] = column[k]
    responses.place[index, contact, level] = place
    return place
