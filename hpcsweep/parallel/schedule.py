"""Schedule tasks on ranks: the rule that the farm follows, and a simulation of it.

A task is a path: its blocks are done one after another, but not necessarily on one rank. With work
W on N ranks and costliest task d, no schedule ends before max(W / N, d). This rule comes close to
the bound for any costs:

* a free rank takes the costliest waiting task;
* a waiting task that needs as long as the fair share W(t) / N of the remaining work must start now,
or it alone ends late. The running task with the least left is recalled after its block, and waits
in its turn.

Without the second rule (only costliest first, Graham 1969) three equal tasks on two ranks take 4/3
of the bound. With it, and small blocks, they meet the bound of McNaughton (1959): as long as no
rank idles and no waiting task is longer than the fair share, both shrink at the same rate.
"""

import heapq
from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

DEDICATED_MASTER = 32
"""Ranks from which on the master does not compute: it costs at most 1/32 of the ranks, and no
rank waits for the master to finish a run of its own."""
CRITICAL = 0.95
"""Share of W(t) / N from which on a waiting task must start."""
SOON = 0.05
"""A rank is not interrupted if it is free within this share of the waiting task's rest, or for
a task that is not longer than its own by this share."""
BALANCE_SECONDS = 0.1
"""Least time (s) between two inspections of the running tasks."""
BALANCES = 200
"""Approximate maximum number of inspections of the running tasks in a whole job."""
MESSAGE_SECONDS = 1e-4
"""Assumed time (s) of the master for one message (`hpcsweep schedule --replay` measures it)."""
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
        self._waiting = sorted((left(task), -task) for task in tasks)
        self._left: dict[int, float] = {}
        self._since: dict[int, float] = {}
        self._recalled: set[int] = set()
        self._next_balance = -np.inf

    def __len__(self) -> int:
        """Return the number of waiting tasks."""
        return len(self._waiting)

    def clear(self) -> None:
        """Drop the waiting tasks."""
        self._waiting.clear()

    def take(self, now: float) -> int:
        """Start the costliest waiting task at time `now` (s)."""
        left, task = self._waiting.pop()
        self._left[-task] = left
        self._since[-task] = now
        return -task

    def progress(self, task: int, now: float) -> None:
        """Record that a running task has finished a block."""
        if task in self._since:
            self._left[task] = max(self._left[task] - (now - self._since[task]), 0.0)
            self._since[task] = now

    def end(self, task: int) -> None:
        """Record that a task is finished."""
        del self._left[task], self._since[task]
        self._recalled.discard(task)

    def put_back(self, task: int, now: float) -> None:
        """Return a running task to the waiting ones."""
        self.progress(task, now)
        insort(self._waiting, (self._left[task], -task))
        self.end(task)

    def recalls(self, now: float, every: float = BALANCE_SECONDS) -> list[int]:
        """Return the running tasks to recall; inspects them at most once in `every` (s)."""
        if self._n == 1 or not self._waiting or now < self._next_balance:
            return []
        self._refresh()
        rest = {
            task: max(left - (now - self._since[task]), 0.0) for task, left in self._left.items()
        }
        share = (sum(rest.values()) + sum(left for left, _ in self._waiting)) / self._n
        self._next_balance = now + max(every, share / BALANCES)
        victims = iter(sorted((left, task) for task, left in rest.items()))
        coming = len(self._recalled)
        found: list[int] = []
        first = bisect_right(self._waiting, (CRITICAL * share, 1))
        for left, _ in reversed(self._waiting[first:]):
            if coming > 0:
                coming -= 1
                continue
            least, victim = next(victims, (np.inf, -1))
            while victim in self._recalled:
                least, victim = next(victims, (np.inf, -1))
            if least >= (1 - SOON) * left:
                break
            if least > SOON * left:
                found.append(victim)
        self._recalled.update(found)
        return found

    def _refresh(self) -> None:
        self._waiting = sorted((self._estimate(-task), task) for _, task in self._waiting)
        for task in self._left:
            self._left[task] = self._estimate(task)


class ExactCosts:
    """Costs of tasks that are known in advance.

    Parameters
    ----------
    blocks : sequence of ndarray
        Cost (s) of the blocks of each task, in order.
    """

    def __init__(self, blocks: Sequence[np.ndarray]):
        self._rest = [np.append(np.cumsum(block[::-1])[::-1], 0.0).tolist() for block in blocks]
        self._done = [0] * len(blocks)

    def done(self, task: int, block: int, seconds: float) -> None:
        """Record that a block is done."""
        self._done[task] = block + 1

    def left(self, task: int) -> float:
        """Return the remaining cost (s) of a task."""
        return self._rest[task][self._done[task]]


@dataclass(frozen=True)
class Prediction:
    """Outcome of a simulated schedule.

    Attributes
    ----------
    n_ranks : int
    makespan : float
        Seconds from the start to the end of the last task.
    bound : float
        max(total / n_ranks, costliest): no schedule is faster.
    efficiency : float
        total / (n_ranks makespan).
    recalls : int
        Tasks that moved from one rank to another.
    messages : int
        Messages the master handled.
    master_load : float
        Share of the makespan the master spent on them.
    """

    n_ranks: int
    makespan: float
    bound: float
    efficiency: float
    recalls: int
    messages: int
    master_load: float


