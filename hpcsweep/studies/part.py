"""Base of studies without varied keys: each is its own only part (`hpcsweep.studies.vary`)."""

from typing import ClassVar, Self

from hpcsweep.studies.blocks import Block, Place
from hpcsweep.studies.growth import Growth
from hpcsweep.studies.seeds import Reader
from hpcsweep.studies.study import Axis


class Part:
    """A study of the values of one job."""

    axes: ClassVar[tuple[Axis, ...]] = ()

    starts_at_rest: ClassVar[bool] = False
    n_parts: ClassVar[int] = 1

    @property
    def growth(self) -> Growth | None:
        """Return None: all runs are computed."""
        return None

    def with_reader(self, _reader: Reader) -> Self:
        """Return the study itself, whose runs start from no motions of files."""
        return self

    def missing_inputs(self) -> str:
        """Return nothing."""
        return ""

    def describe_part(self, _place: Place) -> str:
        """Return nothing, as there are no `axes`."""
        return ""

    def part(self, _place: Place) -> Self:
        """Return the study itself, as there are no `axes`."""
        return self

    def part_of(self, block: Block) -> tuple[Self, Block]:
        """Return the part to which a block belongs, and the block with its index there."""
        return self, block
