"""Counts over the runs of a study, for its summary: cost, kinds of motion, failures."""

from collections import Counter

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, classify, contact_name
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule


class RunTally:
    """Counts over the runs of frames that are shown one after the other.

    What it tells as ``window_test`` is None where motions were not classified; of ``runs`` of which
    a whole window was integrated it counts the periods that the points of the window claim and that
    are ``wrong``, and those ``missed``.
    """

    def __init__(self, study):
        self._study = study
        self._settings, self._units_at = study.settings, study.structure.units_at
        self.classes = np.zeros((len(study.directions), len(MotionClass)), int)
        self.outcomes = np.zeros(len(Outcome), int)
        self.skip_rules = np.zeros(len(SkipRule), int)
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.plain = {"runs": 0, "wrong": 0, "missed": 0}
        self.cycles = 0

    @property
    def done(self) -> int:
        """Runs that are computed."""
        return int(self.classes[:, MotionClass.NO_CONTACT :].sum())

    def add(self, frame) -> None:
        """Count the runs of one frame, an xarray.Dataset."""
        classes = classify(frame, self._settings, self._units_at)[:, 0]
        for row, kinds in zip(self.classes, classes, strict=True):
            row += np.bincount(kinds, minlength=row.size)
        outcome = frame["outcome"].values[:, 0]
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        skip_rule = frame["skip_rule"].values[:, 0][there]
        self.skip_rules += np.bincount(skip_rule, minlength=self.skip_rules.size)
        self.cycles += int(frame["cycles"].values[:, 0][there].sum())
        if "motion" in frame:
            self._compare(frame)
        periodic = classes == MotionClass.PERIODIC
        _count(self.periods, frame["orbit_period"].values[:, 0][periodic])
        if "contact" in frame:
            _count(self.contacts, frame["contact"].values[:, 0][outcome == Outcome.COMPLETE])

    def _compare(self, frame) -> None:
        """Compare what the window test said with what was decided, where it saw a whole window."""
        plain, period = frame["window_period"].values, frame["orbit_period"].values
        tested = (plain >= 0) & (frame["outcome"].values == Outcome.COMPLETE)
        self.plain["runs"] += int(tested.sum())
        self.plain["wrong"] += int((tested & (plain > 0) & (plain != period)).sum())
        self.plain["missed"] += int((tested & (plain == 0) & (period > 0)).sum())

    def told(self) -> dict:
        """Tell what was counted, in plain values."""
        done, settings = self.done, self._settings
        labels = self._study.structure.contact_labels
        return {
            "periods_per_run": self.cycles / done if done else None,
            "periods_per_run_window": settings.transient_cycles + settings.sampling_cycles,
            "skip_rules": {
                rule.name.lower(): _share(int(self.skip_rules[rule]), done) for rule in SkipRule
            },
            "classes": _classes(self.classes.sum(axis=0)),
            "by_direction": {
                direction: _classes(counts)
                for direction, counts in zip(self._study.directions, self.classes, strict=True)
            },
            "periods": _shares(self.periods, done, sorted(self.periods)),
            "window_test": self.plain if settings.classify_cycles else None,
            "contact_sets": {
                contact_name(contact, labels): _share(count, done)
                for contact, count in self.contacts.most_common()
            },
            "failures": _failures(self.outcomes),
        }


