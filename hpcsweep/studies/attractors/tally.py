"""Count over studies of attractors, for their summaries."""

from collections import Counter
from typing import Any, NamedTuple

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, contact_name
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.study import Study
from hpcsweep.studies.tally import BaseTally, contact_shares, share, shares


class Counted(NamedTuple):
    """Counted properties of an attractor; `contact` is None where the file lacks it."""

    motion_class: int
    orbit_period: int
    contact: int | None

    def named(self, labels) -> str:
        """Return its name: period or class, and contact set."""
        kind = CLASS_NAMES[MotionClass(self.motion_class)]
        name = f"P{self.orbit_period}" if self.orbit_period else kind
        return name if self.contact is None else f"{name} {contact_name(self.contact, labels)}"


def attractors_in(frame) -> tuple[list[int], list[Counted]]:
    """Return identity and kind of all attractors of a frame, an xarray.Dataset."""
    held = frame["attractor_id"].values > 0
    number, kind, period = (
        frame[name].values[held].tolist()
        for name in ("attractor_id", "motion_class", "orbit_period")
    )
    contact = frame["contact"].values[held].tolist() if "contact" in frame else [None] * len(kind)
    return number, list(map(Counted, kind, period, contact))


class SearchTally(BaseTally):
    """Tally of the starts of a study."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.starts: Counter[str] = Counter()

    def add(self, frame, study: Study) -> None:
        """Count the starts of a frame; see `BaseTally.add`."""
        super().add(frame, study)
        there = frame["outcome"].values != Outcome.NOT_COMPUTED
        self.starts["all"] += int(there.sum()) * study.polls_per_run
        for name in UNSTORED:
            self.starts[name] += int(frame[f"n_{name}"].values[there].sum())

    def told_of(self, numbers: Counter[int], attractors: Counter[Counted]) -> dict:
        """Return the counts; shares of the kinds of attractors are of all attractors."""
        starts, held = self.starts["all"], attractors.total()
        classes, periods, contacts = Counter[int](), Counter[int](), Counter[int]()
        for one, count in attractors.items():
            classes[one.motion_class] += count
            if one.orbit_period:
                periods[one.orbit_period] += count
            if one.contact is not None:
                contacts[one.contact] += count
        return super().summary() | {
            "periods_per_start": self.cycles / starts if starts else None,
            "numbers": shares(numbers, self.done),
            "starts": starts,
            **{f"starts_{name}": share(self.starts[name], starts) for name in UNSTORED},
            "attractors": held,
            "classes": {
                CLASS_NAMES[kind]: share(classes[kind], held)
                for kind in (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
            },
            "periods": shares(periods, held),
            "contact_sets": contact_shares(contacts, held, self._study),
        }


class AttractorTally(SearchTally):
    """Tally of points: each attractor of each point counts."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.numbers: Counter[int] = Counter()
        self.attractors: Counter[Counted] = Counter()

    def add(self, frame, study: Study) -> None:
        """Count the points of one frame; see `BaseTally.add`."""
        super().add(frame, study)
        there = frame["outcome"].values != Outcome.NOT_COMPUTED
        self.numbers.update(frame["n_attractors"].values[there].tolist())
        self.attractors.update(attractors_in(frame)[1])

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        return self.told_of(self.numbers, self.attractors)
