"""What `hpcsweep status` tells: the state of the file, and what its journal says of the work.

Reads only, takes no lock, and may be used from any process at any time.
"""

import time
from pathlib import Path

import numpy as np

from hpcsweep.campaign.costs import FrameCosts
from hpcsweep.job import Job
from hpcsweep.parallel.schedule import master_computes
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import Journal, status
from hpcsweep.store.commit import Blocks
from hpcsweep.store.reader import job_of

RECENT = 60.0
"""Seconds over which the present rate is taken."""


def monitor(path: str | Path) -> dict:
    """Describe a campaign file, live, stopped or finished.

    Returns
    -------
    dict
        What `hpcsweep.store.status` gives, and

        runs_per_second, runs_per_second_recent : float or None
            Histories per second by the wall clock in the last session, and in its last minute.
        seconds_remaining : float or None
            Wall time left on that session's ranks; None if nothing was timed, or it is complete.
        last_heard : float or None
            Seconds since the journal's last record.
        frame_seconds : dict or None
            Cost of the frames that were timed whole: number, dearest, median, cheapest.
        remedies : dict of str to dict
            Count of each failed outcome and what to do about it.
        master : dict or None
            The last session's messages, rate, share of the master's time, tasks moved.
        peak_memory : list of int, or None
            Bytes of rank 0 and of the largest rank in the last session, once it has ended.
    """
    path = Path(path)
    state = status(path)
    job = job_of(path)
    records = Journal(path).read()
    blocks = [record for record in records if record["kind"] == "block"]
    last = [index for index, record in enumerate(records) if record["kind"] == "start"]
    session = records[last[-1] :] if last else []
    ended = any(record["kind"] == "end" for record in session)
    now = records[-1]["time"] if ended else time.time()
    remaining = None
    if blocks and not state["complete"]:
        remaining = _seconds_remaining(path, job, blocks, session[0]["ranks"] if session else 1)
    return {
        **state,
        **_rates(session, now),
        "seconds_remaining": remaining,
        "last_heard": time.time() - records[-1]["time"] if records else None,
        "frame_seconds": _frame_seconds(job, blocks),
        "remedies": _remedies(path, job),
        "master": _master(session),
        "peak_memory": next((r["peak_memory"] for r in session if "peak_memory" in r), None),
    }


def _rates(session: list[dict], now: float) -> dict:
    """Count runs per second of wall time."""
    blocks = [record for record in session if record["kind"] == "block"]
    if not blocks:
        return {"runs_per_second": None, "runs_per_second_recent": None}
    begun = session[0]["time"]
    recent = max(begun, now - RECENT)
    total = sum(record["runs"] for record in blocks)
    late = sum(record["runs"] for record in blocks if record["time"] >= recent)
    return {
        "runs_per_second": total / max(now - begun, 1e-9),
        "runs_per_second_recent": late / max(now - recent, 1e-9),
    }


def _seconds_remaining(path: Path, job: Job, records: list[dict], ranks: int) -> float:
    """Estimate the wall time left from the costs so far, frame by frame."""
    costs = FrameCosts(job)
    for r in records:
        costs.measured(r["frame"], r["direction"], r["block"], r["runs"], r["seconds"])
    blocks = Blocks(path, job)
    try:
        for direction, frame, block in np.argwhere(blocks.have_checksum()).tolist():
            low, high = blocks.rows(direction, block)
            costs.done(frame, direction, block, high - low)
    finally:
        blocks.close()
    left = np.array([costs.left(frame) for frame in range(job.omega.size)])
    computing = ranks if master_computes(ranks) else ranks - 1
    return float(max(left.sum() / computing, left.max()))


def _frame_seconds(job: Job, records: list[dict]) -> dict | None:
    """Cost of the frames all of whose blocks were timed."""
    seconds: dict[int, dict[tuple[int, int], float]] = {}
    for r in records:
        seconds.setdefault(r["frame"], {})[r["direction"], r["block"]] = r["seconds"]
    n_blocks = len(job.directions) * -(-job.amplitude.size // job.block)
    whole = {f: sum(cost.values()) for f, cost in seconds.items() if len(cost) == n_blocks}
    if not whole:
        return None
    dearest, cheapest = max(whole, key=whole.__getitem__), min(whole, key=whole.__getitem__)
    return {
        "frames": len(whole),
        "dearest": whole[dearest],
        "dearest_omega": float(job.omega[dearest]),
        "median": float(np.median(list(whole.values()))),
        "cheapest": whole[cheapest],
        "cheapest_omega": float(job.omega[cheapest]),
    }


def _remedies(path: Path, job: Job) -> dict[str, dict]:
    """Count the failed runs by outcome."""
    blocks = Blocks(path, job)
    try:
        done = blocks.have_checksum()
        counts = np.zeros(len(Outcome), int)
        for direction, frame in np.ndindex(done.shape[:2]):
            outcome = blocks.whole("outcome", direction, frame)
            for block in np.flatnonzero(done[direction, frame]):
                low, high = blocks.rows(direction, int(block))
                counts += np.bincount(outcome[low:high], minlength=len(Outcome))
    finally:
        blocks.close()
    return {
        outcome.name: {"runs": int(counts[outcome]), "remedy": remedy}
        for outcome, remedy in REMEDIES.items()
        if counts[outcome]
    }


def _master(session: list[dict]) -> dict | None:
    """Tell how busy the master was, by its last record."""
    known = [record for record in session if "master_seconds" in record]
    if not known:
        return None
    record = known[-1]
    elapsed = max(record["time"] - session[0]["time"], 1e-9)
    messages, seconds = record["messages"], record["message_seconds"]
    return {
        "messages": messages,
        "messages_per_second": messages / elapsed,
        "messages_per_second_possible": messages / seconds if seconds else None,
        "busy": record["master_seconds"] / elapsed,
        "tasks_moved": record["recalls"],
    }
