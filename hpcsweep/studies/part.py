"""Base of studies without varied keys: each is its own only part (`hpcsweep.studies.vary`)."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Self

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Block, Place, Rows
from hpcsweep.studies.growth import StudyGrowth
from hpcsweep.studies.invariants import Broken, listed, of_each
from hpcsweep.studies.seeds import Reader
from hpcsweep.studies.study import Axis
from hpcsweep.studies.variable import Coordinate, Variable


class Part(ABC):
    """A study of the values of one job: its runs are independent unless it says otherwise."""

    structure: Structure

    axes: ClassVar[tuple[Axis, ...]] = ()

    starts_at_rest: ClassVar[bool] = False
    n_parts: ClassVar[int] = 1
    slots: ClassVar[Mapping[str, str]] = {}
    """See `hpcsweep.studies.invariants.of_each`."""

    @property
    @abstractmethod
    def variables(self) -> list[Variable]:
        """Variables of the runs, in the order of the file."""

    @property
    @abstractmethod
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""
        return {name: one.values.size for name, one in self.coordinates.items()}

    @abstractmethod
    def relations(self, block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken in runs, by what should be so."""

    def check(self, block: Block, rows: Rows) -> list[tuple[int, str]]:
        """Return the broken invariants of runs: (row, message)."""
        each = of_each(self.variables, rows, self.structure, self.slots)
        return listed(each | self.relations(block, rows))

    def predecessor(self, _block: Block, _row: int) -> Place | None:
        """Return None: every run is independent."""
        return None

    @property
    def polls_per_run(self) -> int:
        """Least number of calls of `poll` in a run."""
        return 1

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:
        """Component and range of drawn or gridded starts, by name; empty if there are none."""
        return {}

    @property
    def growth(self) -> StudyGrowth | None:
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
