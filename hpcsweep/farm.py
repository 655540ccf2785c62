"""Master and workers: hands opaque tasks to ranks as they become free. Knows no physics.

Rank 0 keeps the list, dearest first. On few ranks it also works, and looks after the others
between two points of its own task; above `DEDICATED_MASTER` ranks it only looks after them. One
rank runs the same code with nobody to look after.

Messages are small tuples. A worker says ``ready``, ``report`` (something for the master's
ears, e.g. progress), ``signal`` (it has one, but no task), ``done`` or ``stopped`` (it was told, or
has a signal of its own); the master answers ``task``, and at any time ``stop``. The run ends when
every worker has been sent ``end`` and has answered ``ended``.
"""

import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

DEDICATED_MASTER = 32
"""Ranks from which on the master does not compute."""
LEAST_SLEEP, MOST_SLEEP = 1e-4, 5e-3
"""Back-off (s) of a rank that waits for a message."""
LOST_GRACE = 5.0
"""Seconds that ranks whose launcher is gone have to stop in good order."""
STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)


class Stop(Exception):
    """Raised out of a task to leave it in good order."""


class LauncherLostError(RuntimeError):
    """The launcher has died, and with it perhaps other ranks: nobody will answer."""


class StopFlag:
    """Set by a signal, a time limit or the launcher's death; `reason` says which.

    Parameters
    ----------
    deadline : float, optional
        Time (s since the epoch) at which to stop.
    launched : bool
        Whether a launcher started this process, which then must not outlive it.

    Attributes
    ----------
    deadline : float, optional
    at_once : callable (reason), optional
        Called in the signal's handler: for times at which nobody asks `is_set`.
    """

    def __init__(self, deadline: float | None = None, launched: bool = False):
        self.reason: str | None = None
        self.at_once: Callable[[str], None] | None = None
        self.deadline = deadline
        self._parent = os.getppid() if launched else None
        self._lost_since: float | None = None
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> "StopFlag":
        self.listen()
        return self

    def listen(self) -> None:
        """Hear the signals; for good, if the flag is not used in a ``with`` statement."""
        for number in STOP_SIGNALS:
            self._previous[number] = signal.signal(number, self._on_signal)

    def ignore(self) -> None:
        """Ignore the signals from now on: Python itself stops hearing them before it ends."""
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def __exit__(self, *_exception) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _on_signal(self, number, _frame) -> None:
        self.reason = signal.Signals(number).name
        if self.at_once is not None:
            self.at_once(self.reason)

    def is_set(self) -> bool:
        """Tell whether to stop.

        Raises
        ------
        LauncherLostError
            If the launcher has been gone for `LOST_GRACE` seconds and the ranks are still there.
        """
        if self._parent is not None and os.getppid() != self._parent:
            self.reason = self.reason or "the launcher died"
            self._lost_since = self._lost_since or time.monotonic()
            if time.monotonic() - self._lost_since > LOST_GRACE:
                raise LauncherLostError(self.reason)
        if self.reason is None and self.deadline is not None and time.time() >= self.deadline:
            self.reason = "time limit"
        return self.reason is not None


def run(
    comm,
    tasks: Iterable[int],
    compute: Callable[[int, Callable[[], None], Callable[[Any], None]], Any],
    flag: StopFlag,
    on_report: Callable[[int, Any], None] = lambda rank, value: None,
    cost: Callable[[int], float] = lambda task: 0.0,
) -> bool:
    """Do all tasks on all ranks.

    Parameters
    ----------
    comm : hpcsweep.mpi.Serial or hpcsweep.mpi.Ranks
    tasks : iterable of int
        Read on rank 0 only.
    compute : callable (task, poll, report)
        Does one task on the rank it runs on. It calls ``poll()`` often, which may raise `Stop`,
        and ``report(value)`` to have the value passed to `on_report` on rank 0.
    flag : StopFlag
    on_report : callable (rank, value)
        Called on rank 0.
    cost : callable
        Estimated cost of a task; the dearest are handed out first, equal ones in order.

    Returns
    -------
    bool
        Whether all tasks were done; the same on every rank.
    """
    if comm.rank == 0:
        finished = _Master(comm, sorted(tasks, key=lambda task: -cost(task)), flag, on_report).run(
            compute
        )
    else:
        _work(comm, compute, flag)
        finished = None
    return comm.bcast(finished)


