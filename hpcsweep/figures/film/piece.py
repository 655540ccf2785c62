"""Survey, paint and encode pieces of a film on one rank or process."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.figures.film import video
from hpcsweep.figures.film.frame import Painter
from hpcsweep.figures.film.scene import Scene
from hpcsweep.figures.labels import choose_floors
from hpcsweep.figures.measures import Measure, measure_of
from hpcsweep.figures.overlay import Overlay
from hpcsweep.figures.palette import motion_index
from hpcsweep.figures.style import classes_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

VARIABLES = ("orbit_period", "outcome")


@dataclass(frozen=True)
class Request:
    """Request of a film.

    Attributes
    ----------
    file, output : Path
        Results, and the film; its ending selects MP4 or GIF.
    poster : Path or None
        Picture of the frame with most kinds of motion.
    fps : float
    every : int
        Step between frames, in ascending frequency.
    direction : {"up", "down", "both"}
    color : {"direction", "contact", "period"}
    width : int
        In pixels, even; 0 for the default.
    floors : tuple of int
        Shown, from 1; see `labels.choose_floors`. Of a measure its storeys, floors or contacts.
    show : str
        Measure that is drawn in place of stroboscopic displacements; empty for these.
    branches : Path or None
        File of branches that lie under the points.
    at : dict
        Of a job that varies keys, the part shown; see `hpcsweep.store.Frames`.
    """

    file: Path
    output: Path
    poster: Path | None = None
    fps: float = 25.0
    every: int = 1
    direction: str = "both"
    color: str = "direction"
    width: int = 0
    floors: tuple[int, ...] = ()
    show: str = ""
    branches: Path | None = None
    at: Mapping[str, float | str] = field(default_factory=dict)


@dataclass
class Found:
    """Findings of the first pass.

    Attributes
    ----------
    low, high : ndarray, shape (n_panels,), or None
        Extremes of the points of the floors shown.
    motions, contacts : Counter
        Runs of each motion (where colours show it) and contact set.
    richness : dict
        For each frame that has any complete run: number of kinds of motion (period and contact
        set), and of points.
    """

    low: np.ndarray | None = None
    high: np.ndarray | None = None
    motions: Counter = field(default_factory=Counter)
    contacts: Counter = field(default_factory=Counter)
    richness: dict[int, tuple[int, int]] = field(default_factory=dict)

    def add(self, other: "Found") -> None:
        """Merge findings of other frames."""
        if other.low is not None and other.high is not None:
            self.low = other.low if self.low is None else np.minimum(self.low, other.low)
            self.high = other.high if self.high is None else np.maximum(self.high, other.high)
        self.motions.update(other.motions)
        self.contacts.update(other.contacts)
        self.richness.update(other.richness)


class Film:
    """Reader, painter and encoder of pieces of one film; the same on every rank."""

    def __init__(self, request: Request, folder: Path):
        self.request = request
        self.folder = folder
        self.frames = Frames(request.file, at=request.at)
        job = self.frames.job
        self.measure: Measure | None = None
        if request.show:
            self.measure = measure_of(self.frames.dataset(0), job.structure, request.show)
        contact = ("contact",) if "contact" in self.frames else ()
        self.variables = (request.show or "poincare", *VARIABLES, *contact)
        study = as_kind(job.study, RunGrid)
        wanted = study.directions if request.direction == "both" else (request.direction,)
        self.rows = [study.directions.index(name) for name in wanted]
        self.directions = wanted
        self.order = [int(k) for k in np.argsort(study.omega, kind="stable")[:: request.every]]
        n = len(self.measure.places) if self.measure else job.structure.n_floors
        self.floors = choose_floors(n, request.floors)
        self.overlay = Overlay(request.branches, job.structure) if request.branches else None
        self.painter: Painter | None = None

    def read(self, frame: int) -> dict[str, np.ndarray]:
        """Read one frame, runs that are not complete without points."""
        found = {k: v[self.rows] for k, v in self.frames.read(frame, self.variables).items()}
        if self.measure:
            values = found.pop(self.request.show) * self.measure.factor
            found["poincare"] = values[..., None, :]
        found["poincare"] = found["poincare"][..., self.floors]
        found["poincare"][found["outcome"] != Outcome.COMPLETE] = np.nan
        if self.request.color == "period":
            classes = classes_of(self.frames.dataset(frame))[self.rows, 0]
            found["motion"] = motion_index(classes, found["orbit_period"])
        return found

    def survey(self, frames: list[int]) -> Found:
        """Find ranges and classes of some frames."""
        total = Found()
        for k in frames:
            frame = self.read(k)
            done = frame["outcome"] == Outcome.COMPLETE
            points = frame["poincare"][np.isfinite(frame["poincare"][..., 0])]
            if not points.size:
                continue
            periods = frame["orbit_period"][done].tolist()
            contacts = frame["contact"][done].tolist() if "contact" in frame else []
            motions = frame["motion"][done].tolist() if "motion" in frame else []
            kinds = set(zip(periods, contacts or periods, strict=True))
            total.add(
                Found(
                    points.min(axis=0),
                    points.max(axis=0),
                    Counter(motions),
                    Counter(contacts),
                    {k: (len(kinds), len(points))},
                )
            )
        return total

    def paint(self, scene: Scene, frame: int) -> np.ndarray:
        """Paint one frame; shape (height, width, 4)."""
        if self.painter is None:
            self.painter = Painter(scene)
        omega = float(as_kind(self.frames.study, RunGrid).omega[frame])
        branches = self.overlay.at(omega) if self.overlay else []
        return self.painter.paint(omega, self.read(frame), branches)

    def encode(self, scene: Scene, frames: list[int], number: int) -> None:
        """Paint some frames and encode them as segment `number`."""
        pictures = (self.paint(scene, frame) for frame in frames)
        video.encode(pictures, self.segment(number), self.request.fps, is_gif(self.request))

    def segment(self, number: int) -> Path:
        """Return the path of a segment."""
        return self.folder / f"{number:06d}.mp4"


def is_gif(request: Request) -> bool:
    """Return whether a GIF is requested."""
    return request.output.suffix.lower() == ".gif"