class AttractorTally:
    """Counts over the points of a study of attractors; see `RunTally`.

    Classes, periods and contact sets are those of the attractors in the file; their shares are of
    all these.
    """

    def __init__(self, study):
        self._study = study
        self.outcomes = np.zeros(len(Outcome), int)
        self.numbers: Counter[int] = Counter()
        self.classes = np.zeros(len(MotionClass), int)
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.cycles = self.starts = self.undecided = self.failed = self.elsewhere = 0

    @property
    def done(self) -> int:
        """Points that are computed."""
        return int(self.outcomes[Outcome.COMPLETE :].sum())

    def add(self, frame) -> None:
        """Count the points of one frame, an xarray.Dataset."""
        outcome = frame["outcome"].values
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        _count(self.numbers, frame["n_attractors"].values[there])
        held = frame["attractor_id"].values > 0
        kinds = frame["motion_class"].values[held]
        self.classes += np.bincount(kinds, minlength=self.classes.size)
        period = frame["orbit_period"].values[held]
        _count(self.periods, period[period > 0])
        if "contact" in frame:
            _count(self.contacts, frame["contact"].values[held])
        self.cycles += int(frame["cycles"].values[there].sum())
        self.starts += int(there.sum()) * self._study.starts
        self.undecided += int(frame["n_undecided"].values[there].sum())
        self.failed += int(frame["n_failed"].values[there].sum())
        self.elsewhere += int(frame["n_elsewhere"].values[there].sum())

    def told(self) -> dict:
        """Tell what was counted, in plain values."""
        done, held = self.done, int(self.classes.sum())
        labels = self._study.structure.contact_labels
        return {
            "periods_per_run": self.cycles / done if done else None,
            "periods_per_start": self.cycles / self.starts if self.starts else None,
            "numbers": _shares(self.numbers, done, sorted(self.numbers)),
            "starts": self.starts,
            "starts_undecided": _share(self.undecided, self.starts),
            "starts_failed": _share(self.failed, self.starts),
            "starts_elsewhere": _share(self.elsewhere, self.starts),
            "attractors": held,
            "classes": {
                CLASS_NAMES[kind]: _share(int(self.classes[kind]), held)
                for kind in (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
            },
            "periods": _shares(self.periods, held, sorted(self.periods)),
            "contact_sets": {
                contact_name(contact, labels): _share(count, held)
                for contact, count in self.contacts.most_common()
            },
            "failures": _failures(self.outcomes),
        }


class BasinTally:
    """Counts over the rows of a study of basins; see `RunTally`.

    Shares of attractors are of all starts; classes and contact sets are those of the attractors.
    """

    def __init__(self, study):
        self._study = study
        self.outcomes = np.zeros(len(Outcome), int)
        self.attractors: dict[int, dict] = {}
        self.cycles = self.starts = self.undecided = self.failed = self.elsewhere = 0

    @property
    def done(self) -> int:
        """Rows that are computed."""
        return int(self.outcomes[Outcome.COMPLETE :].sum())

    def add(self, frame) -> None:
        """Count a row, an xarray.Dataset."""
        outcome = frame["outcome"].values
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        self.cycles += int(frame["cycles"].values[there].sum())
        self.starts += int(there.sum()) * self._study.horizontal.size
        self.undecided += int(frame["n_undecided"].values[there].sum())
        self.failed += int(frame["n_failed"].values[there].sum())
        self.elsewhere += int(frame["n_elsewhere"].values[there].sum())
        row = frame.isel(direction=0, frame=0, amplitude=0)
        for slot in np.flatnonzero(row["attractor_id"].values).tolist():
            known = self.attractors.setdefault(
                int(row["attractor_id"].values[slot]),
                {
                    "motion_class": int(row["motion_class"].values[slot]),
                    "orbit_period": int(row["orbit_period"].values[slot]),
                    "contact": int(row["contact"].values[slot]) if "contact" in row else None,
                    "hits": 0,
                },
            )
            known["hits"] += int(row["hits"].values[slot])

    def told(self) -> dict:
        """Tell what was counted, in plain values."""
        done, held = self.done, len(self.attractors)
        labels, each = self._study.structure.contact_labels, self.attractors.values()
        classes = Counter(one["motion_class"] for one in each)
        periods = Counter(one["orbit_period"] for one in each if one["orbit_period"])
        contacts = Counter(one["contact"] for one in each if one["contact"] is not None)
        return {
            "periods_per_run": self.cycles / done if done else None,
            "periods_per_start": self.cycles / self.starts if self.starts else None,
            "numbers": {},
            "starts": self.starts,
            "starts_undecided": _share(self.undecided, self.starts),
            "starts_failed": _share(self.failed, self.starts),
            "starts_elsewhere": _share(self.elsewhere, self.starts),
            "attractors": held,
            "basins": {
                number: {"name": self._name(one), **_share(one["hits"], self.starts)}
                for number, one in sorted(self.attractors.items())
            },
            "classes": {
                CLASS_NAMES[kind]: _share(classes[kind], held)
                for kind in (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
            },
            "periods": _shares(periods, held, sorted(periods)),
            "contact_sets": {
                contact_name(contact, labels): _share(count, held)
                for contact, count in contacts.most_common()
            },
            "failures": _failures(self.outcomes),
        }

    def _name(self, one: dict) -> str:
        period, contact = one["orbit_period"], one["contact"]
        name = f"P{period}" if period else CLASS_NAMES[MotionClass(one["motion_class"])]
        if contact is None:
            return name
        return f"{name} {contact_name(contact, self._study.structure.contact_labels)}"


def _count(counter: Counter[int], values: np.ndarray) -> None:
    found, counts = np.unique(values, return_counts=True)
    for value, count in zip(found.tolist(), counts.tolist(), strict=True):
        counter[value] += count


def _share(count: int, done: int) -> dict:
    return {"runs": count, "share": count / done if done else None}


def _shares(counter: Counter[int], done: int, names: list[int]) -> dict[int, dict]:
    return {name: _share(counter[name], done) for name in names}


def _failures(outcomes: np.ndarray) -> dict[str, int]:
    return {
        outcome.name: int(outcomes[outcome])
        for outcome in Outcome
        if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
    }


def _classes(counts: np.ndarray) -> dict[str, dict]:
    done = int(counts[MotionClass.NO_CONTACT :].sum())
    return {
        CLASS_NAMES[kind]: _share(int(counts[kind]), done)
        for kind in MotionClass
        if kind is not MotionClass.NOT_COMPUTED
    }
