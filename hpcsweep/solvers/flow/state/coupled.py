"""Arrays of steps with several contacts in their layers, in modes: see `layer.coupled`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.solitary_rule import N_NODES, N_POWERS

MOST = 8
"""Most contacts of a step."""


class Coupled(NamedTuple):
    """Tables of steps by their length, `levels` of them, and workspace; `modes` are padded."""

    built: np.ndarray = zeros("levels", dtype=int)
    """Whether there are those of the free motion ..."""
    turns: np.ndarray = zeros("levels", 4, "modes", N_NODES)
    """... C and S at the nodes, and the end's share of a force at each: of q, of q'; ..."""
    ends: np.ndarray = zeros("levels", 3, "modes")
    """... C, S and S' at the end."""
    powers: np.ndarray = zeros("levels", "modes", 2, N_POWERS)
    """Terms of S and S'."""
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """Number of responses."""
    place: np.ndarray = zeros("levels", "m", "m", dtype=int)
    """1 + that of the response of a contact to the force of another, 0 if there is none ..."""
    forced: np.ndarray = zeros("levels", "m", dtype=int)
    """... and to the forcing."""
    responses: np.ndarray = zeros("responses of modes", N_NODES, N_NODES)
    """Row k: the distance at all nodes by a unit force at node k."""
    modes: np.ndarray = zeros("2 modes")
    """Modal coordinates and speeds at the start of a step ..."""
    after: np.ndarray = zeros("2 modes")
    """... and at its end."""
    before: np.ndarray = zeros("2 modes")
    """Those at the start of the last step."""
    vector: np.ndarray = zeros("2 modes")
    """A vector to be transformed, ..."""
    wide: np.ndarray = zeros("padded R")
    """... and half of its rows."""
    bend: np.ndarray = zeros("modes")
    """Modal accelerations."""
    motion: np.ndarray = zeros("modes", N_NODES)
    """Modal coordinates at the nodes without forces ..."""
    speeds: np.ndarray = zeros("modes", N_NODES)
    """... and their speeds, of `output`."""
    distances: np.ndarray = zeros(3, "m")
    """Distances of all contacts past their stops, their speeds and accelerations; ..."""
    moved: np.ndarray = zeros(2, "m")
    """... distances and speeds at the end."""
    which: np.ndarray = zeros(MOST, dtype=int)
    """Contacts of the step ..."""
    last: np.ndarray = zeros(3, dtype=int)
    """... their number, the level of its length, and whether ``modes`` are those of its end."""
    free: np.ndarray = zeros(MOST, N_NODES)
    x: np.ndarray = zeros(MOST, N_NODES)
    forces: np.ndarray = zeros(MOST + 1, N_NODES)
    """At the nodes: distances without forces, distances, and forces, the last minus G; ..."""
    slopes: np.ndarray = zeros(MOST, N_NODES)
    varied: np.ndarray = zeros(MOST, N_NODES)
    pushes: np.ndarray = zeros(MOST + 1, N_NODES)
    """... and of a tangent vector: stiffnesses, distances and forces."""
    terms: np.ndarray = zeros(N_POWERS)
    sums: np.ndarray = zeros(N_POWERS, LANES)
    eight: np.ndarray = zeros(2, LANES)
    moments: np.ndarray = zeros(MOST + 1, N_POWERS, LANES)
    between: np.ndarray = zeros("2R")
    """A column of a tangent map."""
    end: np.ndarray = zeros("2R")
    pairs: np.ndarray = zeros("2H")
    """State and forcing at the end of the last step."""
