"""Tables of what is watched along the linear motion, one for each contact set; see `observe`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.model.kernel_model import CONTACT, Model, forcing_size
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, Tables


class Outputs(NamedTuple):
    """Tables of the Q rows of `Model.watched`, and workspace."""

    key: np.ndarray
    """(MAX_TABLES,) uint64: contact set of each table ..."""
    filled: np.ndarray
    """... and the flags of what it is filled for."""
    rows: np.ndarray
    """(MAX_TABLES, Q, 2R): l ..."""
    constant: np.ndarray
    """(MAX_TABLES, Q): ... and c."""
    pair: np.ndarray
    """(MAX_TABLES, N, 2Q): column k of values and slopes per x_k, `LANES` of each in turns."""
    bound4: np.ndarray
    """(MAX_TABLES, N, Q): column k bounds |q''''| per |x_k|."""
    sides: np.ndarray
    """(Q,): 1 where the peak is one of |q|, 0 where it is one of q."""
    start: np.ndarray
    """(2Q,): values and slopes at the start of a step ..."""
    end: np.ndarray
    """... and at its end."""
    place: np.ndarray
    """(2,): table and time of `end`."""
    bounds: np.ndarray
    """(Q,): workspace ..."""
    x_end: np.ndarray
    """(N,): ..."""
    pairs: np.ndarray
    """(2 H,): the forcing ..."""
    accelerations: np.ndarray
    """(R, N): ... of those who build a table ..."""
    coefficients: np.ndarray
    """(N_COEFFICIENTS,): ... or search."""


def new_outputs(model: Model, tables: Tables) -> Outputs:
    """Allocate the outputs of a structure; pages are touched when used."""
    capacity, size = tables.keys.shape[0], tables.step.shape[1]
    n_rows, wide = model.stiffness.shape[0], len(model.watched)
    return Outputs(
        key=zeros(capacity, dtype=np.uint64),
        filled=zeros(capacity, dtype=int),
        rows=zeros(capacity, wide, 2 * n_rows),
        constant=zeros(capacity, wide),
        pair=zeros(capacity, size, 2 * wide),
        bound4=zeros(capacity, size, wide),
        sides=np.where(model.watched[:, 3] == CONTACT, 0.0, 1.0),
        start=zeros(2 * wide),
        end=zeros(2 * wide),
        place=zeros(2),
        bounds=zeros(wide),
        x_end=zeros(size),
        pairs=zeros(forcing_size(model)),
        accelerations=zeros(n_rows, size),
        coefficients=zeros(N_COEFFICIENTS),
    )
