"""A film of orbit diagrams over the forcing frequency, made by many ranks or processes.

Two passes over the frames, both shared out in pieces of `PIECE` frames: the first finds the
ranges of the axes and the classes that occur, the second paints the pieces and encodes each as a
segment of its own. The film's bytes do not depend on how many have worked at it.
"""

import multiprocessing
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep import farm
from hpcsweep.figures import video
from hpcsweep.figures.film_frame import (
    DIRECTION_COLOUR,
    WIDTH,
    Painter,
    Scene,
    contact_colour,
    period_class,
    rgb,
    tint,
)
from hpcsweep.figures.style import PlotError
from hpcsweep.outcome import Outcome
from hpcsweep.store import Frames

PIECE = 40
"""Frames of one segment."""
GIF_WIDTH = 960
LEAST_WIDTH, MOST_WIDTH = 320, 3840
VARIABLES = ("poincare", "orbit_period", "outcome")


@dataclass(frozen=True)
class Request:
    """What film is wanted.

    Attributes
    ----------
    file, output : Path
        Results, and the film; its ending tells MP4 or GIF.
    poster : Path or None
        Picture of the frame with most points.
    fps : float
    every : int
        Every so manieth frame, in ascending frequency.
    direction : {"up", "down", "both"}
    color : {"direction", "contact", "period"}
    width : int
        In pixels, even; 0 for the default.
    """

    file: Path
    output: Path
    poster: Path | None = None
    fps: float = 25.0
    every: int = 1
    direction: str = "both"
    color: str = "direction"
    width: int = 0


@dataclass
class Found:
    """What the first pass finds in frames.

    Attributes
    ----------
    low, high : ndarray, shape (n_floors,), or None
        Extremes of the points, in gaps.
    periods, contacts : Counter
        Runs of each orbit period and contact set.
    points : dict
        Number of points of each frame that has any complete run.
    """

    low: np.ndarray | None = None
    high: np.ndarray | None = None
    periods: Counter = field(default_factory=Counter)
    contacts: Counter = field(default_factory=Counter)
    points: dict[int, int] = field(default_factory=dict)

    def add(self, other: "Found") -> None:
        """Take in what was found elsewhere."""
        if other.low is not None:
            self.low = other.low if self.low is None else np.minimum(self.low, other.low)
            self.high = other.high if self.high is None else np.maximum(self.high, other.high)
        self.periods.update(other.periods)
        self.contacts.update(other.contacts)
        self.points.update(other.points)


class Film:
    """Reads, paints and encodes pieces of one film; the same on every rank."""

    def __init__(self, request: Request, folder: Path):
        self.request = request
        self.folder = folder
        self.frames = Frames(request.file)
        job = self.frames.job
        self.variables = (*VARIABLES, *(("contact",) if "contact" in self.frames else ()))
        wanted = job.directions if request.direction == "both" else (request.direction,)
        self.rows = [job.directions.index(name) for name in wanted]
        self.directions = wanted
        self.order = [int(k) for k in np.argsort(job.omega, kind="stable")[:: request.every]]
        self.painter: Painter | None = None

    def read(self, frame: int) -> dict[str, np.ndarray]:
        """Read one frame, runs that are not complete without points."""
        found = {k: v[self.rows] for k, v in self.frames.read(frame, self.variables).items()}
        n_floors = self.frames.job.structure.n_floors
        found["poincare"] = found["poincare"][..., :n_floors]
        found["poincare"][found["outcome"] != Outcome.COMPLETE] = np.nan
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
            contacts = frame["contact"][done] if "contact" in frame else ()
            total.add(
                Found(
                    points.min(axis=0),
                    points.max(axis=0),
                    Counter(frame["orbit_period"][done].tolist()),
                    Counter(int(c) for c in contacts),
                    {k: len(points)},
                )
            )
        return total

    def paint(self, scene: Scene, frame: int) -> np.ndarray:
        """Paint one frame; shape (height, width, 4)."""
        if self.painter is None:
            self.painter = Painter(scene)
        return self.painter.paint(float(self.frames.job.omega[frame]), self.read(frame))

    def encode(self, scene: Scene, frames: list[int], number: int) -> None:
        """Paint some frames and encode them as segment `number`."""
        pictures = (self.paint(scene, frame) for frame in frames)
        video.encode(pictures, self.segment(number), self.request.fps, is_gif(self.request))

    def segment(self, number: int) -> Path:
        """Name a segment."""
        return self.folder / f"{number:06d}.mp4"


