"""Choose the kernels of motions: specialised to a structure where these have been compiled.

Kernels specialised to the number of floors, contacts and harmonics
(`hpcsweep.kernels.compile.specialise`) take 0.55 to 0.8 of the time and give the same results to
the last bit, but have to be compiled once more: `hpcsweep run` does so where it pays, `hpcsweep
warmup` where it is requested. A new solver uses them if they are loaded or cached, otherwise those
for any structure.
"""

import functools
from typing import NamedTuple

from hpcsweep.kernels.compile.entry_points import LOADING, EntryPoint, SpecialisedKernels
from hpcsweep.kernels.compile.places import Shapes, shapes_of
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.orbit.batch import follow_orbits
from hpcsweep.solvers.flow.orbit.transient import end_of_transient
from hpcsweep.solvers.flow.period.march import march
from hpcsweep.solvers.flow.state.shared import SHARED, Shared, new_shared


class MotionKernels(NamedTuple):
    """The kernels that a solver calls."""

    march: EntryPoint
    end_of_transient: EntryPoint
    follow_orbits: EntryPoint


FOR_ANY = MotionKernels(march, end_of_transient, follow_orbits)


def kernels_for(shared: Shared) -> MotionKernels:
    """Return the kernels for a structure: specialised ones if they are loaded or in the cache."""
    if not (_loaded or _kept_keys()):
        return FOR_ANY
    with LOADING:
        return _kernels_for(shapes_of(shared))


def specialised_kernels(structure: Structure) -> SpecialisedKernels:
    """Return the kernels specialised to a structure, compiled or not."""
    with LOADING:
        return _specialised(shapes_of(new_shared(kernel_model(structure, 1.0), 0.0, 0)))


def use(kernels: SpecialisedKernels) -> None:
    """Make new solvers call these specialised kernels, which are loaded."""
    _loaded.add(kernels.specialisation.key)
    _kernels_for.cache_clear()


_loaded: set[str] = set()
"""Keys of the specialised kernels to use, cached or not."""


@functools.cache
def _kept_keys() -> frozenset[str]:
    return march.kept_specialisations() if isinstance(march, EntryPoint) else frozenset()


@functools.cache
def _specialised(shapes: Shapes) -> SpecialisedKernels:
    # never released: loaded machine code is found by its name, and holds addresses
    return SpecialisedKernels(SHARED.specialise(shapes))


@functools.lru_cache(maxsize=64)
def _kernels_for(shapes: Shapes) -> MotionKernels:
    if SHARED.specialise(shapes).key not in _loaded | _kept_keys():
        return FOR_ANY
    kernels = _specialised(shapes)
    if not kernels.is_kept:
        return FOR_ANY
    kernels.load()
    return MotionKernels(*(kernels[one] for one in FOR_ANY))
