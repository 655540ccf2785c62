"""Say on a terminal how much is done of what makes a user wait before or after the runs."""

import sys
import time
from collections.abc import Callable

SILENCE = 0.5
"""Seconds between two messages, and before the first: what is quick says nothing."""


def counted(doing: str) -> Callable[[int, int], None]:
    """Return what tells the number done and their total, in one line that the last one erases."""
    last, is_terminal, shown = time.monotonic(), sys.stderr.isatty(), ""

    def tell(done: int, total: int) -> None:
        nonlocal last, shown
        if done == total and shown:
            print(" " * len(shown), end="\r", file=sys.stderr, flush=True)
        elif is_terminal and done < total and time.monotonic() - last >= SILENCE:
            last, shown = time.monotonic(), f"{doing} {done} of {total}"
            print(shown, end="\r", file=sys.stderr, flush=True)

    return tell
