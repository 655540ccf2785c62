"""Steps of a linear motion, and the event that ends one: a contact at the edge of its layer.

Each contact is cleared by a proof or searched (`search`); the contact set and the side of each
layer are those of the motion at hand.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, load, local_matrix, local_vector
from hpcsweep.solvers.flow.guard.search import (
    UNDECIDED,
    Bracket,
    Level,
    Stretch,
    Trace,
    first_passage,
    leaves,
    may_reach,
    reaching,
    rising_root,
)
from hpcsweep.solvers.flow.state.state import (
    accelerations,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
)
from hpcsweep.solvers.flow.step.forcing import forcing_at, n_pairs, total_forcing, turn_forcing
from hpcsweep.solvers.flow.step.polynomials import value_and_slope
from hpcsweep.solvers.flow.step.propagators import product, product_of_moduli
from hpcsweep.solvers.flow.step.spectral import (
    bound_contacts,
    bound_rows,
    continues,
    ends_of_contacts,
    modal_step,
    modes_of,
    spectral_step,
    write_rows,
)
from hpcsweep.solvers.flow.step.step import expand, in_modes, state_at
from hpcsweep.solvers.flow.step.strides import have_strides, look, stride

SAME_END = 1e-13
"""Rounding of the end of an interval that is reached by steps of equal length."""


@inlined
def contact_key(tau, z, amplitude, model, pairs, a):
    """Find the contact set of a state outside all layers.

    A contact exactly at a stop of infinite sharpness is closed if it is moving, or otherwise
    accelerating, towards it. `pairs` and `a` are workspace: the forcing, and accelerations.
    """
    key = np.uint64(0)
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
        pushed = 0.0
        if x == 0.0 and w == 0.0:
            forcing_at(tau, amplitude, model, pairs, 0)
            accelerations(total_forcing(pairs, 0, model), z, model, a)
            pushed = contacts.sign[k] * a[contacts.row[k]]
        if x > 0.0 or (x == 0.0 and (w > 0.0 or (w == 0.0 and pushed > 0.0))):
            key |= contact_bit(k)
    return key


@kernel
def layer_edge(key, k, model):
    """Return the edge of the layer that contact k reaches next, and the sign of the way there."""
    edges = model.contacts.edges
    if key & contact_bit(k):
        return Level(-edges[k, 0], edges[k, 2])
    return Level(edges[k, 0], edges[k, 1])


@inlined
def is_clear(key, k, d, x, z_end, model, bound4):
    """Return whether contact k stays outside its layer, or leaves it, within d; True is proved.

    `x` is the augmented state at the start, `z_end` begins with the state at the end.
    """
    i, j = model.contacts.places[k, 0], model.contacts.places[k, 1]
    sign, level = layer_edge(key, k, model)
    g0, slope0 = sign * (x[i] - level), sign * x[j]
    g1, slope1 = sign * (z_end[i] - level), sign * z_end[j]
    return not may_reach(d, g0, slope0, g1, slope1, bound4) or leaves(
        d, g0, slope0, g1, slope1, bound4
    )


@inlined
def first_event(segment, span, model, tables, step):
    """Find the first contact that reaches the edge of its layer within `span` of a step.

    Parameters
    ----------
    segment : Segment
    span : float
        The step from ``step.x`` ends there, at ``step.z_end``.
    tables : Tables

    Returns
    -------
    contact : int
        -1 if none does (proved), `UNDECIDED` if rounding prevents a decision.
    bracket : Bracket
        See `first_passage`. No other contact reaches the edge of its layer before b.
    near : uint64
        Contacts that are not proved to stay outside their layers within `span`.
    """
    key, h, x, z_end, rows = segment.key, segment.h, step.x, step.z_end, step.rows
    contact = -1
    near = np.uint64(0)
    first = Bracket(span, 0.0, span, 0.0)
    for k in range(model.contacts.row.shape[0]):
        i = model.contacts.row[k]
        place, speed_place = model.contacts.places[k, 0], model.contacts.places[k, 1]
        if is_clear(key, k, span, x, z_end, model, step.bounds[place]):
            continue
        near |= contact_bit(k)
        expand(i, segment, tables, step)
        curve = Trace(rows, i, h)
        edge = layer_edge(key, k, model)
        sign, level = edge
        value, slope = z_end[place], z_end[speed_place]
        if first.b < span:
            value, slope = value_and_slope(rows, i, h, first.b)
        start = sign * (x[place] - level), sign * x[speed_place]
        end = sign * (value - level), sign * slope
        part = Stretch(0.0, start[0], start[1], first.b, end[0], end[1])
        bracket = first_passage(curve, part, edge, step.bounds[place])
        if bracket.a == UNDECIDED:
            return UNDECIDED, bracket, near
        if bracket.a < 0.0:
            continue
        if contact >= 0 and bracket.b > first.a:
            # both within one interval: take the time of the first
            earlier = Trace(rows, model.contacts.row[contact], h)
            a = rising_root(earlier, first, layer_edge(key, contact, model))
            b = rising_root(curve, bracket, edge)
            if b >= a:
                first = Bracket(a, 0.0, a, 0.0)
                continue
            bracket = Bracket(b, 0.0, b, 0.0)
        contact, first = k, bracket
    return contact, first, near


@kernel
def _all_are_clear(d, starts, ends):
    """Return whether all contacts stay outside their layers, or leave them; True is proved."""
    width = starts.shape[0] // 2
    for first in range(0, width, LANES):
        g0, slope0 = load(starts, first), load(starts, width + first)
        g1, slope1 = load(ends, first), load(ends, width + first)
        near = reaching(d, g0, slope0, g1, slope1, load(ends, 2 * width + first))
        if near == 0:
            continue
        for k in range(first, first + LANES):
            if near >> (k - first) & 1 and not leaves(
                d, starts[k], starts[width + k], ends[k], ends[width + k], ends[2 * width + k]
            ):
                return False
    return True


@kernel
def _stride_on(segment, steps_left, model, tables, step):
    """Take strides while no contact can reach the edge of its layer (proved) and time remains.

    Each is twice as long as the one before, or half as long as one that is not proved. Return the
    time reached and the number of steps; if a step more could be taken, ``step.bounds`` are those
    of contacts on it.
    """
    index, h, tau, end = segment.index, segment.h, segment.tau, segment.end
    modal, spectrum, strides = step.spectral, tables.spectrum, tables.strides
    first, width = step.z_end.shape[0], spectrum.stops.shape[1]
    starts, ends, edges = local_vector(2 * width), local_vector(3 * width), local_matrix(2, width)
    after, bounds = local_vector(modal.end.shape[0]), local_vector(modal.end.shape[0] // 2)
    turned = local_vector(n_pairs(model))
    n_steps, level = 0, 0
    if not (tau + h < end and steps_left > 0):
        return tau, n_steps
    if not continues(index, tau, modal):
        modes_of(step.x, first // 2, spectrum, modal.end)
    edges[0], edges[1] = 0.0, -1.0
    for k in range(model.contacts.row.shape[0]):
        edges[0, k] = model.contacts.edges[k, 0]
        edges[1, k] = -model.contacts.edges[k, 0] * model.contacts.edges[k, 1]
    bounds[:] = 0.0
    look(modal.end, bounds, spectrum, edges, ends)
    copy_state(ends[: 2 * width], starts)
    while tau + h < end and n_steps < steps_left:
        span, taken = h * 2.0**level, 1 << level
        if level > 0 and (tau + span >= end or n_steps + taken > steps_left):
            level -= 1
            continue
        pairs = step.x[first:]
        stride(level, span, modal.end, pairs, model, spectrum, strides, after, turned, bounds)
        look(after, bounds, spectrum, edges, ends)
        if _all_are_clear(span, starts, ends):
            copy_state(after, modal.end)
            copy_state(turned, step.x[first:])
            copy_state(ends[: 2 * width], starts)
            tau, n_steps = tau + span, n_steps + taken
            level = min(level + 1, strides.steps.shape[0] - 1)
        elif level > 0:
            level -= 1
        else:
            for k in range(model.contacts.row.shape[0]):
                step.bounds[model.contacts.row[k]] = ends[2 * width + k]
            break
    modal.chain[0], modal.chain[1] = tau, index
    return tau, n_steps


@kernel
def _coast_in_modes(segment, steps_left, model, tables, step):
    """Take such steps as `coast` in modes, of which all rows are written at the end alone."""
    _, key, index, h, tau, end = segment
    x, wide, places, half = step.x, step.wide, model.contacts.places, step.z_end.shape[0] // 2
    modal, spectrum, n_steps, clear = step.spectral, tables.spectrum, 0, True
    free = key == np.uint64(0) and tables.strides.steps.shape[0] > 0
    if free and have_strides(h, model, spectrum, tables.strides) > 0:
        tau, n_steps = _stride_on(segment, steps_left, model, tables, step)
        if tau + h < end and n_steps < steps_left:
            modal_step(index, tau, tau + h, model, tables, step)
            clear = False
    while clear and tau + h < end and n_steps < steps_left:
        modal_step(index, tau, tau + h, model, tables, step)
        bound_contacts(h, model, spectrum, step)
        ends_of_contacts(model, spectrum, modal.end, wide)
        for k in range(places.shape[0]):
            if not is_clear(key, k, h, x, wide, model, step.bounds[places[k, 0]]):
                clear = False
                break
        if not clear:
            break
        for k in range(places.shape[0]):
            x[places[k, 0]], x[places[k, 1]] = wide[places[k, 0]], wide[places[k, 1]]
        turn_forcing(x, 2 * half, tables, index)
        tau += h
        n_steps += 1
    if n_steps > 0:
        write_rows(modal.end if clear else modal.terms[0, 0], spectrum, x)
    if not clear:
        write_rows(modal.end, spectrum, wide)
        if model.elements.first.shape[0] > 0:
            bound_rows(h, spectrum, step)
    return tau, n_steps, not clear


@inlined
def coast(segment, steps_left, model, tables, step):
    """Take linear steps while no contact can reach the edge of its layer (proved) and time remains.

    Returns
    -------
    tau : float
    n_steps : int
        ``step.x`` holds the augmented state there.
    tried : bool
        Whether ``step.wide`` and ``step.bounds`` are those of a step from there.
    """
    if in_modes(tables):
        return _coast_in_modes(segment, steps_left, model, tables, step)
    _, key, index, h, tau, end = segment
    x, wide, bounds = step.x, step.wide, step.bounds
    places = model.contacts.places
    n_steps = 0
    while tau + h < end and n_steps < steps_left:
        product(tables.step, index, x, wide)
        product_of_moduli(tables.bound4, index, x, bounds)
        for k in range(places.shape[0]):
            if not is_clear(key, k, h, x, wide, model, bounds[places[k, 0]]):
                return tau, n_steps, True
        for row in range(step.z_end.shape[0]):
            x[row] = wide[row]
        turn_forcing(x, step.z_end.shape[0], tables, index)
        tau += h
        n_steps += 1
    return tau, n_steps, False


@inlined
def look_ahead(segment, steps_left, model, tables, step):
    """Take the strides of `coast`, and go back to their start: all is observed step by step.

    Returns
    -------
    n_steps : int
        Steps to the end of the strides, from where `go_on` goes on: what is gathered does not
        change the motion.
    tried : bool
        See `coast`.
    """
    modal, strides = step.spectral, tables.strides
    if not (segment.key == np.uint64(0) and strides.steps.shape[0] > 0):
        return 0, False
    begun = local_vector(step.x.shape[0])
    copy_state(step.x, begun)
    tau, n_steps, tried = _coast_in_modes(segment, steps_left, model, tables, step)
    if n_steps == 0:
        return 0, tried
    copy_state(step.x, strides.reached)
    copy_state(modal.terms[0, 0] if tried else modal.end, strides.modes)
    copy_state(begun, step.x)
    strides.time[0] = tau
    return n_steps, False


@inlined
def go_on(index, z, tables, step):
    """Go to where strides end; return the time."""
    modal, strides = step.spectral, tables.strides
    tau = strides.time[0]
    copy_state(strides.reached, step.x)
    copy_state(step.x[: z.shape[0]], z)
    copy_state(strides.modes, modal.end)
    modal.chain[0], modal.chain[1] = tau, index
    return tau


@inlined
def take_step(segment, tried, model, tables, step):
    """Take one linear step from ``step.x`` to ``step.z_end``, at most to the end of the period.

    Returns
    -------
    float
        Length of the step.
    """
    index, x = segment.index, step.x
    for row in range(step.z_end.shape[0]):
        step.expanded[row] = False
    span, left, spectral = segment.h, segment.end - segment.tau, in_modes(tables)
    whole = segment.tau + span < segment.end
    if model.ramp.shape[0] > 0 and abs(left - span) <= SAME_END * segment.end:
        span, whole = left, True  # steps of a record are parts of its intervals
    if spectral and not tried:
        tau = segment.tau
        spectral_step(index, tau, tau + segment.h, model, tables, step)
        if model.elements.first.shape[0] > 0:
            bound_rows(segment.h, tables.spectrum, step)
        else:
            bound_contacts(segment.h, model, tables.spectrum, step)
    if whole:
        if not (tried or spectral):
            product(tables.step, index, x, step.wide)
        for row in range(step.z_end.shape[0]):
            step.z_end[row] = step.wide[row]
    else:
        span = left
        state_at(segment, span, tables, step, step.z_end)
    if not (tried or spectral):
        product_of_moduli(tables.bound4, index, x, step.bounds)
    return span
