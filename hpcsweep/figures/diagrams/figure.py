"""Interface of a figure of `hpcsweep plot`: a module with a name, options, `load` and `draw`.

A new figure is one module of this form and one line in `hpcsweep.figures.options.FIGURES`. It takes
its colours from `hpcsweep.figures.palette`, so that a motion, a contact set or a direction looks
the same as everywhere, and its labels from `hpcsweep.figures.style`.
"""

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from hpcsweep.figures import style
from hpcsweep.figures.options import Option
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

if TYPE_CHECKING:
    from hpcsweep.store import Frames


class Figure(Protocol):
    """A module that draws one kind of figure.

    Attributes
    ----------
    NAME : str
        Name for ``--kind``.
    DRAWS : str or tuple of str
        What a file must hold (`Study.holds`), or one of several.
    HELP : str
        What it shows: one or more lines of the command's help.
    OPTIONS : tuple of Option
        Options of the figure.
    """

    NAME: str
    DRAWS: str | tuple[str, ...]
    HELP: str
    OPTIONS: tuple[Option, ...]

    def load(self, frames: "Frames", **options):
        """Read what to draw from a file that may be larger than the memory.

        Parameters
        ----------
        frames : hpcsweep.store.Frames
            Of a results file; where keys are varied, of one part of it.
        **options
            Given ones of `OPTIONS`.

        Returns
        -------
        xarray.Dataset
            Or anything else that `draw` accepts.

        Raises
        ------
        StoreError
            If the file lacks what is needed.
        style.PlotError
            If what was requested cannot be drawn; one line for the user.
        """

    def draw(self, results, **options):
        """Draw what `load` returned, or all results.

        Returns
        -------
        matplotlib.figure.Figure
            For `hpcsweep.figures.view.save`.

        Raises
        ------
        style.PlotError
            If what was requested cannot be drawn.
        """


class Frame(NamedTuple):
    """One frame of a sweep over amplitudes, as `open_frame` finds it.

    Attributes
    ----------
    results, runs : xarray.Dataset
        With the dimension of the frequency, and without.
    classes : ndarray of int, shape (n_directions, n_amplitudes)
        `MotionClass` of its runs.
    done : ndarray of bool, same shape
        Complete ones.
    structure : Structure
    omega : float
    """

    results: Any
    runs: Any
    classes: np.ndarray
    done: np.ndarray
    structure: Structure
    omega: float


def open_frame(results, omega: float | None, *needed: str) -> Frame:
    """Choose the frame nearest to a frequency, default the first.

    Raises
    ------
    PlotError
        If it lacks a needed variable, its points have no amplitudes in common, or no run of it is
        complete.
    """
    style.need(results, *needed)
    style.need_amplitudes(style.job_of(results).study)
    results = results.isel(omega=[style.nearest_frame(results["omega"].values, omega)])
    runs = results.isel(omega=0)
    done = runs["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise style.PlotError("no run of this frame is complete yet")
    classes = style.classes_of(results)[:, 0]
    return Frame(results, runs, classes, done, style.structure_of(results), float(runs["omega"]))


def load_frame(frames: "Frames", omega: float | None = None, **_options):
    """Read the frame nearest to a frequency, default the first."""
    omegas = as_kind(frames.study, RunGrid).omega
    if omega is not None:
        style.check_omega(omegas, omega)
    return frames.gather([*frames], [style.nearest_frame(omegas, omega)])