def ranks_that_help(costs: Sequence[float] | np.ndarray) -> float:
    """Return total / costliest: beyond it the costliest task is the bound."""
    each = np.asarray(costs, float)
    return float(each.sum() / each.max()) if each.size and each.max() > 0 else 1.0


def simulate(
    blocks: Sequence[np.ndarray],
    n_ranks: int,
    *,
    costs=None,
    message_seconds: float = MESSAGE_SECONDS,
    poll_seconds: float = 1e-3,
    switch_seconds: float = 0.0,
    computing_master: bool | None = None,
) -> Prediction:
    """Simulate the farm, event by event.

    Parameters
    ----------
    blocks : sequence of ndarray
        True cost (s) of the blocks of each task, in order.
    n_ranks : int
    costs : object with `done` and `left`, optional
        The master's estimates (`ExactCosts`, `campaign.costs.TaskCosts`). Default: the true costs.
    message_seconds : float
        Time of the master for one message.
    poll_seconds : float
        Time between two polls of a master that computes.
    switch_seconds : float
        Time a rank takes to begin or resume a task.
    computing_master : bool, optional
        Default as in `farm.run`.

    Returns
    -------
    Prediction
    """
    return _Simulation(
        blocks,
        n_ranks,
        costs or ExactCosts(blocks),
        message_seconds,
        poll_seconds,
        switch_seconds,
        computing_ranks(n_ranks) == n_ranks if computing_master is None else computing_master,
    ).run()


class _Simulation:
    """State of one simulation; arguments as `simulate`."""

    def __init__(self, blocks, n_ranks, costs, message, poll, switch, computing_master):
        self._blocks = [np.asarray(block, float).tolist() for block in blocks]
        self._n_ranks = n_ranks
        self._costs = costs
        self._message, self._poll, self._switch = message, poll, switch
        self._computing = computing_master or n_ranks == 1
        self._schedule = Schedule(
            range(len(blocks)), costs.left, n_ranks if self._computing else n_ranks - 1
        )
        self._position = [0] * len(blocks)
        self._of_rank: dict[int, int] = {}
        self._last_report: dict[int, float] = {}
        self._unreported: dict[int, list[tuple]] = {rank: [] for rank in range(n_ranks)}
        self._recalled: set[int] = set()
        self._events: list[tuple[float, int]] = []
        self._master_free = 0.0
        self._master_debt = 0.0
        self._busy = 0.0
        self._messages = self._recalls = 0

    def run(self) -> Prediction:
        idle = list(range(0 if self._computing else 1, self._n_ranks))[::-1]
        now = end = 0.0
        while True:
            while idle and len(self._schedule):
                self._start(idle.pop(), now)
            if not self._events:
                break
            now, rank = heapq.heappop(self._events)
            if self._piece_ended(rank, now):
                end = max(end, now)
                idle.append(rank)
            for task in self._schedule.recalls(now):
                self._recalled.add(task)
                self._serve(now)
        total = sum(map(sum, self._blocks))
        costliest = max(map(sum, self._blocks), default=0.0)
        return Prediction(
            n_ranks=self._n_ranks,
            makespan=end,
            bound=max(total / self._n_ranks, costliest),
            efficiency=total / (self._n_ranks * end) if end > 0 else 1.0,
            recalls=self._recalls,
            messages=self._messages,
            master_load=self._busy / end if end > 0 else 0.0,
        )

    def _serve(self, now: float) -> float:
        """Handle a message sent at `now` on the master; return the time at which it is done."""
        self._messages += 1
        self._busy += self._message
        noticed = max(now, self._master_free)
        if 0 in self._of_rank:
            # a computing master polls between two runs, and its own work waits meanwhile
            noticed += 0.5 * self._poll
            self._master_debt += self._message
        self._master_free = noticed + self._message
        return self._master_free

    def _start(self, rank: int, now: float) -> None:
        begun = now if rank == 0 else self._serve(now)
        task = self._schedule.take(begun)
        self._of_rank[rank] = task
        self._last_report[rank] = begun
        self._next_piece(rank, begun + self._switch)

    def _next_piece(self, rank: int, now: float) -> None:
        task = self._of_rank[rank]
        heapq.heappush(self._events, (now + self._blocks[task][self._position[task]], rank))

    def _report(self, rank: int, now: float) -> None:
        """Report the finished blocks of a rank to the master."""
        for task, position, seconds in self._unreported[rank]:
            self._costs.done(task, position, seconds)
        self._unreported[rank].clear()
        self._last_report[rank] = now
        self._schedule.progress(self._of_rank[rank], now)

    def _piece_ended(self, rank: int, now: float) -> bool:
        """Record the end of a block; return whether the rank is free."""
        if rank == 0 and self._master_debt > 0:
            heapq.heappush(self._events, (now + self._master_debt, rank))
            self._master_debt = 0.0
            return False
        task = self._of_rank[rank]
        position = self._position[task]
        self._position[task] = position + 1
        self._unreported[rank].append((task, position, self._blocks[task][position]))
        if position + 1 == len(self._blocks[task]):
            self._report(rank, now)
            self._schedule.end(task)
        elif task in self._recalled:
            self._report(rank, now)
            self._recalls += 1
            self._schedule.put_back(task, now)
        else:
            due = now - self._last_report[rank] >= report_interval(self._n_ranks)
            if rank == 0 or due:
                self._report(rank, now)
            if rank != 0 and due:
                self._serve(now)
            self._next_piece(rank, now)
            return False
        self._recalled.discard(task)
        del self._of_rank[rank]
        return True
