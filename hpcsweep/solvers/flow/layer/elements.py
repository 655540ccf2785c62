r"""Motions of elements while a smooth contact is within its layer.

Between two changes the set of the sliders that slip is constant, and with it the linear part of the
equation and its constant loads (`layer.sliders`); p is no variable of it, since it changes only
with y, which the step knows: p = y -+ delta while a slider slips. So a step is a collocated one,
whatever the set, and its guards are rows of its polynomials (`guards`), as those of linear segments
are. What is proved of a row from the states at both ends needs the bounds of `step.step` alone:
|y - H| <= D h^2 / 12 and |y' - H'| <= 0.21 D h, H the cubic Hermite interpolant and D as there, and
for these 40 D / h^2 in place of |y''''| gives more, 0.10 D h^2 and 0.32 D h.

Within a step the polynomials of a collocation with s stages are less exact than the state at its
end: an error h^(s + 2) of u and h^(s + 1) of u', where that is of the order of h^(2 s + 1). Where
no guard is passed by the proof above that does not matter: it leaves 0.02 D h^2 for it. Else the
step is taken anew in `PARTS`, whose polynomials are exact to rounding, PARTS^-(s + 1) = 4e-6 of an
error of 1e-8; on these the guard that is passed first is found as everywhere, and a step that ends
there, exactly, is taken in place of the last. A change of a slider does not move the state, nor
(u, u') that of its force: the next step begins where it ended.

Neither passages in closed form nor steps in modes know sliders: all steps are collocated. Contacts
are all within their layers, as far as guards go; which are is looked at when the step has ended.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import local_vector
from hpcsweep.model.elements import ENDS, OWNER
from hpcsweep.model.observed import ENERGY
from hpcsweep.solvers.flow.guard.contacts import set_contacts
from hpcsweep.solvers.flow.guard.elements import (
    all_keep_modes,
    change,
    first_change,
    write_loads,
    write_windows,
)
from hpcsweep.solvers.flow.guard.search import UNDECIDED
from hpcsweep.solvers.flow.layer.measures import measure_layer_step, observe_layer_step
from hpcsweep.solvers.flow.layer.scheme import write_sliders
from hpcsweep.solvers.flow.layer.visit import (
    INTERVAL,
    Interval,
    collocated_step,
    inside_layer,
    longest_step,
)
from hpcsweep.solvers.flow.observe.energies import energies_on_segment
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, NO_TALLY, PASSAGES, read_shared
from hpcsweep.solvers.flow.state.state import (
    accelerations,
    add_sliders,
    copy_state,
    is_ordinary,
    start,
    time_of,
)
from hpcsweep.solvers.flow.step.forcing import forcing_after, forcing_at, n_pairs, total_forcing
from hpcsweep.solvers.flow.step.step import begin_layer_step, layer_segment
from hpcsweep.solvers.outcome import COLLAPSED, COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT

PARTS = 4
"""Of a step on which a guard may be passed."""


@inlined
def _set_modes(modes, elements, pairs, step, proof):
    """Write what the modes of sliders make of steps: loads, guards."""
    write_loads(modes, elements, pairs, step.series)
    write_sliders(modes, elements, step.series.slope, step.layer)
    write_windows(modes, elements, proof)


@inlined
def _accelerate(ground, z, model, layer, out):
    """Evaluate u'' in a state, sliders included."""
    accelerations(ground, z, model, out)
    add_sliders(z, model.elements, layer, out)


class Fine(NamedTuple):
    """Up to the time `until` polynomials have to be exact, steps no longer than `most`."""

    most: float
    until: float


class Taken(NamedTuple):
    """The present step, which is taken up to the first guard that is passed."""

    place: int
    """The guard at its end, -1 if there is none, `UNDECIDED` if rounding forbids to tell."""
    h: float
    """Its length ..."""
    span: float
    """... which is taken, all or, of a step at the start of which a guard is passed, nothing."""
    fine: Fine
    """Of the steps that follow."""
    outcome: int
    steps: int
    """Tried."""


@inlined
def _step(interval, fine, z, amplitude, shared, pairs):
    """Take a step; return it as `Taken`, the forcing at its end in `pairs`."""
    model, tables, work = shared.model, shared.tables, shared.work
    elements, modes, proof, step = model.elements, shared.modes, work.proof, work.step
    tau, end, left = interval
    place, most, steps = -1, fine.most if tau < fine.until else longest_step(model), 0
    while True:
        part = Interval(tau, end, left - steps)
        h, outcome, used = collocated_step(part, most, z, amplitude, shared)
        steps += used
        if outcome != COMPLETE:
            return Taken(-1, h, 0.0, fine, outcome, steps)
        forcing_after(h, tau + h, amplitude, work.forcing, 0, model, pairs)
        ground = total_forcing(pairs, 0, model)
        _accelerate(ground, step.z_end, model, step.layer, step.a_end)
        start(step.x, z, work.forcing)
        begin_layer_step(h, step)
        if place >= 0:
            # one that has become still shorter ends before the guard
            return Taken(place if h == most else -1, h, h, fine, COMPLETE, steps)
        if all_keep_modes(h, elements, proof, step):
            return Taken(-1, h, h, fine, COMPLETE, steps)
        if not tau < fine.until:
            most = h / PARTS
            fine = Fine(most, tau + h)
            continue
        segment = layer_segment(tau, h)
        place, span = first_change(segment, h, modes, tables, model, proof, step)
        if place < 0 or span >= end - tau:
            # what changes at the end does so at the start of what follows
            return Taken(min(place, -1), h, h, fine, COMPLETE, steps)
        if span == h or not tau + span > tau:
            return Taken(place, h, h if span == h else 0.0, fine, COMPLETE, steps)
        most = span


@entry_point((FLOAT, INT, INT), BYTES, INTERVAL, VECTOR, FLOAT, INT, inner=True, on_demand=True)
def visit_layers(packed, interval, z, amplitude, wanted):
    """Integrate from tau until no contact is within its layer, or until `end`, or to a collapse.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`.
    interval : Interval
    z : ndarray, shape (2R,)
    amplitude : float
    wanted : int
        Of `march.march_elements`.

    Returns
    -------
    tau : float
    outcome : int
    steps : int
        Steps tried.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.work.step.z_end)
    tau, end, steps_left = interval
    model, tables, modes, work = shared.model, shared.tables, shared.modes, shared.work
    step, proof, elements, pairs = work.step, work.proof, model.elements, work.forcing
    nothing = np.uint64(0)
    set_contacts(~nothing, nothing, modes, model.contacts)
    _set_modes(modes, elements, pairs, step, proof)
    forcing_at(tau, amplitude, model, pairs, 0)
    ground = total_forcing(pairs, 0, model)
    _accelerate(ground, z, model, step.layer, step.a)
    steps, fine, after = 0, Fine(0.0, tau), local_vector(n_pairs(model))
    while True:
        if steps >= steps_left:
            return tau, STEP_LIMIT, steps
        part = Interval(tau, end, steps_left - steps)
        place, h, span, fine, outcome, used = _step(part, fine, z, amplitude, shared, after)
        steps += used
        if place == UNDECIDED:
            return tau, SOLVER_FAILED, steps
        if outcome != COMPLETE:
            return tau, outcome, steps
        segment, begun, before = layer_segment(tau, h), tau, ground
        if span > 0.0:
            tau = end if h >= end - tau else tau + h
            copy_state(after, pairs)
            ground = total_forcing(pairs, 0, model)
            if wanted != NO_TALLY:
                observe_layer_step(segment, z, wanted, shared)
            if wanted & ANY_MEASURE:
                measure_layer_step(packed, (begun, h, amplitude, before, ground), wanted)
            if wanted & ENERGY:
                energies_on_segment(segment, h, tables, shared.tally, step)
        else:
            copy_state(z, step.z_end)
        if place >= 0:
            shared.counts[PASSAGES] += 1
            change(place, segment, span, step.z_end, modes, model, tables, proof, step)
        copy_state(step.z_end, z)
        if not is_ordinary(z):
            return tau, NON_FINITE, steps
        if place >= 0:
            if elements.guard[place, ENDS] > 0.0:
                modes.path[elements.ways[place, OWNER]] = time_of(tau, model)
                return tau, COLLAPSED, steps
            _set_modes(modes, elements, pairs, step, proof)
        _accelerate(ground, z, model, step.layer, step.a)
        if tau >= end or not inside_layer(z, model):
            return tau, COMPLETE, steps
