r"""Fast passage of one contact through its layer, in closed form up to a quadrature.

With x = d . u - g the contact force, along e with d . e = 1, differs from the piecewise linear
spring beta max(x, 0) by

    r(x) = beta |x| / (1 + exp(rho |x|)),      positive, even, pushing towards the stop.

Let the contact pass x = 0 with velocity v at time 0, sigma = sign(v). To first order in r along
the true path the passage adds to the piecewise linear motion, continued to time 0,

    dz = sum_k (-1)^k / k!  (M_-^k m_k^- + M_+^k m_k^+) e,      m_k^+- = int s^k r(x(s)) ds

over the two halves (variation of constants; e moves the velocities, M_+- is the linear field
before and after). With X = |x| as integration variable ds = dX / w(X), and the speed w follows
from work and energy along the true path,

    w(X)^2 = v*^2 +- 2 sigma (a X +- j X^2 / (2 |v*|) + R(X)) - [x > 0] beta X^2,
    R(X) = int_0^X r,   upper signs after, lower before the passage,

a and j being acceleration and jerk without the contact force. At the stop itself v*^2 = v^2 + sigma
E with E = 2 R(inf) = beta pi^2 / (6 rho^2), v the speed of the linear motion: the potential step.
All integrals have the weight y / (1 + exp(y)), y = rho X, on [0, inf), for which `NODES` and
`WEIGHTS` are the Gauss rule. The expansion holds while w^2 stays near v*^2 inside the layer, which
`passage_is_fast` tests; everything else is integrated (`layer`).

The time from the stop is int dX / w. It is X over the mean q = (|v*| + w) / 2 of the speeds if w^2
is linear in X; to first order in what else is in w^2, g X^2 and +- 2 sigma R, it is longer by

    X / q (g X^2 / (12 q^2)  -+ sigma Q / (q |v*| X)),      Q(X) = int_0^X R - X R / 2,

the latter exact where R is constant already. The true motion is at the stop when the linear one is
still, or already, on its way there, at d = m_1^arriving / v*: all times s are those from the stop
and d together, and for so long the spring of the other side acts on v* d / 2 in the mean,

    m_k -> m_k + k d m_(k-1),       m_0 -> m_0 - beta |v*| d^2 / 2.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import LANES, fma, load, root, total
from hpcsweep.model.contact import FULL_POTENTIAL
from hpcsweep.solvers.flow.rules.tableau import recurrence, rule
from hpcsweep.solvers.flow.state.state import is_oblique

N_NODES = LANES
FAST = 0.9
"""Largest relative change of w^2 inside the layer for which the closed form is used: it must be
left at once. The rule is then right to 2e-14 of the impulse (tried on (1 - c y / 36)^(-1/2) and
(1 - c (y / 36)^2)^(-1/2) with c up to this)."""
NEGLECTED = 1e-12
"""Largest error (gaps, gaps omega_0) of one passage by the closed form."""


def _gauss_rule(n_nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gauss rule for the weight y / (1 + exp(y)) on [0, inf), and R and Q at its nodes.

    Of a fine discretisation of the weight: Gauss-Legendre panels to y = 90, exact to rounding.

    Returns
    -------
    nodes, weights, potential, delay : ndarray, shape (n_nodes,)
        `potential` is rho^2 / beta R(X) at the nodes, `delay` rho^2 / beta Q(X) / X.
    """
    panel, panel_weight = np.polynomial.legendre.leggauss(40)
    edges = np.linspace(0.0, 90.0, 91)
    half = 0.5 * np.diff(edges)[:, None]
    y = (edges[:-1, None] + half * (panel + 1.0)).ravel()
    measure = (half * panel_weight).ravel() * y / (1.0 + np.exp(y))
    nodes, weights = rule(*recurrence(y, measure, n_nodes))
    potential, delay = np.empty(n_nodes), np.empty(n_nodes)
    for k, node in enumerate(nodes):
        t = 0.5 * node * (panel + 1.0)
        share = 0.5 * node * panel_weight * t / (1.0 + np.exp(t))
        potential[k] = np.sum(share)
        delay[k] = np.sum(share * (1.0 - t / node)) - 0.5 * potential[k]
    return nodes, weights, potential, delay


NODES, WEIGHTS, POTENTIAL, DELAY = _gauss_rule(N_NODES)
LAST = float(NODES[-1])


