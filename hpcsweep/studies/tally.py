"""Count over the runs of a study, for its summary: cost, kinds of motion, failures."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass, Shakedown, class_names, classify, contact_name
from hpcsweep.model.reduction import physical
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.study import Study
from hpcsweep.studies.variable import Variable


class BaseTally:
    """Counts over the runs of a study, frame by frame, of runs of any kind.

    Attributes
    ----------
    counts : dict of str to Counter
        Numbers of things, by the name of what is counted: a variable, by its values, say.
    largest : dict of str to dict
        Largest value of each `tallied` variable, and where it is.
    """

    placed_by: tuple[str, ...] = ("amplitude", "omega")
    """Coordinates that tell where it is."""
    at_once: int = 1
    """Most frames that `add` takes together."""

    def __init__(self, study: Study):
        self._study = study
        self.counts: defaultdict[str, Counter] = defaultdict(Counter)
        self.largest: dict[str, dict] = {}

    @property
    def done(self) -> int:
        """Number of computed runs."""
        outcomes = self.counts["outcome"]
        return outcomes.total() - outcomes[Outcome.NOT_COMPUTED]

    def count(self, name: str, values: np.ndarray) -> None:
        """Count values."""
        distinct, numbers = np.unique(values, return_counts=True)
        self.counts[name].update(dict(zip(distinct.tolist(), numbers.tolist(), strict=True)))

    def add(self, frame, study: Study) -> None:
        """Count the runs of `at_once` frames, an xarray.Dataset, of a study or of a part of it."""
        self.count("outcome", frame["outcome"].values)
        if "cycles" in frame:
            there = frame["outcome"].values != Outcome.NOT_COMPUTED
            self.counts["all"]["cycles"] += int(frame["cycles"].values[there].sum())
        for variable in study.variables:
            if variable.tallied and variable.name in frame:
                self._add_largest(frame, variable, study)

    def _add_largest(self, frame, variable: Variable, study: Study) -> None:
        """Update the largest value of a measure, and its place."""
        array = frame[variable.name]
        if array.dims[-1] == "floor":
            array = array.isel(floor=physical(array["floor"].values.tolist()))
        if not np.isfinite(array.values).any():
            return
        place = np.unravel_index(int(np.nanargmax(array.values)), array.shape)
        if array.values[place] > self.largest.get(variable.name, {"value": -np.inf})["value"]:
            at = array.isel(dict(zip(array.dims, place, strict=True)))
            self.largest[variable.name] = {
                "value": float(at),
                "units": unit_of(study.structure, variable.units),
                "of": str(at[array.dims[-1]].item()),
                **{name: _coordinate(name, at, frame) for name in self.placed_by},
            }

    def summary(self) -> dict[str, Any]:
        """Return the counts: numbers, strings, lists and dicts."""
        return {
            "periods_per_run": self.counts["all"]["cycles"] / self.done if self.done else None,
            "largest": self.largest,
            "failures": {
                outcome.name: self.counts["outcome"][outcome]
                for outcome in Outcome
                if outcome not in (Outcome.NOT_COMPUTED, Outcome.COMPLETE)
            },
        }


MOST_UNDECIDED = 5
"""Undecided runs of which it is told what they are near to."""


class RunTally(BaseTally):
    """Tally of runs; the classes of their motions are counted by direction.

    ``window_test`` is None where motions were not classified; otherwise, over the ``runs`` with a
    completely integrated window, it counts the periods claimed by the points of the window that are
    ``wrong``, and those ``missed``.
    """

    def __init__(self, study: Study):
        super().__init__(study)
        self.undecided: dict[str, str] = {}

    def add(self, frame, study: Study) -> None:
        """Count the runs of one frame; see `BaseTally.add`."""
        super().add(frame, study)
        classes = classify(frame, study.settings, study.units_at)[:, 0]
        for direction, kinds in zip(study.directions, classes, strict=True):
            self.count(direction, kinds)
        self._add_undecided(frame, classes == MotionClass.UNDECIDED, study)
        outcome = frame["outcome"].values[:, 0]
        self.count("skip_rule", frame["skip_rule"].values[:, 0][outcome != Outcome.NOT_COMPUTED])
        if "motion" in frame:
            self._compare(frame)
        periodic = classes == MotionClass.PERIODIC
        self.count("orbit_period", frame["orbit_period"].values[:, 0][periodic])
        for name in ("shakedown", "contact"):
            if name in frame:
                self.count(name, frame[name].values[:, 0][outcome == Outcome.COMPLETE])

    def _add_undecided(self, frame, undecided: np.ndarray, study: Study) -> None:
        """Tell of the first undecided runs what they are near to: exponent, nearest return."""
        for place in np.argwhere(undecided)[: MOST_UNDECIDED - len(self.undecided)].tolist():
            run = frame.isel(dict(zip(study.run_dims, (place[0], 0, place[1]), strict=True)))
            where = {name: run[name].item() for name in dict.fromkeys((*study.run_dims, "omega"))}
            told = []
            if "lyapunov" in run and np.isfinite(run["lyapunov"]):
                told.append(f"exponent {run['lyapunov'].item():.2g}")
            if "poincare" in run and (count := int(run["n_points"])) > 1:
                points = run["poincare"].values[:count] / study.structure.state_units
                lags = range(1, min(study.settings.max_orbit_period, count - 1) + 1)
                apart = [float(np.abs(points[-1] - points[-1 - p]).max()) for p in lags]
                p = int(np.argmin(apart))
                told.append(f"returns within {apart[p]:.1g} after {p + 1} periods")
            self.undecided[run_name(where)] = ", ".join(told) or "near to what is not stored"

    def _compare(self, frame) -> None:
        """Compare the window test with the classification, where there is a whole window."""
        window, period = frame["window_period"].values, frame["orbit_period"].values
        tested = (window >= 0) & (frame["outcome"].values == Outcome.COMPLETE)
        for name, where in (
            ("runs", tested),
            ("wrong", tested & (window > 0) & (window != period)),
            ("missed", tested & (window == 0) & (period > 0)),
        ):
            self.counts["window"][name] += int(where.sum())

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        study, counts = self._study, self.counts
        window = {name: counts["window"][name] for name in ("runs", "wrong", "missed")}
        classes: Counter[int] = sum((counts[name] for name in study.directions), Counter())
        return super().summary() | {
            "periods_per_run_window": study.settings.transient_cycles
            + study.settings.sampling_cycles,
            "skip_rules": {
                rule.name.lower(): share(counts["skip_rule"][rule], self.done) for rule in SkipRule
            },
            "classes": class_shares(classes, study),
            "by_direction": {name: class_shares(counts[name], study) for name in study.directions},
            "undecided": self.undecided,
            "periods": shares(counts["orbit_period"], self.done),
            "shakedown": shakedown_shares(counts["shakedown"], self.done, study),
            "window_test": window if study.settings.classify_cycles else None,
            "contact_sets": contact_shares(counts["contact"], self.done, study),
        }


def _coordinate(name: str, at, frame) -> float | str:
    """Return a coordinate of a value, or what all values of its frame share."""
    if name in at.coords:
        return at[name].item()
    return frame[name].item() if name in frame else frame.attrs[name]


def share(count: int, done: int) -> dict:
    """Return a number, and its share of all completed ones."""
    return {"runs": count, "share": count / done if done else None}


def shares(counter: Counter[int], done: int) -> dict[int, dict]:
    """Return the shares of all counts, ascending."""
    return {name: share(counter[name], done) for name in sorted(counter)}


def shakedown_shares(counter: Counter, total: int, study: Study) -> dict[str, dict[str, Any]]:
    """Return the counts and shares of what the sliders do, of a structure that has some."""
    if not study.structure.sliders:
        return {}
    return {kind.name.lower(): share(counter[kind], total) for kind in Shakedown}


def contact_shares(counter: Counter[int], done: int, study: Study) -> dict[str, dict]:
    """Return the shares of sets of contacts by their names, the most frequent first."""
    labels = study.structure.contact_labels
    return {
        contact_name(contact, labels): share(number, done)
        for contact, number in counter.most_common()
    }


def class_shares(
    counts: Counter[int], study: Study, kinds: Iterable[MotionClass] = tuple(MotionClass)[1:]
) -> dict[str, dict]:
    """Return the shares of classes of motions, of all that are computed."""
    done = counts.total() - counts[MotionClass.NOT_COMPUTED]
    names = class_names(study.structure)
    return {names[kind]: share(counts[kind], done) for kind in kinds}
