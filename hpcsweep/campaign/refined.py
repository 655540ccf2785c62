"""Campaigns of refined maps: rounds of points, each known when the one before is computed.

Rank 0 walks the rounds (`hpcsweep.studies.refine.rounds`), which depend on the labels of the points
of earlier rounds alone. It knows labels from the file, as far as all ranks have verified it, and
from what ranks report. A round is cut into tasks: points of one frame, which are computed together
and committed one by one. So neither ranks nor kills change which points are computed, or any byte.
"""

import time
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from hpcsweep.campaign.pilot import KnownCosts
from hpcsweep.campaign.work import Failures, Work
from hpcsweep.parallel import farm
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.store import StoreError, WriteError
from hpcsweep.store.crossing import Crossing
from hpcsweep.store.inferred import Inferred, write_inferred
from hpcsweep.store.records import BlockCost
from hpcsweep.studies.blocks import Block
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.refinement import Refinement, Source, map_shape
from hpcsweep.studies.refine.rounds import Rounds
from hpcsweep.studies.refine.variables import SOURCE, derived_values
from hpcsweep.studies.study import Study, as_kind

AT_ONCE = 64
"""Points of a task, at most; where a point takes long one is."""
COMPUTED = (Source.COMPUTED, Source.AUDIT)


class RoundCosts(KnownCosts):
    """Remaining cost of a round, with equal costs of all points, so that no pilot is needed.

    The number of further rounds is unknown.
    """

    def __init__(self, comm, study: Study, output: Path):
        super().__init__(comm, study, output, False, np.zeros(0, int))
        self._sizes: list[int] = []
        self._left = self._done = 0

    def begin(self, sizes: list[int]) -> None:
        """Begin a round of tasks, given their numbers of points."""
        self._sizes, self._left = sizes, sum(sizes)

    def n_samples(self) -> int:
        """Return 0: there is no pilot."""
        return 0

    def block_done(self, cost: BlockCost) -> None:
        """Learn what points cost."""
        self._left -= cost.runs
        self._done += cost.runs
        self.spent += cost.seconds
        if self.begun is None:
            self.begun = time.monotonic() - cost.seconds

    def left(self, task: int) -> float:
        """Return the points of a task."""
        return float(self._sizes[task])

    def seconds_left(self) -> float | None:
        """Estimate the wall time (s) that the rest of the round takes."""
        if not self.spent:
            return None
        return max(self._left, 0) * self.spent / self._done / self.n_computing


