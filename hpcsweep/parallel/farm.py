"""Master and workers: hand opaque tasks to ranks as they become free. Knows no physics.

Rank 0 keeps the list (`schedule`). On few ranks it also works, and serves the others between two
steps of its own task; above `schedule.DEDICATED_MASTER` ranks it only serves them. A single rank
runs the same code with nobody to serve.

Messages are small tuples. A worker says ``ready``, ``report`` (e.g. progress, at most a few a
second), ``done``, ``back`` (the rest of a recalled task), ``stopped`` (by the master or by a signal
of its own) or ``signal`` (it received one while it had no task); the master answers ``task``, and
at any time ``stop`` or ``recall``. The run ends when every worker has been sent ``end`` and has
answered ``ended``.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from hpcsweep.parallel.mpi import SLEEP
from hpcsweep.parallel.schedule import Schedule, computing_ranks, report_interval
from hpcsweep.parallel.stopping import Stop, StopFlag

BALANCE_SECONDS, BALANCE_SHARE = 0.1, 0.02
"""Least time (s) between two choices of tasks to recall, and largest share of the master's."""


@dataclass
class Traffic:
    """Work that the master has done."""

    messages: int = 0
    master_seconds: float = 0.0
    """Time spent on messages and on choosing tasks to recall (s)."""
    recalls: int = 0
    """Tasks that moved from one rank to another."""


def run(
    comm,
    tasks: Iterable[int],
    compute: Callable[..., Any],
    flag: StopFlag,
    on_report: Callable[[int, Any], None] = lambda rank, value: None,
    cost: Callable[[int], float] = lambda task: 0.0,
    on_end: Callable[[int], None] = lambda task: None,
    traffic: Traffic | None = None,
    tick: Callable[[], None] = lambda: None,
    at_rest: Callable[[], None] = lambda: None,
) -> bool:
    """Compute all tasks on all ranks (collective).

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    tasks : iterable of int
        Read on rank 0 only.
    compute : callable (task, poll, report), or (task, poll, report, rest)
        Does one task on the rank it runs on. It calls ``poll()`` often, which may raise `Stop`, and
        ``report(value)`` to pass a value to `on_report` on rank 0. If that returns True the task is
        recalled: `compute` may then return, in place of None, a small value from which to continue,
        and is called with it as `rest`, perhaps on another rank.
    flag : StopFlag
    on_report : callable (rank, value)
        Called on rank 0.
    cost : callable
        Estimate the remaining cost (s) of a task, as of the last report; called repeatedly on
        rank 0. The costliest tasks are handed out first, equal ones in order.
    on_end : callable (task)
        Called on rank 0 when a task is done, after its last report.
    traffic : Traffic, optional
        Filled on rank 0.
    tick : callable
        Called on rank 0 whenever it polls for messages, whether or not there are any.
    at_rest : callable
        Called repeatedly on any other rank while it is idle.

    Returns
    -------
    bool
        Whether all tasks were done; the same on every rank.
    """
    if comm.rank == 0:
        traffic = traffic or Traffic()
        master = _Master(comm, tasks, flag, on_report, cost, on_end, traffic, tick)
        finished = master.run(compute)
    else:
        _work(comm, compute, flag, at_rest)
        finished = None
    return comm.bcast(finished)


