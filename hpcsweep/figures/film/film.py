"""A film of orbit diagrams over the forcing frequency, made by many ranks or processes.

Two passes over the frames, both distributed in pieces of `PIECE` frames: the first finds the ranges
of the axes and the classes that occur, the second paints the pieces and encodes each as a segment.
The film's bytes do not depend on the number of ranks or processes.
"""

import contextlib
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.film import video
from hpcsweep.figures.film.picture import Picture
from hpcsweep.figures.film.request import WIDTH, Request
from hpcsweep.figures.film.workers import Workers
from hpcsweep.figures.measures import ShownMeasure, measure_of
from hpcsweep.figures.overlay import Overlay
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

PIECE = 40
"""Frames of one segment."""


@dataclass
class FirstPass:
    """Findings of the first pass.

    Attributes
    ----------
    low, high : ndarray, shape (n_panels,)
        Extremes of the points of the floors shown.
    motions, contacts : Counter
        Runs of each motion (where colours show it) and contact set.
    richness : dict
        For each frame that has any complete run: number of kinds of motion (period and contact
        set), and of points.
    """

    low: np.ndarray = field(default_factory=lambda: np.array(np.inf))
    high: np.ndarray = field(default_factory=lambda: np.array(-np.inf))
    motions: Counter = field(default_factory=Counter)
    contacts: Counter = field(default_factory=Counter)
    richness: dict[int, tuple[int, int]] = field(default_factory=dict)

    def add(self, other: "FirstPass") -> None:
        """Merge findings of other frames."""
        self.low = np.minimum(self.low, other.low)
        self.high = np.maximum(self.high, other.high)
        self.motions.update(other.motions)
        self.contacts.update(other.contacts)
        self.richness.update(other.richness)


class Film:
    """Reader, painter and encoder of pieces of one film; the same on every rank."""

    def __init__(self, request: Request, folder: Path):
        self.request, self.folder = request, folder
        self.frames = Frames(request.file, at=request.at)
        self.study = as_kind(self.frames.study, RunGrid)
        self.structure = self.frames.job.structure
        self.measure: ShownMeasure | None = None
        if request.show:
            self.measure = measure_of(self.frames.dataset(0), self.structure, request.show)
        known = self.study.directions
        self.directions = known if request.direction == "both" else (request.direction,)
        self.order = [int(k) for k in np.argsort(self.study.omega, kind="stable")[:: request.every]]
        n = len(self.measure.places) if self.measure else self.structure.n_floors
        self.floors = labels.choose_floors(n, request.floors)
        self.overlay = Overlay(request.branches, self.structure) if request.branches else None
        self.width = request.width or WIDTH[request.is_gif]
        self._picture: Picture | None = None

    def read(self, frame: int) -> dict[str, np.ndarray]:
        """Read one frame.

        Returns
        -------
        dict
            ``poincare`` (direction, amplitude, point, panel), NaN where there is no point;
            ``orbit_period``, ``outcome`` and, where the file or the colours have them, ``contact``
            and ``motion`` (index in `palette.MOTIONS`), all (direction, amplitude).
        """
        shown = self.request.show or "poincare"
        names = (shown, "orbit_period", "outcome", *{"contact"}.intersection(self.frames))
        rows = [self.study.directions.index(name) for name in self.directions]
        found = {k: v[rows] for k, v in self.frames.read(frame, names).items()}
        values = found.pop(shown)
        if self.measure:
            values = (values * self.measure.factor)[..., None, :]
        values = found["poincare"] = values[..., self.floors]
        values[found["outcome"] != Outcome.COMPLETE] = np.nan
        if self.request.color == "period":
            classes = style.classes_of(self.frames.dataset(frame))[rows, 0]
            found["motion"] = palette.motion_index(classes, found["orbit_period"])
        return found

    def survey(self, frames: list[int]) -> FirstPass:
        """Find ranges and classes of some frames."""
        total = FirstPass()
        for k in frames:
            frame = self.read(k)
            points = frame["poincare"][np.isfinite(frame["poincare"][..., 0])]
            if points.size:
                done = frame["outcome"] == Outcome.COMPLETE
                periods, contacts, motions = (
                    frame[name][done].tolist() if name in frame else []
                    for name in ("orbit_period", "contact", "motion")
                )
                kinds = set(zip(periods, contacts or periods, strict=True))
                extremes = points.min(axis=0), points.max(axis=0)
                richness = {k: (len(kinds), len(points))}
                total.add(FirstPass(*extremes, Counter(motions), Counter(contacts), richness))
        return total

    def picture(self, found: FirstPass) -> Picture:
        """Return the picture of the frames, made once."""
        if self._picture is None:
            self._picture = Picture(self, found)
        return self._picture

    def paint(self, found: FirstPass, frame: int) -> np.ndarray:
        """Paint one frame; shape (height, width, 4)."""
        omega = float(self.study.omega[frame])
        branches = self.overlay.at(omega) if self.overlay else []
        return self.picture(found).paint(omega, self.read(frame), branches)

    def encode(self, frames: list[int], found: FirstPass) -> None:
        """Paint some frames and encode them as a segment."""
        pictures = (self.paint(found, frame) for frame in frames)
        request = self.request
        video.encode(pictures, self.segment(frames[0]), request.fps, request.is_gif)

    def segment(self, first: int) -> Path:
        """Return the path of the segment that begins with a frame."""
        return self.folder / f"{first:06d}.mp4"


