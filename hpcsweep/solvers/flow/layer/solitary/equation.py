r"""The integral equation of a step with one contact alone in its layer.

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
"""

import math

from hpcsweep.kernels.compile import inlined
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
from hpcsweep.solvers.flow.rules.solitary_rule import AT_END, AT_START, N_NODES, NODES
from hpcsweep.solvers.flow.state.augmented import start
from hpcsweep.solvers.flow.state.contacts import distance
from hpcsweep.solvers.flow.state.tables import ZERO

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
def less_responses(free, table, place, forces):
    """Return the distances `free` less the responses to `forces` at the nodes, in two registers."""
    first = place * N_NODES * N_NODES
    low, high = load(free, 0), load(free, LANES)
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
def _largest_of(low, high):
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
def take_step(contact, place, h, stiffness, linear, z, model, responses, work):
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
    model, responses, work

    Returns
    -------
    float
        Estimated error of the velocity of the contact; inf if the iteration has not converged.
    """
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
        low, high = less_responses(free, responses.response, place, forces)
        change = _largest_of(low - old_low, high - old_high)
        if not change < math.inf:
            return math.inf
        # the next change is smaller by at least
        ratio = square / ((2 * iteration + 3) * (2 * iteration + 4))
        if change * min(ratio, 1.0) <= ROUNDING:
            break
        if ratio < 0.5 and change >= previous:
            if change <= 100.0 * ROUNDING:
                break
            return math.inf
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
    scale = max(min(_largest_of(low, high), most), TINY)
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
            low, high = less_responses(free, responses.response, place, forces)
            change = _largest_of(low - old_low, high - old_high)
            if not change > VARIED * _largest_of(low, high):
                break
        store(forces, 0, slope_low * low)
        store(forces, LANES, slope_high * high)
        _state_at_end(place, x, width, responses, forces, work.wide)
        for i in range(width):
            tangent[i, column] = work.wide[i]
