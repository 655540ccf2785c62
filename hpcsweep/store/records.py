"""Records of the journal: the only module that knows their keys.

=========  ======================================================================================
kind       values
=========  ======================================================================================
start      ranks, hosts, transport: a session begins
pilot      frame, along, runs, seconds: runs that were timed at a place of a frame
block      rank, place, runs, seconds: the block at a place of ``commit`` was computed
master     messages, message_seconds, master_seconds, recalls: load of rank 0 so far
end        reason, written_bytes, write_seconds, rank_seconds, peak_memory, and as master
=========  ======================================================================================
"""

import contextlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from hpcsweep.parallel.farm import Traffic
from hpcsweep.store.journal import Journal


class BlockCost(NamedTuple):
    """Cost of a block: its index in ``commit``, its runs, seconds, and the time of the record."""

    place: tuple[int, ...]
    runs: int
    seconds: float
    time: float = 0.0


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
        As of its last record, written at `load_time`.
    """

    started: float
    ranks: int
    hosts: list[str]
    transport: str | None
    last: float
    ended: str | None = None
    written_bytes: int | None = None
    write_seconds: float | None = None
    rank_seconds: float | None = None
    peak_memory: list[int] | None = None
    costs: list[BlockCost] = field(default_factory=list)
    load: Traffic | None = None
    load_time: float = 0.0


@dataclass
class History:
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


def block_record(cost: BlockCost) -> dict:
    """Return the values of a block's record."""
    return {
        "place": [int(at) for at in cost.place],
        "runs": cost.runs,
        "seconds": cost.seconds,
    }


def load_record(load: Traffic) -> dict:
    """Return the values of a record of the master's load."""
    return {
        "messages": load.messages,
        "message_seconds": round(load.message_seconds, 6),
        "master_seconds": round(load.seconds, 6),
        "recalls": load.recalls,
    }


def read_history(path: Path) -> History:
    """Read the journal of a results file; empty if there is none."""
    history = History()
    for record in Journal(path).read():
        history.last = record["time"]
        with contextlib.suppress(KeyError, TypeError, ValueError):
            _check(record)
            _READERS.get(record["kind"], _pass)(history, record)
        if history.sessions:
            history.sessions[-1].last = record["time"]
    return history


def _check(record: dict) -> None:
    """Refuse a record with a value of the wrong kind.

    Raises
    ------
    ValueError
    """
    for key, value in record.items():
        expected = _KINDS.get(key)
        if expected is None:
            continue
        if key in _LISTS and isinstance(value, list):
            good = all(map(expected, value))
        else:
            good = key not in _LISTS and expected(value)
        if not good and not (value is None and key in _MAYBE):
            raise ValueError(f"{key} = {value!r:.40}")


def _is_count(value: object) -> bool:
    return type(value) is int and 0 <= value < 2**62


def _is_time(value: object) -> bool:
    return type(value) in (int, float) and 0 <= value < 1e15  # type: ignore[operator]


def _is_word(value: object) -> bool:
    return isinstance(value, str) and len(value) < 1000


_MAYBE = ("transport", "written_bytes", "write_seconds", "rank_seconds", "peak_memory")
_LISTS = ("hosts", "peak_memory", "place")
_KINDS = {
    **dict.fromkeys(("ranks", "rank", "place", "frame", "runs", "messages", "recalls"), _is_count),
    **dict.fromkeys(("written_bytes", "peak_memory"), _is_count),
    **dict.fromkeys(
        ("along", "seconds", "message_seconds", "master_seconds", "write_seconds", "rank_seconds"),
        _is_time,
    ),
    **dict.fromkeys(("hosts", "transport", "reason"), _is_word),
}
"""Checks of the values of records."""


def _pass(history: History, record: dict) -> None:
    """Ignore a record of a later version."""


def _start(history: History, record: dict) -> None:
    history.sessions.append(
        Session(
            started=record["time"],
            ranks=max(record["ranks"], 1),
            hosts=record["hosts"],
            transport=record.get("transport"),
            last=record["time"],
        )
    )


def _block(history: History, record: dict) -> None:
    if record["runs"] < 1:
        raise ValueError("a block without runs")
    cost = BlockCost(tuple(record["place"]), record["runs"], record["seconds"], record["time"])
    history.costs.append(cost)
    if history.sessions:
        history.sessions[-1].costs.append(cost)


def _pilot(history: History, record: dict) -> None:
    if "along" in record:  # not in journals of early versions
        history.samples.append(PilotCost(*(record[key] for key in PilotCost._fields)))


def _master(history: History, record: dict) -> None:
    if history.sessions and "master_seconds" in record:
        history.sessions[-1].load = Traffic(
            record["messages"],
            record["message_seconds"],
            record["master_seconds"],
            record["recalls"],
        )
        history.sessions[-1].load_time = record["time"]


def _end(history: History, record: dict) -> None:
    _master(history, record)
    if history.sessions:
        session = history.sessions[-1]
        session.ended = record["reason"]
        for name in ("written_bytes", "write_seconds", "rank_seconds", "peak_memory"):
            setattr(session, name, record.get(name))


_READERS = {
    "start": _start,
    "block": _block,
    "pilot": _pilot,
    "master": _master,
    "end": _end,
}
