"""One run: over time, forces over displacements, stroboscopic points, amplitudes over frequency.

The motion goes on from the last point that is stored of the run. The spectrum of an orbit is that
of one turn round it, a line for each multiple of its frequency; of others, times Hann's window.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.diagrams import mesh, phase
from hpcsweep.figures.diagrams.sweep import mark_stops, open_frame
from hpcsweep.figures.options import COORDINATES, RUN, Option, figure_of, whole_number
from hpcsweep.model.coordinates import coordinate_of

POINTS = Option(
    "--points",
    "stroboscopic points of a section, forcing periods of a history or a spectrum (default: those "
    "of an orbit; where nothing repeats 2000, 10, 500)",
    dest="count",
    type=whole_number(1, 10**6),
    metavar="N",
)
PARTS, FINE = 128, 400
"""Of a forcing period, of a spectrum and of what is drawn over time."""
HIGHEST = 16
"""Multiple of the forcing frequency to which spectra are drawn."""
SIZES = (4.8, 3.6), (3.0, 2.6), (0.4, 0.4)
"""Inches of a figure of one panel, of each of several, and of what is beside these."""
OPTIONS = *RUN, *COORDINATES, POINTS


class Shown(NamedTuple):
    """A run: its structure, amplitude and frequency, its period, 0 if there is none, its state."""

    structure: Any
    amplitude: float
    omega: float
    period: int
    state: np.ndarray
    title: str

    def course(self, n_periods: int, parts: int):
        """Return the motion at all parts of so many forcing periods."""
        from hpcsweep.solvers.trajectory import PeriodMap  # imports the compiler

        return PeriodMap(*self[:3], self.state, parts).follow(n_periods)


def load(
    frames,
    omega: float | None = None,
    amplitudes: Sequence[float] = (),
    along: Sequence[float] = (),
    direction: str | None = None,
    **_options,
) -> Shown:
    """Read the run that is asked for."""
    frame = open_frame(phase.load(frames, omega, amplitudes), "poincare")
    of_amplitude = frame.study.run_dims[-1] == "amplitude"
    values, flag = (amplitudes, "amplitude") if of_amplitude else (along, "along")
    if len(values) != 1:
        raise style.PlotError(f"this figure is of one run: --{flag}, one value, is needed")
    motion = phase.run_at(frame, values[0], direction, flag)
    run = frame.runs.isel(direction=motion.direction, **{frame.study.run_dims[-1]: motion.along})
    title = f"{frame.caption}\n{phase.words_of_run(frame, motion)}"
    structure = frame.study.structure_at(motion.along)
    state = run["poincare"].values[int(run["n_points"]) - 1]
    forcing = float(run["amplitude"]), float(run["omega"])
    return Shown(structure, *forcing, int(run["orbit_period"]), state, title)


@figure_of("time", "motions", load, *OPTIONS)
def time(run: Shown, floors=(), count: int | None = None, **_options):
    """Displacements and forces of one run over time, at --amplitude A or --along X."""
    structure, shown = run.structure, coordinates(run.structure, floors)
    course = run.course(count or run.period or 10, FINE)
    loops, over = _loops(structure, course), np.arange(len(course.states)) / FINE
    figure, axes = style.new_figure(len(shown) + bool(loops), 1.2 + 1.7 * (len(shown) + 1))
    for axis, coordinate in zip(axes, shown, strict=False):
        axis.plot(over, coordinate.of(course.states), color=palette.series_colour(0), lw=0.9)
        axis.set_ylabel(labels.displacement(structure, coordinate.symbol), fontsize=9)
        mark_stops(axis, [structure], coordinate)
    for series, (name, (_, force)) in enumerate(loops.items()):
        axes[-1].plot(over, force, color=palette.series_colour(series), lw=0.9, label=name)
    if loops:
        axes[-1].set_ylabel("force" + labels.unit(structure, "force"), fontsize=9)
        axes[-1].legend(fontsize=7, frameon=False, ncols=4)
    axes[-1].set(xlabel=r"time in forcing periods  $\tau / T$", xlim=(0, over[-1]))
    return style.head(figure, run.title, fontsize=9)


def _loops(structure, course) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return displacement and force of each slider, and of each contact that is not rigid."""
    n, (states, forces) = structure.n_floors, course
    pushes = structure.contact_forces(states[:, : 2 * n])
    names = [structure.contact_names[k] for k in structure.contact_numbers]
    held = {f"slider {name}": forces[:, j] for j, name in enumerate(structure.slider_names)}
    held |= {
        f"contact {name}": pushes[:, k]
        for k, name in enumerate(names)
        if not structure.is_rigid[k] and pushes[:, k].any()
    }
    rows = {name: coordinate_of(structure, name.replace(" ", ":", 1)) for name in held}
    return {name: (rows[name].of(states), force) for name, force in held.items()}


