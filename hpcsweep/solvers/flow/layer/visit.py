"""Visit the layer: take steps until no contact is inside its layer, and choose their lengths.

Where damping couples no modes, and few contacts are in their layers, steps are those of `volterra`;
all others are collocated. These have two limits.

- The poles of the sigmoid (`limits`), with kappa + 1 / kappa = `ELLIPSE`.
  The force has the size beta / rho, so that kappa^-16 = 2e-12 leaves a velocity error of
  about 1e-14 on a step of h = 1e-3 to 1e-2. The limit also keeps a contact that is still far away
  from stepping over its layer.
- The iteration contracts as h^2 |dG/du| / 2, so h <= `CONTRACTION` / sqrt(|dG/du|), and likewise
  for damping and forcing.

Both limits assume that the motion stays as uniform as at the start. The result of a step is checked
by `error.quadrature_error`. A step with an error above the tolerance is shortened, according to its
order, and repeated.
"""

import math
from typing import NamedTuple

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    INT,
    MATRIX,
    VECTOR,
    entry_point,
    type_of,
)
from hpcsweep.model.observed import IMPACT
from hpcsweep.solvers.flow.layer.measures import measure_layer_step, observe_layer_step
from hpcsweep.solvers.flow.layer.scheme import (
    accelerations_at_stages,
    allowed_error,
    collocate,
    finish,
    quadrature_error,
    reach,
    stiffness_up_to,
)
from hpcsweep.solvers.flow.layer.variations import layer_tangent
from hpcsweep.solvers.flow.layer.volterra.equation import write_part
from hpcsweep.solvers.flow.layer.volterra.step import (
    CONTACTS,
    GOING,
    LEVEL,
    steps_in_modes,
    volterra_steps,
)
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import (
    accelerations,
    approach_speed,
    copy_state,
    distance,
    is_oblique,
    is_ordinary,
)
from hpcsweep.solvers.flow.step.forcing import forcing_after, forcing_at, total_forcing
from hpcsweep.solvers.flow.step.spectral import write_rows
from hpcsweep.solvers.flow.step.step import layer_segment
from hpcsweep.solvers.outcome import COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT

ELLIPSE = 5.5
"""kappa + 1 / kappa with kappa = 5.3."""
CONTRACTION = 1.2
DISTANT = 100.0
"""rho |x| above which a contact that moves half its way to the stop stays where S is 0 or 1."""


class Interval(NamedTuple):
    """Interval in which a visit to the layer begins and must end."""

    tau: float
    end: float
    steps_left: int


INTERVAL = type_of(Interval(0.0, 0.0, 0))


@kernel
def inside_layer(z, model):
    """Return whether any contact is within its layer (never, if it has no width)."""
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        if abs(distance(k, z, contacts)) < model.layer:
            return True
    return False


@kernel
def longest_step(model):
    """Return the limit of steps by damping and forcing, see the module."""
    n = model.stiffness.shape[0]
    drag = 0.4 * model.omega
    for h in range(model.harmonics.shape[0]):
        drag = max(drag, 0.4 * model.harmonics[h, 0] * model.omega)
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(model.damping[i, j])
        drag = max(drag, row)
    return 0.4 / drag if drag > 0.0 else math.inf


@kernel
def step_limit(z, a, model, most):
    """Return the length of a step, at most `most`, from state z and accelerations a.

    See the module.

    Returns
    -------
    h : float
    stiffness : float
        Largest stiffness expected on the step.
    """
    stiffness = model.stiffness_bound
    contacts = model.contacts
    hardest = 0.0
    h = min(most, CONTRACTION / math.sqrt(stiffness))
    for k in range(contacts.row.shape[0] - 1, -1, -1):
        x, v = distance(k, z, contacts), approach_speed(k, z, contacts)
        pushed = contacts.sign[k] * a[contacts.row[k]]
        if model.rho * abs(x) > DISTANT and (abs(v) + abs(pushed) * h) * h < 0.5 * abs(x):
            # its reach is longer than 0.53 |x|
            nearest = x
        elif model.rho > 0.0:
            y = model.rho * x
            along = y if v >= 0.0 else -y
            size = math.sqrt(math.pi**2 + y * y)
            way = reach(size, -along, ELLIPSE) / model.rho
            if v * pushed <= 0.0 and v * v < 2.0 * abs(pushed) * way:
                way = min(way, reach(size, along, ELLIPSE) / model.rho)
            v = abs(v)
            root = math.sqrt(v * v + 2.0 * abs(pushed) * way)
            if root > 0.0:
                h = min(h, 2.0 * way / (v + root))
            nearest = x + way
        else:
            nearest = 0.0
        stiff = stiffness_up_to(nearest, contacts.beta[k], model.rho)
        # a contact that is switched on softens at first, which must not hide the stiffness of
        # others
        hardest = hardest + max(stiff, 0.0) if is_oblique(contacts) else max(hardest, stiff)
    return min(h, CONTRACTION / math.sqrt(stiffness + hardest)), stiffness + hardest


@kernel
def shortening(allowed, error):
    """Return the factor that shortens a step whose error, ~ h^(2 N_STAGES + 1), is too large."""
    return max(0.9 * (allowed / error) ** (1.0 / (2 * N_STAGES + 1)), 0.5)


