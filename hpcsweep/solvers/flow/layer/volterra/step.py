"""Take the steps of a visit with a few contacts in their layers, in modes; see `equation`.

Between two steps of a visit the motion stays in modes; its rows are written at the end alone.
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
from hpcsweep.kernels.simd.vectors import local_matrix, local_vector
from hpcsweep.solvers.flow.layer.volterra.equation import (
    step_tangent,
    take_step,
    write_accelerations,
    write_distances,
)
from hpcsweep.solvers.flow.layer.volterra.plan import level_of, plan_step
from hpcsweep.solvers.flow.layer.volterra.tables import longest_step
from hpcsweep.solvers.flow.rules import strategies
from hpcsweep.solvers.flow.state.shared import NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state
from hpcsweep.solvers.flow.state.tables import LEVELS
from hpcsweep.solvers.flow.step.forcing import forcing_after, total_forcing
from hpcsweep.solvers.flow.step.spectral import modes_of, write_rows

CONTACTS, LEVEL, GOING = range(3)
"""Places in ``Volterra.last``."""


@inlined
def steps_in_modes(shared):
    """Return whether steps inside layers are those of this module."""
    if not strategies.USED.volterra:
        return False
    return shared.volterra.built.shape[0] > 0 and shared.tables.spectrum.damping.shape[0] == 0


@kernel
def _others_stay_away(r, moved, model, own):
    """Return whether all contacts that are not of the step are before their layers at its end."""
    for k in range(model.contacts.row.shape[0]):
        if not moved[0, k] <= -model.layer:
            taken = False
            for i in range(r):
                taken = taken or own.which[i] == k
            if not taken:
                return False
    return True


@kernel
def _tangent_to_modes(spectrum, tangent):
    """Transform the columns of `tangent` to modes, in place."""
    n, half, width = spectrum.to_modes.shape[0], tangent.shape[0] // 2, spectrum.squares.shape[0]
    state, modes = local_vector(2 * half), local_vector(2 * width)
    for column in range(tangent.shape[1]):
        for i in range(2 * half):
            state[i] = tangent[i, column]
        modes_of(state, half, spectrum, modes)
        for j in range(n):
            tangent[j, column], tangent[half + j, column] = modes[j], modes[width + j]


@kernel
def _tangent_to_rows(spectrum, tangent):
    """Transform the columns of `tangent` back."""
    n, half, width = spectrum.to_modes.shape[0], tangent.shape[0] // 2, spectrum.squares.shape[0]
    modes, state = local_vector(2 * width), local_vector(2 * half)
    for column in range(tangent.shape[1]):
        for j in range(n):
            modes[j], modes[width + j] = tangent[j, column], tangent[half + j, column]
        write_rows(modes, spectrum, state)
        for i in range(2 * half):
            tangent[i, column] = state[i]


@inlined
def _step(left, longest, shared, moved, after):
    """Take a step from ``own.modes``; return its length, 0 if none.

    `moved`, (2, m), receives distances and speeds at its end, `after` the modes.
    """
    model, own = shared.model, shared.volterra
    r, h, stiffness = plan_step(longest, model, own)
    # what is left of a period is collocated, not cut into shorter and shorter steps
    if r == 0 or h > 2.0 * left:
        return 0.0
    level, h = level_of(min(h, left), longest)
    while level < LEVELS:
        allowed = take_step(level, h, r, stiffness, shared, moved, after)
        if allowed and _others_stay_away(r, moved, model, own):
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
def volterra_steps(packed, tau, end, most, z, amplitude, wanted, tangent):
    """Take steps while a contact is inside its layer, to `end` at most.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`; ``work.forcing`` is the forcing at the start, on return at the
        end.
    tau, end : float
    most : int
        Most steps.
    z : ndarray, shape (2R,)
        State at tau, on return where the last step ends.
    amplitude : float
    wanted : int
        If not 0, only one step is taken; z and ``work.forcing`` are left, and the end is in
        ``volterra.modes``.
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
    z = as_long_as(z, shared.work.step.z_end)
    tangent = as_long_as(tangent, shared.work.step.z_end)
    model, spectrum, own = shared.model, shared.tables.spectrum, shared.volterra
    pairs, modes, first = shared.work.forcing, own.modes, 2 * spectrum.squares.shape[0]
    if own.last[GOING] == 0:
        modes_of(z, z.shape[0] // 2, spectrum, modes)
        write_distances(modes, model, spectrum, own.distances)
    copy_state(pairs[: modes.shape[0] - first], modes[first:])
    moved, after = local_matrix(2, model.contacts.row.shape[0]), local_vector(modes.shape[0])
    last, steps, longest = 0.0, 0, longest_step(model, spectrum)
    while steps < most:
        write_accelerations(
            total_forcing(modes, first, model), modes, model, spectrum, own.distances
        )
        h = _step(end - tau, longest, shared, moved, after)
        if not h > 0.0:
            break
        last, steps = h, steps + 1
        tau = end if h >= end - tau else tau + h
        forcing_after(h, tau, amplitude, modes, first, model, after[first:])
        copy_state(modes, own.before)
        copy_state(after, modes)
        copy_matrix(moved, own.distances)
        if tangent.shape[1] > 0:
            if steps == 1:
                _tangent_to_modes(spectrum, tangent)
            step_tangent(own.last[LEVEL], own.last[CONTACTS], model, spectrum, own, tangent)
        if wanted != NO_TALLY or tau >= end or not _goes_on(moved, model):
            break
    if steps > 0:
        if tangent.shape[1] > 0:
            _tangent_to_rows(spectrum, tangent)
        if wanted == NO_TALLY:
            write_rows(modes, spectrum, z)
            copy_state(modes[first:], pairs)
    return tau, last, steps
