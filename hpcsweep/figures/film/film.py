"""A film of orbit diagrams over the forcing frequency, drawn by many ranks or processes.

Two passes over the frames, both distributed: the first finds the ranges of the axes and the classes
that occur, the second draws each frame as a picture, of which ffmpeg makes the film. Its bytes do
not depend on the number of ranks or processes.
"""

import multiprocessing
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, closing
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.figures.film.frames import Common, Film, FrameSurvey, Request, common_of
from hpcsweep.figures.film.picture import Picture
from hpcsweep.figures.palette import rgb
from hpcsweep.figures.style import PlotError
from hpcsweep.parallel import farm
from hpcsweep.parallel.mpi import on_master
from hpcsweep.parallel.stopping import StopFlag

ENDINGS = (".mp4", ".gif")
PICTURES = "%06d.png"
"""Names of the pictures, from 0."""
QUALITY = "20"
"""Constant rate factor of x264: thin lines and points stay clean."""
THREADS = "4"
"""Always as many, so that the bytes of a film do not depend on the machine's cores."""
MAX_GIF_RATE = 50.0
"""Frames per second above which browsers slow a GIF down."""
GIF_COLOURS, GIF_WANTED = 255, 128
"""Colours of a GIF, and those of points and bands among them, which it shows exactly."""

_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"
)
"""The colours that players assume of films of this height."""
_MP4 = ("-vf", _TO_YUV, "-c:v", "libx264", "-preset", "veryfast", "-crf", QUALITY)
_GIF = "[0:v][1:v]paletteuse=dither=none:diff_mode=rectangle"
MIN_WIDTH, MAX_WIDTH = 320, 3840
"""Of a frame (pixels)."""
PIECE = 8
"""Frames that a rank or process takes at once."""


@lru_cache(maxsize=1)
def _film(request: Request) -> Film:
    return Film(request)


@lru_cache(maxsize=1)
def _picture(request: Request, common: Common) -> Picture:
    return Picture(_film(request), common)


def check(request: Request) -> None:
    """Check a request before any work.

    Raises
    ------
    PlotError
        One line for the user.
    StoreError
        If the file is not a campaign file, or holds no stroboscopic points.
    """
    if request.output.suffix.lower() not in ENDINGS:
        raise PlotError(f"--output {request.output}: must end in {' or '.join(ENDINGS)}")
    for path in (request.output, request.poster):
        if path is not None and not path.parent.is_dir():
            raise PlotError(f"{path}: folder {path.parent} does not exist")
        if path is not None and path.is_dir():
            raise PlotError(f"{path}: is a folder")
    if request.poster is not None and request.poster.suffix.lower() != ".png":
        raise PlotError(f"--poster {request.poster}: must end in .png")
    if request.is_gif and request.fps > MAX_GIF_RATE:
        raise PlotError(f"--fps {request.fps:g}: a GIF plays at most {MAX_GIF_RATE:g}")
    if request.width and (request.width % 2 or not MIN_WIDTH <= request.width <= MAX_WIDTH):
        raise PlotError(f"--width {request.width}: must be even, from {MIN_WIDTH} to {MAX_WIDTH}")
    Film(request).frames.close()
    find_ffmpeg()


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
        surveyed and once drawn.

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
    with ExitStack() as stack:
        # a rank that fails waits for no other: the caller ends them all
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        pool = None
        if comm.size == 1 and processes > 1:
            context = multiprocessing.get_context("spawn")
            pool = stack.enter_context(ProcessPoolExecutor(processes, context))
        order = _film(request).order
        shown = None
        if progress and comm.rank == 0:
            shown = stack.enter_context(closing(progress(2 * len(order), 0)))
        share = partial(_share, comm, pool, shown)
        surveys = share(partial(_survey, request), order)
        if surveys is None:
            return None
        surveyed = comm.bcast({each.frame: each for each in surveys if each})
        drawn = [k for k in order if k in surveyed]
        if not drawn:
            raise PlotError(f"{request.file}: no run is complete yet")
        common = common_of([surveyed[k] for k in drawn])
        if share(partial(_draw, request, common, folder), [*enumerate(drawn)]) is None:
            return None
        richest = max(drawn, key=lambda k: (surveyed[k].kinds, surveyed[k].points, -k))
        finish = partial(_finish, request, common, folder, drawn.index(richest))
        with StopFlag():  # a film whose frames are drawn is finished
            _on_first(request, comm, finish)
    return len(drawn)


