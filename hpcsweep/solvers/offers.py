"""What is known of the motions of a structure: capabilities, asked by name.

A study, a model or a figure asks for what it needs, not for what a structure is made of; what is
told where that is refused stands beside it.
"""

from collections.abc import Callable
from typing import NamedTuple

from hpcsweep.model.arguments import instance
from hpcsweep.model.structure import Structure

YIELDS = "where springs yield"


class Capability(NamedTuple):
    """Something that is known of the motions of some structures."""

    of: Callable[[Structure], bool]
    """Whether it is known of a structure."""
    lacks: str = YIELDS
    """Where it is not, in words."""
    why: str = ""
    """What is told of structures of which it is not known."""
    without: str = "sliders"
    """What those of which it is known do not have."""

    def demand(self, structure: Structure) -> None:
        """Refuse a structure, as an argument, of which it is not known.

        Raises
        ------
        ValueError
        """
        instance("structure", structure, Structure)
        if not self.of(structure):
            raise ValueError(f"structure must be without {self.without}: {self.why}")


def _never_yields(structure: Structure) -> bool:
    return not structure.sliders


def _is_elastic(structure: Structure) -> bool:
    return not (structure.sliders or structure.is_rigid.any())


BOTH = "sliders and rigid stops"
BDF = Capability(
    lambda one: _is_elastic(one) and not (one.contact_damping.any() or one.reduction),
    "where contacts have dashpots or are rigid, springs yield, or a model is reduced",
)
"""Motions by the solver `bdf`, that of the published study. With the fast modes of a reduced model
it takes minutes for a run."""
TANGENTS = Capability(
    _never_yields,
    f"{YIELDS}: only their orbits have a tangent map",
    "their tangent maps are differences",
)
"""Exact tangent maps of every motion; else differences of smooth ones, which have kinks."""
BATCHES = Capability(_never_yields)
"""Many runs, or points of a branch, by one call of a kernel; else one after the other."""
SMOOTH = Capability(_is_elastic)
"""Maps with a tangent map everywhere; else branches of their orbits have corners."""
CLOSING = Capability(_never_yields)
"""Orbits that close; else they may ratchet."""
ISOLATED = Capability(lambda one: not (one.sliders or one.n_rigid))
"""Orbits that are isolated; else they come in families."""
LINEAR = Capability(_never_yields, why="knows no free drift")
"""The motion without contacts in closed form, in proportion to A; else only while nothing slips."""
CURVES = Capability(_is_elastic, why="curves of theirs are not followed", without=BOTH)
"""Curves of special points and of limits over two parameters."""
HARMONIC = Capability(
    lambda one: all(slider.returns is None and slider.backbone is None for slider in one.sliders),
    why="flag_height, returns and backbone go with records",
    without="sliders that slip back or degrade",
)
"""Motions under a harmonic forcing."""
FORCES = Capability(
    lambda one: not one.is_rigid.any(),
    "where stops are rigid: speeds jump",
    "knows no accelerations at impacts",
    "rigid stops",
)
"""Forces of contacts, and accelerations of floors, at every instant."""
PAGES = Capability(_is_elastic, why="follows no motion", without=BOTH)
"""Motions that pages and portraits follow."""