def make(
    request: Request, comm, processes: int = 1, progress: Callable[[int, int], Any] | None = None
) -> int | None:
    """Make a film (collective).

    Parameters
    ----------
    request : Request
        Checked.
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    processes : int
        Processes that share the work if there is one rank.
    progress : callable, optional
        Return the progress display on rank 0 (`campaign.progress`): each frame counts twice, once
        surveyed and once painted.

    Returns
    -------
    int or None
        Number of frames in the film; None if it was stopped by a signal.

    Raises
    ------
    PlotError
        On every rank, if no run is complete.
    """
    name = f".{request.output.name}."
    new_folder = partial(tempfile.mkdtemp, prefix=name, dir=request.output.parent)
    folder = Path(_on_first(request, comm, new_folder))
    try:
        film = Film(request, folder)
        shown = progress(2 * len(film.order), 0) if progress and comm.rank == 0 else None
        with contextlib.closing(shown) if shown else contextlib.nullcontext():
            advance = shown.advance if shown else lambda frames: None
            n_frames = _make(film, comm, processes, advance)
    except BaseException:
        # no other rank is waited for: the caller ends them all
        shutil.rmtree(folder, ignore_errors=True)
        raise
    comm.barrier()
    if comm.rank == 0:
        shutil.rmtree(folder, ignore_errors=True)
    return n_frames


def _on_first(request: Request, comm, do: Callable[[], Any]) -> Any:
    """Return on every rank what rank 0 has done; refuse a film that it cannot write."""
    result = problem = None
    if comm.rank == 0:
        try:
            result = do()
        except OSError as error:
            problem = f"{request.output}: cannot be written: {error.strerror or error}"
    result, problem = comm.bcast((result, problem))
    if problem is not None:
        raise style.PlotError(problem)
    return result


def _make(film: Film, comm, processes: int, advance: Callable[[int], None]) -> int | None:
    """Survey all frames, then paint and join them."""
    found = FirstPass()
    with Workers(comm, processes, film, advance) as workers:
        if not workers.run(Film.survey, _pieces(film.order), collect=found.add):
            return None
        found = comm.bcast(found)
        drawn = [k for k in film.order if k in found.richness]
        if not drawn:
            raise style.PlotError(f"{film.request.file}: no run is complete yet")
        if not workers.run(Film.encode, _pieces(drawn), found):
            return None
    segments = [film.segment(piece[0]) for piece in _pieces(drawn)]
    _on_first(film.request, comm, lambda: _finish(film, found, segments))
    return len(drawn)


def _pieces(frames: list[int]) -> list[list[int]]:
    return [frames[k : k + PIECE] for k in range(0, len(frames), PIECE)]


def _finish(film: Film, found: FirstPass, segments: list[Path]) -> None:
    """Join the segments, write the poster, move both to their places."""
    from PIL import Image

    request = film.request
    picture = film.paint(found, max(found.richness, key=lambda k: (found.richness[k], -k)))
    keys = *film.picture(found).keys.values(), *film.picture(found).sets.values()
    whole = film.folder / f"film{request.output.suffix.lower()}"
    video.join(
        segments, whole, video.palette_of(picture, [c for c, _ in keys]) if request.is_gif else None
    )
    if request.poster is not None:
        poster = film.folder / "poster.png"
        Image.fromarray(np.ascontiguousarray(picture[..., :3])).save(poster)
        poster.replace(request.poster)
    whole.replace(request.output)
