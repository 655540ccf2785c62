"""Plan a step, try it, and try it shorter where its error is too large."""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.solvers.flow.layer.limits import allowed_error
from hpcsweep.solvers.flow.layer.solitary.equation import solitary_tangent, take_step
from hpcsweep.solvers.flow.layer.solitary.output import dense_output
from hpcsweep.solvers.flow.layer.solitary.plan import (
    level_of,
    linear_table,
    others_stay_away,
    plan_step,
    solitary_contact,
)
from hpcsweep.solvers.flow.layer.solitary.tables import response_table
from hpcsweep.solvers.flow.state.contacts import distance
from hpcsweep.solvers.flow.state.responses import LEVELS
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.tally import NO_TALLY


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
    if contact < 0 or not (model.rho > 0.0 and model.contacts.is_elastic):
        return 0.0
    h, stiffness = plan_step(contact, z, work.a, left, model)
    if not h > 0.0:
        return 0.0
    linear = model.contacts.beta[contact] if distance(contact, z, model.contacts) > 0.0 else 0.0
    index = linear_table(z, -1, model, tables, packed)
    level, h = level_of(h, tables.h[index])
    while level < LEVELS:
        place = response_table(index, contact, level, packed, responses)
        error = take_step(contact, place, h, stiffness, linear, z, model, responses, work)
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
