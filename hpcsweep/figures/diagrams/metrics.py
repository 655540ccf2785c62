"""Drifts, modal norms and measures of a sweep, and what impact changes of them."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, tells_chaos
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.diagrams.sweep import Frame, load_frame, open_frame
from hpcsweep.figures.options import AMPLITUDES, DIRECTION, OMEGA, figure_of
from hpcsweep.model.reduction import physical
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.grid import DOWN
from hpcsweep.studies.quantities import MEASURES

DASHES = ((0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1, 2)), (0, (1, 1)), (0, (8, 2, 1, 2, 1, 2)))
MAX_LINES = 10
"""Storeys, floors or contacts that are drawn, the first."""
LEVELS = (0.8, 1.0, 1.25)
"""Ratios of drift with impact to drift without at which the shade changes."""
SHADES = (
    ("other motion", palette.OTHER_MOTION),
    ("no contact", palette.NO_CONTACT),
    (r"beneficial, $r \leq$ 0.8", palette.RATIOS[0]),
    (r"beneficial, 0.8 < $r \leq$ 1", palette.RATIOS[1]),
    (r"adverse, 1 < $r \leq$ 1.25", palette.RATIOS[2]),
    (r"adverse, $r$ > 1.25", palette.RATIOS[3]),
)
"""(name, colour)."""


@figure_of("metrics", "motions", load_frame, OMEGA, AMPLITUDES)
def metrics(results, **_options):
    """Drift and mean modal norms along the path of one frame, with those without a stop.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    frame = open_frame(results, "drift", "modal_norm")
    runs, span = frame.runs, frame.along
    figure, axes = style.new_figure(2, 6.6)
    _drift(axes[0], frame, _along_path(frame, free_drift))
    _norms(axes[1], frame, _along_path(frame, free_modal_norms))
    axes[1].set_xlabel(labels.along(frame.study))
    axes[1].set_xlim(span[0], span[-1] if span.size > 1 else span[0] + 1e-9)
    style.letter(axes)
    axes[0].legend(fontsize=8, markerscale=1.5)
    handles = axes[1].get_legend_handles_labels()[0]
    # a column for each direction and one without stop: legends are filled column by column
    n_columns = runs.sizes["direction"] + 1
    handles = [handle for k in range(n_columns) for handle in handles[k::n_columns]]
    style.foot(figure, handles, frame.results, frame.classes, n_columns)
    return style.head(figure, frame.caption)


def _along_path(frame: Frame, of: Callable) -> np.ndarray:
    """Return what a structure has at a frequency without its stops, at each place of a path."""
    omegas = np.broadcast_to(frame.runs["omega"].values, frame.along.shape).tolist()
    kept = lru_cache(of)
    return np.array([kept(frame.study.structure_at(at), omega) for at, omega in enumerate(omegas)])


def free_modal_norms(structure, omega: float) -> np.ndarray:
    """Return the mean modal norms (17) of the steady state without stop, shape (n,).

    They do not depend on the amplitude; NaN at an undamped resonance.
    """
    # imports scipy.linalg, which no other figure needs
    from hpcsweep.solvers.linear import LinearOrbit

    orbit = LinearOrbit(structure.without_contacts(), omega)
    try:
        structure.steady_harmonics(omega)
    except ZeroDivisionError:
        return np.full(structure.n_floors, np.nan)
    small = 1e-3 * structure.length_unit * structure.frequency_unit**2
    seen = orbit.window(small)
    return np.full(structure.n_floors, np.nan) if seen is None else seen.modal_norm


def _without(frame: Frame) -> str:
    return "elastic, " * (not LINEAR.of(frame.structure)) + "without stop"


def _drift(axis, frame: Frame, free: np.ndarray) -> None:
    chaotic = dict(palette.MOTIONS)[CLASS_NAMES[MotionClass.CHAOTIC]]
    names, drifts = frame.runs["direction"].values.tolist(), frame.runs["drift"].values
    for direction, drift, row in zip(names, drifts, frame.classes, strict=True):
        chaos, marker = row == MotionClass.CHAOTIC, style.MARKERS[direction]
        for chosen, colour, label in (
            (~chaos, palette.DIRECTIONS[direction], direction),
            (chaos, chaotic, f"{direction}, chaotic"),
        ):
            if chosen.any():
                _plot(axis, frame.along[chosen], drift[chosen], marker, colour, direction, label)
    looks = {"color": "black", "linewidth": 1.1, "linestyle": DASHES[0]}
    axis.plot(frame.along, free, label=_without(frame), **looks)
    axis.set_ylabel(labels.RUN_LABELS["drift"])


def _plot(axis, x, y, marker: str, colour: str, direction: str, label: str) -> None:
    """Draw points, hollow on the way down."""
    face = "none" if direction == DOWN else colour
    looks = {"color": colour, "markerfacecolor": face, "markersize": 2.4, "markeredgewidth": 0.5}
    axis.plot(x, y, marker, label=label, **looks)


def _norms(axis, frame: Frame, free: np.ndarray) -> None:
    runs, names = frame.runs, frame.runs["direction"].values.tolist()
    shown = min(runs.sizes["mode"], labels.MAX_MODES)
    for mode in range(shown):
        colour, marker = palette.mode_colour(mode, shown), "os^D<>pX*h"[mode % 10]
        for direction, norm in zip(names, runs["modal_norm"].values, strict=True):
            label = f"mode {mode + 1}, {direction}"
            _plot(axis, frame.along, norm[:, mode], marker, colour, direction, label)
        looks = {"color": colour, "linewidth": 1.1, "linestyle": DASHES[mode % len(DASHES)]}
        label = f"mode {mode + 1}, {_without(frame)}"
        axis.plot(frame.along, free[:, mode], label=label, **looks)
    axis.set_ylabel(labels.RUN_LABELS["modal_norm"])
    if shown < runs.sizes["mode"]:
        title = f"the lowest {shown} of {runs.sizes['mode']} modes"
        axis.set_title(title, loc="right", fontsize=9)


