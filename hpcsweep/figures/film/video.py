"""Make MP4 and GIF of pictures, with the ffmpeg that comes with the wheel imageio-ffmpeg."""

import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from hpcsweep.figures.cielab import rgb
from hpcsweep.figures.style import PlotError

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
