"""Choose the kernels of motions: specialised to a structure where these have been compiled.

Kernels specialised to the number of floors, contacts and harmonics
(`hpcsweep.kernels.compile.specialise`) take 0.65 to 0.9 of the time and give the same results to
the last bit, but have to be compiled once more: `hpcsweep run` does so where it pays, `hpcsweep
warmup` where it is requested. A new solver uses them if they are loaded or cached, otherwise those
for any structure.

The kernel of elements, a quarter of what there is to compile, is compiled and loaded for structures
that have some, and that of smooth contacts beside them likewise; those of measures
(`march_measured`, `measure_layer_step`) where measures are requested.
"""

import functools
from typing import NamedTuple

from hpcsweep.kernels.compile.entry_points import (
    LOADING,
    EntryPoint,
    SpecialisedKernels,
    with_called,
)
from hpcsweep.kernels.compile.places import Pattern, Words
from hpcsweep.kernels.compile.warm import load_all, missing
from hpcsweep.model.kernel_model import Model, kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.layer.elements import visit_layers
from hpcsweep.solvers.flow.layer.measures import measure_layer_step
from hpcsweep.solvers.flow.march.march import march, march_elements, march_measured
from hpcsweep.solvers.flow.orbit.batch import follow_orbits
from hpcsweep.solvers.flow.orbit.chain import advance_chain
from hpcsweep.solvers.flow.orbit.contract import take_round
from hpcsweep.solvers.flow.orbit.transient import end_of_transient
from hpcsweep.solvers.flow.orbit.yielding import march_yielding
from hpcsweep.solvers.flow.state.shared import SHARED, new_shared


class MotionKernels(NamedTuple):
    """The kernels that a solver calls."""

    march: EntryPoint
    end_of_transient: EntryPoint
    follow_orbits: EntryPoint
    advance_chain: EntryPoint
    take_round: EntryPoint
    """These two are compiled on their first call: sweeps do without."""
    march_yielding: EntryPoint
    """Of structures with sliders."""
    measures: list[EntryPoint]
    """What these call where measures are requested."""

    def load_measures(self) -> None:
        """Compile these, or load them, before measures are requested."""
        load_all(self.measures)


OF_BRANCHES = advance_chain, take_round

FOR_ANY = MotionKernels(
    march,
    end_of_transient,
    follow_orbits,
    *OF_BRANCHES,
    march_yielding,
    with_called(march_measured, measure_layer_step),
)


def kernels_for(model: Model, words: Words) -> MotionKernels:
    """Return the kernels for a structure: specialised ones if they are loaded or in the cache.

    Parameters
    ----------
    model : Model
    words : Words
        Of the `Pattern` of its `Shared`.
    """
    elements = of_elements(model)
    if not (elements or _loaded or _kept_keys()):
        return FOR_ANY
    with LOADING:
        return _kernels_for(words, elements)


def of_elements(model: Model) -> tuple[EntryPoint, ...]:
    """Return the kernels of the elements of a structure, whose contacts may be smooth."""
    if not model.elements.first.size:
        return ()
    layers = visit_layers, measure_layer_step  # that of sliders, which always ask for drifts
    yields = (march_yielding,) if model.elements.stiffness.size else ()
    return (march_elements, *yields, *layers) if model.layer else (march_elements, *yields)


def needed_kernels(
    structure: Structure | None, specialised: bool = False, measures: bool = False
) -> list[EntryPoint]:
    """Return the kernels that motions of a structure need, compiled or not.

    Parameters
    ----------
    structure : Structure or None
        None for those that motions of any structures need.
    specialised : bool
        Return those specialised to the structure.
    measures : bool
        Include those of measures.
    """
    if structure is None:
        every = _needed((march_elements, march_yielding, visit_layers), measures)
        return with_called(*every, *OF_BRANCHES)
    model = kernel_model(structure, 1.0)
    needed = _needed(of_elements(model), measures)
    if not specialised:
        return needed
    with LOADING:
        return _specialised(_words_for(model)).of(needed)


@functools.cache
def _needed(elements: tuple[EntryPoint, ...], measures: bool) -> list[EntryPoint]:
    measuring = (march_measured, measure_layer_step) * measures
    return with_called(march, end_of_transient, follow_orbits, *elements, *measuring)


def branch_kernels(structure: Structure) -> list[EntryPoint]:
    """Return what following branches calls besides, of the kernels that solvers call."""
    needed = with_called(*OF_BRANCHES, *FOR_ANY.measures)
    model = kernel_model(structure, 1.0)
    words = _words_for(model)
    return needed if kernels_for(model, words) is FOR_ANY else _specialised(words).of(needed)


def _words_for(model: Model) -> Words:
    return Pattern(new_shared(model, 0.0, 0)).words


def use(structure: Structure) -> None:
    """Make new solvers of a structure call the kernels specialised to it, which are loaded."""
    _loaded.add(SHARED.specialise(_words_for(kernel_model(structure, 1.0))).key)
    _kernels_for.cache_clear()


_loaded: set[str] = set()
"""Keys of the specialised kernels to use, cached or not."""


@functools.cache
def _kept_keys() -> frozenset[str]:
    return march.kept_specialisations() if isinstance(march, EntryPoint) else frozenset()


@functools.cache
def _specialised(words: Words) -> SpecialisedKernels:
    # never released: loaded machine code is found by its name, and holds addresses
    return SpecialisedKernels(SHARED.specialise(words))


@functools.lru_cache(maxsize=64)
def _kernels_for(words: Words, elements: tuple[EntryPoint, ...]) -> MotionKernels:
    needed = _needed(elements, False)
    if SHARED.specialise(words).key in _loaded | _kept_keys():
        kernels = _specialised(words)
        specialised = kernels.of(needed)
        if not missing(specialised):
            load_all(specialised)
            called = (kernels[entry] for entry in FOR_ANY if isinstance(entry, EntryPoint))
            return MotionKernels(*called, kernels.of(FOR_ANY.measures))  # type: ignore[call-arg,arg-type]
    if elements:
        load_all(needed)
    return FOR_ANY
