"""Count over studies of attractors and of basins, for their summaries."""

import math
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.boundaries import basin_boundary
from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, contact_name, shakedown_name
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies import tally
from hpcsweep.studies.attractors.search import KINDS, UNSTORED
from hpcsweep.studies.refine.audit import SOURCE, inferred_name
from hpcsweep.studies.refinement import Source
from hpcsweep.studies.study import Study


class Counted(NamedTuple):
    """Counted properties of an attractor; None where the file lacks them."""

    motion: int
    orbit_period: int
    contact: int | None
    shakedown: int | None

    def named(self, labels) -> str:
        """Return its name: period or class, and contact set."""
        kind = CLASS_NAMES[MotionClass(self.motion)]
        name = f"P{self.orbit_period}" if self.orbit_period else kind
        name += "" if self.contact is None else f" {contact_name(self.contact, labels)}"
        return name + shakedown_name(self.shakedown)


def attractors_in(frame) -> tuple[list[int], list[Counted]]:
    """Return identity and kind of all attractors of a frame, an xarray.Dataset."""
    held = frame["attractor_id"].values > 0
    number, kind, period = (
        frame[name].values[held].tolist() for name in ("attractor_id", "motion", "orbit_period")
    )
    contact, shakedown = (
        frame[name].values[held].tolist() if name in frame else [None] * len(kind)
        for name in ("contact", "shakedown")
    )
    return number, list(map(Counted, kind, period, contact, shakedown))


class AttractorTally(tally.BaseTally):
    """Tally of points and their starts: each attractor of each point counts."""

    def add(self, frame, study: Study) -> None:
        """Count the points of one frame; see `BaseTally.add`."""
        super().add(frame, study)
        there = frame["outcome"].values != Outcome.NOT_COMPUTED
        starts = self.counts["starts"]
        starts["all"] += int(there.sum()) * study.polls_per_run
        for name in UNSTORED:
            starts[name] += int(frame[f"n_{name}"].values[there].sum())
        self._add_attractors(frame, there)

    def _add_attractors(self, frame, there: np.ndarray) -> None:
        """Count the attractors of a frame."""
        self.count("n_attractors", frame["n_attractors"].values[there])
        self.counts["attractors"].update(attractors_in(frame)[1])

    def summary(self) -> dict[str, Any]:
        """Return the counts; shares of the kinds of attractors are of all attractors."""
        counts = self.counts
        starts, held = counts["starts"]["all"], counts["attractors"].total()
        # the same by each property of an attractor
        of_each = [Counter[Any]() for _ in Counted._fields]
        for attractor, number in counts["attractors"].items():
            for counter, value in zip(of_each, attractor, strict=True):
                counter[value] += number
        classes, periods, contacts, shakedown = of_each
        del periods[0], contacts[None]
        return super().summary() | {
            "periods_per_start": counts["all"]["cycles"] / starts if starts else None,
            "numbers": tally.shares(counts["n_attractors"], self.done),
            "starts": starts,
            **{f"starts_{name}": tally.share(counts["starts"][name], starts) for name in UNSTORED},
            "attractors": held,
            "classes": tally.class_shares(classes, self._study, KINDS),
            "periods": tally.shares(periods, held),
            "shakedown": tally.shakedown_shares(shakedown, held, self._study),
            "contact_sets": tally.contact_shares(contacts, held, self._study),
        }


class BasinTally(AttractorTally):
    """Tally of rows of starts: all list the same attractors, whose shares are of all starts."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.attractors: dict[str, Counted] = {}
        self.rows: dict[str, list[tuple[np.ndarray, float, np.ndarray]]] = {}

    def _add_attractors(self, frame, _there: np.ndarray) -> None:
        """Count the starts of a row to each attractor."""
        self._add_labels(frame, frame["label"].values)
        self._add_row(frame, frame["label"].values)

    def _add_row(self, frame, labels: np.ndarray) -> None:
        """Keep the labels of a row of the slice, and its places on both axes."""
        places = frame["column"].values, frame["ordinate"].values.item()
        self.rows.setdefault(frame.attrs["part"], []).append((*places, labels.ravel()))

    def _add_labels(self, frame, labels: np.ndarray) -> None:
        part = frame.attrs["part"]
        for number, kind in zip(*attractors_in(frame), strict=True):
            name = f"{part}, {number}" if part else str(number)
            self.attractors[name] = kind
            self.counts["hits"][name] += int((labels == number).sum())

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        labels, starts = self._study.structure.contact_labels, self.counts["starts"]["all"]
        basins = {
            name: {"name": kind.named(labels), **tally.share(self.counts["hits"][name], starts)}
            for name, kind in self.attractors.items()
        }
        self.counts["attractors"] = Counter(self.attractors.values())
        return super().summary() | {"basins": basins, "boundaries": self._boundaries()}

    def _boundaries(self) -> dict[str, dict[str, Any]]:
        """Return basin entropy and uncertainty exponent of each part that has several basins.

        Of slices whose starts are not evenly spaced there is none.
        """
        boundaries = {}
        for part, rows in self.rows.items():
            columns, ordinates, labels = zip(*rows, strict=True)
            steps = [np.diff(axis) for axis in (columns[0], np.array(ordinates))]
            boundary = basin_boundary(np.array(labels))
            even = all(np.allclose(step, step.mean(), rtol=1e-6, atol=0) for step in steps)
            if even and not math.isnan(boundary.boundary_entropy):
                exponent = None if math.isnan(boundary.exponent.mean) else [*boundary.exponent]
                boundaries[part or "of the slice"] = {**boundary._asdict(), "exponent": exponent}
        return boundaries


class StartTally(BasinTally):
    """Tally of the starts of a refined map: shares are of all, computed or inferred."""

    def add(self, frame, study: Study) -> None:
        """Count a row; see `BaseTally.add`."""
        tally.BaseTally.add(self, frame, study)
        computed = frame["outcome"].values != Outcome.NOT_COMPUTED
        inferred = frame[SOURCE].values == Source.INFERRED
        labels = np.where(inferred, frame[inferred_name("label")].values, frame["label"].values)
        self._add_row(frame, np.where(computed | inferred, labels, 0))
        labels = labels[computed | inferred]
        starts = self.counts["starts"]
        starts["all"] += labels.size
        for name, label in UNSTORED.items():
            starts[name] += int((labels == label).sum())
        self._add_labels(frame, labels)

    def summary(self) -> dict[str, Any]:
        """Return the counts; the periods of a start are those of the computed ones."""
        counts = super().summary()
        return counts | {"periods_per_start": counts["periods_per_run"]}
