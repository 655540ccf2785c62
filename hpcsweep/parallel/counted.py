"""Say on a terminal how much is done of what makes a user wait before or after the runs."""

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")
SILENCE = 0.5
"""Seconds between two messages, and before the first: what is quick says nothing."""


def counted(items: Iterable[Item], total: int, doing: str) -> Iterator[Item]:
    """Go through items; tell the number done, of a total, in one line that the end erases."""
    last, is_terminal, shown = time.monotonic(), sys.stderr.isatty(), ""
    for done, item in enumerate(items):
        if is_terminal and time.monotonic() - last >= SILENCE:
            last, shown = time.monotonic(), f"{doing} {done} of {total}"
            print(shown, end="\r", file=sys.stderr, flush=True)
        yield item
    if shown:
        print(" " * len(shown), end="\r", file=sys.stderr, flush=True)
