"""Workspace of a collocation step; the stages are left there for observation."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.solitary_rule import N_NODES
from hpcsweep.solvers.flow.rules.tableau import N_STAGES


class LayerWorkspace(NamedTuple):
    """Stages of a step, and workspace.

    Attributes
    ----------
    u, v, g : ndarray, shape (n, N_STAGES)
        Displacements, velocities and accelerations at the stages.
    fresh, ground, active : ndarray
        Workspace.
    free, speeds : ndarray, shape (n, N_STAGES)
        u_0 + c_j h v_0 and v_0: the stages without acceleration.
    spring : ndarray, shape (m, N_STAGES)
        Workspace: the stiffness of each contact.
    values, state, rates : ndarray
        Workspace: of one component at ends and stages, shape (N_STAGES + 2,); a state and its
        accelerations, shapes (2n,) and (n,).
    """

    u: np.ndarray
    v: np.ndarray
    g: np.ndarray
    fresh: np.ndarray
    ground: np.ndarray
    active: np.ndarray
    free: np.ndarray
    speeds: np.ndarray
    spring: np.ndarray
    values: np.ndarray
    state: np.ndarray
    rates: np.ndarray


def new_layer_workspace(n: int, n_contacts: int) -> LayerWorkspace:
    """Allocate the stages of n rows of displacements."""
    stages = (n, N_STAGES)
    return LayerWorkspace(
        u=zeros(*stages),
        v=zeros(*stages),
        g=zeros(*stages),
        fresh=zeros(*stages),
        ground=zeros(N_STAGES),
        active=zeros(n_contacts, dtype=int),
        free=zeros(*stages),
        speeds=zeros(*stages),
        spring=zeros(n_contacts, N_STAGES),
        values=zeros(N_STAGES + 2),
        state=zeros(2 * n),
        rates=zeros(n),
    )


class SolitaryWorkspace(NamedTuple):
    """Node values of a step with one contact in its layer, (N_NODES,) each.

    Attributes
    ----------
    free : ndarray
        Distances without the force of the contact.
    x, forces : ndarray
        Distances, and the force beyond that in the linear motion.
    moments : ndarray, shape (LANES, N_STAGES)
        Workspace.
    """

    free: np.ndarray
    x: np.ndarray
    forces: np.ndarray
    moments: np.ndarray


def new_solitary_workspace() -> SolitaryWorkspace:
    """Allocate the workspace."""
    return SolitaryWorkspace(*(zeros(N_NODES) for _ in range(3)), zeros(LANES, N_STAGES))
