"""Count over studies of attractors, for their summaries."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, contact_name
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.tally import add_largest, failures, share, shares


class Found(NamedTuple):
    """Counted properties of an attractor; `contact` is None where the file lacks it."""

    motion_class: int
    orbit_period: int
    contact: int | None

    def named(self, labels) -> str:
        """Return its name: period or class, and contact set."""
        kind = CLASS_NAMES[MotionClass(self.motion_class)]
        name = f"P{self.orbit_period}" if self.orbit_period else kind
        return name if self.contact is None else f"{name} {contact_name(self.contact, labels)}"


def attractors_in(frame) -> tuple[list[int], list[Found]]:
    """Return identity and kind of all attractors of a frame, an xarray.Dataset."""
    held = frame["attractor_id"].values > 0
    number, kind, period = (
        frame[name].values[held].tolist()
        for name in ("attractor_id", "motion_class", "orbit_period")
    )
    contact = frame["contact"].values[held].tolist() if "contact" in frame else [None] * len(kind)
    return number, list(map(Found, kind, period, contact))


class SearchTally:
    """Tally of the starts of a study; see `hpcsweep.studies.tally.RunTally`."""

    def __init__(self, study):
        self._labels = study.structure.contact_labels
        self.outcomes = np.zeros(len(Outcome), int)
        self.largest: dict[str, dict] = {}
        self.cycles = self.starts = self.undecided = self.failed = self.elsewhere = 0

    @property
    def done(self) -> int:
        """Number of computed runs."""
        return int(self.outcomes[Outcome.COMPLETE :].sum())

    def add_starts(self, frame, study, starts: int) -> None:
        """Count a frame, an xarray.Dataset, of a study with `starts` starts a run."""
        add_largest(self.largest, frame, study)
        outcome = frame["outcome"].values
        there = outcome != Outcome.NOT_COMPUTED
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        self.cycles += int(frame["cycles"].values[there].sum())
        self.starts += int(there.sum()) * starts
        self.undecided += int(frame["n_undecided"].values[there].sum())
        self.failed += int(frame["n_failed"].values[there].sum())
        self.elsewhere += int(frame["n_elsewhere"].values[there].sum())

    def told_of(self, numbers: Counter[int], attractors: Counter[Found]) -> dict:
        """Return the counts; shares of the kinds of attractors are of all attractors."""
        done, held = self.done, attractors.total()
        classes, periods, contacts = Counter[int](), Counter[int](), Counter[int]()
        for one, count in attractors.items():
            classes[one.motion_class] += count
            if one.orbit_period:
                periods[one.orbit_period] += count
            if one.contact is not None:
                contacts[one.contact] += count
        return {
            "periods_per_run": self.cycles / done if done else None,
            "periods_per_start": self.cycles / self.starts if self.starts else None,
            "numbers": shares(numbers, done, sorted(numbers)),
            "starts": self.starts,
            "starts_undecided": share(self.undecided, self.starts),
            "starts_failed": share(self.failed, self.starts),
            "starts_elsewhere": share(self.elsewhere, self.starts),
            "attractors": held,
            "classes": {
                CLASS_NAMES[kind]: share(classes[kind], held)
                for kind in (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
            },
            "periods": shares(periods, held, sorted(periods)),
            "contact_sets": {
                contact_name(contact, self._labels): share(count, held)
                for contact, count in contacts.most_common()
            },
            "largest": self.largest,
            "failures": failures(self.outcomes),
        }


class AttractorTally(SearchTally):
    """Tally of points: each attractor of each point counts."""

    def __init__(self, study):
        super().__init__(study)
        self.numbers: Counter[int] = Counter()
        self.attractors: Counter[Found] = Counter()

    def add(self, frame, study) -> None:
        """Count the points of one frame, an xarray.Dataset, of a study or of a part of it."""
        self.add_starts(frame, study, study.starts)
        there = frame["outcome"].values != Outcome.NOT_COMPUTED
        self.numbers.update(frame["n_attractors"].values[there].tolist())
        self.attractors.update(attractors_in(frame)[1])

    def summary(self) -> dict:
        """Return the counts: numbers, strings, lists and dicts."""
        return self.told_of(self.numbers, self.attractors)
