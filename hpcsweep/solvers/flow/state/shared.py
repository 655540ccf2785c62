"""What kernels share: the data of a structure, and the tally of a motion.

Tally: contact set, drift, modal norms, peaks, impacts
------------------------------------------------------

`peaks`, `impacts` and `modal_norm` update it on linear segments, `layer.measures` by the
same functions inside a layer.

Data shared by the kernels of one structure and frequency, passed as one array
------------------------------------------------------------------------------
`SHARED.place` and `WATCH.place` copy a whole tuple into an array of bytes once; kernels read it as
a view: `read_shared`, `read_watch`.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.places import Pattern, Words, allocate, part, zeros
from hpcsweep.kernels.simd import LANES
from hpcsweep.model.kernel_model import Model, kernel_model, model_at_frequency
from hpcsweep.model.observed import ANY_PEAK, IMPACT, MAX_ORDER, N_IMPACTS, ROWS
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.state.tables import (
    Outputs,
    Tables,
    outputs_of,
    sizes_of,
    spectrum_of,
)
from hpcsweep.solvers.flow.state.workspace import Volterra, Workspace

NO_TALLY, MAXIMA, NORMS = range(3)
ANY_MEASURE = ANY_PEAK | IMPACT | ROWS
"""What to gather: nothing; contact set and drift; these and the modal norms. To the latter two
flags of `hpcsweep.model.observed` may be added, `ENERGY` of motions of elements under a record."""


LINEAR_STEPS, PASSAGES, LAYER_STEPS, VISITS, TABLES = range(5)
"""Places in ``Shared.counts``: linear steps, passages in closed form or changes of elements, steps
inside layers, visits to these, and tables that were built."""


class Tally(NamedTuple):
    """Quantities gathered over a window."""

    contact: np.ndarray = zeros(1, dtype=np.uint64)
    """Bit k is set once contact k has closed."""
    peak_drift: np.ndarray = zeros(1)
    free_time: np.ndarray = zeros(1)
    """Time without contact."""
    modal: np.ndarray = zeros("n")
    """Integral of |q_j| / ||q|| over that time."""
    peaks: np.ndarray = zeros("W")
    """Of each row of `Model.watched`, of a contact past its stop; they start from 0 ..."""
    times: np.ndarray = zeros("W")
    """... and when they are."""
    impacts: np.ndarray = zeros(N_IMPACTS, "m")
    """See `hpcsweep.model.observed`."""
    closed: np.ndarray = zeros(1, dtype=np.uint64)
    """The contacts that are closed now."""
    beside: np.ndarray = zeros(1, dtype=np.uint64)
    """Those that have not come apart since they have last been closed ..."""
    size: np.ndarray = zeros(1)
    """... by the rounding of this largest displacement or speed, see `measures.ROUNDING`."""
    energy: np.ndarray = zeros("n+1", "n")
    """Integrals of u_i' u_j', and below of G u_i'."""


class Asked(NamedTuple):
    """Rows of displacements that are asked for, `LANES` at once, and what they do."""

    counts: np.ndarray = zeros(2, dtype=int)
    """Rows, and harmonics of each."""
    rows: np.ndarray = zeros(LANES, "n")
    sums: np.ndarray = zeros(LANES, 4 + 2 * MAX_ORDER)
    """Largest value of each, and of minus it; integrals of y, of y^2, and of y cos and y sin of
    each harmonic."""


class Modes(NamedTuple):
    """What elements carry along a motion; see `hpcsweep.model.elements`."""

    mode: np.ndarray = zeros("E", dtype=int)
    state: np.ndarray = zeros("states")
    """p, 0 at rest, behind it the memory of each slider, if any has one, see `degrading` ..."""
    path: np.ndarray = zeros("E")
    """... the sum of its changes; of a limit the time at which the motion has left it ..."""
    taken: np.ndarray = zeros("E", dtype=int)
    """... and how often it has changed by more than rounding."""


@inlined
def wants_norms(wanted):
    """Return whether modal norms are requested."""
    return wanted & 3 == NORMS


