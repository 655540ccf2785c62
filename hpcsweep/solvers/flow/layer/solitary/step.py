r"""Take a step with one contact in its layer, and give its motion for `observation`.

Motion along both halves of a step with one contact in its layer, for its measures
----------------------------------------------------------------------------------
A step is planned for 16 nodes on it: kappa of `layer.limits` is 2.6. For measures its motion is
given at 8 nodes in each half, where kappa is 3.7 or more, by the linear motion and the response of
`equation` to the force f, both of degree 15 in time::

    x(t) = exp(M t) x_0 - sum_m c_m h (h / H)^m int_0^(t / h) (t / h - s)^m f(s h) ds,

sum_m c_m s^m being exp(M s H) e, H the step of the table.
"""

import math

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, store, total
from hpcsweep.model.contact import contact_force, contact_forces
from hpcsweep.solvers.flow.layer.scheme import allowed_error
from hpcsweep.solvers.flow.layer.solitary.equation import (
    error_of_rule,
    impulse_row,
    response_table,
    solitary_tangent,
    take_step,
)
from hpcsweep.solvers.flow.layer.solitary.plan import (
    level_of,
    linear_table,
    others_stay_away,
    plan_step,
    solitary_contact,
)
from hpcsweep.solvers.flow.linear.forcing import forcing_at
from hpcsweep.solvers.flow.linear.polynomials import evaluate, expand_row
from hpcsweep.solvers.flow.linear.step import in_modes
from hpcsweep.solvers.flow.rules import strategies
from hpcsweep.solvers.flow.rules.solitary_rule import (
    HALF_NODES,
    HALF_RESPONSES,
    MIDDLE_RESPONSES,
    N_NODES,
    RESPONSES,
    WEIGHTS,
)
from hpcsweep.solvers.flow.rules.tableau import NODES as STAGE_NODES
from hpcsweep.solvers.flow.state.shared import NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import copy_state, distance, start
from hpcsweep.solvers.flow.state.tables import LEVELS, N_COEFFICIENTS, ZERO


@inlined
def dense_output(contact, index, linear, h, z, model, tables, work):
    """Write displacements and velocities at the stages of `scheme` into ``work.layer``.

    The linear motion is that of the table `index`, without this contact; the response to its whole
    force is a sum of powers of time. With the spring's stiffness `linear` within the motion these
    sums would not converge on a long step in a wide layer, where beta h^2 is up to 13.
    """
    solitary, stage, rows = work.solitary, work.layer, work.rows
    x, forces, moments = work.x, solitary.free, solitary.moments
    for block in range(0, N_NODES, LANES):
        whole = fma(load(solitary.x, block), linear, load(solitary.forces, block))
        store(forces, block, whole)
    n = model.stiffness.shape[0]
    start(x, z, work.forcing)
    factor = h
    for m in range(LANES):
        combine(
            moments,
            m * LANES,
            ZERO,
            0,
            factor,
            RESPONSES,
            m * N_NODES * LANES,
            LANES,
            forces,
            0,
            N_NODES,
        )
        factor *= h
    sigma = fma(load(STAGE_NODES, 0), 2.0 * h / tables.h[index], load(ZERO, 0) - 1.0)
    for row in range(2 * n):
        expand_row(tables.poly, index, row, x, rows)
        value = evaluate(rows[row], sigma)
        for m in range(LANES):
            moved = tables.impulses[index, contact, m, row]
            value = fma(load(moments, m * LANES), -moved, value)
        if row < n:
            store(stage.u, row * LANES, value)
        else:
            store(stage.v, (row - n) * LANES, value)


def _shift() -> np.ndarray:
    """Return the map of coefficients by (2 s - 1)^p to those by s^j, shape (p, j)."""
    found = np.zeros((N_COEFFICIENTS, N_COEFFICIENTS))
    for p in range(N_COEFFICIENTS):
        for j in range(p + 1):
            found[p, j] = math.comb(p, j) * 2.0**j * (-1.0) ** (p - j)
    return found


SHIFT = _shift()


@inlined
def integral_of_force(contact, h, z0, z1, rho, model, work):
    """Integrate x S over the step that `equation.take_step` has taken, by its nodes.

    Returns
    -------
    integral, missed : float
        And its estimated error, as there.
    """
    low = contact_forces(load(work.solitary.x, 0), 1.0, rho)
    high = contact_forces(load(work.solitary.x, LANES), 1.0, rho)
    first = contact_force(distance(contact, z0, model.contacts), 1.0, rho)
    last = contact_force(distance(contact, z1, model.contacts), 1.0, rho)
    value = h * total(fma(load(WEIGHTS, 0), low, load(WEIGHTS, LANES) * high))
    return value, error_of_rule(h, low, high, first, last, 1.0 / rho)


