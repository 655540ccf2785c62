"""Orbit diagram: stroboscopic displacement of each floor against the forcing amplitude."""

from pathlib import Path

import numpy as np

from hpcsweep.figures.diagrams.regions import coexistence, contact_regions
from hpcsweep.figures.style import (
    AMPLITUDE,
    PALETTE,
    UNDECIDED,
    PlotError,
    caption,
    classes_of,
    contact_name,
    foot,
    nearest_frame,
    need,
    new_figure,
    roman,
    save,
)
from hpcsweep.solvers.outcome import Outcome

DIRECTION_STYLE = {"up": (PALETTE[0], "o"), "down": (PALETTE[1], "v")}
MOST_CLASSES = 10
"""Contact sets or periods that have a colour of their own; rarer ones share grey."""
LEAST_WIDTH, WIDE_LABEL, NARROW_LABEL = 0.035, 0.05, 0.02
"""Parts of the panel's width: least region whose label names its sets; room the labels take."""


def draw(results, path: Path, omega: float | None = None, color: str = "direction") -> None:
    """Draw one frame of a campaign and write it to `path`.

    Parameters
    ----------
    results : xarray.Dataset
        Of `hpcsweep.open_results`.
    path : Path
        Its ending chooses the format.
    omega : float, optional
        The frame nearest to this frequency; default the first.
    color : {"direction", "contact", "period"}
        What the colours tell.

    Raises
    ------
    PlotError
        If the file does not hold what is to be drawn.
    """
    need(results, "poincare", *(("contact",) if color == "contact" else ()))
    results = results.isel(frame=[nearest_frame(results["omega"].values, omega)])
    frame = results.isel(frame=0)
    n = results.sizes["state"] // 2
    done = frame["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise PlotError("no run of this frame is complete yet")
    classes = classes_of(results)
    figure, axes = new_figure(n, 1.2 + 1.75 * n)
    amplitude, points, floors, directions, keys = _scatter(frame, done, n, color)
    size = float(np.clip(14000 / max(amplitude.size, 1), 0.4, 7.0))
    groups = _groups(keys, color, n, frame)
    for floor, axis in zip(range(n)[::-1], axes, strict=True):
        for key, _label, colour in groups:
            for direction, (_, marker) in DIRECTION_STYLE.items():
                chosen = (floors == floor) & (directions == direction) & (keys == key)
                if chosen.any():
                    filled = direction == "up"
                    axis.scatter(
                        amplitude[chosen],
                        points[chosen],
                        s=size if filled else 1.8 * size,
                        marker=marker,
                        facecolors=colour if filled else "none",
                        edgecolors="none" if filled else colour,
                        linewidths=0 if filled else 0.35,
                        rasterized=True,
                        zorder=2 if filled else 3,
                    )
        axis.set_ylabel(rf"$u_{{{floor + 1}}}(jT)$  [gaps]")
        axis.margins(y=0.08)
    axes[-1].set_xlabel(AMPLITUDE)
    span = frame["amplitude"].values
    axes[-1].set_xlim(span[0], span[-1] if span.size > 1 else span[0] + 1e-9)
    if "contact" in frame:
        _mark_regions(axes, frame, done, n, coexistence(frame, classes[:, 0]))
    _legend(figure, groups, color, results, classes)
    figure.suptitle(caption(results, float(frame["omega"])), fontsize=10)
    save(figure, path)


def _scatter(frame, done, n, color):
    """Flatten the points: amplitude, displacement, floor, direction, colour key of each."""
    columns = [[], [], [], [], []]
    classes = {
        "direction": None,
        "contact": frame["contact"].values if color == "contact" else None,
        "period": frame["orbit_period"].values,
    }[color]
    counts = frame["n_points"].values
    poincare = frame["poincare"].values
    for d, direction in enumerate(frame["direction"].values):
        for a in np.flatnonzero(done[d]):
            count = int(counts[d, a])
            key = str(direction) if classes is None else str(int(classes[d, a]))
            for floor in range(n):
                columns[0].append(np.full(count, frame["amplitude"].values[a]))
                columns[1].append(poincare[d, a, :count, floor])
                columns[2].append(np.full(count, floor))
                columns[3].append(np.full(count, str(direction), "U4"))
                columns[4].append(np.full(count, key, "U24"))
    return tuple(np.concatenate(column) for column in columns)


def _groups(keys, color, n, frame) -> list[tuple[str, str, str]]:
    """Give (key, label, colour) of every class of points, commonest first."""
    if color == "direction":
        return [
            (direction, f"sweep {direction}", DIRECTION_STYLE[direction][0])
            for direction in frame["direction"].values
        ]
    names, count = np.unique(keys, return_counts=True)
    if color == "contact":
        order = names[np.argsort(-count, kind="stable")]
        named = [(key, contact_name(int(key), n)) for key in order]
        named = [(key, "no contact" if name == "none" else name) for key, name in named]
    else:
        periodic = sorted(int(key) for key in names if key != "0")
        named = [(str(p), f"P{p}") for p in periodic]
        if "0" in names:
            named.append(("0", "no period found"))
    groups = []
    for place, (key, label) in enumerate(named):
        known = place < MOST_CLASSES and not (color == "period" and key == "0")
        groups.append((key, label, PALETTE[place] if known else UNDECIDED))
    return groups


def _mark_regions(axes, frame, done, n, coexisting) -> None:
    """Mark the contact regions along the top, as in Figure 3 of the paper."""
    amplitude = frame["amplitude"].values
    least = max(3, amplitude.size // 100)
    regions = contact_regions(frame["contact"].values, done, least, coexisting)
    edges = np.concatenate(
        ([amplitude[0]], 0.5 * (amplitude[1:] + amplitude[:-1]), [amplitude[-1]])
    )
    total = edges[-1] - edges[0]
    top = axes[0]
    taken: list[float] = []
    for number, region in enumerate(regions, 1):
        left, right = edges[region.first], edges[region.last + 1]
        if region.first > 0:
            for axis in axes:
                axis.axvline(left, color="0.45", linewidth=0.6, linestyle=(0, (4, 3)), zorder=1)
        sets = "\n".join(contact_name(c, n).replace("none", "–") for c in region.contacts)
        wide = total > 0 and (right - left) / total > LEAST_WIDTH
        label = f"({roman(number)})\n{sets}" if wide else f"({roman(number)})"
        middle = 0.5 * (left + right)
        half = 0.5 * (WIDE_LABEL if wide else NARROW_LABEL) * total
        level = 0
        while level < len(taken) and middle - half < taken[level]:
            level += 1
        taken[level:] = [middle + half]
        top.annotate(
            label,
            (middle, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3 + 30 * level),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7,
            linespacing=1.05,
            rotation=0 if wide else 90,
        )


def _legend(figure, groups, color, results, classes) -> None:
    from matplotlib.lines import Line2D

    handles = []
    for key, label, colour in groups[: MOST_CLASSES + 1]:
        marker = DIRECTION_STYLE[key][1] if color == "direction" else "s"
        hollow = color == "direction" and key == "down"
        handles.append(
            Line2D(
                [],
                [],
                linestyle="none",
                marker=marker,
                label=label,
                markersize=5,
                markerfacecolor="none" if hollow else colour,
                markeredgecolor=colour,
            )
        )
    if color != "direction":
        for direction, (_, marker) in DIRECTION_STYLE.items():
            handles.append(
                Line2D(
                    [],
                    [],
                    linestyle="none",
                    marker=marker,
                    label=f"sweep {direction}",
                    markersize=5,
                    markeredgecolor="0.3",
                    markerfacecolor="0.3" if direction == "up" else "none",
                )
            )
    foot(figure, handles, results, classes, min(len(handles), 6))