@kernel
def clear(tally):
    """Reset the tally."""
    tally.contact[0] = 0
    tally.peak_drift[0] = 0.0
    tally.free_time[0] = 0.0
    for j in range(tally.modal.shape[0]):
        tally.modal[j] = 0.0
    for w in range(tally.peaks.shape[0]):
        tally.peaks[w] = tally.times[w] = 0.0
    tally.closed[0] = tally.beside[0] = 0
    tally.size[0] = 0.0
    for i in range(tally.impacts.shape[0]):
        for k in range(tally.impacts.shape[1]):
            tally.impacts[i, k] = 0.0


class Shared(NamedTuple):
    """Constants of all motions of one structure at one frequency, and workspace."""

    model: Model
    outputs: Outputs
    tolerance: float
    """Allowed local error of a step inside a layer, relative to max(1, |z|)."""
    max_steps: int
    """Most steps in one forcing period."""
    tables: Tables = part(Tables)
    work: Workspace = part(Workspace)
    tally: Tally = part(Tally)
    asked: Asked = part(Asked)
    modes: Modes = part(Modes)
    volterra: Volterra = part(Volterra)
    counts: np.ndarray = zeros(5, dtype=int)
    """Linear steps, fast passages, layer steps, layer visits and tables built so far."""


class Watch(NamedTuple):
    """Record of the points of a motion, and workspace for Newton's method."""

    since: np.ndarray = zeros(1, dtype=int)
    """Forcing periods since the watch began; 0 restarts it."""
    history: np.ndarray = zeros("points", "2R")
    """The last points, cyclic."""
    distance: np.ndarray = zeros("ring", "ring")
    """The last e_k (`transient`), cyclic, of every p."""
    close: np.ndarray = zeros("ring", dtype=int)
    """For how many points each p has been closed ..."""
    falling: np.ndarray = zeros("ring", dtype=int)
    """... or approached."""
    previous: np.ndarray = zeros("2R")
    point: np.ndarray = zeros("2R")
    """Start of a step of Newton's method, after a jump the orbit's point."""
    taken: np.ndarray = zeros("2R")
    """Point at which `matrix` was computed."""
    matrix: np.ndarray = zeros("2R", "2R")
    """Tangent map over an orbit."""
    factors: np.ndarray = zeros("2R", "2R")
    left: np.ndarray = zeros("2R")


def new_shared(model: Model, tolerance: float, max_steps: int) -> Shared:
    """Allocate tables and workspace for a structure."""
    sizes = sizes_of(model)
    return allocate(
        Shared,
        sizes,
        model=model,
        outputs=outputs_of(model, sizes),
        tables=allocate(Tables, sizes, spectrum=spectrum_of(model, sizes)),
        tolerance=float(tolerance),
        max_steps=int(max_steps),
    )


def new_watch(size: int, max_period: int) -> Watch:
    """Allocate the workspace for states of a size and orbits of up to `max_period` periods."""
    return allocate(Watch, {"2R": size, "points": 2 * max_period + 1, "ring": max_period + 1})


# of any structure: the types are the same for all
SHARED = Arena(new_shared(kernel_model(Structure(1), 1.0), 0.0, 0))
WATCH = Arena(new_watch(2, 1))
read_shared, read_watch = SHARED.read, WATCH.read


def watch_of(size: int, max_period: int) -> tuple[Watch, np.ndarray]:
    """Return a watch, and packed."""
    return WATCH.copy(_watch_pattern(size, max_period))


@lru_cache(maxsize=64)
def _watch_pattern(size: int, max_period: int) -> Pattern:
    return WATCH.pattern(new_watch(size, max_period))


def shared_at(
    structure: Structure, omega: float, tolerance: float, max_steps: int, parts: int = 1
) -> tuple[Shared, np.ndarray, Words]:
    """Return the data of a structure at a forcing frequency, packed, and the words of its arrays.

    Of `parts` of a forcing period the period is that of one. A structure keeps its pattern. Of
    1.2 ms for a solver of three floors that saves 1.0: along a curve over Omega, each step needs
    two.
    """
    pattern = _pattern_of(structure, tolerance, max_steps)

    def change(shared: Shared) -> Shared:
        model = model_at_frequency(shared.model, structure, omega)
        return shared._replace(model=model._replace(period=model.period / parts))

    shared, packed = SHARED.copy(pattern, change)
    return shared, packed, pattern.words


@lru_cache(maxsize=64)
def _pattern_of(structure: Structure, tolerance: float, max_steps: int) -> Pattern:
    return SHARED.pattern(new_shared(kernel_model(structure, 1.0), tolerance, max_steps))
