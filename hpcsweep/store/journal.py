"""Keep the history beside the file: ``FILE.journal``, one JSON object a line.

Sessions (host names, ranks, start, end) and the cost of each block, in seconds by the clock and of
processor time of its rank, which are less among busy neighbours. They differ from run to run, and
are therefore kept out of the results, which do not. Losing the journal loses no result.

=========  ======================================================================================
kind       values
=========  ======================================================================================
start      ranks, hosts, transport: a session begins
pilot      frame, along, runs, seconds: runs that were timed at a place of a frame
block      rank, place, runs, seconds, processor: the block at a place of ``commit`` was computed
master     messages, master_seconds, recalls: load of rank 0 so far
end        reason, rank_seconds, peak_memory, and as master
=========  ======================================================================================
"""

import contextlib
import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from hpcsweep.job.paths import beside
from hpcsweep.parallel.farm import Traffic
from hpcsweep.store.layout import WriteError, reason

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
        self._last_write = -math.inf
        self.note(kind, **values)

    def note(self, kind: str, **values) -> None:
        """Append one record within about a second: many notes cost one write."""
        self._kept.append(json.dumps({"kind": kind, "time": time.time(), **values}) + "\n")
        if time.monotonic() - self._last_write >= WRITE_INTERVAL:
            self._write()

    def take(self, records: list[dict]) -> None:
        """Append records of other journals; see `append`."""
        self._kept += [json.dumps(record) + "\n" for record in records]
        self._write()

    def _write(self) -> None:
        line = "".join(self._kept)
        self._kept.clear()
        self._last_write = time.monotonic()
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(line.encode())
        except OSError as error:
            raise WriteError.of(self.path, reason(error)) from None

    def read(self) -> list[dict]:
        """Read all records; skip invalid lines, such as one cut off by a crash.

        Returns
        -------
        list of dict
            Each has a ``kind`` (str) and a finite ``time`` (float).
        """
        records: list[Any] = []
        # reading a pipe would block
        if not self.path.is_file():
            return []
        with contextlib.suppress(OSError), self.path.open("rb") as file:
            for line in iter(partial(file.readline, LONGEST_LINE), b""):
                # RecursionError: brackets nested too deeply
                with contextlib.suppress(ValueError, RecursionError):
                    records.append(json.loads(line))
        return [record for record in records if _is_record(record)]


def _is_record(record: object) -> bool:
    if not isinstance(record, dict) or not isinstance(record.get("kind"), str):
        return False
    moment: Any = record.get("time")
    return type(moment) in (int, float) and 0 <= moment < LATEST


class BlockCost(NamedTuple):
    """Cost of a block: its index in ``commit``, its runs, seconds."""

    place: tuple[int, ...]
    runs: int
    seconds: float
    """By the clock."""
    processor: float | None = None
    """Seconds of processor time; None if they are not known."""


def instant() -> tuple[float, float]:
    """Return the clock and the processor time of this process, in seconds."""
    return time.perf_counter(), time.process_time()


def spent(place: tuple[int, ...], runs: int, begun: tuple[float, float]) -> BlockCost:
    """Return the cost of a block that began at an `instant`."""
    clock, processor = (round(b - a, 6) for a, b in zip(begun, instant(), strict=True))
    return BlockCost(tuple(map(int, place)), runs, clock, processor)


def totals(costs: Iterable[BlockCost]) -> tuple[int, float, float]:
    """Sum runs of blocks, seconds, and those of processor time, by the clock if not known."""
    every = list(costs)
    core = (cost.seconds if cost.processor is None else cost.processor for cost in every)
    return sum(cost.runs for cost in every), sum(cost.seconds for cost in every), sum(core)


class PilotCost(NamedTuple):
    """Cost of timed runs: frame, place along it (0 to 1), runs, seconds."""

    frame: int
    along: float
    runs: int
    seconds: float


@dataclass
class Session:
    """One call of `hpcsweep run`, as recorded in the journal.

    Attributes
    ----------
    started, last : float
        Times (s since the epoch) of its first and its last record.
    ended : str or None
        Why it ended; None if it is running or was killed.
    costs : list of BlockCost
    load : Traffic or None
        As last recorded.
    """

    started: float
    ranks: int
    hosts: list[str]
    transport: str | None
    last: float
    ended: str | None = None
    peak_memory: list[int] | None = None
    costs: list[BlockCost] = field(default_factory=list)
    load: Traffic | None = None


@dataclass
class CampaignHistory:
    """History of a campaign, from its journal.

    Attributes
    ----------
    sessions : list of Session
    costs : list of BlockCost
        Of all sessions, also where the beginning of the journal is lost.
    samples : list of PilotCost
    last : float or None
        Time of the last record.
    """

    sessions: list[Session] = field(default_factory=list)
    costs: list[BlockCost] = field(default_factory=list)
    samples: list[PilotCost] = field(default_factory=list)
    last: float | None = None

    @property
    def latest(self) -> dict[tuple[int, ...], BlockCost]:
        """Latest cost of each block."""
        return {cost.place: cost for cost in self.costs}


def read_history(path: Path) -> CampaignHistory:
    """Read the journal of a results file; empty if there is none."""
    history = CampaignHistory()
    for record in Journal(path).read():
        history.last = record["time"]
        with contextlib.suppress(KeyError, TypeError, ValueError):
            if all(map(_is_sane, record.values())):
                _take(history, record)
        if history.sessions:
            history.sessions[-1].last = record["time"]
    return history


def _is_sane(value: object) -> bool:
    """Return whether a journal has such values: short words, numbers from 0 on, lists of them."""
    if isinstance(value, list):
        return all(map(_is_sane, value))
    if isinstance(value, str):
        return len(value) < 1000
    return value is None or (type(value) in (int, float) and 0 <= value < 2**62)  # type: ignore[operator]


def _take(history: CampaignHistory, record: dict) -> None:
    """Add a record; one of a kind that a later version writes changes nothing.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a value is missing, or of the wrong kind.
    """
    kind, now = record["kind"], record["time"]
    session = history.sessions[-1] if history.sessions else None
    if kind == "start":
        ranks, hosts = max(int(record["ranks"]), 1), [*map(str, record["hosts"])]
        history.sessions.append(Session(now, ranks, hosts, record.get("transport"), last=now))
    elif kind == "block":
        place, runs = tuple(map(int, record["place"])), int(record["runs"])
        if runs < 1:
            raise ValueError("a block without runs")
        seconds, processor = float(record["seconds"]), record.get("processor")
        processor = None if processor is None else float(processor)
        cost = BlockCost(place, runs, seconds, processor)
        history.costs.append(cost)
        if session:
            session.costs.append(cost)
    elif kind == "pilot":
        frame, along = int(record["frame"]), float(record["along"])
        runs, seconds = int(record["runs"]), float(record["seconds"])
        history.samples.append(PilotCost(frame, along, runs, seconds))
    elif kind in ("master", "end") and session:
        if kind == "end":
            session.ended = str(record["reason"])
            session.peak_memory = [*map(int, record.get("peak_memory") or ())] or None
        seconds, recalls = float(record["master_seconds"]), int(record["recalls"])
        session.load = Traffic(int(record["messages"]), seconds, recalls)
