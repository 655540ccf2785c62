"""Keep the history beside the file: ``FILE.journal``, one JSON object a line.

Sessions (host names, ranks, start, end) and the cost of each block in seconds. They differ from run
to run, and are therefore kept out of the results, which do not. Losing the journal loses no result.
"""

import contextlib
import json
import math
import os
import time
from pathlib import Path

from hpcsweep.job.paths import beside
from hpcsweep.store.create import reason
from hpcsweep.store.layout import WriteError

WRITE_INTERVAL = 1.0
"""Least time (s) between two writes of notes."""


LONGEST_LINE = 2**20
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
        records = []
        # reading a pipe would block
        if not self.path.is_file():
            return []
        try:
            with self.path.open("rb") as file:
                while line := file.readline(LONGEST_LINE):
                    # RecursionError: brackets nested too deeply
                    with contextlib.suppress(ValueError, RecursionError):
                        record = json.loads(line)
                        if _is_record(record):
                            records.append(record)
        except OSError:
            return records
        return records


def _is_record(record: object) -> bool:
    if not isinstance(record, dict) or not isinstance(record.get("kind"), str):
        return False
    moment = record.get("time")
    if isinstance(moment, bool) or not isinstance(moment, int | float):
        return False
    return 0 <= moment < LATEST
