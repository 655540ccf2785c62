"""Tables of absolute accelerations along the linear motion, one for each contact set."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.model.kernel_model import ACCELERATION, Model, forcing_size
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, Tables, padded


class Outputs(NamedTuple):
    """Tables of the n floors, see `observe.outputs`, and workspace; Q is n, padded."""

    first_floor: int
    """Place of the floors in `Model.watched`, ..."""
    first: int
    """... of their accelerations ..."""
    first_contact: int
    """... and of the contacts."""
    key: np.ndarray
    """(MAX_TABLES,) uint64: contact set of each table ..."""
    filled: np.ndarray
    """... and which are filled."""
    pair: np.ndarray
    """(MAX_TABLES, N, 2Q): column k of values and slopes per x_k, `LANES` of each in turns."""
    poly: np.ndarray
    """(MAX_TABLES, n, N, N_COEFFICIENTS): polynomials on a step per x_k."""
    bound4: np.ndarray
    """(MAX_TABLES, N, Q): column k bounds |q''''| per |x_k|."""
    start: np.ndarray
    """(2Q,): values and slopes at the start of a step ..."""
    end: np.ndarray
    """... and at its end."""
    place: np.ndarray
    """(2,): table and time of `end`."""
    bounds: np.ndarray
    """(Q,): workspace ..."""
    rows: np.ndarray
    """(n, N_COEFFICIENTS): ..."""
    x_end: np.ndarray
    """(N,): ..."""
    pairs: np.ndarray
    """(2 H,): the forcing ..."""
    functionals: np.ndarray
    """(n, 2R): ... of those who build a table ..."""
    constant: np.ndarray
    """(n,): ..."""
    accelerations: np.ndarray
    """(R, N)"""


def new_outputs(model: Model, tables: Tables) -> Outputs:
    """Allocate the outputs of a structure; pages are touched when used."""
    capacity, size = tables.keys.shape[0], tables.step.shape[1]
    n, n_rows = len(model.modal_transform), model.stiffness.shape[0]
    return Outputs(
        first_floor=padded(len(model.drift_rows)),
        first=int(np.argmax(model.watched[:, 3] == ACCELERATION)),
        first_contact=len(model.watched) - padded(len(model.contacts.row)),
        key=zeros(capacity, dtype=np.uint64),
        filled=zeros(capacity, dtype=bool),
        pair=zeros(capacity, size, 2 * padded(n)),
        poly=zeros(capacity, n, size, N_COEFFICIENTS),
        bound4=zeros(capacity, size, padded(n)),
        start=zeros(2 * padded(n)),
        end=zeros(2 * padded(n)),
        place=np.full(2, -1.0),
        bounds=zeros(padded(n)),
        rows=zeros(n, N_COEFFICIENTS),
        x_end=zeros(size),
        pairs=zeros(forcing_size(model)),
        functionals=zeros(n, 2 * n_rows),
        constant=zeros(n),
        accelerations=zeros(n_rows, size),
    )
