"""Take the steps of a visit with several contacts in their layers, in modes; see `equation`.

A step ends before the force of a contact that is in its layer, or comes near it meanwhile, meets a
pole (`solitary.plan`), and before the iteration for all forces would converge slowly. Contacts that
stay before their layers on it do not push, which is confirmed at its end. Between two steps of a
visit the motion stays in modes; its rows are written at the end alone.
"""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    INT,
    MATRIX,
    VECTOR,
    entry_point,
)
from hpcsweep.model.contact import MAX_STIFFNESS
from hpcsweep.solvers.flow.layer.coupled.equation import (
    coupled_tangent,
    longest_step,
    take_step,
    write_accelerations,
    write_distances,
)
from hpcsweep.solvers.flow.layer.scheme import stiffness_up_to
from hpcsweep.solvers.flow.layer.solitary.plan import AT_EDGE, SURE, level_of, until_poles
from hpcsweep.solvers.flow.linear.forcing import forcing_after, total_forcing
from hpcsweep.solvers.flow.linear.spectral import modes_of, write_rows
from hpcsweep.solvers.flow.rules import strategies
from hpcsweep.solvers.flow.state.coupled import MOST
from hpcsweep.solvers.flow.state.shared import NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state
from hpcsweep.solvers.flow.state.tables import LEVELS

CONTACTS, LEVEL, GOING = range(3)
"""Places in ``Coupled.last``."""
CONTRACTION = 3.0
"""Largest h sqrt(|df/dx|): rounding grows by less than cosh(3) = 10 over the iteration."""


@inlined
def steps_in_modes(shared):
    """Return whether steps inside layers are those of this module."""
    there = strategies.USED.coupled and shared.coupled.built.shape[0] > 0
    return there and shared.tables.spectrum.damping.shape[0] == 0


@kernel
def _plan_step(most, model, own):
    """Choose the contacts of a step, in ``own.which``, and its length, at most `most`.

    Returns
    -------
    r : int
        Number of contacts, 0 if they are too many.
    h : float
    stiffness : float
        See `take_step`.
    """
    contacts, rho, layer, x = model.contacts, model.rho, model.layer, own.distances
    h, stiffness, r = most, 0.0, 0
    # first those inside their layers, which limit the step most
    for outside in range(2):
        for k in range(contacts.row.shape[0]):
            place, speed, pushed, beta = x[0, k], x[1, k], x[2, k], contacts.beta[k]
            if (abs(place) < AT_EDGE * layer) == (outside == 1):
                continue
            way = SURE * h * (abs(speed) + abs(pushed) * h)
            near = outside == 0 or way > abs(place) - layer
            if not near and place < 0.0:
                continue
            if r == MOST:
                return 0, 0.0, 0.0
            own.which[r] = k
            r += 1
            stiff = MAX_STIFFNESS * beta if near else beta
            if near:
                h = min(h, until_poles(place, speed, pushed, rho))
                if place < 0.0:
                    turn = min(h, speed / -pushed) if speed > 0.0 > pushed else h
                    nearest = place + max(0.0, speed + 0.5 * pushed * turn) * turn
                    stiff = abs(stiffness_up_to(nearest, beta, rho))
            stiffness = stiffness + stiff if contacts.is_oblique else max(stiffness, stiff)
            if h * h * stiffness > CONTRACTION * CONTRACTION:
                h = CONTRACTION / math.sqrt(stiffness)
    return r, h, stiffness


@kernel
def _others_stay_away(r, model, own):
    """Return whether all contacts that are not of the step are before their layers at its end."""
    for k in range(model.contacts.row.shape[0]):
        if not own.moved[0, k] <= -model.layer:
            taken = False
            for i in range(r):
                taken = taken or own.which[i] == k
            if not taken:
                return False
    return True


@kernel
def _tangent_to_modes(spectrum, own, tangent):
    """Transform the columns of `tangent` to modes, in place."""
    n, half, width = spectrum.to_modes.shape[0], tangent.shape[0] // 2, spectrum.squares.shape[0]
    state = own.between
    for column in range(tangent.shape[1]):
        for i in range(2 * half):
            state[i] = tangent[i, column]
        modes_of(state, half, spectrum, own.after)
        for j in range(n):
            tangent[j, column], tangent[half + j, column] = own.after[j], own.after[width + j]


