"""What a figure of `hpcsweep plot` is: a module that says its name, options, data and drawing.

A new figure is one module of this form and one line in `hpcsweep.commands.plot.FIGURES`. It takes
its colours from `hpcsweep.figures.palette`, so that a motion, a contact set or a direction looks
the same as everywhere, and its labels from `hpcsweep.figures.style`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol


@dataclass(frozen=True, eq=False)
class Option:
    """An option of the command line.

    Attributes
    ----------
    flag : str
        Such as ``--omega``. Figures that know an option of the same flag share the object.
    help : str
        What it chooses, and its default; the figures that know it are named by the command.
    keyword : str
        Name under which `Figure.draw` takes the value.
    arguments : dict
        Further arguments of `argparse.ArgumentParser.add_argument`.
    """

    flag: str
    help: str
    keyword: str
    arguments: Mapping[str, Any] = field(default_factory=dict)


class Figure(Protocol):
    """A module that draws one kind of figure.

    Attributes
    ----------
    NAME : str
        Of ``--kind``.
    DRAWS : str
        What a file must hold (`Study.holds`).
    HELP : str
        What it shows: one or more lines of the command's help.
    OPTIONS : tuple of Option
        What can be chosen.
    """

    NAME: str
    DRAWS: str
    HELP: str
    OPTIONS: tuple[Option, ...]

    def load(self, path: Path, **options):
        """Read what is drawn, of a file that may be larger than the memory.

        Parameters
        ----------
        path : Path
            Of a results file.
        **options
            Those of `OPTIONS` that were given.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        StoreError
            If it is not a campaign file.
        PlotError
            If what was requested cannot be drawn; one line for the user.
        """

    def draw(self, results, path: Path, **options) -> None:
        """Draw what `load` returned, or all results, and write the picture to `path`.

        Raises
        ------
        PlotError
            If what was requested cannot be drawn; then nothing is written.
        """


OMEGA = Option(
    "--omega",
    "frequency; the nearest frame is drawn (default: the first)",
    "omega",
    {"type": float},
)
FLOORS = Option(
    "--floor",
    "floor shown, may be given several times (default: all of up to 5, of more the first, the "
    "middle and the top)",
    "floors",
    {"type": int, "action": "append", "metavar": "I"},
)
DIRECTION = Option(
    "--direction",
    "sweep drawn (default: the first)",
    "direction",
    {"choices": ("up", "down")},
)


def load_frame(path: Path, omega: float | None = None, **_options):
    """Read the frame nearest to a frequency, default the first."""
    from hpcsweep.figures.style import nearest_frame
    from hpcsweep.store import Frames

    frames = Frames(path)
    try:
        return frames.gather([*frames], [nearest_frame(frames.job.study.omega, omega)])
    finally:
        frames.close()
