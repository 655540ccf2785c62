"""Encode pictures as MP4 and GIF, with the ffmpeg that comes with the wheel imageio-ffmpeg.

A film is encoded in segments, which can be made in parallel, and joined without re-encoding (MP4),
or from lossless segments with one palette (GIF). One thread encodes a segment, so that its bytes do
not depend on the machine's cores.
"""

import contextlib
import subprocess
import tempfile
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from hpcsweep.figures.cielab import rgb
from hpcsweep.figures.style import PlotError

ENDINGS = (".mp4", ".gif")
QUALITY = "20"
"""Constant rate factor of x264: thin lines and points stay clean."""
MAX_GIF_RATE = 50.0
"""Frames per second above which browsers slow a GIF down."""
GIF_COLOURS, GIF_WANTED = 255, 128
"""Colours of a GIF, and those of points and bands among them, which it shows exactly."""

_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"
)
"""The colours that players assume of films of this height."""
_MP4 = (*("-vf", _TO_YUV, "-c:v", "libx264", "-preset", "veryfast", "-crf", QUALITY),)
_LOSSLESS = ("-c:v", "libx264rgb", "-preset", "ultrafast", "-qp", "0")


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


def encode(pictures: Iterable[np.ndarray], path: Path, fps: float, lossless: bool) -> None:
    """Encode pictures as one segment.

    Parameters
    ----------
    pictures : iterable of ndarray of uint8, shape (height, width, 4)
        Red, green, blue, unused; even height and width.
    path : Path
        Ends in .mp4.
    fps : float
        Pictures per second.
    lossless : bool
        Keep every pixel's colour (for a GIF).

    Raises
    ------
    RuntimeError
        If ffmpeg fails; with its message.
    """
    pictures = iter(pictures)
    first = next(pictures)
    height, width = first.shape[:2]
    given = ("-f", "rawvideo", "-pix_fmt", "rgb0", "-s", f"{width}x{height}", "-r", f"{fps:g}")
    how = _LOSSLESS if lossless else _MP4
    command = [*_call(), *given, "-i", "-", "-threads", "1", *how, str(path)]
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said)
        with contextlib.suppress(BrokenPipeError), cast(BinaryIO, process.stdin) as pipe:
            for picture in chain((first,), pictures):
                pipe.write(picture.data)
        _check(process.wait(), said)


def join(segments: list[Path], path: Path, palette: np.ndarray | None = None) -> None:
    """Join segments, in order, to one film that plays before it is completely loaded.

    Parameters
    ----------
    segments : list of Path
        In one folder, where a list of them is written.
    path : Path
        Its ending selects MP4 or GIF.
    palette : ndarray of uint8, shape (k, 3)
        Colours of the GIF, at most `GIF_COLOURS`.
    """
    listed = segments[0].with_name("segments.txt")
    listed.write_text("".join(f"file '{segment.name}'\n" for segment in segments))
    given = ["-f", "concat", "-i", str(listed)]
    if path.suffix.lower() == ".gif":
        from PIL import Image

        assert palette is not None, "a GIF needs its colours"
        colours = np.zeros((256, 4), np.uint8)
        colours[: len(palette), :3] = palette
        colours[: len(palette), 3] = 255
        table = segments[0].with_name("palette.png")
        Image.fromarray(colours.reshape(16, 16, 4), "RGBA").save(table)
        use = "[0:v][1:v]paletteuse=dither=none:diff_mode=rectangle"
        how = ["-i", str(table), "-filter_complex", use, "-f", "gif", "-loop", "0"]
    else:
        how = ["-c", "copy", "-movflags", "+faststart", "-f", "mp4"]
    with tempfile.TemporaryFile() as said:
        done = subprocess.run([*_call(), *given, *how, str(path)], stderr=said, check=False)
        _check(done.returncode, said)


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


def _call() -> list[str]:
    return [find_ffmpeg(), "-nostdin", "-hide_banner", "-loglevel", "error", "-y"]


def _check(code: int, said) -> None:
    if code != 0:
        said.seek(0)
        text = " ".join(said.read().decode(errors="replace").split())
        raise RuntimeError(f"ffmpeg ended with code {code}: {text[-500:]}")
