"""Report the state of campaign files and, from their journals, of the work (`hpcsweep status`).

Only reads, takes no lock, and may be called from any process at any time; of many files a row each.
"""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.job import JobError
from hpcsweep.job.paths import path_of
from hpcsweep.parallel.schedule import computing_ranks
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import Layout, StoreError, open_layout
from hpcsweep.store.commit import Blocks
from hpcsweep.store.inferred import Inferred, is_complete
from hpcsweep.store.journal import CampaignHistory, Session, read_history, totals
from hpcsweep.store.opening import check_file

LISTED_FAILURES = 20
FRAMES = {"omega": "frame"}
"""Nouns for the frames of a study, where they are not the name of their dimension."""
OUTCOMES = {int(outcome): outcome.name for outcome in Outcome}
SILENT = 120.0
"""Seconds without a record after which a session may not run any more: one comes every 30."""
OF_SESSIONS = ("started", "ranks", "hosts", "transport", "ended")
"""What is told of a session."""
OF_ROWS = (
    *("file", "name", "runs_total", "n_failed", "core_seconds", "core_seconds_remaining"),
    "last_heard",
)
"""What a row tells of a status."""
HEADS = ("file", "state", "runs", "%", "failed", "core s", "left", "heard")


def status(path: str | Path) -> dict:
    """Describe a campaign file, live, stopped or finished.

    Returns
    -------
    dict
        Plain numbers, strings and lists: progress, outcomes, sessions, failures, and

        run_noun, frame_noun : str
            What people call a run and a frame of this study: point and frame, row and row, ...
        runs_per_second : float or None
            Runs per second by the wall clock in the last session.
        seconds_remaining : float or None
            Wall time left on that session's ranks; None if nothing was timed or all is complete.
        core_seconds, clock_seconds : float
            Processor time of the ranks in blocks, and the same by the clock.
        last_heard : float or None
            Seconds since the journal's last record.
        runs_inferred, audit : int, dict or None
            Only of a refined map: its inferred points, and the last `Look` of their audit.
        remedies : dict of str to dict
            Count of each failed outcome and its remedy.
        master : dict or None
            The last session's messages, their rate, share of the master's time, tasks moved.
        peak_memory : list of int, or None
            Bytes of rank 0 and of the largest rank in the last session, if it has ended.
    """
    path = path_of("path", path)
    layout = open_layout(path)
    history = read_history(path)
    session = history.sessions[-1] if history.sessions else None
    with Blocks(path, layout) as blocks:
        committed = blocks.have_checksum()
        names = {"outcome", "cycles", *layout.study.status_variables}
        there = [v.name for v in layout.variables if v.name in names]
        runs = {name: blocks.whole(name) for name in there}
        inferred = Inferred(blocks) if layout.derived else None
        state = {**_runs(layout, committed, runs, inferred), "complete": is_complete(blocks)}
    work, remaining = None, None
    if history.costs and not state["complete"] and not layout.derived:
        costs = TaskCosts(layout.study)
        costs.learn(history, np.argwhere(committed))
        computing = computing_ranks(session.ranks if session else 1)
        work, remaining = costs.remaining(), costs.remaining(computing)
    return {
        "file": str(path),
        "version": str(check_file(path).get("hpcsweep_version", "")),
        **state,
        **_costs(history, work, state["complete"]),
        "runs_per_second": _rate(session) if session and session.costs else None,
        "seconds_remaining": remaining,
        "last_heard": None if history.last is None else time.time() - history.last,
        "master": _master(session),
        "peak_memory": session.peak_memory if session else None,
        "sessions": [
            {name: getattr(each, name) for name in OF_SESSIONS} for each in history.sessions
        ],
    }


