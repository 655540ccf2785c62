"""Cut long integrations into pieces of bounded time, between which to poll.

While a kernel computes, Python handles no signal and no message. A motion is therefore advanced
piece by piece; since a forcing period depends only on its start state, results are equal to those
of one call, to the last bit. The time of one piece determines the number of periods of the next.
"""

import time
from collections.abc import Callable, Iterator

Poll = Callable[[], None] | None
"""Called now and then within long work; may raise to leave it."""
PIECE_SECONDS = 0.05
"""Intended time of a piece: if the next periods are ten times as slow, Ctrl-C is heard after half a
second."""
POLL_PERIODS = 2000
"""Most forcing periods of a piece: two milliseconds where there is little contact, beside which the
microsecond of a call is negligible."""
GROWTH = 8
"""Largest factor from one piece to the next."""


class Polling:
    """Polling within the motions of one solver."""

    def __init__(self) -> None:
        self._size = 1
        self._begun = 0.0

    def cut(self, n_periods: int, poll: Poll = None) -> Iterator[tuple[int, int]]:
        """Cut `n_periods` into pieces (first, last), and call `poll` before each."""
        if poll is not None and n_periods == 0:
            poll()
        last = 0
        while last < n_periods:
            if poll is not None:
                poll()
            first, last = last, min(last + self._size, n_periods)
            begun = time.perf_counter()
            yield first, last
            self._learn(last - first, time.perf_counter() - begun)

    def begin(self, poll: Poll = None) -> int:
        """Begin a piece that counts its own periods; return its most periods."""
        if poll is not None:
            poll()
        self._begun = time.perf_counter()
        return self._size

    def end(self, n_periods: int) -> None:
        """End the piece after `n_periods`."""
        self._learn(n_periods, time.perf_counter() - self._begun)

    def _learn(self, n_periods: int, seconds: float) -> None:
        """Choose the size of the next piece from the time of one."""
        if n_periods < self._size and seconds < PIECE_SECONDS:
            return
        fitting = n_periods * PIECE_SECONDS / max(seconds, 1e-9)
        self._size = max(1, int(min(fitting, GROWTH * n_periods, POLL_PERIODS)))