@inlined
def collocated_step(interval, most, z, amplitude, shared):
    """Take a collocation step from z, to ``work.step.z_end``, whose error is within the tolerance.

    Returns
    -------
    h : float
        Its length.
    outcome : int
    steps : int
        Steps tried.
    """
    model, work = shared.model, shared.work
    tau, left = interval.tau, interval.end - interval.tau
    h, stiffness = step_limit(z, work.step.a, model, min(left, most))
    if not tau + h > tau:
        return h, SOLVER_FAILED, 0
    for steps in range(1, interval.steps_left + 1):
        step = layer_segment(tau, h)
        if collocate(
            step, z, work.step.a, amplitude, work.forcing, stiffness, model, work.step.layer
        ):
            finish(h, z, work.step.layer.g, work.step.z_end)
            error = quadrature_error(h, z, model, work.step.layer)
            allowed = allowed_error(work.step.z_end, shared.tolerance)
            if error <= allowed:
                return h, COMPLETE, steps
            h *= shortening(allowed, error)
        else:
            h *= 0.5
        if not h > 1e-14 * left:
            return h, SOLVER_FAILED, steps
    return h, STEP_LIMIT, interval.steps_left


DENSE = (1e-7, 1e-9)
"""Relative errors of forces along the polynomials of a whole step in modes, and of its halves."""
SEEN, MEASURED = 1e-10, 1e-12
"""Allowed errors of displacements for contact set, drift and norms, of speeds for measures."""


@inlined
def _parts_for(wanted, h, shared):
    """Return into how many parts a step in modes of length h is cut for what is wanted."""
    own, contacts, most = shared.volterra, shared.model.contacts, 0.0
    for i in range(own.last[CONTACTS]):
        most = max(most, contacts.beta[own.which[i]])
    pull = most / shared.model.rho * h
    error = pull / MEASURED if wanted & ANY_MEASURE else pull * h / SEEN
    if error * DENSE[0] <= 1.0:
        return 1
    return 2 if error * DENSE[1] <= 1.0 else 4


@kernel
def _begin_part(part, n_parts, tau, h, z, amplitude, wanted, shared):
    """Write a part, of length h, of the step of `volterra_steps`, as a collocated one."""
    model, work, own = shared.model, shared.work, shared.volterra
    spectrum, stage, level = shared.tables.spectrum, work.step.layer, own.last[LEVEL]
    write_part(n_parts - 1 + part, n_parts * h, level, model, spectrum, own, stage.u, stage.v)
    accelerations_at_stages(tau, h, z, amplitude, work.forcing, model, work)
    if part < n_parts - 1:
        finish(h, z, stage.g, work.step.z_end)
    else:
        write_rows(own.modes, spectrum, work.step.z_end)
    if wanted & IMPACT:
        quadrature_error(h, z, model, stage)


@entry_point(
    (FLOAT, INT, INT), BYTES, INTERVAL, VECTOR, FLOAT, INT, MATRIX, inner=True, specialises=True
)
def visit_layer(packed, interval, z, amplitude, wanted, tangent):
    """Integrate from tau until no contact is inside its layer, or until `end`.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`.
    interval : Interval
    z : ndarray, shape (2R,)
    amplitude : float
    wanted, tangent
        See `march.march`.

    Returns
    -------
    tau : float
    outcome : int
    steps : int
        Steps taken.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.work.step.z_end)
    tangent = as_long_as(tangent, shared.work.step.z_end)
    tau, end, steps_left = interval
    model, work = shared.model, shared.work
    pairs = work.forcing
    forcing_at(tau, amplitude, model, pairs, 0)
    ground = total_forcing(pairs, 0, model)
    accelerations(ground, z, model, work.step.a)
    most = longest_step(model)
    modal = steps_in_modes(shared)
    own = shared.volterra
    own.last[GOING] = 0
    steps = 0
    while True:
        left, room = end - tau, steps_left - steps
        if room == 0:
            return tau, STEP_LIMIT, steps
        after, h, used, n_parts = tau, 0.0, 0, 1
        if modal:
            after, h, used = volterra_steps(packed, tau, end, room, z, amplitude, wanted, tangent)
        parted = used > 0
        if parted and wanted == NO_TALLY:
            tau, ground, n_parts = after, total_forcing(pairs, 0, model), 0
            accelerations(ground, z, model, work.step.a)
        elif parted:
            n_parts = _parts_for(wanted, h, shared)
            h /= n_parts
        else:
            own.last[GOING] = 0
            interval = Interval(tau, end, room)
            h, outcome, used = collocated_step(interval, most, z, amplitude, shared)
            if outcome != COMPLETE:
                return tau, outcome, steps + used
        steps += used
        for part in range(n_parts):
            if parted:
                _begin_part(part, n_parts, tau, h, z, amplitude, wanted, shared)
            begun, before = tau, ground
            tau = end if h >= left else tau + h
            forcing_after(h, tau, amplitude, pairs, 0, model, pairs)
            if parted and part == n_parts - 1:
                tau = after
                copy_state(own.modes[own.modes.shape[0] - pairs.shape[0] :], pairs)
            ground = total_forcing(pairs, 0, model)
            accelerations(ground, work.step.z_end, model, work.step.a_end)
            if wanted != NO_TALLY:
                observe_layer_step(layer_segment(begun, h), z, wanted, shared)
            if wanted & ANY_MEASURE:
                measure_layer_step(packed, (begun, h, amplitude, before, ground), wanted)
            if tangent.shape[1] > 0 and not parted:
                layer_tangent(h, model, work.step.layer, tangent)
            copy_state(work.step.z_end, z)
            copy_state(work.step.a_end, work.step.a)
        if not is_ordinary(z):
            return tau, NON_FINITE, steps
        if tau >= end or not inside_layer(z, model):
            return tau, COMPLETE, steps
