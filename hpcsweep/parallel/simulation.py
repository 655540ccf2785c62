"""Simulate the schedule of tasks whose costs are known, on any number of ranks."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from hpcsweep.parallel.schedule import Schedule, computing_ranks, report_interval

MESSAGE_SECONDS = 1e-4
"""Assumed time (s) of the master for one message (`hpcsweep schedule --replay` measures it)."""


class ExactCosts:
    """Costs of tasks that are known in advance.

    Parameters
    ----------
    blocks : sequence of ndarray
        Cost (s) of the blocks of each task, in order.
    """

    def __init__(self, blocks: Sequence[np.ndarray]):
        self._rest = [
            [*accumulate(reversed(block.tolist()), initial=0.0)][::-1] for block in blocks
        ]
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
            range(len(blocks)),
            costs.left,
            n_ranks if self._computing else n_ranks - 1,
            known=isinstance(costs, ExactCosts),
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
