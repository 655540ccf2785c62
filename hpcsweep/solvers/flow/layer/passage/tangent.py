"""Tangent map along the motion: the product of the propagators of its segments.

The field is continuous, so a change of contact set alone adds nothing. The three kinds of
segment of `period` give

- linear: exp(M s), from the tables;
- fast passage: the kick k(z, tau) of `crossing` is applied where the linear motion reaches the
  stop, at a time that moves by dt = -dx / v with the distance x past it, v its speed. With the
  fields f_- before and f_+ after it::

      S = I + Dk - (Dk f_- + dk/dtau - M_+ k) dx^T / v,        f_+(z + k) - f_-(z) = M_+ k

  The kick depends on z through the speed v and the acceleration a (and through the jerk, so little
  that it is left out). Its moments are sums over nodes X of c t^k / w, with w(X)^2 of `crossing`
  and t = +-2 X / (|v*| + w) (1 + b + c), b and c the delays. The derivatives of these sums have the
  factors -w' / w - k ((1 + 2 b + c) (|v*|' + w') / (|v*| + w) + c |v*|' / |v*|), where, upper signs
  at x > 0,

      d|v*|/dv = v / |v*|,    dw/dv = (v - sigma j X^2 v / (2 |v*|^3)) / w,    dw/da = +-X / w;

- inside a layer: the variational equations of the collocation solution, at the same stages.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import fma, local_matrix, local_vector
from hpcsweep.solvers.flow.guard.events import coast
from hpcsweep.solvers.flow.layer.passage.crossing import (
    add_kick,
    at_stop,
    delays,
    half_passage,
    rates_since_linear,
    since_linear,
    sums,
)
from hpcsweep.solvers.flow.state.shared import LINEAR_STEPS
from hpcsweep.solvers.flow.state.state import Segment, is_oblique
from hpcsweep.solvers.flow.step.step import step_tangent


@inlined
def coast_on(segment, coasts, left, tangent, shared):
    """Take the steps of a table that no contact can end, if nothing is observed along them.

    Parameters
    ----------
    segment : Segment
    coasts : bool
        Whether that is so.
    left : int
        Steps that may be taken, with the one that follows.
    tangent : ndarray, shape (2R, m), or None
        Multiplied by the tangent map. None, in compiling: steps are taken one by one.

    Returns
    -------
    segment : Segment
        What is left.
    tried : bool
        See `coast`.
    steps : int
        Those taken, with the one that follows.
    """
    tried, steps = False, 1
    if tangent is not None and coasts:
        model, tables, work = shared.model, shared.tables, shared.work
        tau, coasted, tried = coast(segment, left - 1, model, tables, work.step)
        step_tangent(segment, segment.h, coasted, tangent, model, tables, work.step.spectral)
        kind, key, index, h, _, end = segment
        segment = Segment(kind, key, index, h, tau, end)
        shared.counts[LINEAR_STEPS] += coasted
        steps += coasted
    shared.counts[LINEAR_STEPS] += 1
    return segment, tried, steps


@inlined
def _rates(half, faster, pushed):
    """Differentiate c t^k / w, k = 0 to 4, of `half`, where v and a change at these rates."""
    powers, shares_v, times_v, shares_a, times_a = half
    shares = fma(faster, shares_v, pushed * shares_a)
    times = fma(faster, times_v, pushed * times_a)
    return (
        -1.0 * powers[0] * shares,
        -1.0 * powers[1] * (shares + times),
        -1.0 * powers[2] * fma(2.0, times, shares),
        -1.0 * powers[3] * fma(3.0, times, shares),
        -1.0 * powers[4] * fma(4.0, times, shares),
    )


@inlined
def _differentiated(side, stop):
    """Return the moments of half a passage node by node, and their derivatives.

    Parameters
    ----------
    side : float
        1 for the half at x > 0, -1 for that at x < 0.
    stop : crossing.AtStop

    Returns
    -------
    moments : tuple of Lanes
        m_0 to m_4.
    shares_v, times_v, shares_a, times_a : Lanes
        Logarithmic derivatives of w and of 1 / t by v and by a; see the module.
    """
    powers, x, w = half_passage(side, stop)
    inverse = 1.0 / w
    later = 1.0 / (w + stop.speed)
    square = stop.slowness * stop.slowness
    bend = -0.5 * stop.sign * stop.j * stop.v * square * stop.slowness
    faster = fma(x * x, bend, stop.v) * inverse
    pushed = x * inverse * side
    bent, delayed = delays(side, stop, x, later)
    share = fma(2.0, bent, delayed + 1.0)
    rising = stop.v * stop.slowness
    earlier = fma((faster + rising) * later, share, delayed * (rising * stop.slowness))
    return powers, faster * inverse, earlier, pushed * inverse, pushed * later * share


@inlined
def passage_tangent(arrival, z, a, jerk, model, tangent):
    """Multiply `tangent` by the matrix S of a fast passage, in place.

    The kick is differentiated by v and by a; for a single column in one directional derivative.

    Parameters
    ----------
    arrival : Arrival
        Its `key` is the contact set after the passage.
    z : ndarray, shape (2R,)
        State at the stop before the kick.
    a : ndarray, shape (R,)
        Accelerations there without the force of the contact.
    jerk : float
        Their derivative in its row.
    tangent : ndarray, shape (2R, m)
    """
    contact, key_after = arrival.contact, arrival.key
    contacts = model.contacts
    beta, rho = contacts.beta[contact], model.rho
    if rho == math.inf or beta == 0.0:
        return
    n, n_columns = model.stiffness.shape[0], tangent.shape[1]
    row, sign = contacts.row[contact], contacts.sign[contact]
    v, pushed_by, bend = sign * z[n + row], sign * a[row], sign * jerk
    stop = at_stop(v, pushed_by, bend, beta, rho)
    free, inside = _differentiated(-1.0, stop), _differentiated(1.0, stop)
    found = sums(free[0], inside[0])
    kicks, drift = local_matrix(3, 2 * n), local_vector(2 * n)
    kicks[:] = 0.0
    add_kick(since_linear(found, stop), contact, key_after, model, kicks[2])
    _drift_of_kick(key_after, kicks[2], model, drift)
    for column in range(n_columns):
        later = sign * tangent[row, column] / v
        # along f_- the speed changes by a and the acceleration by the jerk
        faster = sign * tangent[n + row, column] - later * pushed_by
        pushed = sign * _pushed(contact, key_after, column, tangent, model) - later * bend
        if column == 0:
            for which in range(min(n_columns, 2)):
                by_v, by_a = 1.0 - which, 0.0 + which
                if n_columns == 1:
                    by_v, by_a = faster, pushed
                rates = sums(_rates(free, by_v, by_a), _rates(inside, by_v, by_a))
                rates = rates_since_linear(found, rates, by_v, stop)
                add_kick(rates, contact, key_after, model, kicks[which])
        if n_columns == 1:
            faster, pushed = 1.0, 0.0
        for i in range(2 * n):
            tangent[i, column] += kicks[0, i] * faster + kicks[1, i] * pushed + drift[i] * later


@inlined
def _drift_of_kick(key, kick, model, drift):
    """Write M_+ k, `key` the contact set after the passage."""
    contacts, stiffness, damping = model.contacts, model.stiffness, model.damping
    n = stiffness.shape[0]
    for i in range(n):
        drift[i] = kick[n + i]
        force = 0.0
        for j in range(n):
            force -= stiffness[i, j] * kick[j] + damping[i, j] * kick[n + j]
        drift[n + i] = force
    for k in range(contacts.row.shape[0]):
        if (key >> np.uint64(k)) & np.uint64(1):
            force = contacts.beta[k] * contacts.sign[k] * kick[contacts.row[k]]
            for p in range(contacts.first[k], contacts.first[k + 1]):
                drift[n + contacts.push_row[p]] -= contacts.push[p] * force


@inlined
def _pushed(contact, key, column, tangent, model):
    """Return the variation of the acceleration in the row of a contact, without its own force."""
    contacts, stiffness, damping = model.contacts, model.stiffness, model.damping
    n, row = stiffness.shape[0], contacts.row[contact]
    pushed = 0.0
    for j in range(n):
        pushed -= stiffness[row, j] * tangent[j, column]
        pushed -= damping[row, j] * tangent[n + j, column]
    if is_oblique(contacts):
        for k in range(contacts.row.shape[0]):
            if k != contact and (key >> np.uint64(k)) & np.uint64(1):
                stretched = contacts.sign[k] * tangent[contacts.row[k], column]
                oblique = contacts.sign[contact] * contacts.oblique[contact, k]
                pushed -= oblique * contacts.beta[k] * stretched
    return pushed