@figure_of("measures", "motions", load_frame, OMEGA, AMPLITUDES, DIRECTION)
def measures(results, direction: str | None = None, **_options):
    """Peak drift of each storey, displacement and acceleration of each floor over the amplitude.

    Also force and impacts of each contact; one frame.

    Raises
    ------
    PlotError
        If the file holds none of them.
    """
    shown = labels.held_measures(results)
    if not shown:
        asked = ", ".join(f"output.{name}" for name in MEASURES)
        limit = f"set one of {asked} to true, or output.rows, in the job"
        raise style.PlotError(f"the file holds none of them: {limit}")
    swept = [style.direction_index(results["direction"].values, direction)]
    frame = open_frame(results.isel(direction=swept))
    structure, runs, done = frame.structure, frame.runs.isel(direction=0), frame.done[0]
    over_amplitude = frame.study.run_dims[-2:] == ("omega", "amplitude")
    graze = style.grazing_amplitude(structure, frame.omega) if over_amplitude else np.inf
    grazes = frame.along[0] <= graze <= frame.along[-1]
    figure, axes = style.new_figure(len(shown), 1.2 + 2.3 * len(shown))
    for axis, name in zip(axes, shown, strict=True):
        measure = labels.measure_of(results, structure, name)
        for place in physical(results[measure.dim].values.tolist())[:MAX_LINES]:
            values = runs[name].isel({measure.dim: place}).where(done) * measure.factor[place]
            looks = {"markersize": 3, "linewidth": 0.8, "color": palette.series_colour(place)}
            axis.plot(frame.along, values, ".-", label=measure.places[place], **looks)
        axis.set_ylabel(measure.label + measure.unit)
        if not any((line.get_ydata() < 0.0).any() for line in axis.lines):
            axis.set_ylim(bottom=0)
        axis.legend(fontsize=7, frameon=False, ncols=2)
        if grazes:
            axis.axvline(graze, color=palette.STOP, linewidth=0.8, linestyle="--")
    axes[-1].set_xlabel(labels.along(frame.study) + ",  dashed: grazing" * bool(grazes))
    return style.head(figure, f"{frame.caption},  {style.words_of(frame.results)}", fontsize=9)


@figure_of("benefit", "motions", mesh.open_map, DIRECTION)
def benefit(results, **_options):
    """Where impact lowers and raises the drift, for chaos and for period 1.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    style.demand(LINEAR, style.structure_of(results), "--kind benefit", "map")
    style.need(results, "drift", "contact")
    if not tells_chaos(results):
        style.need(results, "lyapunov")
    results = mesh.by_frequency(results)
    classes = style.classes_of(results)
    ratio = drift_ratio(results)[0]
    period = results["orbit_period"].values[0]
    panels = (
        ("(a) chaotic impacting", classes[0] == MotionClass.CHAOTIC),
        ("(b) P1 impacting", (classes[0] == MotionClass.PERIODIC) & (period == 1)),
    )
    size = 3.6, min(4.3, mesh.map_height(results, 6.4))
    figure, axes = mesh.panels(len(panels), size, size)
    for axis, (name, chosen) in zip(axes, panels, strict=True):
        _benefit_panel(axis, results, classes[0], chosen, ratio, name)
    mesh.finish(axes, results)
    handles = [labels.area(name, colour) for name, colour in (*SHADES[2:], *SHADES[:2])]
    style.foot(figure, handles + mesh.map_keys(results), results, classes, 4)
    title = f"{style.caption(results)},  {style.words_of(results)}"
    meaning = r"$r$ = drift with the stop / drift without it"
    return style.head(figure, title, meaning, fontsize=9)


def free_drift(structure, omega: float) -> float:
    """Return the normalised drift (18) of the steady state without stop, in A/Omega^2.

    Closed form, `Structure.steady_drift`; NaN at an undamped resonance.
    """
    try:
        return float(omega**2 * structure.steady_drift(omega))
    except ZeroDivisionError:
        return np.nan


def drift_ratio(results) -> np.ndarray:
    """Return the drift over the drift without stop at the same A and Omega, shape of the runs."""
    structure = style.structure_of(results)
    free = np.array([free_drift(structure, float(omega)) for omega in results["omega"].values])
    return results["drift"].values / free[None, :, None]


def _benefit_panel(axis, results, classes, chosen, ratio, name) -> None:
    index = np.zeros(classes.shape, int)
    index[classes == MotionClass.NO_CONTACT] = 1
    rated = chosen & np.isfinite(ratio)
    index[rated] = 2 + np.searchsorted(LEVELS, ratio[rated], side="left")
    index[np.isin(classes, (MotionClass.NOT_COMPUTED, MotionClass.FAILED))] = -1
    mesh.grid_of(results).fill(axis, index, [colour for _, colour in SHADES])
    count = int(rated.sum())
    note = "no such run"
    if count:
        share = style.percent(float((ratio[rated] <= 1).mean()))
        note = f"beneficial: {share} of {count} runs"
    axis.set_title(f"{name}\n{note}", fontsize=9)
