"""Costs of tasks that rank 0 knows: from the journal, a pilot, and the blocks done.

Time of the whole over the least possible one, without the pilot and with it (replayed with the
measured costs, updated from blocks in both): 1.16 and 1.03 for the 48 frames of
`jobs/paper/gaps.toml` on 16 ranks, 1.40 and 1.14 on 32; 1.33 and 1.18 for 40 frames of the whole
study on 4 ranks; nothing (1.36 and 1.37) for the same with the damping as described. It also makes
the remaining time known from the start.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.parallel.schedule import computing_ranks
from hpcsweep.store import read_history
from hpcsweep.store.records import BlockCost
from hpcsweep.studies.study import Study

MIN_ELAPSED = 0.5
"""Seconds of work after which the overhead besides the runs is known."""


class KnownCosts:
    """Costs of the unfinished tasks; made on every rank, held on rank 0.

    Nothing is kept where only one task is left: there is nothing to decide, and its runs show how
    fast it is. A single rank takes the tasks in their order, but reports the remaining time.

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    study : Study
    output : Path, optional
        File whose journal is read, where there is more than one task to do.
    done : ndarray of int, shape (n, n_axes)
        Places of the blocks of unfinished tasks that are done.
    """

    def __init__(self, comm, study: Study, output: Path | None = None, done: Any = ()):
        self.n_computing = computing_ranks(comm.size)
        self.begun: float | None = None
        self.spent = 0.0
        self.tasks: TaskCosts | None = None
        self._n_samples = costs.n_samples(study)
        if comm.rank == 0 and output is not None:
            self.tasks = TaskCosts(study)
            self.tasks.learn(read_history(output), done)

    def n_samples(self) -> int:
        """Return the number of samples that a pilot has yet to time; 0 except on rank 0."""
        if not self.tasks or self.tasks.n_known() >= self._n_samples * costs.PILOT_TIMED:
            return 0
        return self._n_samples

    def block_done(self, cost: BlockCost) -> None:
        """Update from a block."""
        if self.tasks:
            self.tasks.measured(cost)
            self.tasks.done(cost.place)
            self._spend(cost.seconds)

    def _spend(self, seconds: float) -> None:
        """Add the time of runs, from which the overhead besides them follows."""
        self.spent += seconds
        if self.begun is None:
            self.begun = time.monotonic() - seconds

    def seconds_left(self) -> float | None:
        """Estimate the wall time (s) that the runs take which are left; None if it is not known."""
        return self.tasks.remaining(self.n_computing) if self.tasks else None


def remaining_of(campaigns: Sequence[KnownCosts]) -> float | None:
    """Estimate the wall time (s) until several campaigns that share the ranks are done.

    Besides its runs a rank handles messages and commits, which take longer than the runs of single
    points: runs are scaled by the wall time that they have taken in this session.

    Returns
    -------
    float or None
        None if nothing is known of one of them.
    """
    runs = 0.0
    for each in campaigns:
        left = each.seconds_left()
        if left is None:
            return None
        runs += left
    begun = [each.begun for each in campaigns if each.begun is not None]
    elapsed = time.monotonic() - min(begun) if begun else 0.0
    spent = sum(each.spent for each in campaigns)
    if elapsed < MIN_ELAPSED or not spent:
        return runs
    return runs * max(elapsed * campaigns[0].n_computing / spent, 1.0)