@kernel
def _tangent_to_rows(spectrum, own, tangent):
    """Transform the columns of `tangent` back."""
    n, half, width = spectrum.to_modes.shape[0], tangent.shape[0] // 2, spectrum.squares.shape[0]
    modes, state = own.vector, own.between
    for column in range(tangent.shape[1]):
        for j in range(n):
            modes[j], modes[width + j] = tangent[j, column], tangent[half + j, column]
        write_rows(modes, spectrum, own, state)
        for i in range(2 * half):
            tangent[i, column] = state[i]


@inlined
def _step(tau, left, longest, amplitude, pairs, shared):
    """Take a step from ``own.modes`` at tau to ``own.after``; return its length, 0 if none."""
    model, own = shared.model, shared.coupled
    r, h, stiffness = _plan_step(longest, model, own)
    # what is left of a period is collocated, not cut into shorter and shorter steps
    if r == 0 or h > 2.0 * left:
        return 0.0
    level, h = level_of(min(h, left), longest)
    while level < LEVELS:
        allowed = take_step(level, h, r, stiffness, (tau, amplitude, pairs), shared)
        if allowed and _others_stay_away(r, model, own):
            own.last[CONTACTS], own.last[LEVEL], own.last[GOING] = r, level, 1
            return h
        level += 1
        h *= math.sqrt(0.5)
    return 0.0


@inlined
def _goes_on(x, model):
    """Return whether a contact is inside its layer."""
    for k in range(x.shape[1]):
        if abs(x[0, k]) < model.layer:
            return True
    return False


@entry_point(
    (FLOAT, FLOAT, INT),
    BYTES,
    FLOAT,
    FLOAT,
    INT,
    VECTOR,
    FLOAT,
    INT,
    MATRIX,
    inner=True,
    specialises=True,
)
def coupled_steps(packed, tau, end, most, z, amplitude, wanted, tangent):
    """Take steps while a contact is inside its layer, to `end` at most.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`; ``work.forcing`` is the forcing at the start, on return at the end.
    tau, end : float
    most : int
        Most steps.
    z : ndarray, shape (2R,)
        State at tau, on return where the last step ends.
    amplitude : float
    wanted : int
        If not 0, only one step is taken; z is left, and the end is in ``coupled.end``.
    tangent : ndarray, shape (2R, m)
        Multiplied by the tangent map, in place.

    Returns
    -------
    tau : float
        End of the last step.
    h : float
        Its length.
    steps : int
        Their number, 0 if none could be taken.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.previous)
    tangent = as_long_as(tangent, shared.previous)
    model, spectrum, own = shared.model, shared.tables.spectrum, shared.coupled
    pairs, modes = shared.work.forcing, own.modes
    if own.last[GOING] == 0:
        modes_of(z, z.shape[0] // 2, spectrum, modes)
        write_distances(modes, model, spectrum, own, own.distances)
    last, steps, longest = 0.0, 0, longest_step(spectrum)
    while steps < most:
        write_accelerations(total_forcing(pairs, 0, model), modes, model, spectrum, own)
        h = _step(tau, end - tau, longest, amplitude, pairs, shared)
        if not h > 0.0:
            break
        last, steps = h, steps + 1
        copy_state(modes, own.before)
        copy_state(own.after, modes)
        copy_matrix(own.moved, own.distances)
        tau = end if h >= end - tau else tau + h
        forcing_after(h, tau, amplitude, pairs, 0, model, pairs)
        if tangent.shape[1] > 0:
            if steps == 1:
                _tangent_to_modes(spectrum, own, tangent)
            coupled_tangent(own.last[LEVEL], own.last[CONTACTS], model, spectrum, own, tangent)
        if wanted != NO_TALLY or tau >= end or not _goes_on(own.moved, model):
            break
    if steps > 0:
        if tangent.shape[1] > 0:
            _tangent_to_rows(spectrum, own, tangent)
        write_rows(modes, spectrum, own, own.end)
        if wanted == NO_TALLY:
            copy_state(own.end, z)
        else:
            copy_state(pairs, own.pairs)
    return tau, last, steps
