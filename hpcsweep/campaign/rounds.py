"""Campaigns of studies that grow: rounds of runs, each known when the one before is computed.

Rank 0 walks the rounds (`Job.growth`), which depend on the labels of the runs of earlier rounds
alone. It knows labels from the file, as far as all ranks have verified it, and from
what ranks report. A round is cut into tasks: runs of one frame, which are computed together and
committed one by one. So neither ranks nor kills change which runs are computed, or any byte.
"""

import numpy as np

from hpcsweep.campaign.costs import KnownCosts
from hpcsweep.campaign.work import Failures, RankWork
from hpcsweep.parallel import farm
from hpcsweep.store import StoreError, WriteError
from hpcsweep.store.inferred import Inferred, write_inferred
from hpcsweep.store.inputs import Inputs
from hpcsweep.store.journal import BlockCost, instant, spent
from hpcsweep.studies.blocks import Block


class RoundCosts(KnownCosts):
    """Remaining cost of a round, with equal costs of all runs, so that no pilot is needed.

    The number of further rounds is unknown.
    """

    left_runs = done_runs = 0

    def block_done(self, cost: BlockCost) -> None:
        """Learn what runs cost."""
        self.left_runs -= cost.runs
        self.done_runs += cost.runs
        self._spend(cost.seconds)

    def seconds_left(self) -> float | None:
        """Estimate the wall time (s) that the rest of the round takes."""
        if not self.spent:
            return None
        return max(self.left_runs, 0) * self.spent / self.done_runs / self.n_computing


class RoundsWork(RankWork):
    """A study that grows: the tasks of one round after the other; see `RankWork`."""

    def _scan(self, _say) -> None:
        """Verify the contents of the file, each rank its share of the frames."""
        blocks, study = self._campaign.blocks, self.study
        assert blocks.layout.growth is not None
        self._growth = blocks.layout.growth
        self._shape = blocks.layout.shape(study.commit)
        self.todo, self._complete, self.scanned = [], False, True
        inferred, sound = Inferred(blocks), True
        audit = inferred.audit()
        labelled = []
        try:
            for place in inferred.places[self._comm.rank :: self._comm.size]:
                if self._flag.is_set():
                    raise farm.Stop
                runs, labels = inferred.labels(place)
                sound &= inferred.agrees(place, runs, audit)
                if runs.size:
                    labelled.append((runs, labels))
        except farm.Stop:
            self.scanned = False
        gathered = self._comm.gather((labelled, sound, self.scanned))
        self.scanned = self._comm.bcast(all(part[2] for part in gathered or []))
        if gathered is None:
            return
        self._complete = self.scanned and all(part[1] for part in gathered)
        self._rounds = self._growth.begin(None if self._complete else self._crossed())
        for part in gathered:
            for found in part[0]:
                self._rounds.labels.store(*found)
        self.done_runs = study.n_runs if self._complete else int(self._rounds.labels.known.sum())

    def _crossed(self) -> np.ndarray | None:
        """Read where known curves cross; they were found sound when the file was prepared."""
        try:
            return Inputs(self._campaign.blocks.layout).crossed()
        except StoreError as error:
            raise WriteError(f"{error}; it was changed by somebody else in mid-run") from None

    def estimate(self, _wanted: bool) -> None:
        """Begin to estimate what tasks cost."""
        self.costs = self._round_costs = RoundCosts(self._comm, self.study)

    def is_complete(self) -> bool:
        """Return whether no round is left and the file holds all; on rank 0."""
        return self._complete and super().is_complete()

    def plan(self) -> tuple[np.ndarray, int]:
        """Return the runs of the next round, and how many are inferred if there is none, on rank 0.

        All that earlier rounds computed must be committed.
        """
        runs = None if self._complete else self._rounds.next()
        if runs is not None:
            return runs, 0
        inferred = 0
        if not self._complete:
            write_inferred(self._campaign, self._growth.values(self._rounds))
            self._complete, inferred = True, self._rounds.n_inferred
        return np.zeros(0, int), inferred

    def begin(self, runs: np.ndarray) -> None:
        """Cut a round into tasks, each with a limited number of runs of a frame."""
        cuts = np.flatnonzero(np.diff(runs // self._shape[-1])) + 1
        whole = np.split(runs, cuts) if runs.size else []
        most = self._growth.at_once
        self._tasks = [part[k : k + most] for part in whole for k in range(0, len(part), most)]
        self.todo = list(range(len(self._tasks)))
        self._round_costs.left_runs = runs.size

    def left(self, task: int) -> float:
        """Return the number of runs of a task."""
        return float(len(self._tasks[task]))

    def _block(self, run: int) -> Block:
        return self.study.block(tuple(int(k) for k in np.unravel_index(run, self._shape)))

    def compute(self, task: int, poll, report, _rest=None) -> None:
        """Compute the runs of a task, commit each and report their labels."""
        poll()
        blocks = [self._block(run) for run in self._tasks[task].tolist()]
        start = self.study.initial_state
        begun = instant()
        taken = [self._reuse.rows(block, start) for block in blocks]
        new = [block for block, kept in zip(blocks, taken, strict=True) if kept is None]
        computed = iter(self._growth.compute(new, start, poll) if new else ())
        rows = [next(computed) if kept is None else kept for kept in taken]
        whole = {name: np.concatenate([values[name] for values in rows]) for name in rows[0]}
        labels, failures = self._growth.refinement.labels(whole), Failures()
        for block, values, failed in zip(blocks, rows, labels[:, 0], strict=True):
            self._campaign.write_block(block, start, values)
            if failed:
                failures.add(self._failed(block, values))
        cost = spent(new[0].place, len(new), begun) if new else None
        report((task, labels, cost, failures))

    def block_done(self, rank: int, value) -> int:
        """Take the report of a task, on rank 0; return its runs."""
        task, labels, cost, failures = value
        runs = self._tasks[task]
        self._failures.add(failures)
        self._rounds.labels.store(runs, labels)
        self.costs.block_done(BlockCost((), len(runs), cost.seconds if cost else 0.0))
        if cost:
            self.journal.note("block", rank=rank, **cost._asdict())
        return len(runs)
