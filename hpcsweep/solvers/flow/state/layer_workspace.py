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
    missed : ndarray, shape (m,)
        Estimated error of the integral of the force of each active contact over a collocation step.
    between : ndarray, shape (2n,)
        State between both halves of a step.
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
    missed: np.ndarray
    between: np.ndarray
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
        missed=zeros(n_contacts),
        between=zeros(2 * n),
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
        Workspace ...
    halves : ndarray, shape (2, N_NODES, N_STAGES)
    middle, powers : ndarray
        ... and that of `solitary.halves`.
    """

    free: np.ndarray
    x: np.ndarray
    forces: np.ndarray
    moments: np.ndarray
    halves: np.ndarray
    middle: np.ndarray
    powers: np.ndarray


def new_solitary_workspace() -> SolitaryWorkspace:
    """Allocate the workspace."""
    return SolitaryWorkspace(
        *(zeros(N_NODES) for _ in range(3)),
        zeros(LANES, N_STAGES),
        zeros(2, N_NODES, N_STAGES),
        zeros(N_NODES),
        zeros(N_NODES),
    )
