"""What a user sees while kernels are compiled: a bar on a terminal, lines elsewhere."""

import math
import sys
import time
from collections.abc import Callable
from typing import TextIO

from hpcsweep.kernels.warm import Progress

BAR = 30
"""Characters."""
SILENCE = 10.0
"""Seconds between two lines where no bar can be drawn."""


def duration(seconds: float) -> str:
    """Write a time that is foretold: ``40 s``, ``3 min``."""
    if seconds < 100.0:
        return f"{max(round(seconds), 1)} s"
    return f"{round(seconds / 60.0)} min"


class Report:
    """Tells a user how far the compilation has come.

    Parameters
    ----------
    say : callable
        Says a line.
    stream : file
        Where the bar is drawn if it is a terminal.
    """

    def __init__(self, say: Callable[[str], None], stream: TextIO | None = None):
        self._say = say
        self._stream = sys.stderr if stream is None else stream
        self._last = 0.0

    def __call__(self, progress: Progress) -> None:
        """Tell the progress."""
        done, total, name, left = progress
        to_go = "" if math.isnan(left) else f", {duration(left)} to go"
        if done == 0:
            about = "" if math.isnan(left) else f", about {duration(left)}"
            self._say(f"compiling {total} kernels, once for this type of processor{about}")
            self._last = time.monotonic()
        if self._stream.isatty():
            filled = BAR * done // total
            bar = "#" * filled + "." * (BAR - filled)
            last = f" {name}{to_go}" if done else ""
            line = f"[{bar}] {done}/{total}{last}"
            self._stream.write(f"\r\033[K{line}" if done < total else "\r\033[K")
            self._stream.flush()
        elif 0 < done < total and time.monotonic() - self._last >= SILENCE:
            self._say(f"compiled {done} of {total} kernels{to_go}")
            self._last = time.monotonic()
