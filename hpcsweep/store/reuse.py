"""Reuse results of earlier files, equal to the last bit.

The result of a run is a function of its structure, its settings, its frequency and amplitude, and
the state that it starts from. So a block is taken from another file where all of these are the
same, bit for bit, and the checksums of the other file hold:

- where everything but the grid is the same: every other field of the fingerprints;
- where the other file has, at the same frequency, direction and values of the varied keys, the
  amplitudes of the block, consecutively and in this order;
- where the run before the first of them ended, in the other file, in exactly the state that the
  block starts from. A sweep is a path: after other amplitudes the same amplitudes may be on
  another branch, and then the states differ. Where the paths have met again they do not.

A block is taken whole or not at all. It enters the file as if it had been computed: with the
checksum of the new job.
"""

from collections import Counter
from collections.abc import Sequence
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from hpcsweep.job.job import meaning_but_grid
from hpcsweep.store.commit import Blocks
from hpcsweep.store.layout import Layout, StoreError
from hpcsweep.store.opening import check_own, open_layout
from hpcsweep.studies.blocks import Block, Place
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import Study, as_kind

KEPT = 16
"""Blocks of an earlier file to cache: neighbours in a new grid come from the same one."""
NOT_THE_SAME = "of another structure or setting"
NOT_IN_GRID = "not in its grid"
NOT_COMMITTED = "not computed there"
OTHER_STATE = "from another state: paths differ"
"""Reasons why a run is not taken, from the worst match to the best."""
REASONS = (NOT_THE_SAME, NOT_IN_GRID, NOT_COMMITTED, OTHER_STATE)


class Earlier:
    """An earlier file as a source of a job's results.

    Parameters
    ----------
    path : Path
    layout : Layout
        Of the job.

    Raises
    ------
    StoreError
        If it is not a campaign file, or more than the grid differs.
    """

    def __init__(self, path: Path, layout: Layout):
        self.path = path
        self.layout = open_layout(path)
        check_own(path, self.layout, "reuses")
        self._study = layout.study
        old = self.layout.study
        for study in (old, self._study):
            if not study.grid_fields:
                raise StoreError(
                    f"{path}: runs of {study.kind} depend on the whole job; nothing fits"
                )
        places = list(np.ndindex(*(len(axis.values) for axis in old.axes)))
        self._places = {_key(old.part(place)): place for place in places}
        wanted = np.ndindex(*(len(axis.values) for axis in self._study.axes))
        if not any(_key(self._study.part(place)) in self._places for place in wanted):
            raise StoreError(f"{path}: {_difference(old, self._study)}; nothing of it fits the job")
        self._blocks = Blocks(path, self.layout)
        self._believed = lru_cache(KEPT)(self._blocks.believed)
        # by the place of a part of the job
        self._place_of = cache(lambda place: self._places.get(_key(self._study.part(place))))

    def close(self) -> None:
        """Close the file."""
        self._blocks.close()

    def rows(self, block: Block, start: np.ndarray) -> dict[str, np.ndarray] | str:
        """Return the rows of a block that starts from a state, or one of `REASONS`."""
        study, inner = self._study.part_of(block)
        part = as_kind(study, RunGrid)
        place = self._place_of(block.place[: len(block.place) - len(inner.place)])
        if place is None:
            return NOT_THE_SAME
        old = as_kind(self.layout.study.part(place), RunGrid)
        taken = self._find(old, part, inner)
        if taken is None:
            return NOT_IN_GRID
        direction, frame, first = taken
        rows: list[dict[str, np.ndarray]] = []
        for at in range(first, first + inner.n_runs):
            held = self._block_of(place, old, direction, frame, at)
            whole = self._believed(held)
            if whole is None:
                return NOT_COMMITTED
            rows.append({name: values[at - held.first[-1]] for name, values in whole.items()})
        begun = first + inner.begin
        held = self._block_of(place, old, direction, frame, begun)
        before = self._blocks.start_of(held, begun - held.first[-1])
        if before.tobytes() != np.ascontiguousarray(start, "<f8").tobytes():
            return OTHER_STATE
        names = self._blocks.variables
        return {name: np.array([row[name] for row in rows]) for name in names}

    def _find(self, old: RunGrid, part: RunGrid, block: Block) -> tuple[int, int, int] | None:
        """Return the direction, the frame and the lowest amplitude of a block in the other grid."""
        direction, frame, low = block.first
        name = part.directions[direction]
        if name not in old.directions or old.run_dims != part.run_dims:
            return None
        asked = slice(low, low + block.n_runs)
        pairs = [
            (getattr(old, each), getattr(part, each)(frame)[asked])
            for each in ("along_of", "omegas_of", "amplitudes_of")
        ]
        for there in np.flatnonzero(old.frames == part.frames[frame]).tolist():
            first = int(np.searchsorted(old.along_of(there), pairs[0][1][0]))
            held = slice(first, first + block.n_runs)
            if all(np.array_equal(of(there)[held], wanted) for of, wanted in pairs):
                return old.directions.index(name), there, first
        return None

    def _block_of(self, place: Place, old: RunGrid, direction: int, frame: int, at: int) -> Block:
        """Return the block of the other file, in one of its parts, that holds an amplitude."""
        along = old.n_along - 1 - at if old.descends(direction) else at
        return self.layout.study.block((*place, direction, frame, along // old.block_size))


class Reuse:
    """Earlier files as sources of a job's results; the first that has a block provides it.

    Parameters
    ----------
    layout : Layout
        Of the job.
    paths : sequence of Path

    Attributes
    ----------
    runs : Counter
        Runs taken, by file, and runs not taken, by reason.
    """

    def __init__(self, layout: Layout, paths: Sequence[Path]):
        self._files = [Earlier(path, layout) for path in paths]
        self.runs: Counter[str] = Counter()

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            file.close()

    def rows(self, block: Block, start: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the rows of a block that starts from a state, or None where no file has them."""
        reasons = []
        for file in self._files:
            taken = file.rows(block, start)
            if not isinstance(taken, str):
                self.runs[f"from {file.path}"] += block.n_runs
                return taken
            reasons.append(taken)
        if reasons:
            self.runs[max(reasons, key=REASONS.index)] += block.n_runs
        return None


def as_text(runs: Counter[str]) -> str:
    """Format how many runs were taken, and why the others were not."""
    taken = {name: count for name, count in runs.items() if name not in REASONS}
    others = [f"{runs[reason]} {reason}" for reason in REASONS if runs[reason]]
    each = ", ".join(f"{count} {name}" for name, count in sorted(taken.items()))
    line = f"reused {sum(taken.values())} of {sum(runs.values())} runs"
    if len(taken) > 1:
        line += f" ({each})"
    return line + (f"; computed: {', '.join(others)}" if others else "")


def _key(study: Study) -> str:
    return repr(sorted(meaning_but_grid(study).items()))


def _difference(old: Study, new: Study) -> str:
    """Return in what the first parts of two jobs differ, apart from their grids."""
    place = (0,) * len(old.axes), (0,) * len(new.axes)
    there, here = meaning_but_grid(old.part(place[0])), meaning_but_grid(new.part(place[1]))
    part, name = next(key for key in [*there, *here] if there.get(key) != here.get(key))
    what = {"structure": "structure", "settings": "setting", "study": "study"}[part]
    return f"is of another {what} ({name})"
