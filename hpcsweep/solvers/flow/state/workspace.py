"""Workspace of the kernels: arrays whose contents mean nothing between calls."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import part, zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.rules.volterra_rule import N_NODES, N_PARTS
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS


class LayerWorkspace(NamedTuple):
    """Stages of a step, and workspace."""

    u: np.ndarray = zeros("R", N_STAGES)
    v: np.ndarray = zeros("R", N_STAGES)
    g: np.ndarray = zeros("R", N_STAGES)
    """Displacements, velocities and accelerations at the stages."""
    ground: np.ndarray = zeros(N_STAGES)
    active: np.ndarray = zeros("m", dtype=int)
    """The forcing at the stages, and 0 or 1 where the sigmoid of a contact has that value on the
    whole step, 2 where it has to be evaluated."""
    pushed: np.ndarray = zeros("L")
    taken: np.ndarray = zeros("L")
    """Of the sliders, see `layer.sliders`."""
    missed: np.ndarray = zeros("m")
    """Estimated error of the integral of the force of each active contact over a step."""


N_TERMS = 24
"""Most terms of a Taylor series of a step."""


class SeriesWorkspace(NamedTuple):
    """A step as a Taylor series, see `step.series`."""

    field: np.ndarray = zeros("N", "padded R")
    """y'' of all rows in the augmented state, by its columns ..."""
    key: np.ndarray = zeros(2, dtype=np.uint64)
    """... for this set, if the second is 2, of which there is `free` where it is not 0 ..."""
    free: np.ndarray = zeros("N", "padded R")
    """... and for the empty one."""
    slope: np.ndarray = zeros("L")
    """Part of its stiffness that a slider keeps in a set that has its bit."""
    reactions: np.ndarray = zeros("rigid", "N")
    """Of the contacts that rest in that set, by the augmented state, see `constraint`."""
    terms: np.ndarray = zeros(N_TERMS, "padded R+padded R")
    """Term k of all rows of y, then of y' ..."""
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """... and how many there are."""


N_CLOSED = 31
"""Most terms of a step in modes."""


class SpectralWorkspace(NamedTuple):
    """A step of a large structure, see `step.spectral`."""

    terms: np.ndarray = zeros(2, N_CLOSED, "2 modes")
    """Terms of modal coordinates, then of their speeds, of a step, and of a tangent vector."""
    count: np.ndarray = zeros(2, dtype=int)  # type: ignore[assignment]
    """How many there are, and 1 where the bounds of all rows are those of this step."""
    end: np.ndarray = zeros("2 modes")
    """The modes at the end of the present step ..."""
    chain: np.ndarray = zeros(2)
    """... and when that is, and its table."""


class Step(NamedTuple):
    """The present step of a motion, and what it is made of; see `step.step`."""

    x: np.ndarray = zeros("N")
    """The augmented state at its start ..."""
    z_end: np.ndarray = zeros("2R")
    """... and the state at its end, ..."""
    a: np.ndarray = zeros("R")
    a_end: np.ndarray = zeros("R")
    """... and accelerations there, inside a layer and at a stop."""
    wide: np.ndarray = zeros("padded 2R")
    """The state at its end before it is taken."""
    bounds: np.ndarray = zeros("padded R")
    """Of the fourth derivatives."""
    rows: np.ndarray = zeros("2R", N_COEFFICIENTS)
    """Polynomials, valid where `expanded`."""
    expanded: np.ndarray = zeros("2R", dtype=bool)
    series: SeriesWorkspace = part(SeriesWorkspace)
    spectral: SpectralWorkspace = part(SpectralWorkspace)
    layer: LayerWorkspace = part(LayerWorkspace)


class Proof(NamedTuple):
    """What proves that elements keep their modes along a step, see `guard.elements`."""

    ends: np.ndarray = zeros(6, "padded E")
    """Elongations: at the start of the step, their speeds, both at its end, and bounds of their
    fourth derivatives; and a row into which eights of drifts reach."""
    windows: np.ndarray = zeros(6, "padded E")
    """Within which elongations, below and above, and speeds elements keep their modes; and for
    which mode, from 1 on, and in which state that is written."""
    kept: np.ndarray = zeros("padded E", dtype=bool)
    """Which do so on the present step (proved)."""


class Workspace(NamedTuple):
    """Workspace for the kernels; contents mean nothing between calls.

    But for what says of itself for which elements, or set, it was written, and is kept for these:
    the windows of `Proof` and the field of `SeriesWorkspace`.
    """

    step: Step = part(Step)
    proof: Proof = part(Proof)
    forcing: np.ndarray = zeros("2H+L")
    """Pairs of the forcing, see `forcing`, and loads of sliders."""


MOST = 8
"""Most contacts of a step."""


class Volterra(NamedTuple):
    """Tables of steps by their length, `levels` of them, and workspace; `modes` are padded."""

    built: np.ndarray = zeros("levels", "built", dtype=int)
    """Which of them there are: those of the end, of each part of a step, and of each contact."""
    steps: np.ndarray = zeros("levels", 2, "units", "modes")
    """At the end q, then q', of each mode by its units ..."""
    late: np.ndarray = zeros("levels", 2, N_NODES, "modes")
    """... and by a force at each node."""
    linear: np.ndarray = zeros("levels", "m", "2 modes+2H", N_NODES)
    """The distance of a contact at all nodes by q, q' and the pairs."""
    seen: np.ndarray = zeros("levels", N_PARTS, "modal n", 2, "nodes+units", LANES)
    """Of a part q, then q', at its nodes by forces on the mode at the nodes of the step, then by
    units."""
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """Number of responses."""
    place: np.ndarray = zeros("levels", "m", "m", dtype=int)
    """1 + that of the response of a contact to the force of another, 0 if there is none."""
    responses: np.ndarray = zeros("responses", N_NODES, N_NODES)
    """Row k: the distance at all nodes by a unit force at node k."""
    modes: np.ndarray = zeros("2 modes+2H")
    """Modal coordinates and speeds at the start of a step, and the pairs of the forcing ..."""
    before: np.ndarray = zeros("2 modes+2H")
    """... and those at the start of the last step."""
    distances: np.ndarray = zeros(3, "m")
    """Distances of all contacts past their stops, their speeds and accelerations; ..."""
    which: np.ndarray = zeros(MOST, dtype=int)
    """Contacts of the step ..."""
    last: np.ndarray = zeros(3, dtype=int)
    """... their number, the level of its length, and whether ``modes`` are those of its end."""
    x: np.ndarray = zeros(MOST, N_NODES)
    forces: np.ndarray = zeros(MOST, N_NODES)
    """Distances and forces at the nodes."""
