"""Contacts of a state: bits in a contact set, distances past the stops, and speeds."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel


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
