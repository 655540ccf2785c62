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

a and j being acceleration and jerk without the contact force. At the stop itself
v*^2 = v^2 + sigma E with E = 2 R(inf) = beta pi^2 / (6 rho^2), v the speed of the linear motion:
the potential step. All integrals have the weight y / (1 + exp(y)), y = rho X, on [0, inf), for
which `NODES` and `WEIGHTS` are the Gauss rule. The expansion holds while w^2 stays near v*^2
inside the layer; `passage_is_fast` asks for that, and everything else is integrated (`layer`).
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.vectors import LANES, fma, load, root, total
from hpcsweep.model.contact import FULL_POTENTIAL
from hpcsweep.solvers.flow.gauss import recurrence, rule

N_NODES = LANES
FAST = 0.3
"""Largest relative change of w^2 inside the layer for which the closed form is used."""
NEGLECTED = 1e-12
"""Largest error (gaps, gaps omega_0) of one passage by the closed form."""


def _gauss_rule(n_nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss rule for the weight y / (1 + exp(y)) on [0, inf), and R at its nodes.

    Of a fine discretisation of the weight: Gauss-Legendre panels to y = 90, exact to rounding.

    Returns
    -------
    nodes, weights, potential : ndarray, shape (n_nodes,)
        `potential` is rho^2 / beta R(X) at the nodes.
    """
    panel, panel_weight = np.polynomial.legendre.leggauss(40)
    edges = np.linspace(0.0, 90.0, 91)
    half = 0.5 * np.diff(edges)[:, None]
    y = (edges[:-1, None] + half * (panel + 1.0)).ravel()
    measure = (half * panel_weight).ravel() * y / (1.0 + np.exp(y))
    nodes, weights = rule(*recurrence(y, measure, n_nodes))
    potential = np.empty(n_nodes)
    for k, node in enumerate(nodes):
        t = 0.5 * node * (panel + 1.0)
        potential[k] = 0.5 * node * np.sum(panel_weight * t / (1.0 + np.exp(t)))
    return nodes, weights, potential


NODES, WEIGHTS, POTENTIAL = _gauss_rule(N_NODES)


@kernel
def passage_is_fast(v, a, j, contact, model):
    """Tell whether the closed form holds for a passage at velocity v (see the module).

    The relative change of w^2 inside the layer, on which the quadrature rests, must be below
    `FAST`. What the expansion leaves out must be below `NEGLECTED`: with t = 1 / (rho |v|), the
    impulse J and kappa = beta + |K|, for the coordinate that feels most of it (`Contacts.gain`), of
    the terms k = 4 (m_4 = 144 J t^4) those without beta^2, the
    terms k = 5 (m_5 = 875 J t^5) and k = 6 (m_6 = 6100 J t^6) with their highest power of kappa,
    and in w^2 the fourth derivative of u and the product of jerk and acceleration (at y = 3,
    where r has its centre of mass).
    """
    beta, rho, layer = model.contacts.beta[contact], model.rho, model.layer
    if rho == math.inf:
        return v != 0.0
    speed = abs(v)
    square = v * v
    change = (
        2.0 * abs(a) * layer
        + abs(j) * layer * layer / speed
        + beta * layer * layer
        + 4.0 * FULL_POTENTIAL * beta / (rho * rho)
    )
    if not change <= FAST * square:
        return False
    inverse = 1.0 / speed
    time = inverse / rho
    impulse = 2.0 * FULL_POTENTIAL * beta * time / rho * model.contacts.gain[contact]
    stiffness = model.stiffness_bound + (model.hardest if model.contacts.is_oblique else beta)
    phase = stiffness * time * time
    fourth = 24.0 * impulse * phase * time * time
    fifth = impulse * phase * phase * (8.0 * time + 9.0 * phase)
    centre = 3.0 * time
    bend = abs(j) * centre * centre * inverse
    tilt = abs(a) * centre * inverse
    snap = (2.0 * abs(j) + 4.0 * abs(a)) * centre**3 * inverse / 6.0
    left_out = impulse * (bend * (tilt + stiffness * centre * centre) + snap)
    return fourth + fifth <= NEGLECTED and left_out <= NEGLECTED


@inlined
def half_passage(side, v, a, j, beta, rho):
    """Give s^k r ds, k = 0 to 4, at the nodes of half a passage; see `moments` and the module.

    Parameters
    ----------
    side : float
        1 for the half at x > 0, -1 for that at x < 0.

    Returns
    -------
    moments : tuple of Lanes
    x, w : Lanes
        Distances from the stop, and the speeds there.
    speed : float
        |v*|
    """
    unit = beta / (rho * rho)
    sigma = 1.0 if v > 0.0 else -1.0
    square = v * v + sigma * 2.0 * unit * FULL_POTENTIAL
    speed = math.sqrt(square)
    spring = beta if side > 0.0 else 0.0
    x = load(NODES, 0) * (1.0 / rho)
    work = fma(x, a, load(POTENTIAL, 0) * unit) * (2.0 * side)
    w = root(fma(x * x, sigma * j / speed - spring, work + square))
    t = x * (2.0 * sigma * side) / (w + speed)
    share = load(WEIGHTS, 0) * unit / w
    first = share * t
    second = first * t
    third = second * t
    return (share, first, second, third, third * t), x, w, speed


@inlined
def sums(free, contact):
    """Add up what `half_passage` gives of both halves, for `add_kick`; see `moments`."""
    return (
        total(free[0] + contact[0]),
        total(free[1] + contact[1]),
        total(free[2]),
        total(contact[2]),
        total(free[3]),
        total(contact[3]),
        total(contact[4]),
    )


@kernel
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
    free, _, _, _ = half_passage(-1.0, v, a, j, beta, rho)
    contact, _, _, _ = half_passage(1.0, v, a, j, beta, rho)
    return sums(free, contact)


@kernel
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
    if contacts.is_oblique:
        for k in range(contacts.row.shape[0]):
            oblique = contacts.oblique[k, contact]
            if k == contact or oblique == 0.0 or not (key >> np.uint64(k)) & np.uint64(1):
                continue
            for p in range(contacts.first[k], contacts.first[k + 1]):
                square = -contacts.beta[k] * oblique * contacts.push[p]
                z[contacts.push_row[p]] -= square * third / 6.0
                z[n + contacts.push_row[p]] += 0.5 * square * second