@inlined
def passage_is_fast(v, a, j, contact, model):
    """Return whether the closed form holds for a passage at velocity v (see the module).

    The relative change of w^2 inside the layer, and up to the last node of the quadrature, must be
    below `FAST`. What the expansion leaves out must be below `NEGLECTED`: with t = 1 / (rho |v|),
    the impulse J and kappa = beta + |K|, for the coordinate that feels most of it
    (`Contacts.gain`), of the terms k = 4 (m_4 = 144 J t^4) those without beta^2, the terms k = 5
    (m_5 = 875 J t^5) and k = 6 (m_6 = 6100 J t^6) with their highest power of kappa; of w^2, at
    y = 3, where r has its centre of mass, jerk and spring together (an eighth: tried), and the
    fourth derivative of u and jerk and acceleration together: odd functions of time, which add up
    over both halves as far as these are uneven, and in displacements.
    """
    beta, rho, layer = model.contacts.beta[contact], model.rho, model.layer
    square = v * v
    inverse, width = 1.0 / abs(v), 1.0 / rho
    potential = 2.0 * FULL_POTENTIAL * beta * width * width
    reach = max(layer, LAST * width)
    change = (2.0 * abs(a) + (abs(j) * inverse + beta) * reach) * reach + 2.0 * potential
    if not change <= FAST * square:
        return False
    time = inverse * width
    impulse = potential * inverse * model.contacts.gain[contact]
    stiffness = model.stiffness_bound + (model.hardest if is_oblique(model.contacts) else beta)
    phase = stiffness * time * time
    fourth = 24.0 * impulse * phase * time * time
    fifth = impulse * phase * phase * (8.0 * time + 9.0 * phase)
    centre = 3.0 * time
    bend = abs(j) * centre * centre * inverse
    tilt = abs(a) * centre * inverse
    most = max(model.stiffness_bound, 4.0)
    snap = (2.0 * abs(j) + most * abs(a)) * centre**3 * inverse / 6.0
    spring = stiffness * centre * centre
    uneven = tilt + spring + 2.0 * potential * inverse * inverse + centre
    left_out = impulse * (0.125 * bend * spring + (bend * tilt + snap) * uneven)
    return fourth + fifth <= NEGLECTED and left_out <= NEGLECTED


class AtStop(NamedTuple):
    """A contact at its stop."""

    speed: float
    """|v*|"""
    slowness: float
    """1 / |v*|"""
    sign: float
    """Of v."""
    unit: float
    """beta / rho^2"""
    width: float
    """1 / rho"""
    v: float
    a: float
    j: float
    beta: float


@inlined
def at_stop(v, a, j, beta, rho):
    """Return the quantities of a contact at its stop; see `moments`."""
    width = 1.0 / rho
    unit = beta * width * width
    sign = 1.0 if v > 0.0 else -1.0
    speed = math.sqrt(v * v + sign * 2.0 * FULL_POTENTIAL * unit)
    return AtStop(speed, 1.0 / speed, sign, unit, width, v, a, j, beta)


@inlined
def _bend(side, stop):
    """Return g, the coefficient of X^2 in w^2."""
    spring = stop.beta if side > 0.0 else 0.0
    return stop.sign * stop.j * stop.slowness - spring


@inlined
def delays(side, stop, x, later):
    """Return the relative delays at the nodes, of g X^2 and of R; `later` is 1 / (|v*| + w)."""
    part = x * later
    delayed = load(DELAY, 0) * later * (-2.0 * side * stop.unit * stop.slowness)
    return part * part * (_bend(side, stop) * (1.0 / 3.0)), delayed


@inlined
def speeds(side, stop):
    """Return the distances from the stop X, the speeds w there and 1 / (|v*| + w) at the nodes."""
    x = load(NODES, 0) * stop.width
    work = fma(x, stop.a, load(POTENTIAL, 0) * stop.unit) * (2.0 * side)
    w = root(fma(x * x, _bend(side, stop), work + stop.speed * stop.speed))
    return x, w, 1.0 / (w + stop.speed)


@inlined
def half_passage(side, stop, found):
    """Return s^k r ds, k = 0 to 4, at the nodes of half a passage; see `moments` and the module.

    Parameters
    ----------
    side : float
        1 for the half at x > 0, -1 for that at x < 0.
    stop : AtStop
    found : tuple of Lanes
        Of `speeds`.
    """
    x, w, later = found
    t = x * later * (2.0 * stop.sign * side)
    bent, delayed = delays(side, stop, x, later)
    t = fma(t, bent + delayed, t)
    share = load(WEIGHTS, 0) * stop.unit / w
    first = share * t
    second = first * t
    third = second * t
    return share, first, second, third, third * t


@inlined
def sums(free, contact):
    """Sum the moments of `half_passage` over both halves.

    Returns
    -------
    tuple of float
        m_0 of both halves together; m_1, m_2, m_3 of the half at x < 0 and of that at x > 0 in
        turns; m_4 of that at x > 0.
    """
    return (
        total(free[0] + contact[0]),
        total(free[1]),
        total(contact[1]),
        total(free[2]),
        total(contact[2]),
        total(free[3]),
        total(contact[3]),
        total(contact[4]),
    )


