"""Show progress: a bar on a terminal, a line a minute in a log."""

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable
from datetime import timedelta
from importlib.util import find_spec
from typing import TextIO

from hpcsweep.studies.run_names import count, plural

LOG_INTERVAL = 60.0
BAR_INTERVAL = 5.0
BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}, {rate_fmt}{postfix}]"
"""tqdm's own format without its estimate, which assumes that all runs cost the same."""


def note(text: str) -> None:
    """Write one line with the time of day to standard error."""
    say_line(f"{time.strftime('%H:%M:%S')} {text}")


def say_line(text: str) -> None:
    """Write one line to standard error; where that fails, drop it."""
    try:
        print(text, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Make a stream that cannot be written discard its output, also at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def make_progress(total: int, done: int, unit: str = "run"):
    """Return the display that suits standard error."""
    has_bar = sys.stderr.isatty() and find_spec("tqdm") is not None
    return (Bar if has_bar else Log)(total, done, unit)


class Silent:
    """A progress display that shows nothing."""

    _remaining: Callable[[], float | None] = staticmethod(lambda: None)

    def advance(self, runs: int) -> None:
        """Count finished runs."""

    def message(self, text: str) -> None:
        """Show a message."""

    def expect(self, remaining: Callable[[], float | None]) -> None:
        """Set the function that estimates the remaining time (s)."""
        self._remaining = remaining

    def tick(self) -> None:
        """Update the display; called several times a second."""

    def close(self) -> None:
        """Close the display."""


class Bar(Silent):
    """A bar, drawn by tqdm; its own remaining time is replaced where a better one is known."""

    def __init__(self, total: int, done: int, unit: str = "run"):
        from tqdm import tqdm

        self._bar = tqdm(total=total, initial=done, unit=unit, smoothing=0.05, dynamic_ncols=True)
        self._last = -math.inf

    def advance(self, runs: int) -> None:
        """Count finished runs."""
        self._bar.update(runs)

    def tick(self) -> None:
        """Update the remaining time now and then; the bar's own clock does the rest."""
        if time.monotonic() - self._last < BAR_INTERVAL:
            return
        self._last = time.monotonic()
        remaining = self._remaining()
        if remaining is not None:
            self._bar.bar_format = BAR
            self._bar.set_postfix_str(f"{timedelta(seconds=int(remaining))} left", refresh=False)

    def message(self, text: str) -> None:
        """Show a message without breaking the bar."""
        self._bar.write(text, file=sys.stderr)

    def close(self) -> None:
        """Leave the last state of the bar standing."""
        self._bar.close()


class Log(Silent):
    """A line at the start, one a minute, and one at the end."""

    def __init__(self, total: int, done: int, unit: str = "run"):
        self._total, self._done, self._first, self._unit = total, done, done, unit
        self._begun = self._last = time.monotonic()
        resumed = f", {done} of them already in the file" if done else ""
        self.message(f"{count(total, unit)}{resumed}")

    def advance(self, runs: int) -> None:
        """Count finished runs."""
        self._done += runs

    def tick(self) -> None:
        """Write a line if a minute has passed, whether or not any run has finished."""
        if time.monotonic() - self._last >= LOG_INTERVAL:
            self._last = time.monotonic()
            self.message(self._line())

    def message(self, text: str) -> None:
        """Write one line with the time of day."""
        note(text)

    def close(self) -> None:
        """Write the last line."""
        self.message(self._line())

    def _line(self) -> str:
        elapsed = time.monotonic() - self._begun
        rate = (self._done - self._first) / elapsed if elapsed > 0 else 0.0
        runs = plural(self._unit, self._total)
        line = f"{self._done}/{self._total} {runs} ({100 * self._done / self._total:.1f} %)"
        if rate > 0:
            line += f", {rate:.3g} {self._unit}s/s"
            if self._done < self._total:
                remaining = self._remaining()
                if remaining is None:
                    remaining = (self._total - self._done) / rate
                line += f", {timedelta(seconds=int(remaining))} left"
        return line
