"""Workspace of half a slow passage (`slow_passage`)."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.passage_rule import N_NODES
from hpcsweep.solvers.flow.state.tables import padded


class HalfPassage(NamedTuple):
    """Workspace of half a passage, also used by its tangent map.

    Attributes
    ----------
    x : ndarray, shape (N,)
        Augmented state at the stop.
    kicked : ndarray, shape (padded 2R,)
        Effect of the force of this side on it.
    series, moments : ndarray, shape (LANES,)
        Series of the distance, moments of the force.
    times, forces, slopes, shares, moved : ndarray, shape (N_NODES,)
        At the nodes: times from the stop, forces and their derivatives by the distance, as smooth
        factors of the weight; workspace.
    response : ndarray, shape (N_NODES, N_NODES)
        Row j: displacement at all nodes per unit force at node j.
    """

    x: np.ndarray
    kicked: np.ndarray
    series: np.ndarray
    moments: np.ndarray
    times: np.ndarray
    forces: np.ndarray
    slopes: np.ndarray
    shares: np.ndarray
    moved: np.ndarray
    response: np.ndarray


def new_half_passage(n: int, size: int) -> HalfPassage:
    """Allocate the workspace for n rows of displacements, `size` of the augmented state."""
    at_nodes = (zeros(N_NODES) for _ in range(5))
    return HalfPassage(
        zeros(size),
        zeros(padded(2 * n)),
        zeros(LANES),
        zeros(LANES),
        *at_nodes,
        zeros(N_NODES, N_NODES),
    )
