"""Make MP4 of pictures, with the ffmpeg that comes with the wheel imageio-ffmpeg."""

import subprocess
from pathlib import Path

from hpcsweep.figures.style import PlotError

PICTURES = "%06d.png"
"""Names of the pictures, from 0."""
QUALITY = "20"
"""Constant rate factor of x264: thin lines and points stay clean."""
THREADS = "4"
"""Always as many, so that the bytes of a film do not depend on the machine's cores."""

_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709"
)
"""The colours that players assume of films of this height."""
_MP4 = ("-vf", _TO_YUV, "-c:v", "libx264", "-preset", "veryfast", "-crf", QUALITY)


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
    fps : float
        Pictures per second.

    Raises
    ------
    RuntimeError
        If ffmpeg fails; with its message.
    """
    how = (*_MP4, "-threads", THREADS, "-movflags", "+faststart", "-f", "mp4")
    call = (find_ffmpeg(), "-nostdin", "-hide_banner", "-loglevel", "error", "-y")
    given = ("-framerate", f"{fps:g}", "-i", str(folder / PICTURES))
    done = subprocess.run([*call, *given, *how, str(film)], capture_output=True, check=False)
    if done.returncode != 0:
        text = " ".join(done.stderr.decode(errors="replace").split())
        raise RuntimeError(f"ffmpeg ended with code {done.returncode}: {text[-500:]}")
