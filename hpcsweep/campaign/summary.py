"""Summarize a whole study: its cost, and the kinds of motion it found.

The file is read one frame at a time, so that five million runs need little memory.
"""

from pathlib import Path

from hpcsweep.dynamics.classify import tells_chaos
from hpcsweep.job.paths import path_of
from hpcsweep.model.confinement import unconfined
from hpcsweep.model.description import contacts_named, one_line
from hpcsweep.store import Frames
from hpcsweep.store.journal import CampaignHistory, read_history, totals


def summarize(path: str | Path) -> dict:
    """Summarize a campaign file, complete or not.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    dict
        Plain numbers, strings and lists. Shares are of the completed runs; those of periods are of
        the periodic ones. ``by_direction`` has the shares of each sweep; other kinds of study add
        their own tally. ``cost`` is None where the file has no journal: its wall time is that of
        all sessions, from start to last record; its core seconds are the processor time of the
        blocks in the file, each counted once, ``clock_seconds`` the same by the clock.

    Raises
    ------
    StoreError
        If it is not a campaign file.
    """
    path = path_of("path", path)
    frames = Frames(path, None)
    try:
        study, job = frames.whole.study, frames.whole
        tally = study.tally()
        for place in frames.places:
            frames.choose(place)
            for first in range(0, frames.study.n_frames, tally.at_once):
                some = range(frames.study.n_frames)[first : first + tally.at_once]
                tally.add(frames.gather([*frames], some), frames.study)
        audit = frames.audit()
    finally:
        frames.close()
    size, structure = path.stat(), study.structure
    return {
        "file": str(path),
        "name": job.name,
        "study": study.kind,
        "structure": one_line(structure),
        "n_floors": structure.n_floors,
        "drifts": unconfined(structure) or None,
        "stiffness_ratio": None if structure.matrices else structure.stiffness_ratio,
        "contacts": len(structure.contacts),
        "contacts_named": contacts_named(structure),
        "damping_ratios": structure.damping_ratios.tolist(),
        "vary": {axis.key: list(axis.values) for axis in study.axes},
        "frames": study.n_frames,
        study.run_dims[-1] + "s": study.dimensions[study.run_dims[-1]],
        "directions": list(study.directions),
        "dimensions": {dim: study.dimensions[dim] for dim in study.run_dims},
        "run_noun": study.run_noun,
        "runs_total": study.n_runs,
        "runs_done": tally.done,
        **audit,
        "cost": total_cost(read_history(path)),
        "file_bytes": size.st_size,
        "disk_bytes": size.st_blocks * 512,
        "tells_chaos": tells_chaos(frames),
        **tally.summary(),
    }


def total_cost(history: CampaignHistory) -> dict | None:
    """Sum the sessions of a journal; return None if nothing was timed."""
    latest = history.latest.values()
    if not history.sessions or not latest:
        return None
    wall = sum(session.last - session.started for session in history.sessions)
    runs, clock, core = totals(latest)
    return {
        "sessions": len(history.sessions),
        "ranks": sorted({session.ranks for session in history.sessions}),
        "wall_seconds": wall,
        "core_seconds": core,
        "clock_seconds": clock,
        "runs_timed": runs,
        "runs_per_second": runs / wall if wall else None,
        "runs_per_core_second": runs / core if core else None,
    }
