"""Schedule tasks on ranks: the rule that the farm follows.

A task is a path: its blocks are done one after another, but not necessarily on one rank. With work
W on N ranks and costliest task d, no schedule ends before max(W / N, d). This rule comes close to
the bound for any costs:

* a free rank takes the costliest waiting task; those of less than `SMALL` of the fair share of all
work go in order, so that neighbours, which share tables, stay together;
* a waiting task that needs as long as the fair share W(t) / N of the remaining work must start now,
or it alone ends late. The running task with the least left is recalled after its block, and waits
in its turn.

Without the second rule (only costliest first, Graham 1969) three equal tasks on two ranks take 4/3
of the bound. With it, and small blocks, they meet the bound of McNaughton (1959): as long as no
rank idles and no waiting task is longer than the fair share, both shrink at the same rate.
"""

from bisect import bisect_right, insort
from collections.abc import Callable, Iterable

import numpy as np

DEDICATED_MASTER = 32
"""Ranks from which on the master does not compute: it costs at most 1/32 of the ranks, and no
rank waits for the master to finish a run of its own."""
SMALL = 1e-3
"""Share of W / N: as much later the last rank may end for the order of shorter tasks."""
CRITICAL = 0.95
"""Share of W(t) / N from which on a waiting task must start."""
SOON = 0.05
"""A rank is not interrupted if it is free within this share of the waiting task's rest, or for
a task that is not longer than its own by this share."""
REPORT_SECONDS = 0.5
"""Least time (s) between two reports of one rank, for up to `REPORTING_RANKS` ranks."""
REPORTING_RANKS = 500


def computing_ranks(n_ranks: int) -> int:
    """Return the number of ranks that compute: all, or all but rank 0."""
    return n_ranks if n_ranks <= DEDICATED_MASTER else n_ranks - 1


def report_interval(n_ranks: int) -> float:
    """Return the least time (s) between a rank's reports: at most 1,000 a second in all."""
    return REPORT_SECONDS * max(1.0, n_ranks / REPORTING_RANKS)


class Schedule:
    """Waiting and running tasks.

    Parameters
    ----------
    tasks : iterable of int
    left : callable (task)
        Estimate the remaining cost (s) of a task, as of its last block. Called repeatedly, so
        the estimate may improve. Equal tasks go in order.
    n_computing : int
        Ranks that compute.
    """

    def __init__(self, tasks: Iterable[int], left: Callable[[int], float], n_computing: int):
        self._estimate = left
        self._n = n_computing
        costs = {task: left(task) for task in tasks}
        self._small = SMALL * sum(costs.values()) / n_computing
        self._waiting = sorted((self._key(cost), -task) for task, cost in costs.items())
        self._since: dict[int, float] = {}
        self.recalled: set[int] = set()

    def __len__(self) -> int:
        """Return the number of waiting tasks."""
        return len(self._waiting)

    def clear(self) -> None:
        """Drop the waiting tasks."""
        self._waiting.clear()

    def take(self, now: float) -> int:
        """Start the costliest waiting task at time `now` (s)."""
        _, task = self._waiting.pop()
        self._since[-task] = now
        return -task

    def progress(self, task: int, now: float) -> None:
        """Record that a running task has finished a block."""
        if task in self._since:
            self._since[task] = now

    def end(self, task: int) -> None:
        """Record that a task is finished."""
        del self._since[task]
        self.recalled.discard(task)

    def put_back(self, task: int) -> None:
        """Return a running task to the waiting ones."""
        insort(self._waiting, (self._key(self._estimate(task)), -task))
        self.end(task)

    def _key(self, cost: float) -> float:
        """Return by what a task is sorted: its cost (s), 0 if it is small."""
        return cost if cost > self._small else 0.0

    def recalls(self, now: float) -> list[int]:
        """Return the running tasks to recall."""
        if self._n == 1 or not self._waiting:
            return []
        costs = [(self._estimate(-task), task) for _, task in self._waiting]
        waiting = sum(left for left, _ in costs)
        self._waiting = sorted((self._key(left), task) for left, task in costs)
        if self._waiting[-1][0] < CRITICAL * waiting / self._n:
            return []  # below the fair share, however little the running tasks have left
        rest = {
            task: max(self._estimate(task) - (now - since), 0.0)
            for task, since in self._since.items()
        }
        share = (sum(rest.values()) + waiting) / self._n
        victims = iter(sorted((left, task) for task, left in rest.items()))
        coming = len(self.recalled)
        tasks: list[int] = []
        first = bisect_right(self._waiting, (CRITICAL * share, 1))
        for left, _ in reversed(self._waiting[first:]):
            if coming > 0:
                coming -= 1
                continue
            least, victim = next(victims, (np.inf, -1))
            while victim in self.recalled:
                least, victim = next(victims, (np.inf, -1))
            if least >= (1 - SOON) * left:
                break
            if least > SOON * left:
                tasks.append(victim)
        self.recalled.update(tasks)
        return tasks
