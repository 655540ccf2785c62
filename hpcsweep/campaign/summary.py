"""Numbers of a whole study: its cost, and what kinds of motion it found.

The file is read one frame at a time, so that five million runs need little memory.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, classify, contact_name
from hpcsweep.job.paths import path_of
from hpcsweep.model.description import in_words
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames, read_history
from hpcsweep.store.records import History
from hpcsweep.studies.shortcut import Shortcut


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
    ``plain_test`` is None where motions were not decided; of the ``runs`` of which a whole window
    was integrated it counts the periods that the points of the window claim and that are ``wrong``,
    and those ``missed``.

    Raises
    ------
    StoreError
        If it is not a campaign file.
    """
    path = path_of("path", path)
    frames = Frames(path)
    try:
        study = frames.study
        tally = _Tally(study)
        for frame in range(study.omega.size):
            tally.add(frames.dataset(frame))
    finally:
        frames.close()
    done = int(tally.classes[:, MotionClass.NO_CONTACT :].sum())
    size = path.stat()
    structure, settings = study.structure, study.settings
    return {
        "file": str(path),
        "name": frames.job.name,
        "study": study.kind,
        "structure": _told(structure),
        "n_floors": structure.n_floors,
        "stiffness_ratio": None if structure.matrices else structure.stiffness_ratio,
        "contacts": len(structure.contacts),
        "damping_ratios": structure.damping_ratios.tolist(),
        "frames": int(study.omega.size),
        "amplitudes": int(study.n_amplitudes),
        "directions": list(study.directions),
        "runs_total": study.n_runs,
        "runs_done": done,
        "cost": total_cost(read_history(path)),
        "periods_per_run": tally.cycles / done if done else None,
        "periods_per_run_plain": settings.transient_cycles + settings.sampling_cycles,
        "shortcuts": {
            rule.name.lower(): _share(int(tally.shortcuts[rule]), done) for rule in Shortcut
        },
        "file_bytes": size.st_size,
        "disk_bytes": size.st_blocks * 512,
        "has_exponents": "lyapunov" in frames,
        "classes": _classes(tally.classes.sum(axis=0)),
        "by_direction": {
            direction: _classes(counts)
            for direction, counts in zip(study.directions, tally.classes, strict=True)
        },
        "periods": {period: _share(count, done) for period, count in sorted(tally.periods.items())},
        "plain_test": tally.plain if settings.decide_cycles else None,
        "contact_sets": {
            contact_name(contact, structure.contact_labels): _share(count, done)
            for contact, count in tally.contacts.most_common()
        },
        "failures": {
            outcome.name: int(tally.outcomes[outcome])
            for outcome in Outcome
            if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
        },
    }


def _told(structure) -> str:
    """Write the structure on one line."""
    parts = [f"{symbol} = {value}" if symbol else value for symbol, value in in_words(structure)]
    return ", ".join(parts)


class _Tally:
    """Counts over the runs of frames that are shown one after the other."""

    def __init__(self, study):
        self._settings, self._units = study.settings, study.structure.state_units
        self.classes = np.zeros((len(study.directions), len(MotionClass)), int)
        self.outcomes = np.zeros(len(Outcome), int)
        self.shortcuts = np.zeros(len(Shortcut), int)
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.plain = {"runs": 0, "wrong": 0, "missed": 0}
        self.cycles = 0

    def add(self, frame) -> None:
        """Count the runs of one frame, an xarray.Dataset."""
        classes = classify(frame, self._settings, self._units)[:, 0]
        for row, kinds in zip(self.classes, classes, strict=True):
            row += np.bincount(kinds, minlength=row.size)
        outcome = frame["outcome"].values[:, 0]
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        shortcut = frame["shortcut"].values[:, 0][there]
        self.shortcuts += np.bincount(shortcut, minlength=self.shortcuts.size)
        self.cycles += int(frame["cycles"].values[:, 0][there].sum())
        if "motion" in frame:
            self._compare(frame)
        periodic = classes == MotionClass.PERIODIC
        _count(self.periods, frame["orbit_period"].values[:, 0][periodic])
        if "contact" in frame:
            _count(self.contacts, frame["contact"].values[:, 0][outcome == Outcome.COMPLETE])

    def _compare(self, frame) -> None:
        """Compare what the plain test said with what was decided, where it saw a whole window."""
        plain, period = frame["plain_period"].values, frame["orbit_period"].values
        tested = (plain >= 0) & (frame["outcome"].values == Outcome.COMPLETE)
        self.plain["runs"] += int(tested.sum())
        self.plain["wrong"] += int((tested & (plain > 0) & (plain != period)).sum())
        self.plain["missed"] += int((tested & (plain == 0) & (period > 0)).sum())


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


def total_cost(history: History) -> dict | None:
    """Add up the sessions of a journal; None if nothing was timed."""
    latest = history.latest.values()
    if not history.sessions or not latest:
        return None
    wall = sum(session.last - session.started for session in history.sessions)
    runs = sum(cost.runs for cost in latest)
    seconds = sum(cost.seconds for cost in latest)
    return {
        "sessions": len(history.sessions),
        "ranks": sorted({session.ranks for session in history.sessions}),
        "wall_seconds": wall,
        "core_seconds": seconds,
        "runs_timed": runs,
        "runs_per_second": runs / wall if wall else None,
        "runs_per_core_second": runs / seconds if seconds else None,
    }
