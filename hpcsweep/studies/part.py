"""Base of studies without varied keys: each is its own only part (`hpcsweep.studies.vary`)."""

from typing import Any, ClassVar, Self

from hpcsweep.studies.blocks import Block, Place
from hpcsweep.studies.study import Axis


class Part:
    """A study of the values of one job."""

    axes: ClassVar[tuple[Axis, ...]] = ()
    has_seeds: ClassVar[bool] = False

    n_parts: ClassVar[int] = 1
    refine: Any = None

    def describe_part(self, _place: Place) -> str:
        """Return nothing, as there are no `axes`."""
        return ""

    def part(self, _place: Place) -> Self:
        """Return the study itself, as there are no `axes`."""
        return self

    def part_of(self, block: Block) -> tuple[Self, Block]:
        """Return the part to which a block belongs, and the block with its index there."""
        return self, block