class _Master:
    """The list of tasks, and who is free."""

    def __init__(self, comm, tasks: Sequence[int], flag: StopFlag, on_report):
        self._comm = comm
        self._waiting = list(tasks)[::-1]
        self._flag = flag
        self._on_report = on_report
        self._idle: list[int] = []
        self._busy: set[int] = set(range(1, comm.size))
        self._stopping = False
        self._unfinished = False

    def run(self, compute) -> bool:
        sleep = LEAST_SLEEP
        while self._waiting or self._busy:
            if self._serve():
                sleep = LEAST_SLEEP
                continue
            if self._comm.size <= DEDICATED_MASTER and self._waiting and not self._stopping:
                task = self._waiting.pop()
                try:
                    compute(task, self._poll, lambda value: self._on_report(0, value))
                except Stop:
                    self._unfinished = True
                    self._stop()
                continue
            time.sleep(sleep)
            sleep = min(2 * sleep, MOST_SLEEP)
        for rank in range(1, self._comm.size):
            self._comm.send(("end", None), rank)
        self._hear_out()
        return not self._unfinished

    def _hear_out(self) -> None:
        """Receive what workers said before they ended: MPI cannot end with messages under way."""
        left = self._comm.size - 1
        while left:
            message = self._comm.receive()
            if message is None:
                self._flag.is_set()
                time.sleep(LEAST_SLEEP)
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
        if self._waiting:
            self._unfinished = True
            self._waiting.clear()

    def _serve(self) -> bool:
        """Handle the waiting messages; tell whether there were any."""
        if self._flag.is_set():
            self._stop()
        any_message = False
        while (message := self._comm.receive()) is not None:
            any_message = True
            rank, (kind, value) = message
            if kind == "report":
                self._on_report(rank, value)
                continue
            if kind == "signal":
                self._flag.reason = self._flag.reason or value
                self._stop()
                continue
            if kind == "stopped":
                self._flag.reason = self._flag.reason or value
                self._unfinished = True
                self._stop()
            self._busy.discard(rank)
            self._idle.append(rank)
        while self._idle and self._waiting:
            rank = self._idle.pop(0)
            self._busy.add(rank)
            self._comm.send(("task", self._waiting.pop()), rank)
        return any_message


def _work(comm, compute, flag: StopFlag) -> None:
    """Do what the master says, until it says ``end``."""
    told_to_stop = told_master = False

    def poll() -> None:
        nonlocal told_to_stop
        if flag.is_set():
            raise Stop
        message = comm.receive()
        if message is not None:
            told_to_stop = True
            raise Stop

    def report(value) -> None:
        comm.send(("report", value), 0)

    comm.send(("ready", None), 0)
    sleep = LEAST_SLEEP
    while True:
        message = comm.receive()
        if message is None:
            if flag.is_set() and not told_master:
                # idle, so that no poll says it: the others may have hours to go
                told_master = True
                comm.send(("signal", flag.reason), 0)
            time.sleep(sleep)
            sleep = min(2 * sleep, MOST_SLEEP)
            continue
        sleep = LEAST_SLEEP
        kind, task = message[1]
        if kind == "end":
            comm.send(("ended", None), 0)
            return
        if kind == "stop":
            continue
        try:
            compute(task, poll, report)
        except Stop:
            comm.send(("stopped", None if told_to_stop else flag.reason), 0)
        else:
            comm.send(("done", None), 0)
