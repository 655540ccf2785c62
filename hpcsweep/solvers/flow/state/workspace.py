"""Workspace of the kernels: arrays whose contents mean nothing between calls."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.kernel_model import Model, forcing_size
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.state.layer_workspace import (
    LayerWorkspace,
    SolitaryWorkspace,
    new_layer_workspace,
    new_solitary_workspace,
)
from hpcsweep.solvers.flow.state.slow_workspace import HalfPassage, new_half_passage
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, N_MODAL, padded

MAX_DEPTH = 16
"""Cuts of a step that is searched for a contact."""


class TangentWorkspace(NamedTuple):
    """Workspace.

    Attributes
    ----------
    propagator : ndarray, shape (2R, padded 2R)
        By columns.
    powers : ndarray, shape (N_COEFFICIENTS,)
    column, product : ndarray, shape (padded 2R,)
    kicks : ndarray, shape (3, 2R)
        Of a fast passage: two derivatives of the kick, and the kick.
    drift : ndarray, shape (2R,)
        M_+ k
    """

    propagator: np.ndarray
    powers: np.ndarray
    column: np.ndarray
    product: np.ndarray
    kicks: np.ndarray
    drift: np.ndarray


def new_tangent_workspace(n: int) -> TangentWorkspace:
    """Allocate the workspace for n rows of displacements."""
    rows = padded(2 * n)
    return TangentWorkspace(
        zeros(2 * n, rows),
        zeros(N_COEFFICIENTS),
        zeros(rows),
        zeros(rows),
        zeros(3, 2 * n),
        zeros(2 * n),
    )


class Workspace(NamedTuple):
    """Workspace for the kernels; contents mean nothing between calls."""

    x: np.ndarray
    z_end: np.ndarray
    moved: np.ndarray
    """(2R,): a trial state."""
    wide: np.ndarray
    """Padded 2R: the end of a step."""
    bounds: np.ndarray
    """Padded R: bounds of the fourth derivatives on a step."""
    rows: np.ndarray
    """(2R, N_COEFFICIENTS): polynomials of the present step, valid where `expanded`."""
    expanded: np.ndarray
    drift_rows: np.ndarray
    modal_rows: np.ndarray
    modal_nodes: np.ndarray
    """Padded n N_MODAL: modal coordinates at the nodes of an interval, by mode, then node."""
    modal_part: np.ndarray
    modal_series: np.ndarray
    modal_powers: np.ndarray
    """(N_COEFFICIENTS, N_MODAL): powers of the nodes of an interval."""
    modal_summary: np.ndarray
    """(LANES,): see `modal_norm.SUMMARY`."""
    forcing: np.ndarray
    """(2 H,): pairs of the forcing, see `forcing`."""
    ways: np.ndarray
    stack: np.ndarray
    a: np.ndarray
    a_end: np.ndarray
    arriving: HalfPassage
    departing: HalfPassage
    tangent: TangentWorkspace
    layer: LayerWorkspace
    solitary: SolitaryWorkspace
    stage_u: np.ndarray
    stage_v: np.ndarray
    stage_a: np.ndarray
    newton: np.ndarray
    """(2 (N_STAGES + 2),): a polynomial of a layer step."""


def new_workspace(model: Model) -> Workspace:
    """Allocate the workspace for a structure."""
    n, n_modes = model.stiffness.shape[0], model.modal_transform.shape[0]
    n_forcing = forcing_size(model)
    return Workspace(
        x=zeros(2 * n + n_forcing + 1),
        z_end=zeros(2 * n),
        moved=zeros(2 * n),
        wide=zeros(padded(2 * n)),
        bounds=zeros(padded(n)),
        rows=zeros(2 * n, N_COEFFICIENTS),
        expanded=zeros(2 * n, dtype=bool),
        drift_rows=zeros(1, N_COEFFICIENTS),
        modal_rows=zeros(n_modes, N_COEFFICIENTS),
        modal_nodes=zeros(padded(n_modes * N_MODAL)),
        modal_part=zeros(n_modes),
        modal_series=zeros(LANES),
        modal_powers=zeros(N_COEFFICIENTS, N_MODAL),
        modal_summary=zeros(LANES),
        forcing=zeros(n_forcing),
        ways=zeros(n),
        stack=zeros(MAX_DEPTH + 2, 3),
        a=zeros(n),
        a_end=zeros(n),
        arriving=new_half_passage(n, 2 * n + n_forcing + 1),
        departing=new_half_passage(n, 2 * n + n_forcing + 1),
        tangent=new_tangent_workspace(n),
        layer=new_layer_workspace(n, model.contacts.row.size),
        solitary=new_solitary_workspace(),
        stage_u=zeros(N_STAGES),
        stage_v=zeros(N_STAGES),
        stage_a=zeros(N_STAGES),
        newton=zeros(2 * (N_STAGES + 2)),
    )
