"""Count over the runs of a study, for its summary: cost, kinds of motion, failures."""

from collections import Counter
from typing import Any, cast

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, classify, contact_name
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import MEASURES
from hpcsweep.studies.study import Study
from hpcsweep.studies.variable import Variable


class BaseTally:
    """Counts over the runs of a study, frame by frame, of runs of any kind."""

    measures: tuple[str, ...] = MEASURES
    """Variables whose largest value is told, and where it is."""

    def __init__(self, study: Study):
        self._study = study
        self.outcomes: Counter[int] = Counter()
        self.cycles = 0
        self.largest: dict[str, dict] = {}

    @property
    def done(self) -> int:
        """Number of computed runs."""
        return self.outcomes.total() - self.outcomes[Outcome.NOT_COMPUTED]

    def add(self, frame, study: Study) -> None:
        """Count the runs of one frame, an xarray.Dataset, of a study or of a part of it."""
        count(self.outcomes, frame["outcome"].values)
        if "cycles" in frame:
            there = frame["outcome"].values != Outcome.NOT_COMPUTED
            self.cycles += int(frame["cycles"].values[there].sum())
        for variable in study.variables:
            if variable.name in self.measures and variable.name in frame:
                self._add_largest(frame[variable.name], variable, study, frame.attrs["part"])

    def _add_largest(self, array, variable: Variable, study: Study, part: str) -> None:
        """Update the largest value of a measure, and its place."""
        if not np.isfinite(array.values).any():
            return
        place = np.unravel_index(int(np.nanargmax(array.values)), array.shape)
        at = array.isel(dict(zip(array.dims, place, strict=True)))
        if float(at) > self.largest.get(variable.name, {"value": -np.inf})["value"]:
            self.largest[variable.name] = {
                "value": float(at),
                "units": unit_of(study.structure, variable.units),
                "of": str(at[array.dims[-1]].item()),
                **self._place(at, study, part),
            }

    def _place(self, at, study: Study, part: str) -> dict[str, Any]:
        """Return the place of a value of a frame."""
        del part
        omega = float(at["omega"] if "omega" in at.coords else cast(Any, study).omega[0])
        return {"amplitude": float(at["amplitude"]), "omega": omega}

    def summary(self) -> dict[str, Any]:
        """Return the counts: numbers, strings, lists and dicts."""
        return {
            "periods_per_run": self.cycles / self.done if self.done else None,
            "largest": self.largest,
            "failures": {
                outcome.name: self.outcomes[outcome]
                for outcome in Outcome
                if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
            },
        }


class RunTally(BaseTally):
    """Tally of runs.

    ``window_test`` is None where motions were not classified; otherwise, over the ``runs`` with a
    completely integrated window, it counts the periods claimed by the points of the window that are
    ``wrong``, and those ``missed``.
    """

    def __init__(self, study: Study):
        super().__init__(study)
        self.classes = np.zeros((len(study.directions), len(MotionClass)), int)
        self.skip_rules: Counter[int] = Counter()
        self.periods: Counter[int] = Counter()
        self.contacts: Counter[int] = Counter()
        self.window = {"runs": 0, "wrong": 0, "missed": 0}

    def add(self, frame, study: Study) -> None:
        """Count the runs of one frame; see `BaseTally.add`."""
        super().add(frame, study)
        classes = classify(frame, study.settings, study.structure.units_at)[:, 0]
        for row, kinds in zip(self.classes, classes, strict=True):
            row += np.bincount(kinds, minlength=row.size)
        outcome = frame["outcome"].values[:, 0]
        computed = frame["skip_rule"].values[:, 0][outcome != Outcome.NOT_COMPUTED]
        count(self.skip_rules, computed)
        if "motion" in frame:
            self._compare(frame)
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

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        settings = self._study.settings
        return super().summary() | {
            "periods_per_run_window": settings.transient_cycles + settings.sampling_cycles,
            "skip_rules": {
                rule.name.lower(): share(self.skip_rules[rule], self.done) for rule in SkipRule
            },
            "classes": class_shares(self.classes.sum(axis=0)),
            "by_direction": {
                direction: class_shares(counts)
                for direction, counts in zip(self._study.directions, self.classes, strict=True)
            },
            "periods": shares(self.periods, self.done),
            "window_test": self.window if settings.classify_cycles else None,
            "contact_sets": contact_shares(self.contacts, self.done, self._study),
        }


def count(counter: Counter[int], values: np.ndarray) -> None:
    """Count values."""
    found, counts = np.unique(values, return_counts=True)
    counter.update(dict(zip(found.tolist(), counts.tolist(), strict=True)))


def share(count: int, done: int) -> dict:
    """Return a number, and its share of all completed ones."""
    return {"runs": count, "share": count / done if done else None}


def shares(counter: Counter[int], done: int) -> dict[int, dict]:
    """Return the shares of all counts, ascending."""
    return {name: share(counter[name], done) for name in sorted(counter)}


def contact_shares(counter: Counter[int], done: int, study: Study) -> dict[str, dict]:
    """Return the shares of sets of contacts by their names, the most frequent first."""
    labels = study.structure.contact_labels
    return {
        contact_name(contact, labels): share(number, done)
        for contact, number in counter.most_common()
    }


def class_shares(counts: np.ndarray) -> dict[str, dict]:
    """Return the shares of the motion classes."""
    done = int(counts[MotionClass.NO_CONTACT :].sum())
    return {
        CLASS_NAMES[kind]: share(int(counts[kind]), done)
        for kind in MotionClass
        if kind is not MotionClass.NOT_COMPUTED
    }
