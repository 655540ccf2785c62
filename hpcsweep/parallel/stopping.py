"""Stop in good order: by a signal, a time limit, or when the launcher has died."""

import os
import signal
import time
from collections.abc import Callable
from typing import Any

LOST_GRACE = 5.0
"""Seconds within which ranks whose launcher is gone must stop in good order."""
STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGHUP)


class Stop(Exception):
    """Raised out of a task to leave it in good order."""


class LauncherLostError(RuntimeError):
    """Raised where the launcher has died, perhaps with other ranks: messages stay unanswered."""


class StopFlag:
    """Flag set by a signal, a time limit or the launcher's death; `reason` says which.

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
        Called in the signal handler, for times at which nobody polls `is_set`.
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
        """Listen to the signals, permanently if the flag is not used in a ``with`` statement."""
        for number in STOP_SIGNALS:
            if number == signal.SIGHUP and signal.getsignal(number) == signal.SIG_IGN:
                continue  # nohup
            self._previous[number] = signal.signal(number, self._on_signal)

    def ignore(self) -> None:
        """Ignore the signals from now on: Python stops handling them before it exits."""
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
        """Return whether to stop.

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