class _Master:
    """The master: the schedule and the free ranks."""

    def __init__(self, comm, tasks, flag: StopFlag, on_report, cost, on_end, traffic, tick):
        self._comm = comm
        n_computing = computing_ranks(comm.size)
        self._computes = n_computing == comm.size
        self._schedule = Schedule(tasks, cost, n_computing)
        self._flag = flag
        self._on_report, self._on_end = on_report, on_end
        self._traffic: Traffic = traffic
        self._tick = tick
        self._idle: list[int] = []
        self._busy: set[int] = set(range(1, comm.size))
        self._task_of: dict[int, int] = {}
        self._rest: dict[int, Any] = {}
        self._next_balance = 0.0
        self._stopping = False
        self._unfinished = False

    def run(self, compute) -> bool:
        while len(self._schedule) or self._busy:
            if self._serve():
                continue
            if self._computes and len(self._schedule) and not self._stopping:
                self._compute(compute)
            else:
                time.sleep(SLEEP)
        for rank in range(1, self._comm.size):
            self._comm.send(("end", None), rank)
        self._hear_out()
        return not self._unfinished

    def _compute(self, compute) -> None:
        """Compute a task, or a part of it, on this rank."""
        task, *rest = self._take(0)

        def report(value) -> bool:
            self._on_report(0, value)
            self._schedule.progress(task, time.monotonic())
            return task in self._schedule.recalled

        try:
            left = compute(task, self._poll, report, *rest)
        except Stop:
            self._unfinished = True
            self._stop()
        else:
            self._ended(0, left)

    def _take(self, rank: int) -> tuple:
        """Start a task on a rank; return what `compute` needs."""
        task = self._schedule.take(time.monotonic())
        self._task_of[rank] = task
        return (task, self._rest.pop(task)) if task in self._rest else (task,)

    def _ended(self, rank: int, rest=None) -> None:
        """Record that a rank has finished its task, or returns the rest of it."""
        task = self._task_of.pop(rank, None)
        if task is None:
            return
        if rest is None:
            self._schedule.end(task)
            self._on_end(task)
        elif self._stopping:
            self._unfinished = True
        else:
            self._traffic.recalls += 1
            self._rest[task] = rest
            self._schedule.put_back(task)

    def _hear_out(self) -> None:
        """Receive what workers sent before they ended: MPI cannot finalize before."""
        left = self._comm.size - 1
        while left:
            message = self._comm.receive()
            if message is None:
                self._flag.is_set()
                time.sleep(SLEEP)
            elif message[1][0] == "ended":
                left -= 1

    def _poll(self) -> None:
        self._serve()
        if self._stopping:
            raise Stop

    def _stop(self) -> None:
        if not self._stopping:
            self._stopping = True
            for rank in self._busy:
                self._comm.send(("stop", None), rank)
        if len(self._schedule):
            self._unfinished = True
            self._schedule.clear()

    def _serve(self) -> bool:
        """Handle the waiting messages; return whether there were any."""
        if self._flag.is_set():
            self._stop()
        self._tick()
        begun = time.perf_counter()
        handled = 0
        while (message := self._comm.receive()) is not None:
            handled += 1
            self._handle(*message)
        while self._idle and len(self._schedule):
            rank = self._idle.pop(0)
            self._busy.add(rank)
            self._comm.send(("task", self._take(rank)), rank)
        self._traffic.messages += handled
        balanced = self._comm.size > 1 and begun >= self._next_balance
        if balanced:
            recalls = self._schedule.recalls(time.monotonic())
            for rank, task in self._task_of.items():
                if rank != 0 and task in recalls:
                    self._comm.send(("recall", task), rank)
        if handled or balanced:
            spent = time.perf_counter() - begun
            self._traffic.master_seconds += spent
            if balanced:
                self._next_balance = begun + max(BALANCE_SECONDS, spent / BALANCE_SHARE)
        return handled > 0

    def _handle(self, rank: int, message: tuple) -> None:
        kind, value = message
        reports, rest = value
        for report in reports:
            self._on_report(rank, report)
        if kind == "report":
            self._schedule.progress(self._task_of[rank], time.monotonic())
            return
        if kind == "signal":
            self._flag.reason = self._flag.reason or rest
            self._stop()
            return
        if kind == "stopped":
            self._flag.reason = self._flag.reason or rest
            self._task_of.pop(rank, None)
            self._unfinished = True
            self._stop()
        else:
            self._ended(rank, rest)
        self._busy.discard(rank)
        self._idle.append(rank)


def _work(comm, compute, flag: StopFlag, at_rest) -> None:
    """Obey the master until it sends ``end``."""
    interval = report_interval(comm.size)
    told_to_stop = told_master = False
    recalled = None
    task = None
    reports: list[Any] = []
    last_report = time.monotonic()

    def listen() -> None:
        nonlocal told_to_stop, recalled
        while (message := comm.receive()) is not None:
            kind, value = message[1]
            if kind == "recall":
                recalled = value
            else:
                told_to_stop = True

    def poll() -> None:
        if flag.is_set():
            raise Stop
        listen()
        if told_to_stop:
            raise Stop

    def report(value) -> bool:
        nonlocal last_report
        reports.append(value)
        if time.monotonic() - last_report >= interval:
            say("report")
        listen()
        return recalled == task

    def say(kind: str, rest=None) -> None:
        nonlocal last_report
        comm.send((kind, (tuple(reports), rest)), 0)
        reports.clear()
        last_report = time.monotonic()

    say("ready")
    while True:
        message = comm.receive()
        if message is None:
            if flag.is_set() and not told_master:
                # idle, so that no poll says it: the others may have hours to go
                told_master = True
                say("signal", flag.reason)
            at_rest()
            time.sleep(SLEEP)
            continue
        kind, value = message[1]
        if kind == "end":
            say("ended")
            return
        if kind != "task":
            continue
        recalled, task, rest = None, value[0], value[1:]
        try:
            left = compute(task, poll, report, *rest)
        except Stop:
            say("stopped", None if told_to_stop else flag.reason)
        else:
            say("done" if left is None else "back", left)
