"""Progress for people: a bar on a terminal, a line a minute in a log."""

import sys
import time

LOG_INTERVAL = 60.0


def note(text: str) -> None:
    """Write one line with the time of day to standard error."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def make_progress(total: int, done: int, unit: str = "run"):
    """Make the display that suits standard error."""
    return (Bar if sys.stderr.isatty() else Log)(total, done, unit)


class Bar:
    """A bar, drawn by tqdm."""

    def __init__(self, total: int, done: int, unit: str = "run"):
        from tqdm import tqdm

        self._bar = tqdm(total=total, initial=done, unit=unit, smoothing=0.05, dynamic_ncols=True)

    def advance(self, runs: int) -> None:
        """Count what is finished."""
        self._bar.update(runs)

    def tick(self) -> None:
        """Leave the bar to its own clock."""

    def message(self, text: str) -> None:
        """Say something without tearing the bar."""
        self._bar.write(text, file=sys.stderr)

    def close(self) -> None:
        """Leave the last state of the bar standing."""
        self._bar.close()


class Log:
    """A line at the start, one a minute, and one at the end."""

    def __init__(self, total: int, done: int, unit: str = "run"):
        self._total, self._done, self._first, self._unit = total, done, done, unit
        self._begun = self._last = time.monotonic()
        resumed = f", {done} of them already in the file" if done else ""
        self.message(f"{total} {unit}s{resumed}")

    def advance(self, runs: int) -> None:
        """Count what is finished."""
        self._done += runs

    def tick(self) -> None:
        """Write a line if a minute has passed, whether or not anything was finished."""
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
        line = f"{self._done}/{self._total} {self._unit}s ({100 * self._done / self._total:.1f} %)"
        if rate > 0:
            line += f", {rate:.3g} {self._unit}s/s"
            if self._done < self._total:
                line += f", {_duration((self._total - self._done) / rate)} left"
        return line


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}"
