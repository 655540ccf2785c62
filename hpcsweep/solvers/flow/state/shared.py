"""Data shared by the kernels of one structure and frequency, passed as one array.

numba unpacks every array of a call. For the fifty of a flow map that takes as long as several
forcing periods. `SHARED.place` and `WATCH.place` therefore copy the whole tuple into a buffer once,
in the kernels' form, from which they read it: `read_shared`, `read_watch`.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile.places import Pattern, Shapes, zeros
from hpcsweep.model.kernel_model import Model, kernel_model, model_at_frequency
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.state.outputs import Outputs, new_outputs
from hpcsweep.solvers.flow.state.responses import Responses, empty_responses
from hpcsweep.solvers.flow.state.tables import Tables, empty_tables
from hpcsweep.solvers.flow.state.tally import Tally, new_tally
from hpcsweep.solvers.flow.state.workspace import Workspace, new_workspace


class Shared(NamedTuple):
    """Constants of all motions of one structure at one frequency, and workspace."""

    model: Model
    tables: Tables
    responses: Responses
    work: Workspace
    tally: Tally
    outputs: Outputs
    counts: np.ndarray
    """(5,) int: linear steps, fast passages, layer steps, layer visits and tables built so far."""
    previous: np.ndarray
    """(2R,): workspace for the start of a period."""
    no_points: np.ndarray
    """(0, 2R)"""
    no_tangent: np.ndarray
    """(2R, 0)"""
    no_growth: np.ndarray
    """(0,)"""
    tolerance: float
    """Allowed local error of a step inside a layer, relative to max(1, |z|)."""
    max_steps: int
    """Most steps in one forcing period."""


class Watch(NamedTuple):
    """Record of the points of a motion, and workspace for Newton's method."""

    since: np.ndarray
    """(1,) int: forcing periods since the watch began; 0 restarts it."""
    history: np.ndarray
    """(2 max_period + 1, 2R): the last points, cyclic."""
    distance: np.ndarray
    """(max_period + 1, max_period + 1): the last e_k (`transient`), cyclic, of every p."""
    close: np.ndarray
    """(max_period + 1,) int: for how many points each p has been closed ..."""
    falling: np.ndarray
    """... or approached."""
    previous: np.ndarray
    point: np.ndarray
    """(2R,): start of a step of Newton's method, after a jump the orbit's point."""
    taken: np.ndarray
    """(2R,): point at which `matrix` was computed."""
    matrix: np.ndarray
    """(2R, 2R): tangent map over an orbit."""
    factors: np.ndarray
    left: np.ndarray


def new_shared(model: Model, tolerance: float, max_steps: int) -> Shared:
    """Allocate tables and workspace for a structure."""
    n = model.stiffness.shape[0]
    tables = empty_tables(model)
    return Shared(
        model=model,
        tables=tables,
        responses=empty_responses(model, tables.keys.shape[0]),
        work=new_workspace(model),
        tally=new_tally(model.modal_transform.shape[0], model),
        outputs=new_outputs(model, tables),
        counts=zeros(5, dtype=int),
        previous=zeros(2 * n),
        no_points=zeros(0, 2 * n),
        no_tangent=zeros(2 * n, 0),
        no_growth=zeros(0),
        tolerance=float(tolerance),
        max_steps=int(max_steps),
    )


def new_watch(n: int, max_period: int) -> Watch:
    """Allocate the workspace for n rows and orbits of up to `max_period` forcing periods."""
    size = 2 * n
    ring = max_period + 1
    return Watch(
        since=zeros(1, dtype=int),
        history=zeros(2 * max_period + 1, size),
        distance=zeros(ring, ring),
        close=zeros(ring, dtype=int),
        falling=zeros(ring, dtype=int),
        previous=zeros(size),
        point=zeros(size),
        taken=zeros(size),
        matrix=zeros(size, size),
        factors=zeros(size, size),
        left=zeros(size),
    )


# of any structure: the types are the same for all
SHARED = Arena(new_shared(kernel_model(Structure(1), 1.0), 0.0, 0))
WATCH = Arena(new_watch(1, 1))
read_shared, read_watch = SHARED.read, WATCH.read


def shared_at(
    structure: Structure, omega: float, tolerance: float, max_steps: int
) -> tuple[Shared, np.ndarray, Shapes]:
    """Return the data of a structure at a forcing frequency, packed, and the shapes of its arrays.

    A structure keeps its pattern. Of 1.2 ms for a solver of three floors that saves 1.0: along a
    curve over Omega, each step needs two.
    """
    pattern = _pattern_of(structure, tolerance, max_steps)
    shared, packed = SHARED.copy(
        pattern, lambda it: it._replace(model=model_at_frequency(it.model, structure, omega))
    )
    return shared, packed, pattern.shapes


@lru_cache(maxsize=64)
def _pattern_of(structure: Structure, tolerance: float, max_steps: int) -> Pattern:
    return SHARED.pattern(new_shared(kernel_model(structure, 1.0), tolerance, max_steps))