def _runs(
    layout: Layout, committed: np.ndarray, runs: dict[str, np.ndarray], inferred: Inferred | None
) -> dict:
    """Count the runs that are in the file, by what became of them."""
    study, outcome = layout.study, runs["outcome"]
    done = np.zeros(outcome.shape, bool)
    for place in map(tuple, np.argwhere(committed).tolist()):
        done[study.block(place).runs] = True
    n_done = int(done.sum())
    failed = np.argwhere(done & (outcome != Outcome.COMPLETE))
    audit: dict = {}
    is_known = done
    if inferred is not None:
        mask = inferred.mask()
        audit = inferred.summary(mask)
        is_known = done if mask is None else done | mask
    within = "direction", study.run_dims[-1]
    frames = is_known.all(axis=tuple(k for k, dim in enumerate(study.run_dims) if dim in within))
    return {
        "name": layout.name,
        "study": study.kind,
        "run_noun": study.run_noun,
        "frame_noun": FRAMES.get(study.run_dims[-2], study.run_dims[-2]),
        "solver": study.settings.solver,
        "runs_done": n_done,
        "runs_total": study.n_runs,
        "frames_done": int(frames.sum()),
        "frames_total": int(frames.size),
        **audit,
        "periods_per_run": float(runs["cycles"][done].mean())
        if n_done and "cycles" in runs
        else None,
        **study.count(done, runs),
        "n_failed": len(failed),
        "failures": [
            {
                **study.describe(run),
                "outcome": OUTCOMES.get(int(outcome[run]), "damaged; see validate"),
            }
            for run in map(tuple, failed[:LISTED_FAILURES].tolist())
        ],
        "remedies": {
            kind.name: {"runs": int((done & (outcome == kind)).sum()), "remedy": remedy}
            for kind, remedy in REMEDIES.items()
            if (done & (outcome == kind)).any()
        },
    }


def _costs(history: CampaignHistory, work: float | None, complete: bool) -> dict:
    """Return the timed costs and what is left."""
    runs, clock, core = totals(history.costs)
    left = work if work is None or not clock else work * core / clock
    return {
        "core_seconds": core,
        "clock_seconds": clock,
        "runs_per_core_second": runs / core if core else None,
        "core_seconds_remaining": 0.0 if complete and runs else left,
    }


def _rate(session: Session) -> float:
    """Return the runs per second of wall time in a session."""
    end = session.last if session.ended else time.time()
    return sum(cost.runs for cost in session.costs) / max(end - session.started, 1e-9)


def _master(session: Session | None) -> dict | None:
    """Return the master's load as of its last record."""
    if session is None or session.load is None:
        return None
    load = session.load
    elapsed = max(session.last - session.started, 1e-9)
    return {
        "messages": load.messages,
        "messages_per_second": load.messages / elapsed,
        "busy": load.master_seconds / elapsed,
        "tasks_moved": load.recalls,
    }


def overview(path: str | Path) -> dict:
    """Return the progress of a campaign, of its `status`, in a row of a table.

    Returns
    -------
    dict
        ``file``, ``name``, ``runs_done``, inferred ones among them, ``runs_total``, ``n_failed``,
        ``core_seconds``, ``core_seconds_remaining`` (None if none was timed, and of a refined map),
        ``last_heard`` (s) and ``state``: ``complete``, ``running``, ``stopped`` (in good order),
        ``silent`` (it was killed, or says nothing), ``not begun``, or ``unreadable``, with ``why``.
    """
    try:
        told = status(path)
    except (StoreError, JobError) as error:
        return {"file": str(path), "state": "unreadable", "why": str(error)}
    heard = told["last_heard"]
    if told["complete"]:
        state, told["core_seconds_remaining"] = "complete", 0.0
    elif told["sessions"] and told["sessions"][-1]["ended"]:
        state = "stopped"
    elif heard is None:
        state = "not begun"
    else:
        state = "running" if heard < SILENT else "silent"
    done = told["runs_done"] + told.get("runs_inferred", 0)
    return {name: told[name] for name in OF_ROWS} | {"state": state, "runs_done": done}


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
