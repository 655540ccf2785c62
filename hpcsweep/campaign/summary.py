"""Numbers of a whole study: its cost, and what kinds of motion it found.

The file is read one frame at a time, so that five million runs need little memory.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, classify
from hpcsweep.solvers.outcome import Outcome, Shortcut
from hpcsweep.store import Frames, Journal


def summarize(path: str | Path) -> dict:
    """Summarize a campaign file, complete or not.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    dict
        Plain numbers, strings and lists. Shares are of the runs that are done; of periods, those of
        the class periodic. ``by_direction`` has the shares of each sweep. ``cost`` is None where
        the file has no journal: its wall time is that of all sessions, from their starts to the
        last they are heard of; its core seconds are those of the blocks in the file, each once.

    Raises
    ------
    StoreError
        If it is not a campaign file.
    """
    path = Path(path)
    frames = Frames(path)
    try:
        job = frames.job
        tally = _Tally(len(job.directions), job.settings)
        for frame in range(job.omega.size):
            tally.add(frames.dataset(frame))
    finally:
        frames.close()
    done = int(tally.classes[:, MotionClass.NO_CONTACT :].sum())
    size = path.stat()
    n = job.structure.n_floors
    return {
        "file": str(path),
        "name": job.name,
        "n_floors": n,
        "stiffness_ratio": job.structure.stiffness_ratio,
        "damping_ratios": job.structure.damping_ratios.tolist(),
        "frames": int(job.omega.size),
        "amplitudes": int(job.amplitude.size),
        "directions": list(job.directions),
        "runs_total": job.n_runs,
        "runs_done": done,
        "cost": _cost(Journal(path).read()),
        "periods_per_run": tally.cycles / done if done else None,
        "periods_per_run_plain": job.settings.transient_cycles + job.settings.sampling_cycles,
        "shortcuts": {
            rule.name.lower(): _share(int(tally.shortcuts[rule]), done) for rule in Shortcut
        },
        "file_bytes": size.st_size,
        "disk_bytes": size.st_blocks * 512,
        "has_exponents": "lyapunov" in frames,
        "classes": _classes(tally.classes.sum(axis=0)),
        "by_direction": {
            direction: _classes(counts)
            for direction, counts in zip(job.directions, tally.classes, strict=True)
        },
        "periods": {period: _share(count, done) for period, count in sorted(tally.periods.items())},
        "contact_sets": {
            floors(contact, n): _share(count, done)
            for contact, count in tally.contacts.most_common()
        },
        "failures": {
            outcome.name: int(tally.outcomes[outcome])
            for outcome in Outcome
            if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
        },
    }


def floors(contact: int, n: int) -> str:
    """Write a contact set as C with the numbers of its floors; 'none' if it is empty."""
    touching = [str(i + 1) for i in range(n) if contact >> i & 1]
    return "C" + (",".join(touching) if n > 9 else "".join(touching)) if touching else "none"


class _Tally:
    """Counts over the runs of frames that are shown one after the other."""

    def __init__(self, n_directions: int, settings):
        self._settings = settings
        self.classes = np.zeros((n_directions, len(MotionClass)), int)
        self.outcomes = np.zeros(len(Outcome), int)
        self.shortcuts = np.zeros(len(Shortcut), int)
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.cycles = 0

    def add(self, frame) -> None:
        """Count the runs of one frame, an xarray.Dataset."""
        classes = classify(frame, self._settings)[:, 0]
        for row, kinds in zip(self.classes, classes, strict=True):
            row += np.bincount(kinds, minlength=row.size)
        outcome = frame["outcome"].values[:, 0]
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        shortcut = frame["shortcut"].values[:, 0][there]
        self.shortcuts += np.bincount(shortcut, minlength=self.shortcuts.size)
        self.cycles += int(frame["cycles"].values[:, 0][there].sum())
        periodic = classes == MotionClass.PERIODIC
        _count(self.periods, frame["orbit_period"].values[:, 0][periodic])
        if "contact" in frame:
            _count(self.contacts, frame["contact"].values[:, 0][outcome == Outcome.COMPLETE])


def _count(counter: Counter[int], values: np.ndarray) -> None:
    found, counts = np.unique(values, return_counts=True)
    for value, count in zip(found.tolist(), counts.tolist(), strict=True):
        counter[value] += count


def _share(count: int, done: int) -> dict:
    return {"runs": count, "share": count / done if done else None}


def _classes(counts: np.ndarray) -> dict[str, dict]:
    done = int(counts[MotionClass.NO_CONTACT :].sum())
    return {
        CLASS_NAMES[kind]: _share(int(counts[kind]), done)
        for kind in MotionClass
        if kind is not MotionClass.NOT_COMPUTED
    }


def _cost(records: list[dict]) -> dict | None:
    """Add up the sessions of a journal; None if nothing was timed."""
    blocks: dict[tuple[int, int, int], tuple[int, float]] = {}
    wall, sessions, ranks, begun, last = 0.0, 0, set(), None, None
    for record in records:
        if record["kind"] == "start":
            wall += last - begun if begun is not None else 0.0
            begun = record["time"]
            sessions += 1
            ranks.add(record["ranks"])
        elif record["kind"] == "block":
            place = record["frame"], record["direction"], record["block"]
            blocks[place] = record["runs"], record["seconds"]
        last = record["time"]
    if begun is None or not blocks:
        return None
    wall += last - begun
    runs = sum(count for count, _ in blocks.values())
    seconds = sum(spent for _, spent in blocks.values())
    return {
        "sessions": sessions,
        "ranks": sorted(ranks),
        "wall_seconds": wall,
        "core_seconds": seconds,
        "runs_timed": runs,
        "runs_per_second": runs / wall if wall else None,
        "runs_per_core_second": runs / seconds if seconds else None,
    }