class RefinedWork(Work):
    """A refined map: the tasks of one round after the other; see `Work`."""

    def _scan(self, say) -> None:
        """Verify the contents of the file, each rank its share of the frames."""
        del say
        blocks, study = self._campaign.blocks, self.study
        self._refinement: Refinement = study.refine
        self._shape = map_shape(study)
        quick = SOLVERS[study.settings.solver].follows_orbits and study.polls_per_run == 1
        self._at_once = AT_ONCE if quick else 1
        self.todo, self._complete, self.scanned = [], False, True
        self._inferred = 0
        inferred, sound = Inferred(blocks), True
        audit = inferred.audit()
        known = [(np.zeros(0, int), self._refinement.no_labels)]
        try:
            for place in inferred.places[self._comm.rank :: self._comm.size]:
                if self._flag.is_set():
                    raise farm.Stop
                known.append(inferred.labels(place))
                found = inferred.frame(place, audit)
                computed = found is not None and np.isin(found[SOURCE], COMPUTED)
                at = known[-1][0] % self._shape[-1]
                sound &= found is not None and np.array_equal(np.flatnonzero(computed), at)
        except farm.Stop:
            self.scanned = False
        points, labels = (np.concatenate(parts) for parts in zip(*known, strict=True))
        gathered = self._comm.gather((points, labels, sound, self.scanned))
        self._labels = Labels(study.n_runs)
        for part in gathered or []:
            self._labels.store(part[0], part[1])
        self.scanned = self._comm.bcast(all(part[3] for part in gathered or []))
        self._complete = bool(gathered) and self.scanned and all(part[2] for part in gathered or [])
        self.done_runs = study.n_runs if self._complete else int(self._labels.known.sum())
        crossed = self._crossed() if self._comm.rank == 0 else None
        self._rounds = Rounds(self._shape, self._refinement, self._labels, crossed)

    def _crossed(self) -> np.ndarray | None:
        """Read which boxes known curves cross; they were found sound when the file was prepared."""
        if self._complete:
            return None
        try:
            return Crossing(self.study).boxes()
        except StoreError as error:
            raise WriteError(f"{error}; it was changed by somebody else in mid-run") from None

    def estimate(self, wanted: bool) -> None:
        """Begin to estimate what tasks cost."""
        del wanted
        self.costs = self._round_costs = RoundCosts(self._comm, self.study, self.output)

    @cached_property
    def _walk(self) -> Iterator[np.ndarray]:
        return iter(self._rounds)

    def is_complete(self) -> bool:
        """Return whether no round is left and the file holds all; on rank 0."""
        return self._complete and super().is_complete()

    def plan(self) -> np.ndarray:
        """Return the points of the next round, on rank 0; if there is none the map is complete.

        All that earlier rounds computed must be committed.
        """
        if self._complete:
            return np.zeros(0, int)
        for points in self._walk:
            new = points[~self._labels.known[points]]
            if new.size:
                return new
        write_inferred(self._campaign, derived_values(self.study, self._rounds, self._labels))
        self._inferred = int((self._rounds.source == Source.UNKNOWN).sum())
        self._complete = True
        return np.zeros(0, int)

    def begin(self, points: np.ndarray) -> None:
        """Return the tasks of a round, each with a limited number of points of a frame."""
        frame = points // self._shape[-1]
        cuts = np.flatnonzero(np.diff(frame)) + 1
        whole = np.split(points, cuts) if points.size else []
        self._tasks = [
            part[k : k + self._at_once]
            for part in whole
            for k in range(0, len(part), self._at_once)
        ]
        self.todo = list(range(len(self._tasks)))
        self._round_costs.begin([len(part) for part in self._tasks])

    def newly_inferred(self) -> int:
        """Count the points inferred since the last call."""
        count, self._inferred = self._inferred, 0
        return count

    def _block(self, point: int) -> Block:
        *outer, frame, at = (int(k) for k in np.unravel_index(point, self._shape))
        return self.study.block((*outer, 0, frame, at))

    def compute(self, task: int, poll, report, rest=None) -> None:
        """Compute the points of a task, commit each and report their labels."""
        del rest
        poll()
        blocks = [self._block(point) for point in self._tasks[task].tolist()]
        start = self.study.initial_state
        begun = time.perf_counter()
        rows = [self._reuse.rows(block, start) for block in blocks]
        new = [k for k, found in enumerate(rows) if found is None]
        if new:
            parts = [self.study.part_of(blocks[k]) for k in new]
            part, (_, frame, _) = parts[0][0], parts[0][1].first
            places = np.array([inner.first[-1] for _, inner in parts])
            found = as_kind(part, RunGrid).runs_at(frame, places, start, poll)
            for place, k in enumerate(new):
                rows[k] = {name: values[place : place + 1] for name, values in found.items()}
        whole = {name: np.concatenate([own[name] for own in rows]) for name in rows[0]}
        labels, failures = self._refinement.labels(whole), Failures()
        for block, own, failed in zip(blocks, rows, labels[:, 0], strict=True):
            self._campaign.write_block(block, start, own)
            if failed:
                failures.add(self._failed(block, own))
        seconds = round(time.perf_counter() - begun, 6)
        cost = BlockCost(blocks[new[0]].place, len(new), seconds) if new else None
        report((task, labels, cost, failures))

    def block_done(self, rank: int, value) -> int:
        """Take the report of a task, on rank 0; return its points."""
        task, labels, cost, failures = value
        points = self._tasks[task]
        self._failures.add(failures)
        self._labels.store(points, labels)
        self.costs.block_done(BlockCost((), len(points), cost.seconds if cost else 0.0))
        if cost:
            self._note_cost(rank, cost)
        return len(points)
