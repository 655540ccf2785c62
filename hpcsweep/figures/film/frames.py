"""A film as it is requested, and its frames as they are read."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.overlay import Drawn, Overlay
from hpcsweep.figures.style import PlotError
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind


@dataclass(frozen=True)
class Request:
    """Request of a film.

    Attributes
    ----------
    file, output : Path
        Results, and the film; its ending selects MP4 or GIF.
    fps : float
    every : int
        Step between frames, in ascending frequency.
    color : {"direction", "contact", "period"}
    width : int
        In pixels, even; 0 for the default.
    floors : tuple of int or str
        Shown, see `coordinates.coordinates`. Of a measure its storeys, floors or contacts.
    show : str
        Measure that is drawn in place of stroboscopic displacements; empty for these.
    branches : Path or None
        File of branches that lie under the points.
    at : dict
        Of a job that varies keys, the part shown; see `hpcsweep.store.Frames`.
    """

    file: Path
    output: Path
    fps: float = 25.0
    every: int = 1
    color: str = "direction"
    width: int = 0
    floors: tuple[int | str, ...] = ()
    show: str = ""
    branches: Path | None = None
    at: Mapping[str, float | str] = field(default_factory=dict, hash=False)

    @property
    def is_gif(self) -> bool:
        """Return whether a GIF is requested."""
        return self.output.suffix.lower() == ".gif"


class Survey(NamedTuple):
    """What frames of a film hold.

    Attributes
    ----------
    frames : tuple of int
    low, high : ndarray, shape (n_panels,)
        Extremes of the points of the floors shown.
    keys : set of int
        Directions, motions or contact sets that colours show.
    contacts : Counter
        Runs of each contact set.
    """

    frames: tuple[int, ...]
    low: np.ndarray
    high: np.ndarray
    keys: set[int]
    contacts: Counter[int]


def joined(surveys: Sequence[Survey]) -> Survey:
    """Return what all frames hold."""
    frames, low, high, keys, contacts = zip(*surveys, strict=True)
    ends = np.min(low, axis=0), np.max(high, axis=0)
    return Survey(sum(frames, ()), *ends, set().union(*keys), sum(contacts, Counter()))


class Film:
    """Reader of the frames of one film.

    Raises
    ------
    PlotError, StoreError
        If the file does not hold what is requested; one line for the user.
    """

    def __init__(self, request: Request):
        if request.show and request.show not in labels.SHOWN:
            raise PlotError(f"--show {request.show}: must be one of {', '.join(labels.SHOWN)}")
        self.request = request
        self.frames = Frames(request.file, at=request.at)
        self._shown = request.show or "poincare"
        self.study = as_kind(self.frames.study, RunGrid)
        self.structure = self.frames.job.structure
        style.need_amplitudes(self.study)
        self.measure: labels.ShownMeasure | None = None
        if request.show:
            self.measure = labels.measure_of(self.frames.dataset(0), self.structure, request.show)
        places = [place.partition(" ")[2] for place in self.measure.places] if self.measure else []
        self.floors = style.choose_floors(places, request.floors) if places else []
        self.coordinates = [] if places else coordinates(self.structure, request.floors)
        order = np.argsort(self.study.frames, kind="stable")
        self.order = order[:: request.every].tolist()
        self.overlay: Overlay | None = None
        if request.branches:
            if request.show:
                raise PlotError(f"--branches {request.branches}: does not go with --show")
            self.overlay = Overlay(request.branches, self.study)
            self.overlay.need(self.order)

    @property
    def words(self) -> list[str]:
        """Labels of the vertical axes of the panels."""
        if self.measure:
            return [self.measure.places[floor] + self.measure.unit for floor in self.floors]
        symbols = (coordinate.symbol for coordinate in self.coordinates)
        return [labels.displacement(self.structure, symbol, "(jT)") for symbol in symbols]

    def read(self, frame: int) -> dict[str, np.ndarray]:
        """Read one frame.

        Returns
        -------
        dict
            ``poincare`` (direction, amplitude, point, panel), NaN where there is no point;
            ``orbit_period``, ``outcome``, ``contact`` where the file has it, and ``key``, the
            direction, contact set or motion (index in `palette.MOTIONS`) that the colour shows, all
            (direction, amplitude).
        """
        names = [self._shown, "orbit_period", "outcome"]
        if self.request.color == "contact" or "contact" in self.frames:
            names.append("contact")
        variables = {**self.frames.read(frame, tuple(names))}
        values = variables.pop(self._shown)
        if self.measure:
            values = (values * self.measure.factor)[..., None, self.floors]
        else:
            values = np.stack([each.of(values) for each in self.coordinates], axis=-1)
        variables["poincare"] = values
        values[variables["outcome"] != Outcome.COMPLETE] = np.nan
        periods = variables["orbit_period"]
        if self.request.color == "period":
            classes = style.classes_of(self.frames.dataset(frame))[:, 0]
            variables["key"] = palette.motion_index(classes, periods)
        elif self.request.color == "contact":
            variables["key"] = variables["contact"]
        else:
            variables["key"] = np.indices(periods.shape)[0]
        return variables

    def branches(self, frame: int) -> list[Drawn]:
        """Return the branches that lie under the points of one frame."""
        return self.overlay.at(frame) if self.overlay else []

    def survey(self, frame: int) -> Survey | None:
        """Find ranges and classes of one frame, None if no run of it is complete."""
        variables = self.read(frame)
        points = variables["poincare"][np.isfinite(variables["poincare"][..., 0])]
        if not points.size:
            return None
        done = variables["outcome"] == Outcome.COMPLETE
        contacts = Counter(variables["contact"][done].tolist() if "contact" in variables else ())
        keys = set(variables["key"][done].tolist())
        return Survey((frame,), points.min(axis=0), points.max(axis=0), keys, contacts)
