"""Interface of a figure of `hpcsweep plot`: a module with a name, options, `load` and `draw`.

A new figure is one module of this form and one line in `hpcsweep.figures.options.FIGURES`. It takes
its colours from `hpcsweep.figures.palette`, so that a motion, a contact set or a direction looks
the same as everywhere, and its labels from `hpcsweep.figures.style`.
"""

import contextlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from hpcsweep.figures import labels, style
from hpcsweep.figures.attractors import attractor_classes
from hpcsweep.figures.options import Option
from hpcsweep.figures.overlay import Overlay, lay, overlay_keys
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

if TYPE_CHECKING:
    from hpcsweep.store import Frames


THIN = 0.5
"""Thickness of branches beneath points, in those of a film."""


class Figure(Protocol):
    """A module that draws one kind of figure; its docstring is the command's help.

    Attributes
    ----------
    NAME : str
        Name for ``--kind``.
    DRAWS : str or tuple of str
        What a file must hold (`Study.content`), or one of several.
    OPTIONS : tuple of Option
        Options of the figure.
    """

    NAME: str
    DRAWS: str | tuple[str, ...]
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
    """One frame of sweeps or attractors, as `open_frame` finds it.

    Attributes
    ----------
    results, runs : xarray.Dataset
        With the dimension of the frames, and without.
    classes : ndarray of int, shape (n_directions, n_along)
        `MotionClass` of its runs, or of each attractor, a further axis.
    done : ndarray of bool, shape (n_directions, n_along)
        Complete ones.
    study : RunGrid
    structure : Structure
    omega : float
        NaN where it is not the same in all runs.
    along : ndarray, shape (n_along,)
        Values of the parameter along which the path leads.
    caption : str
    """

    results: Any
    runs: Any
    classes: np.ndarray
    done: np.ndarray
    study: RunGrid
    structure: Structure
    omega: float
    along: np.ndarray
    caption: str


def open_frame(
    results,
    omega: float | None,
    *needed: str,
    amplitudes: Sequence[float] = (),
) -> Frame:
    """Choose the frame nearest to a frequency, along that to an amplitude, default the first.

    Raises
    ------
    PlotError
        If it lacks a needed variable, its points have no amplitudes in common, or no run of it is
        complete.
    """
    style.need(results, *needed)
    study = style.study_of(results, RunGrid)
    style.need_amplitudes(study)
    frame, along = study.run_dims[-2:]
    if len(amplitudes) and frame != "amplitude":
        hint = "--kind orbit and measures draw all those of a frame, --kind phase single ones"
        raise style.PlotError(f"--amplitude {amplitudes[0]:g}: no sweep along omega: {hint}")
    asked = _asked(study, omega, amplitudes)
    results = results.isel({frame: [style.nearest_frame(results[frame].values, asked, frame)]})
    runs = results.isel({frame: 0})
    done = runs["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise style.PlotError(f"no {study.run_noun} of this frame is complete yet")
    several = "attractor_id" in results
    classes = attractor_classes(runs) if several else style.classes_of(results)[:, 0]
    omega, path = labels.common(runs["omega"].values), runs[along].values
    caption = style.caption(results, omega, labels.path_words(study, runs))
    omega = math.nan if omega is None else omega
    return Frame(results, runs, classes, done, study, study.structure, omega, path, caption)


def lay_branches(axes: Mapping[int, Any], frame: Frame, path: Path | None) -> list[Any]:
    """Draw the branches of a file beneath the panels of floors, if there is one; return keys."""
    if path is None:
        return []
    with contextlib.closing(Overlay(path, frame.study)) as overlay:
        is_shown = frame.study.frames == frame.results[frame.study.run_dims[-2]].values
        overlay.need(np.flatnonzero(is_shown).tolist())
        branches = overlay.at(int(np.argmax(is_shown)))
    for floor, axis in axes.items():
        lay(axis, branches, floor, THIN)
    return overlay_keys()


def load_frame(
    frames: "Frames", omega: float | None = None, amplitudes: Sequence[float] = (), **_options
):
    """Read the frame nearest to a frequency, along that to an amplitude, default the first."""
    study = as_kind(frames.study, RunGrid)
    name, asked = study.run_dims[-2], _asked(study, omega, amplitudes)
    if asked is not None:
        style.check_omega(study.frames, asked, name)
    return frames.gather([*frames], [style.nearest_frame(study.frames, asked, name)])


def _asked(study: RunGrid, omega: float | None, amplitudes: Sequence[float] = ()) -> float | None:
    """Return the frequency, or the amplitude along it, of the frame that is asked for.

    Raises
    ------
    PlotError
        If the frames have no frequencies.
    """
    name = study.run_dims[-2]
    if omega is not None and name != "omega":
        raise style.PlotError(f"--omega {omega:g}: the sweep is along {study.run_dims[-1]}")
    return amplitudes[0] if name == "amplitude" and len(amplitudes) else omega