@figure_of("loop", "motions", load, *RUN, POINTS)
def loop(run: Shown, count: int | None = None, **_options):
    """Force over displacement of each slider and contact of one run, --amplitude A or --along X."""
    loops = _loops(run.structure, run.course(count or run.period or 10, FINE))
    if not loops:
        raise style.PlotError("--kind loop: no slider, and no contact that pushes and is not rigid")
    units = labels.unit(run.structure, "length"), labels.unit(run.structure, "force")
    figure, axes = mesh.panels(len(loops), *SIZES, sharex=False, sharey=False)
    for axis, (name, values) in zip(axes, loops.items(), strict=True):
        axis.plot(*values, color=palette.series_colour(0), lw=0.9)
        style.draw_lattice(axis)
        axis.locator_params(axis="x", nbins=5)
        axis.set(xlabel=f"displacement of {name}{units[0]}", ylabel=f"force{units[1]}")
    return style.head(figure, run.title, fontsize=9)


@figure_of("section", "motions", load, *OPTIONS)
def section(run: Shown, floors=(), count: int | None = None, **_options):
    """Stroboscopic section of one run, --points N followed on, at --amplitude A or --along X."""
    from hpcsweep.solvers.solver import stroboscopic_points  # loads what computes

    points = stroboscopic_points(*run[:3], run.state, count or run.period or 2000)
    shown = coordinates(run.structure, floors)
    figure, axes = mesh.panels(len(shown), *SIZES, sharex=False, sharey=False)
    for axis, coordinate in zip(axes, shown, strict=True):
        at = coordinate.of(points), coordinate.of(points, True)
        size = 12.0 if run.period else max(0.3, 4.0 - np.log10(len(points)))
        axis.scatter(*at, s=size, color=palette.DARK_INK, linewidths=0, rasterized=True)
        axis.locator_params(axis="x", nbins=5)
        axis.set_xlabel(labels.displacement(run.structure, coordinate.symbol, "(jT)"))
        axis.set_ylabel(labels.velocity(run.structure, coordinate.symbol, "(jT)"))
        for stop in np.concatenate(coordinate.stops(run.structure)).tolist():
            axis.axvline(stop, color=palette.STOP, lw=0.8, ls=(0, (5, 3)))
    return style.head(figure, run.title, f"{len(points)} points" * (len(points) > 1), fontsize=9)


@figure_of("spectrum", "motions", load, *OPTIONS)
def spectrum(run: Shown, floors=(), count: int | None = None, **_options):
    """Amplitudes of one run over the frequency, at --amplitude A or --along X."""
    n_periods = run.period or count or 500
    states = run.course(n_periods, PARTS).states[:-1]
    window = np.ones(len(states)) if run.period else 2.0 * np.hanning(len(states))
    shown = coordinates(run.structure, floors)
    figure, axes = style.new_figure(len(shown), 1.2 + 2.0 * len(shown))
    most = HIGHEST * n_periods + 1
    for axis, coordinate in zip(axes, shown, strict=True):
        values = coordinate.of(states)
        sizes = 2.0 / len(values) * np.abs(np.fft.rfft(window * (values - values.mean())))[:most]
        at, least = np.arange(len(sizes)) / n_periods, 1e-7 * sizes.max()
        if run.period:
            axis.vlines(at, least, np.maximum(sizes, least), color=palette.DARK_INK, lw=1.0)
        else:
            axis.plot(at, np.maximum(sizes, least), color=palette.DARK_INK, lw=0.6)
        axis.set(yscale="log", ylim=(least, None), xlim=(0, HIGHEST))
        axis.set_ylabel("amplitude of " + labels.displacement(run.structure, coordinate.symbol))
    axes[-1].set_xlabel(r"frequency  [$\Omega$]")
    over = f"one turn of {n_periods} T" if run.period else f"{n_periods} periods, Hann's window"
    return style.head(figure, run.title, over, fontsize=9)
