"""States of motions: their contacts, accelerations, augmented form, and the segments they begin."""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import type_of
from hpcsweep.kernels.simd.vectors import LANES, fma, load, total
from hpcsweep.model.contact import FAR, contact_force
from hpcsweep.solvers.flow.state.tables import LARGE

OVERFLOW = 1e100
"""A coordinate beyond this ends the run as NON_FINITE."""


@kernel
def is_ordinary(z):
    """Return whether no coordinate is NaN or exceeds `OVERFLOW`."""
    for value in z:
        if not abs(value) < OVERFLOW:
            return False
    return True


@kernel
def copy_state(z, out):
    """Copy z into `out`, which may be longer."""
    for i in range(z.shape[0]):
        out[i] = z[i]


@kernel
def copy_matrix(matrix, out):
    """Copy the rows of a matrix into `out`."""
    for i in range(matrix.shape[0]):
        copy_state(matrix[i], out[i])


@kernel
def make_unit(matrix):
    """Set a square matrix to the unit matrix."""
    matrix[:] = 0.0
    for i in range(matrix.shape[0]):
        matrix[i, i] = 1.0


@kernel
def start(x, z, pairs):
    """Write the augmented state: z, the pairs of the forcing, 1."""
    size = z.shape[0]
    copy_state(z, x)
    for k in range(pairs.shape[0]):
        x[size + k] = pairs[k]
    x[x.shape[0] - 1] = 1.0


@kernel
def renew_rows(z, tangent, model):
    """Recompute the rows beyond n from the first n, in z and in columns of `tangent`, if any."""
    n = model.modal_transform.shape[0]
    half = z.shape[0] // 2
    for start in range(0, 2 * half, half):
        for extra in range(half - n):
            value = 0.0
            for j in range(n):
                value += model.rows[extra, j] * z[start + j]
            z[start + n + extra] = value
            if tangent is not None:
                for column in range(tangent.shape[1]):
                    value = 0.0
                    for j in range(n):
                        value += model.rows[extra, j] * tangent[start + j, column]
                    tangent[start + n + extra, column] = value


@inlined
def is_oblique(contacts):
    """Return whether a contact pushes another."""
    return contacts.oblique.shape[0] > 0


@kernel
def contact_bit(k):
    """Return the bit of a contact in a contact set."""
    return np.uint64(1) << np.uint64(k)


@inlined
def distance(k, z, contacts):
    """Return the distance of contact k past its stop."""
    return contacts.edges[k, 0] * z[contacts.places[k, 0]] - contacts.edges[k, 3]


@inlined
def approach_speed(k, z, contacts):
    """Return the speed of that distance."""
    return contacts.edges[k, 0] * z[contacts.places[k, 1]]


@kernel
def less_linear(z, model, out):
    """Take the pull of springs and damping off the accelerations of all rows."""
    stiffness, damping, n = model.stiffness, model.damping, out.shape[0]
    if n >= LARGE:
        whole = n - n % LANES
        for i in range(n):
            springs, drag = load(stiffness, i * n) * load(z, 0), load(damping, i * n) * load(z, n)
            for j in range(LANES, whole, LANES):
                springs = fma(load(stiffness, i * n + j), load(z, j), springs)
                drag = fma(load(damping, i * n + j), load(z, n + j), drag)
            pull = total(springs + drag)
            for j in range(whole, n):
                pull += stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
            out[i] -= pull
        return
    for i in range(n):
        force = out[i]
        for j in range(n):
            force -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        out[i] = force


@kernel
def accelerations(ground, z, model, out):
    """Evaluate u'' at one state into `out`, shape (R,), `ground` being G(tau)."""
    contacts = model.contacts
    for i in range(out.shape[0]):
        force = model.forcing[i] * ground
        k = contacts.solo[i]
        if k >= 0:
            force -= contacts.sign[k] * push_of(k, z, model)
        out[i] = force
    less_linear(z, model, out)
    for other in range(contacts.others.shape[0]):
        k = contacts.others[other]
        force = push_of(k, z, model)
        for p in range(contacts.first[k], contacts.first[k + 1]):
            out[contacts.push_row[p]] -= contacts.push[p] * force


@inlined
def push_of(k, z, model):
    """Evaluate the force of contact k, on its distance, at one state."""
    contacts = model.contacts
    x = distance(k, z, contacts)
    if not model.rho * abs(x) > FAR:
        return contact_force(x, contacts.beta[k], model.rho)
    return contacts.beta[k] * x if x > 0.0 else 0.0


@inlined
def begin_period(z, tangent, model, previous):
    """Keep the state at the start of a period, and renew the rows beyond n."""
    copy_state(z, previous)
    if model.rows.shape[0] > 0:
        renew_rows(z, tangent, model)


@inlined
def end_period(period, z, points, tangent, growth):
    """Write the point that a period has reached, and the growth of the first tangent vector."""
    if growth.shape[0] > 0:
        square = 0.0
        for k in range(z.shape[0]):
            square += tangent[k, 0] ** 2
        size = math.sqrt(square)
        growth[period] = math.log(size) if size > 0.0 else -math.inf
        for k in range(z.shape[0]):
            tangent[k, 0] /= size if size > 0.0 else 1.0
    if points.shape[0] > 0:
        copy_state(z, points[period])


class Segment(NamedTuple):
    """A step of the motion, of one contact set; what is asked of it is in `step.step`."""

    kind: int
    key: np.uint64
    """Contact set."""
    index: int  # type: ignore[assignment]
    """Of its table."""
    h: float
    """Length of a full step."""
    tau: float
    """Start."""
    end: float
    """End of the period."""


class Ending(NamedTuple):
    """Ending of a segment."""

    span: float
    """Its length."""
    contact: int
    """The contact at its end, or the guard of an element, -1 if there is none."""
    passed: bool
    """Whether it has passed its stop in closed form (`passage`). The state after it is then in z,
    that before it in ``step.z_end``, the forcing is in ``work.forcing``."""
    beyond: bool
    """Whether the stop is reached after this step: try again from the edge of the layer."""
    rounded: bool
    """Whether it is passing a stop without layer, already past it by rounding: the contact set
    changes, the state does not. Testing distances again would also change all contacts with stops
    at the same place."""
    jerk: float
    """At the stop, see `pass_layer`."""
    promised: np.uint64


SEGMENT = type_of(Segment(0, np.uint64(0), 0, 0.0, 0.0, 0.0))


@inlined
def time_of(tau, model):
    """Return the time at tau of a sample interval of a record; tau of a forcing period."""
    return model.ramp[0, 2] + tau if model.ramp.shape[0] > 0 else tau


@inlined
def degrade(modes):
    """Return whether some sliders degrade: all have a memory behind the states p."""
    return modes.state.shape[0] > modes.mode.shape[0]


@kernel
def add_sliders(z, elements, stage, out):
    """Add the accelerations by the sliders in a state z to `out`, shape (R,)."""
    first = elements.rows.shape[0] - elements.stiffness.shape[0]
    for j in range(elements.stiffness.shape[0]):
        i, below = elements.rows[first + j]
        y = z[i] - z[below] if below >= 0 else z[i]
        force = fma(stage.taken[j], y, stage.pushed[j])
        for row in range(out.shape[0]):
            out[row] += force * elements.kick[j, row]
