"""The sets of a motion where a stretch of it begins: contacts past their stops, and the table's.

Those past their stops tell what ends the motion; those that push, and sliders that slip, make it
linear and are the key of its table. They are the same where all contacts are elastic. A smooth
contact within its layer is past its stop and does not push: a motion with such a one is `layer`'s.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.guard.contacts import (
    past_stops,
    pushing,
    rest_at_stops,
    set_contacts,
)
from hpcsweep.solvers.flow.guard.elements import sets_of, write_loads, write_windows
from hpcsweep.solvers.flow.guard.events import contact_key
from hpcsweep.solvers.flow.layer.visit import inside_layer
from hpcsweep.solvers.flow.state.state import start
from hpcsweep.solvers.flow.step.forcing import forcing_at

ANY = ~np.uint64(0)
"""In place of the contacts past their stops: some are within their layers."""


@inlined
def is_within(past, key, model):
    """Return whether a smooth contact is within its layer, by the sets of a motion."""
    return model.layer > 0.0 and past & ~key != np.uint64(0)


@inlined
def begin(tau, z, amplitude, elements, shared):
    """Begin a stretch in a state; return the contacts past their stops, and the set of the table.

    Sliders go on as they are. `elements` is that of `march`.
    """
    model, work, modes = shared.model, shared.work, shared.modes
    pairs, step, proof = work.forcing, work.step, work.proof
    if elements is None:
        past = key = np.uint64(0)
        if inside_layer(z, model):
            past = ANY
        else:
            past = key = contact_key(tau, z, amplitude, model, pairs, step.a)
    else:
        write_loads(modes, model.elements, pairs)
        past = past_stops(tau, z, amplitude, model, pairs, step.series)
        key = pushing(past, z, model)
        set_contacts(past, key, modes, model.contacts)
        past, key = sets_of(modes, model.elements)
        past, key = settle(tau, past, key, z, amplitude, model, modes, pairs, step.series, proof)
    begin_at(tau, z, amplitude, model, pairs, step.x)
    return past, key


@inlined
def begin_at(tau, z, amplitude, model, pairs, x):
    """Write the augmented state at tau into x."""
    forcing_at(tau, amplitude, model, pairs, 0)
    start(x, z, pairs)


@inlined
def settle(tau, past, key, z, amplitude, model, modes, pairs, series, proof):
    """Let contacts that rest at their stops go; return the sets, and write the windows, of all."""
    if model.layer == 0.0 and model.contacts.row.shape[0] > 0:
        past, key = rest_at_stops(tau, past, key, z, amplitude, model, pairs, series)
    set_contacts(past, key, modes, model.contacts)
    write_windows(modes, model.elements, proof)
    return past, key