@inlined
def since_linear(m, stop):
    """Return the moments by the time of the linear motion, for `add_kick`, of those of `sums`."""
    d = (m[1] if stop.v > 0.0 else m[2]) * (stop.sign * stop.slowness)
    return (
        fma(-0.5 * stop.beta * stop.speed * d, d, m[0]),
        fma(d, m[0], m[1] + m[2]),
        fma(2.0 * d, m[1], m[3]),
        fma(2.0 * d, m[2], m[4]),
        fma(3.0 * d, m[3], m[5]),
        fma(3.0 * d, m[4], m[6]),
        m[7],
    )


@inlined
def rates_since_linear(m, rates, faster, stop):
    """Differentiate `since_linear`: `rates` are those of m where v changes at the rate `faster`."""
    slowness = stop.sign * stop.slowness
    d = (m[1] if stop.v > 0.0 else m[2]) * slowness
    arriving = rates[1] if stop.v > 0.0 else rates[2]
    change = (arriving - d * faster * stop.v * slowness) * slowness
    return (
        rates[0] - stop.beta * stop.speed * d * change,
        rates[1] + rates[2] + d * rates[0] + change * m[0],
        rates[3] + 2.0 * (d * rates[1] + change * m[1]),
        rates[4] + 2.0 * (d * rates[2] + change * m[2]),
        rates[5] + 3.0 * (d * rates[3] + change * m[3]),
        rates[6] + 3.0 * (d * rates[4] + change * m[4]),
        rates[7],
    )


@inlined
def moments(v, a, j, beta, rho):
    """Integrate s^k r ds, k = 0 to 4, over both halves of a fast passage.

    Parameters
    ----------
    v : float
        Velocity of the linear motion at the stop.
    a, j : float
        Acceleration and jerk there without the contact force of this floor.
    beta, rho : float

    Returns
    -------
    impulse, first, second_free, second_contact, third_free, third_contact, fourth_contact : float
        m_0 and m_1 of both halves together, m_2 and m_3 of the half at x < 0 and of that at
        x > 0, m_4 of that at x > 0.
    """
    stop = at_stop(v, a, j, beta, rho)
    free = half_passage(-1.0, stop, speeds(-1.0, stop))
    contact = half_passage(1.0, stop, speeds(1.0, stop))
    return since_linear(sums(free, contact), stop)


@inlined
def add_kick(m, contact, key, model, z):
    """Add the change of the state by a passage of `contact` with the moments m to z.

    It is sum_k (-1)^k / k! M^k e m_k with M e = (e, -D e), M^2 e = (-D e, -(K + beta c) e + D^2 e),
    of M^3 e its displacements, -(K + beta c) e + D^2 e, and of its velocities what has beta in it,
    beta (c D e + D c e), and of M^4 e what has beta^2, along e. K has in it what the other contacts
    of `key` add; on e that is nothing unless they are oblique to it.
    """
    impulse, first, second_free, second_contact, third_free, third_contact, fourth_contact = m
    contacts = model.contacts
    beta = contacts.beta[contact]
    n = model.stiffness.shape[0]
    second = second_free + second_contact
    third = third_free + third_contact
    stiff = beta * third_contact / 6.0
    for i in range(n):
        damped, square = contacts.damped[contact, i], contacts.bent[contact, i]
        z[i] -= 0.5 * damped * second + square * third / 6.0
        z[n + i] += damped * first + 0.5 * square * second
        z[n + i] -= damped * stiff
    row, sign = contacts.row[contact], contacts.sign[contact]
    inner = sign * contacts.damped[contact, row]
    for p in range(contacts.first[contact], contacts.first[contact + 1]):
        i, e = contacts.push_row[p], contacts.push[p]
        z[i] -= e * (first - stiff)
        z[n + i] += e * (impulse - 0.5 * beta * second_contact)
        z[n + i] -= e * (inner * stiff)
        z[n + i] += e * (beta * beta * fourth_contact / 24.0)
    if is_oblique(contacts):
        for k in range(contacts.row.shape[0]):
            oblique = contacts.oblique[k, contact]
            if k == contact or oblique == 0.0 or not (key >> np.uint64(k)) & np.uint64(1):
                continue
            for p in range(contacts.first[k], contacts.first[k + 1]):
                square = -contacts.beta[k] * oblique * contacts.push[p]
                z[contacts.push_row[p]] -= square * third / 6.0
                z[n + contacts.push_row[p]] += 0.5 * square * second
