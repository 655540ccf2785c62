"""Store of the tables of `layer.solitary.tables`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.places import zeros
from hpcsweep.model.kernel_model import Model, forcing_size
from hpcsweep.solvers.flow.rules.solitary_rule import N_NODES
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, padded

LEVELS = 24
"""Number of step lengths: the last is 1/3,000 of the first."""
CAPACITY = 512
"""Most tables; when more occur the store is emptied and refilled."""


class Responses(NamedTuple):
    """Tables of steps so far; `count[0]` of them are valid."""

    count: np.ndarray
    place: np.ndarray
    """(MAX_TABLES, m, LEVELS) int: table of a contact set, contact and length, or -1."""
    linear: np.ndarray
    """(CAPACITY, N, N_NODES): the displacement of the contact at the nodes, column k per x_k."""
    response: np.ndarray
    """(CAPACITY, N_NODES, N_NODES): row k, by a unit force at node k."""
    step: np.ndarray
    """(CAPACITY, N, padded 2R): the state at the end, column k per x_k."""
    kick: np.ndarray
    """(CAPACITY, N_NODES, padded 2R): row k, by a unit force at node k."""
    impulse: np.ndarray
    """(N_COEFFICIENTS,): workspace ..."""
    values: np.ndarray
    """(N_NODES,): ..."""
    column: np.ndarray
    """(N_NODES,): ... for building a table."""


def empty_responses(model: Model, n_tables: int) -> Responses:
    """Allocate the store for `n_tables` contact sets; pages are touched on first use."""
    n, m = model.stiffness.shape[0], model.contacts.row.size
    size = 2 * n + forcing_size(model) + 1
    return Responses(
        count=zeros(1, dtype=int),
        place=np.full((n_tables, m, LEVELS), -1),
        linear=zeros(CAPACITY, size, N_NODES),
        response=zeros(CAPACITY, N_NODES, N_NODES),
        step=zeros(CAPACITY, size, padded(2 * n)),
        kick=zeros(CAPACITY, N_NODES, padded(2 * n)),
        impulse=zeros(N_COEFFICIENTS),
        values=zeros(N_NODES),
        column=zeros(N_NODES),
    )


@kernel
def forget(responses):
    """Empty the store."""
    responses.count[0] = 0
    responses.place[:] = -1
