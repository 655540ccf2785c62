"""A film of orbit diagrams over the forcing frequency, made by many ranks or processes.

Two passes over the frames, both distributed in pieces of `PIECE` frames: the first finds the ranges
of the axes and the classes that occur, the second paints the pieces and encodes each as a segment.
The film's bytes do not depend on the number of ranks or processes.
"""

import contextlib
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.figures.cielab import rgb
from hpcsweep.figures.film import video
from hpcsweep.figures.film.piece import Film, Found, Request, is_gif
from hpcsweep.figures.film.scene import WIDTH, Scene
from hpcsweep.figures.film.workers import Workers
from hpcsweep.figures.labels import amplitude, choose_floors, unit
from hpcsweep.figures.measures import LABELS, measure_of
from hpcsweep.figures.overlay import Overlay
from hpcsweep.figures.style import PlotError, need_amplitudes, parameters
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

PIECE = 40
"""Frames of one segment."""
GIF_WIDTH = 960
GIF_WANTED = 128
"""Colours of points and bands that a GIF shows exactly, half of those it can have."""
LEAST_WIDTH, MOST_WIDTH = 320, 3840


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
    if is_gif(request) and request.fps > video.MOST_GIF_RATE:
        raise PlotError(f"--fps {request.fps:g}: a GIF plays at most {video.MOST_GIF_RATE:g}")
    if request.width and (request.width % 2 or not LEAST_WIDTH <= request.width <= MOST_WIDTH):
        raise PlotError(
            f"--width {request.width}: must be even, from {LEAST_WIDTH} to {MOST_WIDTH}"
        )
    frames = Frames(request.file, at=request.at)
    try:
        if request.show and request.show not in LABELS:
            raise PlotError(f"--show {request.show}: must be one of {', '.join(LABELS)}")
        needed = (request.show or "poincare", *(("contact",) if request.color == "contact" else ()))
        for name in needed:
            if name not in frames:
                raise PlotError(
                    f"{request.file}: holds no {name}: set output.{name} = true in the job"
                )
        need_amplitudes(frames.job.study)
        n = frames.job.structure.n_floors
        if request.show:
            n = len(measure_of(frames.dataset(0), frames.job.structure, request.show).places)
        choose_floors(n, request.floors)
        if request.branches:
            _check_branches(request, frames)
        directions = frames.job.study.directions
        if request.direction not in ("both", *directions):
            raise PlotError(
                f"--direction {request.direction}: {request.file} holds {', '.join(directions)}"
            )
    finally:
        frames.close()
    video.find_ffmpeg()


def _check_branches(request: Request, frames: Frames) -> None:
    if request.show:
        raise PlotError(f"--branches {request.branches}: does not go with --show")
    overlay = Overlay(Path(str(request.branches)), frames.job.structure)
    try:
        overlay.need(np.sort(as_kind(frames.study, RunGrid).omega)[:: request.every])
    finally:
        overlay.close()


def make(
    request: Request,
    comm,
    processes: int = 1,
    progress: Callable[[int, int], Any] | None = None,
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
    folder, problem = None, None
    if comm.rank == 0:
        try:
            name = f".{request.output.name}."
            folder = Path(tempfile.mkdtemp(prefix=name, dir=request.output.parent))
        except OSError as error:
            problem = f"{request.output}: cannot be written: {error.strerror or error}"
    folder, problem = comm.bcast((folder, problem))
    if problem is not None:
        raise PlotError(problem)
    try:
        n_frames = _make(request, comm, processes, progress, folder)
    except BaseException:
        # no other rank is waited for: the caller ends them all
        shutil.rmtree(folder, ignore_errors=True)
        raise
    comm.barrier()
    if comm.rank == 0:
        shutil.rmtree(folder, ignore_errors=True)
    return n_frames


def _make(request: Request, comm, processes: int, progress, folder: Path) -> int | None:
    """Make a film from segments in `folder`."""
    film = Film(request, folder)
    found = Found()
    shown = None
    if progress is not None and comm.rank == 0:
        shown = progress(2 * len(film.order), 0)
    advance = shown.advance if shown else lambda frames: None
    with contextlib.closing(shown) if shown else contextlib.nullcontext():
        return _paint(film, found, comm, processes, advance)


def _paint(film: Film, found: Found, comm, processes: int, advance) -> int | None:
    """Survey all frames, then paint and join them."""
    request = film.request
    with Workers(comm, processes, film, advance) as workers:
        if not workers.run("survey", _pieces(film.order), None, found.add):
            return None
        scene = comm.bcast(_scene(film, found) if comm.rank == 0 and found.richness else None)
        if scene is None:
            raise PlotError(f"{request.file}: no run is complete yet")
        drawn = comm.bcast([k for k in film.order if k in found.richness])
        pieces = _pieces(drawn)
        if not workers.run("encode", pieces, scene, lambda _: None):
            return None
    problem = None
    if comm.rank == 0:
        try:
            _finish(film, scene, found, len(pieces))
        except OSError as error:
            problem = f"{request.output}: cannot be written: {error.strerror or error}"
    problem = comm.bcast(problem)
    if problem is not None:
        raise PlotError(problem)
    return len(drawn)


def _pieces(frames: list[int]) -> list[list[int]]:
    return [frames[k : k + PIECE] for k in range(0, len(frames), PIECE)]


def _scene(film: Film, found: Found) -> Scene:
    """Return the scene, common to all frames."""
    request, job = film.request, film.frames.job
    assert found.low is not None, "no run is complete"
    assert found.high is not None, "no run is complete"
    study = as_kind(job.study, RunGrid)
    omegas = study.omega[sorted(found.richness)]
    low, high = float(omegas.min()), float(omegas.max())
    marks = tuple(
        (float(w), rf"$\omega_{{{i}}}$")
        for i, w in enumerate(job.structure.frequencies, 1)
        if low < w < high
    )
    title, length = parameters(job.structure, room=None), unit(job.structure, "length")
    if film.measure:
        title, length = f"{film.measure.label};  {title}", film.measure.unit
    return Scene(
        title=title,
        amplitude=study.amplitude,
        omega=(low, high),
        marks=marks,
        low=found.low,
        high=found.high,
        directions=tuple(film.directions),
        words=tuple(study.words[name] for name in film.directions),
        color=request.color,
        motions=tuple(sorted(found.motions)),
        contacts=tuple(sorted(found.contacts, key=lambda c: (-found.contacts[c], c))),
        width=request.width or (GIF_WIDTH if is_gif(request) else WIDTH),
        floors=tuple(film.floors),
        labels=job.structure.contact_labels,
        axes=(amplitude(job.structure), length),
        branches=film.overlay is not None,
        places=tuple(film.measure.places[k] for k in film.floors) if film.measure else (),
    )


def _finish(film: Film, scene: Scene, found: Found, n_pieces: int) -> None:
    """Join the segments, write the poster, move both to their places."""
    request = film.request
    richest = max(found.richness, key=lambda k: (found.richness[k], -k))
    picture = film.paint(scene, richest)
    palette = None
    if is_gif(request):
        wanted = dict.fromkeys(c for c, _ in (*scene.point_legend(), *scene.contact_legend()))
        palette = video.palette_of([picture], [rgb(c) for c in [*wanted][:GIF_WANTED]])
    whole = film.folder / f"film{request.output.suffix.lower()}"
    video.join([film.segment(k) for k in range(n_pieces)], whole, palette)
    if request.poster is not None:
        from PIL import Image

        poster = film.folder / "poster.png"
        Image.fromarray(np.ascontiguousarray(picture[..., :3])).save(poster)
        poster.replace(request.poster)
    whole.replace(request.output)
