"""Count over the runs of a study, for its summary: cost, kinds of motion, failures."""

from collections import Counter

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, classify, contact_name
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import MEASURES


class RunTally:
    """Tally of runs, frame by frame.

    ``window_test`` is None where motions were not classified; otherwise, over the ``runs`` with a
    completely integrated window, it counts the periods claimed by the points of the window that are
    ``wrong``, and those ``missed``.
    """

    def __init__(self, study):
        self._study = study
        self._settings = study.settings
        self.classes = np.zeros((len(study.directions), len(MotionClass)), int)
        self.outcomes = np.zeros(len(Outcome), int)
        self.skip_rules = np.zeros(len(SkipRule), int)
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.window = {"runs": 0, "wrong": 0, "missed": 0}
        self.cycles = 0
        self.largest: dict[str, dict] = {}

    @property
    def done(self) -> int:
        """Number of computed runs."""
        return int(self.classes[:, MotionClass.NO_CONTACT :].sum())

    def add(self, frame, study) -> None:
        """Count the runs of one frame, an xarray.Dataset, of a study or of a part of it."""
        classes = classify(frame, study.settings, study.structure.units_at)[:, 0]
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
        add_largest(self.largest, frame, study)
        periodic = classes == MotionClass.PERIODIC
        count(self.periods, frame["orbit_period"].values[:, 0][periodic])
        if "contact" in frame:
            count(self.contacts, frame["contact"].values[:, 0][outcome == Outcome.COMPLETE])

    def _compare(self, frame) -> None:
        """Compare the window test with the classification, where there is a whole window."""
        window, period = frame["window_period"].values, frame["orbit_period"].values
        tested = (window >= 0) & (frame["outcome"].values == Outcome.COMPLETE)
        self.window["runs"] += int(tested.sum())
        self.window["wrong"] += int((tested & (window > 0) & (window != period)).sum())
        self.window["missed"] += int((tested & (window == 0) & (period > 0)).sum())

    def summary(self) -> dict:
        """Return the counts: numbers, strings, lists and dicts."""
        done, settings = self.done, self._settings
        labels = self._study.structure.contact_labels
        return {
            "periods_per_run": self.cycles / done if done else None,
            "periods_per_run_window": settings.transient_cycles + settings.sampling_cycles,
            "skip_rules": {
                rule.name.lower(): share(int(self.skip_rules[rule]), done) for rule in SkipRule
            },
            "classes": class_shares(self.classes.sum(axis=0)),
            "by_direction": {
                direction: class_shares(counts)
                for direction, counts in zip(self._study.directions, self.classes, strict=True)
            },
            "periods": shares(self.periods, done, sorted(self.periods)),
            "window_test": self.window if settings.classify_cycles else None,
            "contact_sets": {
                contact_name(contact, labels): share(count, done)
                for contact, count in self.contacts.most_common()
            },
            "largest": self.largest,
            "failures": failures(self.outcomes),
        }


def add_largest(largest: dict[str, dict], frame, study) -> None:
    """Update the largest value of each measure, by name, and its place, from a frame of a study."""
    quantities = {variable.name: variable.units for variable in study.variables}
    for name in MEASURES:
        if name not in frame or not np.isfinite(frame[name].values).any():
            continue
        array = frame[name]
        place = np.unravel_index(int(np.nanargmax(array.values)), array.shape)
        at = array.isel(dict(zip(array.dims, place, strict=True)))
        if float(at) > largest.get(name, {"value": -np.inf})["value"]:
            largest[name] = {
                "value": float(at),
                "units": unit_of(study.structure, quantities[name]),
                "of": str(at[array.dims[-1]].item()),
                "amplitude": float(at["amplitude"]),
                "omega": float(at["omega"] if "omega" in at.coords else study.omega[0]),
            }


def count(counter: Counter[int], values: np.ndarray) -> None:
    """Count values."""
    found, counts = np.unique(values, return_counts=True)
    for value, count in zip(found.tolist(), counts.tolist(), strict=True):
        counter[value] += count


def share(count: int, done: int) -> dict:
    """Return a number, and its share of all completed ones."""
    return {"runs": count, "share": count / done if done else None}


def shares(counter: Counter[int], done: int, names: list[int]) -> dict[int, dict]:
    """Return the shares of all counts."""
    return {name: share(counter[name], done) for name in names}


def failures(outcomes: np.ndarray) -> dict[str, int]:
    """Count the runs that did not complete, by outcome."""
    return {
        outcome.name: int(outcomes[outcome])
        for outcome in Outcome
        if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
    }


def class_shares(counts: np.ndarray) -> dict[str, dict]:
    """Return the shares of the motion classes."""
    done = int(counts[MotionClass.NO_CONTACT :].sum())
    return {
        CLASS_NAMES[kind]: share(int(counts[kind]), done)
        for kind in MotionClass
        if kind is not MotionClass.NOT_COMPUTED
    }
