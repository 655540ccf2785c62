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
    values: np.ndarray = zeros(N_COEFFICIENTS)
    """What a polynomial of a step is made of."""
    highest: np.ndarray = zeros(1)
    """Largest distance of a contact past its stop on a step, from 0."""
    state: np.ndarray = zeros("2R")
    rates: np.ndarray = zeros("R")
    pairs: np.ndarray = zeros("2H")
    """A state, its accelerations and the forcing."""


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
    """A step as a Taylor series, see `linear.series`."""

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
    """A step of a large structure, see `linear.spectral`."""

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
    values: np.ndarray = zeros(N_CLOSED)
    """Terms of a row."""
    sums: np.ndarray = zeros(N_CLOSED + 1, LANES)
    """Terms of eight contacts, and a sum."""
    bounds: np.ndarray = zeros("modes")
    """Of the fourth derivatives of the modes."""
    exponential: np.ndarray = zeros(4, "modes")
    """Of free flight, see `spectral._write_exponential`."""


class Workspace(NamedTuple):
    """Workspace for the kernels; contents mean nothing between calls.

    But for what says of itself for which elements, or set, it was written, and is kept for these:
    `windows` and the field of `series`.
    """

    x: np.ndarray = zeros("N")
    z_end: np.ndarray = zeros("2R")
    moved: np.ndarray = zeros("2R")
    """A trial state."""
    wide: np.ndarray = zeros("padded 2R")
    """The end of a step."""
    bounds: np.ndarray = zeros("padded R")
    """Of the fourth derivatives on a step."""
    rows: np.ndarray = zeros("2R", N_COEFFICIENTS)
    """Polynomials of the present step, valid where `expanded`."""
    expanded: np.ndarray = zeros("2R", dtype=bool)
    drift_rows: np.ndarray = zeros(1, N_COEFFICIENTS)
    ends: np.ndarray = zeros(6, "padded E")
    """Elongations of elements: at the start of the present step, their speeds, both at its end, and
    bounds of their fourth derivatives; a row that none reads ..."""
    windows: np.ndarray = zeros(4, "padded E")
    """... and within which elongations, below and above, and speeds they keep their modes, ..."""
    known: np.ndarray = zeros(2, "padded E")
    """... from 1 on these, and in these states."""
    kept: np.ndarray = zeros("padded E", dtype=bool)
    """Which elements keep their modes on the present step (proved)."""
    modal_rows: np.ndarray = zeros("n", N_COEFFICIENTS)
    modal_nodes: np.ndarray = zeros("padded n nodes")
    """Modal coordinates at the nodes of an interval, by mode, then node."""
    modal_part: np.ndarray = zeros("n")
    modal_series: np.ndarray = zeros(LANES)
    modal_powers: np.ndarray = zeros(N_COEFFICIENTS, N_MODAL)
    """Powers of the nodes of an interval."""
    modal_summary: np.ndarray = zeros(LANES)
    """See `modal_norm.SUMMARY`."""
    forcing: np.ndarray = zeros("2H+L")
    """Pairs of the forcing, see `forcing`, and loads of sliders."""
    stack: np.ndarray = zeros(MAX_DEPTH + 2, 3)
    a: np.ndarray = zeros("R")
    a_end: np.ndarray = zeros("R")
    tangent: TangentWorkspace = part(TangentWorkspace)
    layer: LayerWorkspace = part(LayerWorkspace)
    series: SeriesWorkspace = part(SeriesWorkspace)
    spectral: SpectralWorkspace = part(SpectralWorkspace)
