"""What a figure of `hpcsweep plot` is: a module that says its name, options, data and drawing.

A new figure is one module of this form and one line in `hpcsweep.figures.options.FIGURES`. It takes
its colours from `hpcsweep.figures.palette`, so that a motion, a contact set or a direction looks
the same as everywhere, and its labels from `hpcsweep.figures.style`.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from hpcsweep.figures.options import PICTURE, Option

if TYPE_CHECKING:
    from hpcsweep.store import Frames


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
    WRITES : tuple of str
        Endings of what it writes; without it a picture (`PICTURE`), which is made by `load` and
        `draw`. The film and the explorer have commands of their own.
    """

    NAME: str
    DRAWS: str
    HELP: str
    OPTIONS: tuple[Option, ...]
    WRITES: tuple[str, ...] = PICTURE

    def load(self, frames: "Frames", **options):
        """Read what is drawn, of a file that may be larger than the memory.

        Parameters
        ----------
        frames : hpcsweep.store.Frames
            Of a results file; where keys are varied, of one part of it.
        **options
            Those of `OPTIONS` that were given.

        Returns
        -------
        xarray.Dataset
            Or what else `draw` takes.

        Raises
        ------
        StoreError
            If the file does not hold what is needed.
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


def load_frame(frames: "Frames", omega: float | None = None, **_options):
    """Read the frame nearest to a frequency, default the first."""
    from hpcsweep.figures.style import nearest_frame

    return frames.gather([*frames], [nearest_frame(frames.study.omega, omega)])