@inlined
def _moments(contact, h, ratio, linear, model, work):
    """Integrate the force with the powers of time left, at the nodes of both halves and between."""
    beta, rho = model.contacts.beta[contact], model.rho
    solitary = work.solitary
    forces, halves, middle = solitary.free, solitary.halves, solitary.middle
    for block in range(0, N_NODES, LANES):
        x = load(solitary.x, block)
        store(forces, block, fma(x, -linear, contact_forces(x, beta, rho)))
    for block in range(0, N_NODES, LANES):
        combine(middle, block, ZERO, 0, 1.0, MIDDLE_RESPONSES, block, N_NODES, forces, 0, N_NODES)
    factor = h
    for m in range(N_NODES):
        middle[m] *= factor
        for at in range(m * LANES, 2 * N_NODES * LANES, N_NODES * LANES):
            combine(
                halves, at, ZERO, 0, factor, HALF_RESPONSES, at * N_NODES, LANES, forces, 0, N_NODES
            )
        factor *= ratio


@inlined
def motion_in_halves(contact, tau, h, amplitude, z, packed, shared):
    """Write the motion along a step from z, of a contact alone in its layer.

    Displacements and velocities at the nodes of the first half go to ``work.layer.u`` and ``v``,
    those of the second to ``free`` and ``speeds``, the state between them to ``between``.
    """
    model, tables, work = shared.model, shared.tables, shared.work
    contacts, x, rows = model.contacts, work.x, work.rows
    stage, solitary = work.layer, work.solitary
    linear = contacts.beta[contact] if distance(contact, z, contacts) > 0.0 else 0.0
    index = linear_table(z, -1, model, tables, packed)
    poly = tables.poly[index]
    ratio = h / tables.h[index]
    _moments(contact, h, ratio, linear, model, work)
    size = z.shape[0]
    copy_state(z, x)
    forcing_at(tau, amplitude, model, x, size)
    x[x.shape[0] - 1] = 1.0
    impulse, powers = shared.responses.impulse, solitary.powers
    count = N_COEFFICIENTS
    for row in range(size):
        expand_row(tables.poly, index, row, x, rows)
        impulse_row(poly, row, contact, model, impulse)
        for block in range(0, N_COEFFICIENTS, LANES):
            combine(powers, block, ZERO, 0, 1.0, SHIFT, block, count, impulse, 0, count)
        value = evaluate(rows[row], ratio - 1.0)
        for m in range(N_COEFFICIENTS):
            value -= powers[m] * solitary.middle[m]
        stage.between[row] = value
        for half in range(2):
            sigma = fma(load(HALF_NODES, half * LANES), 2.0 * ratio, load(ZERO, 0) - 1.0)
            values = evaluate(rows[row], sigma)
            for m in range(N_COEFFICIENTS):
                values = fma(
                    load(solitary.halves, (half * N_NODES + m) * LANES), -powers[m], values
                )
            if row < size // 2:
                store(stage.u if half == 0 else stage.free, row * LANES, values)
            else:
                to = stage.v if half == 0 else stage.speeds
                store(to, (row - size // 2) * LANES, values)


@kernel
def second_half(stage):
    """Move the motion along the second half to where that of a step is."""
    for row in range(stage.u.shape[0]):
        store(stage.u, row * LANES, load(stage.free, row * LANES))
        store(stage.v, row * LANES, load(stage.speeds, row * LANES))


@entry_point(FLOAT, FLOAT, VECTOR, INT, MATRIX, BYTES, specialises=True)
def solitary_step(left, z, wanted, tangent, packed):
    """Take a step if one contact alone is in its layer; see `equation`.

    Parameters
    ----------
    left : float
        Longest step.
    z : ndarray, shape (2R,)
        State at the start, ``work.a`` its accelerations and ``work.forcing`` the forcing; the end
        state is left in ``work.z_end``.
    wanted : int
        If not 0, ``work.layer`` receives displacements and velocities at its stages.
    tangent : ndarray, shape (2R, m)
        Multiplied by the tangent map of the step, in place.
    packed : ndarray of bytes
        A packed `Shared`.

    Returns
    -------
    float
        Length of the step, 0 if none could be taken.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.previous)
    tangent = as_long_as(tangent, shared.previous)
    model, tables, work, responses = shared.model, shared.tables, shared.work, shared.responses
    contact = solitary_contact(z, model)
    tabled = strategies.USED.solitary and not in_modes(tables)
    if contact < 0 or not (tabled and model.rho > 0.0 and model.contacts.is_elastic):
        return 0.0
    h, stiffness = plan_step(contact, z, work.a, left, model)
    if not h > 0.0:
        return 0.0
    linear = model.contacts.beta[contact] if distance(contact, z, model.contacts) > 0.0 else 0.0
    index = linear_table(z, -1, model, tables, packed)
    level, h = level_of(h, tables.h[index])
    while level < LEVELS:
        place = response_table(index, contact, level, packed, responses)
        error = take_step(contact, place, h, stiffness, linear, z, shared)
        allowed = allowed_error(work.z_end, shared.tolerance)
        if error <= allowed and others_stay_away(contact, z, work.z_end, model):
            if wanted != NO_TALLY:
                free = linear_table(z, contact, model, tables, packed)
                dense_output(contact, free, linear, h, z, model, tables, work)
            if tangent.shape[1] > 0:
                solitary_tangent(contact, place, linear, model, responses, work, tangent)
            return h
        level += 1
        h *= math.sqrt(0.5)
    return 0.0
