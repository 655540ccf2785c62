"""Workspace of the kernels: arrays whose contents mean nothing between calls."""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import part, zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, N_MODAL


class LayerWorkspace(NamedTuple):
    """Stages of a step, and workspace."""

    u: np.ndarray = zeros("R", N_STAGES)
    v: np.ndarray = zeros("R", N_STAGES)
    g: np.ndarray = zeros("R", N_STAGES)
    """Displacements, velocities and accelerations at the stages."""
    fresh: np.ndarray = zeros("R", N_STAGES)
    ground: np.ndarray = zeros(N_STAGES)
    active: np.ndarray = zeros("m", dtype=int)
    """The forcing at the stages, and 0 or 1 where the sigmoid of a contact has that value on the
    whole step, 2 where it has to be evaluated."""
    free: np.ndarray = zeros("R", N_STAGES)
    speeds: np.ndarray = zeros("R", N_STAGES)
    """u_0 + c_j h v_0 and v_0: the stages without acceleration."""
    pushed: np.ndarray = zeros("L")
    taken: np.ndarray = zeros("L")
    """Of the sliders, see `layer.sliders`."""
    spring: np.ndarray = zeros("m", N_STAGES)
    """The stiffness of each contact."""
    missed: np.ndarray = zeros("m")
    """Estimated error of the integral of the force of each active contact over a step."""
    highest: np.ndarray = zeros(1)
    """Largest distance of a contact past its stop on a step, from 0."""
    state: np.ndarray = zeros("2R")
    rates: np.ndarray = zeros("R")
    """A state and its accelerations."""


MAX_DEPTH = 16
"""Cuts of a step that is searched for a contact."""


class TangentWorkspace(NamedTuple):
    """Workspace of tangent maps."""

    propagator: np.ndarray = zeros("2R", "padded 2R")
    """By columns."""
    powers: np.ndarray = zeros(N_COEFFICIENTS)
    column: np.ndarray = zeros("padded 2R")
    product: np.ndarray = zeros("padded 2R")
    kicks: np.ndarray = zeros(3, "2R")
    """Of a fast passage: two derivatives of the kick, and the kick."""
    drift: np.ndarray = zeros("2R")
    """M_+ k"""


N_TERMS = 24
"""Most terms of a Taylor series of a step."""


class SeriesWorkspace(NamedTuple):
    """A step as a Taylor series, see `step.series`."""

    field: np.ndarray = zeros("N", "padded R")
    """y'' of all rows in the augmented state, by its columns ..."""
    key: np.ndarray = zeros(2, dtype=np.uint64)
    """... for this set, if the second is 1 ..."""
    free: np.ndarray = zeros("N", "padded R")
    """... and for the empty one."""
    terms: np.ndarray = zeros(N_TERMS, "padded R+padded R")
    """Term k of all rows of y, then of y' ..."""
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """... and how many there are."""
    x: np.ndarray = zeros("N")
    a: np.ndarray = zeros("padded R")
    """An augmented state, and its accelerations."""


N_CLOSED = 31
"""Most terms of a step in modes."""


class SpectralWorkspace(NamedTuple):
    """A step of a large structure, see `step.spectral`."""

    terms: np.ndarray = zeros(2, N_CLOSED, "2 modes")
    """Terms of modal coordinates, then of their speeds, of a step, and of a tangent vector."""
    count: np.ndarray = zeros(2, dtype=int)  # type: ignore[assignment]
    """How many there are, and 1 where the bounds of all rows are those of this step."""
    start: np.ndarray = zeros("2 modes")
    """The modes of a state, ..."""
    wide: np.ndarray = zeros("padded R")
    """... half of its rows, ..."""
    pairs: np.ndarray = zeros("2H")
    """... and a term of the forcing."""
    end: np.ndarray = zeros("2 modes")
    """The modes at the end of the present step ..."""
    chain: np.ndarray = zeros(2)
    """... and when that is, and its table."""
    sums: np.ndarray = zeros(N_CLOSED + 1, LANES)
    """Terms of eight contacts, and a sum."""
    bounds: np.ndarray = zeros("modes")
    """Of the fourth derivatives of the modes."""
    exponential: np.ndarray = zeros(4, "modes")
    """Of free flight, see `spectral._write_exponential`."""


class Step(NamedTuple):
    """The present step of a motion, and what it is made of; see `step.step`."""

    x: np.ndarray = zeros("N")
    """The augmented state at its start ..."""
    z_end: np.ndarray = zeros("2R")
    """... and the state at its end, ..."""
    a: np.ndarray = zeros("R")
    a_end: np.ndarray = zeros("R")
    """... and accelerations there, inside a layer and at a stop."""
    pairs: np.ndarray = zeros("2H")
    """The forcing at its end, or within it."""
    wide: np.ndarray = zeros("padded 2R")
    """The state at its end before it is taken."""
    bounds: np.ndarray = zeros("padded R")
    """Of the fourth derivatives."""
    rows: np.ndarray = zeros("2R", N_COEFFICIENTS)
    """Polynomials, valid where `expanded`."""
    expanded: np.ndarray = zeros("2R", dtype=bool)
    values: np.ndarray = zeros(N_CLOSED)
    """Of what a polynomial is made: terms, stages, samples of a row."""
    combined: np.ndarray = zeros(1, N_COEFFICIENTS)
    """A polynomial that is made of these ..."""
    stack: np.ndarray = zeros(MAX_DEPTH + 2, 3)
    """... and the parts of one that are searched."""
    series: SeriesWorkspace = part(SeriesWorkspace)
    spectral: SpectralWorkspace = part(SpectralWorkspace)
    layer: LayerWorkspace = part(LayerWorkspace)


class Proof(NamedTuple):
    """What proves that elements keep their modes along a step, see `guard.elements`."""

    ends: np.ndarray = zeros(6, "padded E")
    """Elongations: at the start of the step, their speeds, both at its end, and bounds of their
    fourth derivatives; and a row into which eights of drifts reach."""
    windows: np.ndarray = zeros(4, "padded E")
    """Within which elongations, below and above, and speeds elements keep their modes, ..."""
    written: np.ndarray = zeros(2, "padded E")
    """... from 1 on these, and in these states."""
    kept: np.ndarray = zeros("padded E", dtype=bool)
    """Which do so on the present step (proved)."""


class Norms(NamedTuple):
    """An interval of a step on which modal norms are integrated, see `observe.modal_norm`."""

    rows: np.ndarray = zeros("n", N_COEFFICIENTS)
    """Polynomials of the modal coordinates along the step."""
    nodes: np.ndarray = zeros("padded n nodes")
    """Modal coordinates at the nodes of the interval, by mode, then node."""
    powers: np.ndarray = zeros(N_COEFFICIENTS, N_MODAL)
    """Powers of these nodes."""
    parts: np.ndarray = zeros("n")
    """What the interval adds to each norm."""
    series: np.ndarray = zeros(LANES)
    summary: np.ndarray = zeros(LANES)
    """See `modal_norm.SUMMARY`."""


class Workspace(NamedTuple):
    """Workspace for the kernels; contents mean nothing between calls.

    But for what says of itself for which elements, or set, it was written, and is kept for these:
    the windows of `Proof` and the field of `SeriesWorkspace`.
    """

    step: Step = part(Step)
    proof: Proof = part(Proof)
    norms: Norms = part(Norms)
    tangent: TangentWorkspace = part(TangentWorkspace)
    forcing: np.ndarray = zeros("2H+L")
    """Pairs of the forcing, see `forcing`, and loads of sliders."""
    moved: np.ndarray = zeros("N")
    """A trial state, and the forcing where the motion is."""