def _share(comm, pool, shown, task: Callable[[Any], Any], frames: list) -> list | None:
    """Call a function for each frame, on all ranks or by the pool.

    Returns
    -------
    list or None
        Results on rank 0, in any order; None on all ranks if a signal came.
    """
    results: list = []

    def on_report(_rank: int, values: list) -> None:
        results.extend(values)
        if shown:
            shown.advance(len(values))

    if pool is not None:
        for value in pool.map(task, frames, chunksize=PIECE):
            on_report(0, [value])
        return results

    def compute(number: int, poll, report) -> None:
        values = []
        for frame in frames[number : number + PIECE]:
            poll()
            values.append(task(frame))
        report(values)

    with StopFlag() as flag:
        firsts = range(0, len(frames), PIECE)
        return results if farm.run(comm, firsts, compute, flag, on_report) else None


def _survey(request: Request, frame: int) -> FrameSurvey | None:
    return _film(request).survey(frame)


def _draw(request: Request, common: Common, folder: Path, placed: tuple[int, int]) -> None:
    """Draw a frame as the picture of its place in the film."""
    from PIL import Image

    place, frame = placed
    pixels = _picture(request, common).paint(frame)
    Image.fromarray(pixels).save(folder / (PICTURES % place), compress_level=1)


def _on_first(request: Request, comm, do: Callable[[], Any]) -> Any:
    """Return on every rank what rank 0 has done; refuse a film that it cannot write."""
    try:
        return on_master(comm, do, OSError)
    except OSError as error:
        problem = f"{request.output}: cannot be written: {error.strerror or error}"
        raise PlotError(problem) from None


def _finish(request: Request, common: Common, folder: Path, richest: int) -> None:
    """Make the film, move it and the poster to their places."""
    poster, whole = folder / (PICTURES % richest), folder / f"film{request.output.suffix}"
    keys: list[tuple[str, str]] = []
    if request.is_gif:
        picture = _picture(request, common)
        keys = [*picture.keys.values(), *picture.sets.values()]
    encode(folder, whole, request.fps, poster, [colour for colour, _ in keys])
    if request.poster is not None:
        poster.replace(request.poster)
    whole.replace(request.output)


def find_ffmpeg() -> str:
    """Return the path of ffmpeg.

    Raises
    ------
    PlotError
        If imageio-ffmpeg is not installed, or has no ffmpeg for this machine.
    """
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise PlotError(
            "no ffmpeg: install the extra 'video' (pip install 'hpcsweep[video]', that is "
            "imageio-ffmpeg)"
        ) from None


def encode(folder: Path, film: Path, fps: float, richest: Path, wanted: Iterable[str]) -> None:
    """Make a film of pictures, which plays before it is completely loaded.

    Parameters
    ----------
    folder : Path
        Of `PICTURES`, of even height and width.
    film : Path
        Its ending selects MP4 or GIF.
    fps : float
        Pictures per second.
    richest : Path
        The picture from which a GIF has the commonest colours, beside the `wanted` ones.

    Raises
    ------
    RuntimeError
        If ffmpeg fails; with its message.
    """
    how: tuple[str, ...] = (*_MP4, "-threads", THREADS, "-movflags", "+faststart", "-f", "mp4")
    if film.suffix.lower() == ".gif":
        from PIL import Image

        colours = np.full((256, 4), 255, np.uint8)
        palette = palette_of(np.asarray(Image.open(richest)), wanted)
        colours[: len(palette), :3] = palette
        table = folder / "palette.png"
        Image.fromarray(colours.reshape(16, 16, 4), "RGBA").save(table)
        how = ("-i", str(table), "-filter_complex", _GIF, "-f", "gif", "-loop", "0")
    call = (find_ffmpeg(), "-nostdin", "-hide_banner", "-loglevel", "error", "-y")
    pictures = ("-framerate", f"{fps:g}", "-i", str(folder / PICTURES))
    done = subprocess.run([*call, *pictures, *how, str(film)], capture_output=True, check=False)
    if done.returncode != 0:
        text = " ".join(done.stderr.decode(errors="replace").split())
        raise RuntimeError(f"ffmpeg ended with code {done.returncode}: {text[-500:]}")


def palette_of(picture: np.ndarray, wanted: Iterable[str]) -> np.ndarray:
    """Return the colours of a GIF: the first wanted ones, then the commonest of a picture.

    Returns
    -------
    ndarray of uint8, shape (k, 3)
    """
    colours = dict.fromkeys(rgb(colour) for colour in wanted)
    values, counts = np.unique(picture[..., :3].reshape(-1, 3), axis=0, return_counts=True)
    common = values[np.argsort(-counts, kind="stable")].tolist()
    chosen = dict.fromkeys([*[*colours][:GIF_WANTED], *map(tuple, common)])
    return np.array([*chosen][:GIF_COLOURS], np.uint8)
