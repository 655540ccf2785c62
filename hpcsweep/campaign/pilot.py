"""What rank 0 knows of the tasks' costs: from the journal, a pilot, the blocks done."""

import time
from pathlib import Path

import numpy as np

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.parallel import farm
from hpcsweep.parallel.schedule import computing_ranks
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store import Journal, read_history
from hpcsweep.store.records import BlockCost

LEAST_ELAPSED = 0.5
"""Seconds of work from which on what it takes besides the runs is known."""


class KnownCosts:
    """Costs of the unfinished tasks; made on every rank, held on rank 0.

    Nothing is kept for one task: there is nothing to decide, and its runs tell how fast it is. One
    rank takes the tasks in their order, but is told the time that remains.

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    study : Study
    output : Path
        Whose journal is read.
    todo : list of int
        Unfinished tasks.
    done : ndarray of int, shape (n, n_axes)
        Places of the blocks of these that are done.
    """

    def __init__(self, comm, study, output: Path, todo: list[int], done: np.ndarray):
        self._comm, self._study = comm, study
        self._wanted = comm.bcast(len(todo) > 1)
        self._begun: float | None = None
        self._spent = 0.0
        if comm.rank != 0 or not self._wanted:
            return
        self.tasks = TaskCosts(study)
        history = read_history(output)
        for cost in history.costs:
            self.tasks.measured(cost)
        for sample in history.samples:
            self.tasks.sampled(sample)
        self.tasks.all_done(done)

    def sample(self, journal: Journal, flag: StopFlag) -> bool:
        """Time a pilot on all ranks, if it is needed; tell whether to go on (collective)."""
        count = 0
        if self._comm.rank == 0 and self._wanted:
            count = costs.n_samples(self._study)
            if self.tasks.n_known() >= count * costs.PILOT_TIMED:
                count = 0
        count = self._comm.bcast(count)

        def compute(index, poll, report) -> None:
            sample = costs.time_sample(self._study, index, poll)
            report(sample._replace(seconds=round(sample.seconds, 6)))

        def on_report(_rank, sample) -> None:
            self.tasks.sampled(sample)
            journal.note("pilot", **sample._asdict())

        return count == 0 or farm.run(self._comm, range(count), compute, flag, on_report)

    def block_done(self, cost: BlockCost) -> None:
        """Learn from a block."""
        if self._wanted:
            self.tasks.measured(cost)
            self.tasks.done(cost.place)
            self._spent += cost.seconds
            if self._begun is None:
                self._begun = time.monotonic() - cost.seconds

    def left(self, task: int) -> float:
        """Estimate the cost (s) of what is left of a task; 0 where it does not matter."""
        return self.tasks.left(task) if self._wanted and self._comm.size > 1 else 0.0

    def remaining(self) -> float | None:
        """Estimate the wall time (s) until all is done on these ranks; None if it is not known.

        Beside its runs a rank has messages and commits to do, which of single points take longer
        than these: the time that so many seconds of runs have taken in this session tells.
        """
        if not self._wanted:
            return None
        n_computing = computing_ranks(self._comm.size)
        runs = self.tasks.remaining(n_computing)
        elapsed = 0.0 if self._begun is None else time.monotonic() - self._begun
        if runs is None or elapsed < LEAST_ELAPSED or not self._spent:
            return runs
        return runs * max(elapsed * n_computing / self._spent, 1.0)
