"""A film as it is requested, and checked before any work."""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.figures import labels, style
from hpcsweep.figures.film import video
from hpcsweep.figures.measures import LABELS, measure_of
from hpcsweep.figures.overlay import Overlay
from hpcsweep.figures.style import PlotError
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

WIDTH = 1280, 960
"""Pixels, of MP4 and of GIF."""
MIN_WIDTH, MAX_WIDTH = 320, 3840


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

    @property
    def is_gif(self) -> bool:
        """Return whether a GIF is requested."""
        return self.output.suffix.lower() == ".gif"


def check(request: Request) -> None:
    """Check a request before any work.

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
    if request.is_gif and request.fps > video.MAX_GIF_RATE:
        raise PlotError(f"--fps {request.fps:g}: a GIF plays at most {video.MAX_GIF_RATE:g}")
    if request.width and (request.width % 2 or not MIN_WIDTH <= request.width <= MAX_WIDTH):
        raise PlotError(f"--width {request.width}: must be even, from {MIN_WIDTH} to {MAX_WIDTH}")
    with contextlib.closing(Frames(request.file, at=request.at)) as frames:
        _check_file(request, frames)
    video.find_ffmpeg()


def _check_file(request: Request, frames: Frames) -> None:
    if request.show and request.show not in LABELS:
        raise PlotError(f"--show {request.show}: must be one of {', '.join(LABELS)}")
    needed = (request.show or "poincare", *(("contact",) if request.color == "contact" else ()))
    for name in needed:
        if name not in frames:
            raise PlotError(f"{request.file}: holds no {name}: set output.{name} = true in the job")
    study, structure = as_kind(frames.study, RunGrid), frames.job.structure
    style.need_amplitudes(study)
    n = structure.n_floors
    if request.show:
        n = len(measure_of(frames.dataset(0), structure, request.show).places)
    labels.choose_floors(n, request.floors)
    if request.branches:
        if request.show:
            raise PlotError(f"--branches {request.branches}: does not go with --show")
        with contextlib.closing(Overlay(request.branches, structure)) as overlay:
            overlay.need(np.sort(study.omega)[:: request.every])
    if request.direction not in ("both", *study.directions):
        there = ", ".join(study.directions)
        raise PlotError(f"--direction {request.direction}: {request.file} holds {there}")