def is_gif(request: Request) -> bool:
    """Tell whether a GIF is wanted."""
    return request.output.suffix.lower() == ".gif"


def check(request: Request) -> None:
    """Refuse what cannot be made, before any work.

    Raises
    ------
    PlotError
        One line for the user.
    StoreError
        If the file is not a campaign file, or holds no stroboscopic points.
    """
    if request.output.suffix.lower() not in video.ENDINGS:
        raise PlotError(f"--output {request.output}: must end in {' or '.join(video.ENDINGS)}")
    for path in (request.output, request.poster):
        if path is not None and not path.parent.is_dir():
            raise PlotError(f"{path}: folder {path.parent} does not exist")
        if path is not None and path.is_dir():
            raise PlotError(f"{path}: is a folder")
    if request.poster is not None and request.poster.suffix.lower() != ".png":
        raise PlotError(f"--poster {request.poster}: must end in .png")
    if is_gif(request) and request.fps > video.MOST_GIF_RATE:
        raise PlotError(f"--fps {request.fps:g}: a GIF plays at most {video.MOST_GIF_RATE:g}")
    if request.width and (request.width % 2 or not LEAST_WIDTH <= request.width <= MOST_WIDTH):
        raise PlotError(
            f"--width {request.width}: must be even, from {LEAST_WIDTH} to {MOST_WIDTH}"
        )
    frames = Frames(request.file)
    try:
        needed = ("poincare", *(("contact",) if request.color == "contact" else ()))
        for name in needed:
            if name not in frames:
                raise PlotError(
                    f"{request.file}: holds no {name}: set output.{name} = true in the job"
                )
        directions = frames.job.directions
        if request.direction not in ("both", *directions):
            raise PlotError(
                f"--direction {request.direction}: {request.file} holds {', '.join(directions)}"
            )
    finally:
        frames.close()
    video.find_ffmpeg()


def make(
    request: Request,
    comm,
    processes: int = 1,
    advance: Callable[[int], None] = lambda frames: None,
) -> int | None:
    """Make a film (collective).

    Parameters
    ----------
    request : Request
        Checked.
    comm : hpcsweep.mpi.Serial or hpcsweep.mpi.Ranks
    processes : int
        Processes that share the work where there is one rank.
    advance : callable
        Told on rank 0 of frames that have been surveyed or painted.

    Returns
    -------
    int or None
        Number of frames in the film; None if it was stopped by a signal.

    Raises
    ------
    PlotError
        On every rank, if no run is complete.
    """
    folder = None
    if comm.rank == 0:
        name = f".{request.output.name}."
        folder = Path(tempfile.mkdtemp(prefix=name, dir=request.output.parent))
    folder = comm.bcast(folder)
    try:
        film = Film(request, folder)
        found = Found()

        def collect(_count, other) -> None:
            found.add(other)

        workers = _Workers(comm, processes, film, advance)
        with workers:
            if not workers.run("survey", _pieces(film.order), None, collect):
                return None
            scene = comm.bcast(_scene(film, found) if comm.rank == 0 and found.points else None)
            if scene is None:
                raise PlotError(f"{request.file}: no run is complete yet")
            drawn = comm.bcast([k for k in film.order if k in found.points])
            pieces = _pieces(drawn)
            if not workers.run("encode", pieces, scene, lambda *_: None):
                return None
        if comm.rank == 0:
            _finish(film, scene, found, len(pieces))
        return len(drawn)
    finally:
        comm.barrier()
        if comm.rank == 0:
            shutil.rmtree(folder, ignore_errors=True)


def _pieces(frames: list[int]) -> list[list[int]]:
    return [frames[k : k + PIECE] for k in range(0, len(frames), PIECE)]


