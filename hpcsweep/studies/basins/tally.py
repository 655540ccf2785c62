"""Count over the starts of a study of basins, for its summary."""

from collections import Counter

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.tally import Found, SearchTally, attractors_in
from hpcsweep.studies.refine.refinement import Source
from hpcsweep.studies.refine.variables import SOURCE, inferred_name
from hpcsweep.studies.tally import share


class BasinTally(SearchTally):
    """Tally of rows of starts: all list the same attractors, whose shares are of all starts."""

    def __init__(self, study):
        super().__init__(study)
        self.attractors: dict[str, Found] = {}
        self.hits: Counter[str] = Counter()

    def add(self, frame, study) -> None:
        """Count a row, an xarray.Dataset, of a study or of a part of it."""
        self.add_starts(frame, study, study.horizontal.size)
        self.add_labels(frame, frame["label"].values)

    def add_labels(self, frame, labels: np.ndarray) -> None:
        """Count the starts of a row to each attractor."""
        part = frame.attrs["part"]
        for number, kind in zip(*attractors_in(frame), strict=True):
            name = f"{part}, {number}" if part else str(number)
            self.attractors[name] = kind
            self.hits[name] += int((labels == number).sum())

    def summary(self) -> dict:
        """Return the counts: numbers, strings, lists and dicts."""
        basins = {
            name: {"name": kind.named(self._labels), **share(self.hits[name], self.starts)}
            for name, kind in self.attractors.items()
        }
        return self.told_of(Counter(), Counter(self.attractors.values())) | {"basins": basins}


class StartTally(BasinTally):
    """Tally of the starts of a refined map: shares are of all, computed or inferred."""

    def add(self, frame, study) -> None:
        """Count a row, an xarray.Dataset, of a study."""
        del study
        outcome = frame["outcome"].values
        computed = outcome != Outcome.NOT_COMPUTED
        inferred = frame[SOURCE].values == Source.INFERRED
        labels = np.where(inferred, frame[inferred_name("label")].values, frame["label"].values)
        labels = labels[computed | inferred]
        self.outcomes += np.bincount(outcome.ravel(), minlength=self.outcomes.size)
        self.cycles += int(frame["cycles"].values[computed].sum())
        self.starts += labels.size
        self.undecided += int((labels == UNDECIDED).sum())
        self.failed += int((labels == FAILED).sum())
        self.elsewhere += int((labels == ELSEWHERE).sum())
        self.add_labels(frame, labels)

    def summary(self) -> dict:
        """Return the counts; the periods of a start are those of the computed ones."""
        counts = super().summary()
        return counts | {"periods_per_start": counts["periods_per_run"]}
