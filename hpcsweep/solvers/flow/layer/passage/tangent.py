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
    speeds,
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
def _half(side, stop, found):
    """Return the moments of `half_passage`, x, 1 / w, (1 + 2 b + c) / (|v*| + w) and c."""
    x, w, later = found
    bent, delayed = delays(side, stop, x, later)
    share = later * fma(2.0, bent, delayed + 1.0)
    return half_passage(side, stop, found), x, 1.0 / w, share, delayed


@inlined
def _rates(side, half, stop, faster, pushed):
    """Differentiate the moments of `_half`, where v and a change at these rates."""
    powers, x, inverse, share, delayed = half
    rising = stop.v * stop.slowness * faster
    bend = -0.5 * stop.sign * stop.j * rising * stop.slowness * stop.slowness
    quicker = fma(x, fma(x, bend, side * pushed), stop.v * faster) * inverse
    # of c / w and of t, in parts of these
    first = -1.0 * quicker * inverse
    time = fma(-1.0 * share, quicker + rising, -1.0 * rising * stop.slowness * delayed)
    return (
        powers[0] * first,
        powers[1] * (first + time),
        powers[2] * fma(2.0, time, first),
        powers[3] * fma(3.0, time, first),
        powers[4] * fma(4.0, time, first),
    )


@inlined
def speeds_of_passage(contact, z, a, jerk, model):
    """Return a contact at its stop and the `speeds` of its fast passage, for `passage_tangent`.

    Their roots and quotients wait for each other: other work is best done between the two calls.

    Parameters
    ----------
    contact : int
    z : ndarray, shape (2R,)
        State at the stop before the kick.
    a : ndarray, shape (R,)
        Accelerations there without the force of the contact.
    jerk : float
        Their derivative in its row.
    """
    n, contacts = model.stiffness.shape[0], model.contacts
    row, sign, beta = contacts.row[contact], contacts.sign[contact], contacts.beta[contact]
    stop = at_stop(sign * z[n + row], sign * a[row], sign * jerk, beta, model.rho)
    return stop, speeds(-1.0, stop), speeds(1.0, stop)


@inlined
def passage_tangent(contact, key, passage, model, tangent):
    """Multiply `tangent` by the matrix S of a fast passage, in place.

    The kick is differentiated by v and by a; for a single column in one directional derivative.

    Parameters
    ----------
    contact : int
    key : uint64
        Contact set after the passage.
    passage : tuple
        Of `speeds_of_passage`.
    tangent : ndarray, shape (2R, m)
    """
    n, n_columns = model.stiffness.shape[0], tangent.shape[1]
    stop, outer, inner = passage
    free, inside = _half(-1.0, stop, outer), _half(1.0, stop, inner)
    found = sums(free[0], inside[0])
    kicks, drift = local_matrix(3, 2 * n), local_vector(2 * n)
    kicks[:] = 0.0
    later, faster, pushed = _changes(contact, key, 0, stop, model, tangent)
    # the kick and its derivatives: in one loop, as `add_kick` is long
    for which in range(min(n_columns, 2) + 1):
        m = since_linear(found, stop)
        if which > 0:
            by_v, by_a = 2.0 - which, which - 1.0
            if n_columns == 1:
                by_v, by_a = faster, pushed
            rates = sums(
                _rates(-1.0, free, stop, by_v, by_a), _rates(1.0, inside, stop, by_v, by_a)
            )
            m = rates_since_linear(found, rates, by_v, stop)
        add_kick(m, contact, key, model, kicks[which])
    _drift_of_kick(key, kicks[0], model, drift)
    for column in range(n_columns):
        if n_columns == 1:
            faster, pushed = 1.0, 0.0
        else:
            later, faster, pushed = _changes(contact, key, column, stop, model, tangent)
        for i in range(2 * n):
            tangent[i, column] += kicks[1, i] * faster + kicks[2, i] * pushed + drift[i] * later


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
def _changes(contact, key, column, stop, model, tangent):
    """Return dx / v, by which the stop is reached earlier, and the variations of v and a there."""
    contacts, stiffness, damping = model.contacts, model.stiffness, model.damping
    n, row, sign = stiffness.shape[0], contacts.row[contact], contacts.sign[contact]
    pushed = 0.0
    for j in range(n):
        pushed -= stiffness[row, j] * tangent[j, column]
        pushed -= damping[row, j] * tangent[n + j, column]
    if is_oblique(contacts):
        for k in range(contacts.row.shape[0]):
            if k != contact and (key >> np.uint64(k)) & np.uint64(1):
                stretched = contacts.sign[k] * tangent[contacts.row[k], column]
                oblique = sign * contacts.oblique[contact, k]
                pushed -= oblique * contacts.beta[k] * stretched
    later = sign * tangent[row, column] / stop.v
    # along f_- the speed changes by a and the acceleration by the jerk
    faster = sign * tangent[n + row, column] - later * stop.a
    return later, faster, sign * pushed - later * stop.j
