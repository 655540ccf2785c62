"""Keep the history beside the file: ``FILE.journal``, one JSON object a line.

Sessions (host names, ranks, start, end) and the cost of each block in seconds. They differ from run
to run, and are therefore kept out of the results, which do not. Losing the journal loses no result.
"""

import contextlib
import json
import math
import os
import time
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from hpcsweep.job.paths import beside
from hpcsweep.store.create import reason
from hpcsweep.store.layout import WriteError

WRITE_INTERVAL = 1.0
"""Least time (s) between two writes of notes."""


LONGEST_LINE = 2**20
TOGETHER = 1000
"""Lines that are parsed at once."""
LATEST = 2.0**36
"""Latest valid time (s since the epoch); later ones cannot be shown."""


class Journal:
    """Append-only journal; written by rank 0, read by any process at any time."""

    def __init__(self, path: Path):
        self.path = beside(path, ".journal")
        self._kept: list[str] = []
        self._last_write = -math.inf

    def begin(self) -> None:
        """Remove the journal of an earlier file of this name: its costs are of another job."""
        with contextlib.suppress(OSError):
            self.path.unlink()

    def append(self, kind: str, **values) -> None:
        """Append one record, and those kept back, in a single write.

        Raises
        ------
        WriteError
            If the write fails; also in `note`.
        """
        self._keep(kind, values)
        self._write()

    def note(self, kind: str, **values) -> None:
        """Append one record within about a second: many notes cost one write."""
        self._keep(kind, values)
        if time.monotonic() - self._last_write >= WRITE_INTERVAL:
            self._write()

    def _keep(self, kind: str, values: dict) -> None:
        self._kept.append(json.dumps({"kind": kind, "time": time.time(), **values}) + "\n")

    def _write(self) -> None:
        line = "".join(self._kept)
        self._kept.clear()
        self._last_write = time.monotonic()
        try:
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
            try:
                os.write(descriptor, line.encode())
            finally:
                os.close(descriptor)
        except OSError as error:
            raise WriteError(
                f"{self.path}: cannot be written: {reason(error)}; what is committed is safe: "
                "make room and run again to resume"
            ) from None

    def read(self) -> list[dict]:
        """Read all records; skip invalid lines, such as one cut off by a crash.

        Returns
        -------
        list of dict
            Each has a ``kind`` (str) and a finite ``time`` (float).
        """
        found: list[Any] = []
        # reading a pipe would block
        if not self.path.is_file():
            return []
        with contextlib.suppress(OSError), self.path.open("rb") as file:
            each = iter(partial(file.readline, LONGEST_LINE), b"")
            while lines := list(islice(each, TOGETHER)):
                found += _parsed(lines)
        return [record for record in found if _is_record(record)]


def _parsed(lines: list[bytes]) -> list[Any]:
    """Parse lines, all at once if each is sound, which takes half the time."""
    found: list[Any] = []
    # RecursionError: brackets nested too deeply
    with contextlib.suppress(ValueError, RecursionError):
        found = json.loads(b"[%b]" % b",".join(lines))
        # parts of one value may be on two lines
        if len(found) == len(lines):
            return found
    found = []
    for line in lines:
        with contextlib.suppress(ValueError, RecursionError):
            found.append(json.loads(line))
    return found


def _is_record(record: object) -> bool:
    if not isinstance(record, dict) or not isinstance(record.get("kind"), str):
        return False
    moment = record.get("time")
    if isinstance(moment, bool) or not isinstance(moment, int | float):
        return False
    return 0 <= moment < LATEST
