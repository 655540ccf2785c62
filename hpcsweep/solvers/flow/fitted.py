"""The kernels that motions are computed by: fitted to a structure where that has been done.

Kernels fitted to the number of floors, contacts and harmonics (`hpcsweep.kernels.fitting`) take
0.55 to 0.8 of the time and give the same results to the last bit, but have to be compiled once
more: `hpcsweep run` does so where it pays, `hpcsweep warmup` where it is requested. Whoever makes
a solver gets them if they are loaded or the cache has them, else those for any structure.
"""

import functools
from typing import NamedTuple

from hpcsweep.kernels.placing import Shapes, shapes_of
from hpcsweep.kernels.separate import LOADING, FittedKernels, Separate
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.batch import follow_orbits
from hpcsweep.solvers.flow.march import march
from hpcsweep.solvers.flow.shared import SHARED, Shared, new_shared
from hpcsweep.solvers.flow.transient import end_of_transient


class MotionKernels(NamedTuple):
    """The kernels that a solver calls."""

    march: Separate
    end_of_transient: Separate
    follow_orbits: Separate


FOR_ANY = MotionKernels(march, end_of_transient, follow_orbits)


def kernels_for(shared: Shared) -> MotionKernels:
    """Return the kernels for a structure: fitted ones if they are loaded or the cache has them."""
    if not (_loaded or _kept_keys()):
        return FOR_ANY
    with LOADING:
        return _kernels_for(shapes_of(shared))


def fitted_kernels(structure: Structure) -> FittedKernels:
    """Return the kernels fitted to a structure, which may be compiled or not."""
    with LOADING:
        return _fitted(shapes_of(new_shared(kernel_model(structure, 1.0), 0.0, 0)))


def use(kernels: FittedKernels) -> None:
    """Return fitted kernels, which are loaded, to solvers that are made from now on."""
    _loaded.add(kernels.fit.key)
    _kernels_for.cache_clear()


_loaded: set[str] = set()
"""Keys of those to use, whether the cache could take them or not."""


@functools.cache
def _kept_keys() -> frozenset[str]:
    return march.kept_fits() if isinstance(march, Separate) else frozenset()


@functools.cache
def _fitted(shapes: Shapes) -> FittedKernels:
    # for good: machine code that was loaded once is found by its name, and holds addresses
    return FittedKernels(SHARED.fit(shapes))


@functools.lru_cache(maxsize=64)
def _kernels_for(shapes: Shapes) -> MotionKernels:
    if SHARED.fit(shapes).key not in _loaded | _kept_keys():
        return FOR_ANY
    kernels = _fitted(shapes)
    if not kernels.is_kept:
        return FOR_ANY
    kernels.load()
    return MotionKernels(*(kernels[one] for one in FOR_ANY))
