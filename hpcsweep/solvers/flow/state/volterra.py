"""Arrays of steps with a few contacts in their layers, in modes: see `layer.volterra`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.volterra_rule import N_NODES, N_PARTS, N_POWERS

MOST = 8
"""Most contacts of a step."""


class Volterra(NamedTuple):
    """Tables of steps by their length, `levels` of them, and workspace; `modes` are padded."""

    built: np.ndarray = zeros("levels", dtype=int)
    """Whether there are those of the end ..."""
    steps: np.ndarray = zeros("levels", 2, "units", "modes")
    """... q, then q', of each mode by its units ..."""
    late: np.ndarray = zeros("levels", 2, N_NODES, "modes")
    """... and by a force at each node; ..."""
    has_linear: np.ndarray = zeros("levels", "m", dtype=int)
    """... those of a distance at all nodes ..."""
    linear: np.ndarray = zeros("levels", "m", "2 modes+2H", N_NODES)
    """... by q, q' and the pairs; and of a part of a step: ..."""
    has_part: np.ndarray = zeros("levels", N_PARTS, dtype=int)
    seen: np.ndarray = zeros("levels", N_PARTS, "modal n", 2, "nodes+units", LANES)
    """... q, then q', at its nodes by forces on the mode at the nodes of the step, then units."""
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """Number of responses."""
    place: np.ndarray = zeros("levels", "m", "m", dtype=int)
    """1 + that of the response of a contact to the force of another, 0 if there is none."""
    responses: np.ndarray = zeros("responses", N_NODES, N_NODES)
    """Row k: the distance at all nodes by a unit force at node k."""
    modes: np.ndarray = zeros("2 modes+2H")
    """Modal coordinates and speeds at the start of a step, and the pairs of the forcing ..."""
    after: np.ndarray = zeros("2 modes+2H")
    """... and at its end."""
    before: np.ndarray = zeros("2 modes+2H")
    """Those at the start of the last step."""
    vector: np.ndarray = zeros("2 modes+2H")
    """A column of a tangent map, in modes, ..."""
    between: np.ndarray = zeros("2R")
    """... and in rows, ..."""
    wide: np.ndarray = zeros("padded R")
    """... and half of these."""
    bend: np.ndarray = zeros("modes")
    """Modal accelerations."""
    motion: np.ndarray = zeros("modal n", LANES)
    speeds: np.ndarray = zeros("modal n", LANES)
    """Modal coordinates and speeds at the nodes of a part of a step ..."""
    drive: np.ndarray = zeros("nodes+units")
    """... and what moves one of them."""
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
    forces: np.ndarray = zeros(MOST, N_NODES)
    """At the nodes: distances without forces, distances, and forces; ..."""
    slopes: np.ndarray = zeros(MOST, N_NODES)
    varied: np.ndarray = zeros(MOST, N_NODES)
    pushes: np.ndarray = zeros(MOST, N_NODES)
    """... and of a tangent vector: stiffnesses, distances and forces."""
    terms: np.ndarray = zeros(2, N_POWERS)
    """Of q and q' of a mode."""
    sums: np.ndarray = zeros(N_POWERS, LANES)
    eight: np.ndarray = zeros(2, LANES)
    end: np.ndarray = zeros("2R")
    """State at the end of the last step."""
