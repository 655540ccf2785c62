"""Report the progress of many campaigns: a row each, cheap enough for hundreds of files.

Only the data of a row are read: a few attributes, which blocks have a checksum, the outcomes, and
the journal. Checksums are not verified; `hpcsweep.campaign.status` reports more of one file.
"""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hpcsweep.job import JobError, parse_job
from hpcsweep.job.paths import path_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import StoreError, read_history
from hpcsweep.store.journal import totals
from hpcsweep.store.opening import read_progress

SILENT = 120.0
"""Seconds without a record after which a session may not run any more: one comes every 30."""
HEADS = ("file", "state", "runs", "%", "failed", "core s", "left", "heard")


def overview(path: str | Path) -> dict:
    """Return the progress of a campaign.

    Returns
    -------
    dict
        ``file``, ``name``, ``runs_done``, ``runs_total``, ``n_failed``, ``core_seconds``,
        ``core_seconds_remaining`` (as the blocks so far; None if none was timed, and of a
        refined map), ``last_heard`` (s) and ``state``: ``complete``, ``running``, ``stopped`` (in
        good order), ``silent`` (it was killed, or says nothing), ``not begun``, or
        ``unreadable``, with ``why``.
    """
    path = path_of("path", path)
    try:
        attributes, committed, outcome, inferred = read_progress(path)
        complete = bool((committed if inferred is None else inferred).all())
        done = outcome.size if complete else _runs_done(path, attributes, committed, outcome)
    except (StoreError, JobError) as error:
        return {"file": str(path), "state": "unreadable", "why": str(error)}
    history = read_history(path)
    timed = totals(history.latest.values())
    heard = None if history.last is None else time.time() - history.last
    ended = history.sessions[-1].ended if history.sessions else None
    if complete:
        state = "complete"
    elif ended:
        state = "stopped"
    elif heard is None:
        state = "not begun"
    else:
        state = "running" if heard < SILENT else "silent"
    of_run = timed.core / timed.runs if timed.runs and inferred is None else None
    left = None if of_run is None else (outcome.size - done) * of_run
    return {
        "file": str(path),
        "name": attributes["name"],
        "state": state,
        "runs_done": done,
        "runs_total": outcome.size,
        "n_failed": int((outcome > Outcome.COMPLETE).sum()),
        "core_seconds": timed.core,
        "core_seconds_remaining": 0.0 if complete else left,
        "last_heard": heard,
    }


def _runs_done(path: Path, attributes: dict, committed: np.ndarray, outcome: np.ndarray) -> int:
    """Count the runs of the blocks that have a checksum."""
    study = parse_job(attributes["job"], str(path), attributes["name"], is_stored=True).study
    shape = tuple(study.dimensions[dim] for dim in study.commit.dims)
    if committed.shape != shape or outcome.size != study.n_runs:
        raise StoreError(f"{path}: damaged; see hpcsweep status {path}")
    left = study.dimensions[study.run_dims[-1]] - study.block_size * np.arange(shape[-1])
    return int((committed * np.minimum(left, study.block_size)).sum())


def _lines(rows: Sequence[dict]) -> list[tuple[str, ...]]:
    """Format rows, and their sums as the last, in the columns `HEADS`."""
    readable = [row for row in rows if row["state"] != "unreadable"]
    counts = ("runs_done", "runs_total", "n_failed", "core_seconds")
    lefts = [row["core_seconds_remaining"] for row in readable]
    heards = [row["last_heard"] for row in readable if row["last_heard"] is not None]
    summed = {key: sum(row[key] for row in readable) for key in counts} | {
        "file": f"{len(rows)} files",
        "state": f"{sum(row['state'] == 'complete' for row in rows)} complete",
        "core_seconds_remaining": None if None in lefts else sum(lefts),
        "last_heard": min(heards, default=None),
    }
    return [_cells(row) for row in (*rows, summed)]


def _cells(row: dict) -> tuple[str, ...]:
    if row["state"] == "unreadable":
        return (row["file"], "unreadable", *(6 * ("",)))
    done, total = row["runs_done"], row["runs_total"]
    left, heard = row["core_seconds_remaining"], row["last_heard"]
    return (
        row["file"],
        row["state"],
        f"{done}/{total}",
        f"{100 * done / total:.1f}" if total else "",
        str(row["n_failed"]),
        f"{row['core_seconds']:.4g}",
        "?" if left is None else f"{left:.4g}",
        "" if heard is None else f"{heard:.0f} s ago",
    )


def as_table(rows: Sequence[dict]) -> str:
    """Format rows as lines for a terminal."""
    table = [HEADS, *_lines(rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    form = "  ".join(f"{{:{'<' if k < 2 else '>'}{width}}}" for k, width in enumerate(widths))
    lines = [form.format(*line).rstrip() for line in table]
    reasons = [row["why"] for row in rows if row["state"] == "unreadable"]
    return "\n".join([*lines, *reasons])
