"""A film of orbit diagrams over the forcing frequency, drawn by many ranks.

Two passes over the frames, both distributed: the first finds the ranges of the axes and the classes
that occur, the second draws each frame as a picture, of which ffmpeg makes the film. Its bytes do
not depend on the number of ranks.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

from hpcsweep.figures.film.frames import Film, Request, joined
from hpcsweep.figures.film.picture import Picture
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
_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"
)
"""The colours that players assume of films of this height."""
_MP4 = ("-vf", _TO_YUV, "-c:v", "libx264", "-preset", "veryfast", "-crf", QUALITY)
_GIF = ("-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=none:diff_mode=rectangle")
MIN_WIDTH, MAX_WIDTH = 320, 3840
"""Of a frame (pixels)."""
PIECE = 8
"""Frames that a rank takes at once."""


def load() -> None:
    """Import what films are drawn with: a rank that lacks it stops before it meets the others."""
    import matplotlib  # noqa: F401


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
    if request.is_gif and request.fps > MAX_GIF_RATE:
        raise PlotError(f"--fps {request.fps:g}: a GIF plays at most {MAX_GIF_RATE:g}")
    if request.width and (request.width % 2 or not MIN_WIDTH <= request.width <= MAX_WIDTH):
        raise PlotError(f"--width {request.width}: must be even, from {MIN_WIDTH} to {MAX_WIDTH}")
    film = Film(request)
    film.read(film.order[0])
    film.frames.close()
    find_ffmpeg()


def make(request: Request, comm, progress: Callable[[int, int], Any] | None = None) -> int | None:
    """Make a film (collective).

    Parameters
    ----------
    request : Request
        Checked.
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
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
    from PIL import Image

    name = f".{request.output.name}."
    new_folder = partial(tempfile.mkdtemp, prefix=name, dir=request.output.parent)
    folder = Path(_on_first(request, comm, new_folder))
    with ExitStack() as stack:
        # a rank that fails waits for no other: the caller ends them all
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        film, shown = Film(request), None
        stack.callback(film.frames.close)
        if progress and comm.rank == 0:
            shown = stack.enter_context(closing(progress(2 * len(film.order), 0)))
        share = partial(_share, comm, shown)
        surveys = share(film.survey, film.order)
        if surveys is None:
            return None
        surveyed = comm.bcast({each.frames[0]: each for each in surveys if each})
        drawn = [k for k in film.order if k in surveyed]
        if not drawn:
            raise PlotError(f"{request.file}: no run is complete yet")
        picture = Picture(film, joined([surveyed[k] for k in drawn]))

        def draw(placed: tuple[int, int]) -> None:
            """Draw a frame as the picture of its place in the film."""
            place, frame = placed
            pixels = Image.fromarray(picture.paint(frame))
            pixels.save(folder / (PICTURES % place), compress_level=1)

        if share(draw, [*enumerate(drawn)]) is None:
            return None
        with StopFlag():  # a film whose frames are drawn is finished
            _on_first(request, comm, partial(_finish, request, folder))
    return len(drawn)


def _share(comm, shown, task: Callable[[Any], Any], frames: list) -> list | None:
    """Call a function for each frame, on all ranks.

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

    def compute(number: int, poll, report) -> None:
        values = []
        for frame in frames[number : number + PIECE]:
            poll()
            values.append(task(frame))
        report(values)

    with StopFlag() as flag:
        firsts = range(0, len(frames), PIECE)
        return results if farm.run(comm, firsts, compute, flag, on_report) else None


def _on_first(request: Request, comm, do: Callable[[], Any]) -> Any:
    """Return on every rank what rank 0 has done; refuse a film that it cannot write."""
    try:
        return on_master(comm, do, OSError)
    except OSError as error:
        raise PlotError(f"{request.output}: cannot be written: {error.strerror or error}") from None


def _finish(request: Request, folder: Path) -> None:
    """Make the film, and move it to its place."""
    whole = folder / f"film{request.output.suffix}"
    encode(folder, whole, request.fps)
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


def encode(folder: Path, film: Path, fps: float) -> None:
    """Make a film of pictures, which plays before it is completely loaded.

    Parameters
    ----------
    folder : Path
        Of `PICTURES`, of even height and width.
    film : Path
        Its ending selects MP4 or GIF.
    fps : float
        Pictures per second.

    Raises
    ------
    RuntimeError
        If ffmpeg fails; with its message.
    """
    how: tuple[str, ...] = (*_MP4, "-threads", THREADS, "-movflags", "+faststart", "-f", "mp4")
    if film.suffix.lower() == ".gif":
        how = (*_GIF, "-f", "gif", "-loop", "0")
    call = (find_ffmpeg(), "-nostdin", "-hide_banner", "-loglevel", "error", "-y")
    pictures = ("-framerate", f"{fps:g}", "-i", str(folder / PICTURES))
    done = subprocess.run([*call, *pictures, *how, str(film)], capture_output=True, check=False)
    if done.returncode != 0:
        text = " ".join(done.stderr.decode(errors="replace").split())
        raise RuntimeError(f"ffmpeg ended with code {done.returncode}: {text[-500:]}")