def _scene(film: Film, found: Found) -> Scene:
    """Choose what all frames have in common."""
    request, job = film.request, film.frames.job
    structure = job.structure
    ratios = structure.damping_ratios
    if np.all(ratios == ratios[0]):
        damping = rf"$\zeta$ = {ratios[0]:.4g}"
    else:
        damping = r"$\zeta_i$ = " + ", ".join(f"{value:.4g}" for value in ratios[:4])
        damping += ", ..." if ratios.size > 4 else ""
    title = (
        rf"$n$ = {structure.n_floors},  $\beta$ = {structure.stiffness_ratio:g},  "
        rf"$\rho$ = {structure.sharpness:g},  {damping}"
    )
    omegas = job.omega[sorted(found.points)]
    low, high = float(omegas.min()), float(omegas.max())
    marks = tuple(
        (float(w), rf"$\omega_{{{i}}}$")
        for i, w in enumerate(structure.frequencies, 1)
        if low < w < high
    )
    return Scene(
        title=title,
        amplitude=job.amplitude,
        omega=(low, high),
        marks=marks,
        low=found.low,
        high=found.high,
        directions=tuple(film.directions),
        color=request.color,
        periods=tuple(sorted(found.periods)),
        contacts=tuple(sorted(found.contacts, key=lambda c: (-found.contacts[c], c))),
        width=request.width or (GIF_WIDTH if is_gif(request) else WIDTH),
    )


def _finish(film: Film, scene: Scene, found: Found, n_pieces: int) -> None:
    """Join the segments, write the poster, move both to their places."""
    request = film.request
    richest = max(found.points, key=lambda k: (found.points[k], -k))
    picture = film.paint(scene, richest)
    palette = None
    if is_gif(request):
        wanted = [DIRECTION_COLOUR[name] for name in scene.directions]
        wanted += [period_class(p)[0] for p in scene.periods]
        bands = [contact_colour(scene.contacts, c) for c in scene.contacts]
        wanted += [*bands, *(tint(colour) for colour in bands)]
        palette = video.palette_of([picture], [rgb(colour) for colour in wanted])
    whole = film.folder / f"film{request.output.suffix.lower()}"
    video.join([film.segment(k) for k in range(n_pieces)], whole, palette)
    if request.poster is not None:
        from PIL import Image

        poster = film.folder / "poster.png"
        Image.fromarray(np.ascontiguousarray(picture[..., :3])).save(poster)
        poster.replace(request.poster)
    whole.replace(request.output)


class _Workers:
    """Shares pieces out over ranks, or over processes where there is one rank."""

    def __init__(self, comm, processes: int, film: Film, advance: Callable[[int], None]):
        self._comm, self._film, self._advance = comm, film, advance
        self._pool = None
        if comm.size == 1 and processes > 1:
            self._pool = ProcessPoolExecutor(
                processes,
                multiprocessing.get_context("spawn"),
                _start,
                (film.request, film.folder),
            )

    def __enter__(self) -> "_Workers":
        return self

    def __exit__(self, *_exception) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def run(self, task: str, pieces: list[list[int]], scene: Scene | None, collect) -> bool:
        """Do a task for all pieces; tell whether it was done to the end."""

        def on_report(_rank, value) -> None:
            count, result = value
            collect(count, result)
            self._advance(count)

        if self._pool is not None:
            jobs = [self._pool.submit(_do, task, scene, p, k) for k, p in enumerate(pieces)]
            for job in jobs:
                on_report(0, job.result())
            return True

        def compute(number, poll, report) -> None:
            poll()
            report(_run(self._film, task, scene, pieces[number], number))

        with farm.StopFlag() as flag:
            return farm.run(self._comm, range(len(pieces)), compute, flag, on_report)


def _run(film: Film, task: str, scene: Scene | None, frames: list[int], number: int):
    if task == "survey":
        return len(frames), film.survey(frames)
    film.encode(scene, frames, number)
    return len(frames), None


_film: Film | None = None
"""The film of a worker process."""


def _start(request: Request, folder: Path) -> None:
    global _film
    _film = Film(request, folder)


def _do(task: str, scene: Scene | None, frames: list[int], number: int):
    return _run(_film, task, scene, frames, number)
