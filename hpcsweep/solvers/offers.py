"""What is known of the motions of a structure: capabilities, asked by name.

A study, a model or a figure asks for what it needs, not for what a structure is made of; what is
told where that is refused stands beside it.
"""

from collections.abc import Callable
from typing import NamedTuple

from hpcsweep.model.structure import Structure


class Capability(NamedTuple):
    """Something that is known of the motions of some structures."""

    of: Callable[[Structure], bool]
    """Whether it is known of a structure."""
    lacks: str
    """Where it is not, in words: "where springs yield"."""


BDF = Capability(
    lambda one: not (one.contact_damping.any() or one.sliders or one.reduction),
    "where contacts have dashpots, springs yield, or a model is reduced",
)
"""Motions by the solver `bdf`, that of the published study. With the fast modes of a reduced model
it takes minutes for a run."""
