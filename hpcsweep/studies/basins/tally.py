"""Count over the starts of a study of basins, for its summary."""

from collections import Counter
from typing import Any

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.attractors.tally import Counted, SearchTally, attractors_in
from hpcsweep.studies.refine.refinement import Source
from hpcsweep.studies.refine.variables import SOURCE, inferred_name
from hpcsweep.studies.study import Study
from hpcsweep.studies.tally import BaseTally, share


class BasinTally(SearchTally):
    """Tally of rows of starts: all list the same attractors, whose shares are of all starts."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.attractors: dict[str, Counted] = {}
        self.hits: Counter[str] = Counter()

    def add(self, frame, study: Study) -> None:
        """Count a row; see `BaseTally.add`."""
        super().add(frame, study)
        self.add_labels(frame, frame["label"].values)

    def add_labels(self, frame, labels: np.ndarray) -> None:
        """Count the starts of a row to each attractor."""
        part = frame.attrs["part"]
        for number, kind in zip(*attractors_in(frame), strict=True):
            name = f"{part}, {number}" if part else str(number)
            self.attractors[name] = kind
            self.hits[name] += int((labels == number).sum())

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        labels, starts = self._study.structure.contact_labels, self.starts["all"]
        basins = {
            name: {"name": kind.named(labels), **share(self.hits[name], starts)}
            for name, kind in self.attractors.items()
        }
        return self.told_of(Counter(), Counter(self.attractors.values())) | {"basins": basins}


class StartTally(BasinTally):
    """Tally of the starts of a refined map: shares are of all, computed or inferred."""

    def add(self, frame, study: Study) -> None:
        """Count a row; see `BaseTally.add`."""
        BaseTally.add(self, frame, study)
        computed = frame["outcome"].values != Outcome.NOT_COMPUTED
        inferred = frame[SOURCE].values == Source.INFERRED
        labels = np.where(inferred, frame[inferred_name("label")].values, frame["label"].values)
        labels = labels[computed | inferred]
        self.starts["all"] += labels.size
        for name, label in zip(UNSTORED, (UNDECIDED, FAILED, ELSEWHERE), strict=True):
            self.starts[name] += int((labels == label).sum())
        self.add_labels(frame, labels)

    def summary(self) -> dict[str, Any]:
        """Return the counts; the periods of a start are those of the computed ones."""
        counts = super().summary()
        return counts | {"periods_per_start": counts["periods_per_run"]}
