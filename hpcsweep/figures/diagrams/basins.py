"""Basins of attraction of a slice."""

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, Shakedown, shakedown_name
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.inferred import draw_cells, filled, gather, note_of
from hpcsweep.figures.options import CELLS, figure_of
from hpcsweep.model.coordinates import coordinate_of, floor_coordinate
from hpcsweep.studies.basins.slice import SliceGrid
from hpcsweep.studies.refine.audit import SOURCE

OTHERS = [
    (ELSEWHERE, "other attractors", palette.OTHER_MOTION),
    (UNDECIDED, *palette.MOTIONS[palette.motion_place(MotionClass.UNDECIDED, 0)]),
    (FAILED, *palette.MOTIONS[palette.motion_place(MotionClass.FAILED, 0)]),
]
"""Labels of starts that go to none of the attractors listed, with names and colours."""
MAX_COLUMNS = 3
"""Columns of the legend."""
SIZE = 6.4, 6.9
"""Inches."""


def load(frames, cells: bool | None = None):
    """Read the labels and the attractors, of a refined map also what is inferred."""
    of_attractors = ("attractor_id", "motion", "orbit_period", "contact", "shakedown", "point")
    return gather(frames, ("label", "outcome", *of_attractors), cells)


@figure_of("basins", "basins", load, CELLS)
def basins(results, cells: bool | None = None):
    """Basins of attraction on a slice of the initial states: the attractor that each start goes to.

    Raises
    ------
    PlotError
        If nothing is computed yet.
    """
    study = style.study_of(results, SliceGrid)
    reached = filled(results, "label")[0].reshape(study.vertical.size, study.horizontal.size)
    if not reached.any():
        raise style.PlotError("no row of this slice is computed yet")
    if SOURCE in results and not results[SOURCE].values.any():
        raise style.PlotError("the attractors of a refined map are known when it is complete")
    listed = attractors_of(results, int(np.argmax(reached.any(axis=1))))
    keys = [(number, name, colour) for number, (name, colour, _) in listed.items()]
    keys += OTHERS
    index = np.full(reached.shape, -1)
    for place, (number, _, _) in enumerate(keys):
        index[reached == number] = place
    figure, axes = style.new_grid(1, 1, SIZE)
    axis = axes[0, 0]
    first, second = (_label(study.structure, component) for component in study.components)
    grid = mesh.Grid(study.horizontal, study.vertical, (first, second))
    grid.fill(axis, index, [colour for _, _, colour in keys])
    if cells:
        draw_cells(axis, results, study.vertical, study.horizontal)
    for component, draw in zip(study.components, (axis.axvline, axis.axhline), strict=True):
        if isinstance(component, str) and component[0] == "u":
            stops = coordinate_of(study.structure, component[2:]).stops(study.structure)
            for stop in np.concatenate(stops).tolist():
                draw(stop, color="white", linewidth=1.0, linestyle=(0, (5, 3)))
    for _, colour, point in listed.values():
        _mark(axis, study, point, colour)
    _legend(figure, study, keys, index)
    amplitude = f"$A$ = {study.amplitude[0]:.6g}{labels.named(study.structure, 'acceleration')}"
    notes = f"{style.caption(results, float(study.omega[0]))},  {amplitude}", note_of(results)
    return style.head(figure, *notes)


def _legend(figure, study: SliceGrid, keys: list, index: np.ndarray) -> None:
    """Put the attractors with their shares of the starts, and a title, below the panel."""
    total = int((index >= 0).sum())
    attractors = [name for number, name, _ in keys if number > 0]
    handles = mesh.share_keys(index, [key[1:] for key in keys], "not computed", attractors, total)
    handles.append(labels.dot("a point of each (triangle: outside)", "0.1", face="none"))
    labels.legend_below(figure, handles, f"{total:,} starts; {_rest(study)}", MAX_COLUMNS)


def attractors_of(results, row: int) -> dict[int, tuple[str, str, np.ndarray]]:
    """Return number, name, colour and a point of each attractor of a slice.

    The first of a motion has the motion's colour, further ones have shades of it.
    """
    at_row = results.isel({"direction": 0, "row": row, "amplitude": 0}, missing_dims="ignore")
    labels = style.job_of(results).structure.contact_labels
    listed: dict[int, tuple[str, str, np.ndarray]] = {}
    seen: dict[int, int] = {}
    slots = np.flatnonzero(at_row["attractor_id"].values).tolist()
    sets = [int(at_row["contact"].values[slot]) if "contact" in at_row else 0 for slot in slots]
    for slot, contact, words in zip(slots, sets, style.set_names(sets, labels), strict=True):
        kind = MotionClass(int(at_row["motion"].values[slot]))
        period = int(at_row["orbit_period"].values[slot])
        name = f"P{period}" if period else CLASS_NAMES[kind]
        place = palette.motion_place(kind, period)
        slides = int(at_row["shakedown"].values[slot]) if "shakedown" in at_row else 0
        if "contact" in at_row:
            name += f" {words}"
            place = place if contact or slides > Shakedown.ELASTIC else 0
        name += shakedown_name(slides)
        colour = palette.shade(palette.MOTION_COLOURS[place], seen.get(place, 0))
        seen[place] = seen.get(place, 0) + 1
        listed[slot + 1] = (name, colour, at_row["point"].values[slot])
    return listed


def _mark(axis, study: SliceGrid, point: np.ndarray, colour: str) -> None:
    """Mark a point of an attractor; beyond the slice's rectangle by a triangle at its edge."""
    x, y = (study.across @ point).tolist()
    left, right = study.horizontal[[0, -1]]
    low, high = study.vertical[[0, -1]]
    marker = "o"
    if not (left <= x <= right and low <= y <= high):
        off = {"<": (left - x) / (right - left), ">": (x - right) / (right - left)}
        off |= {"v": (low - y) / (high - low), "^": (y - high) / (high - low)}
        marker = max(off, key=off.__getitem__)
    at = np.clip(x, left, right), np.clip(y, low, high)
    axis.plot(*at, marker, ms=7, mfc=colour, mec="white", mew=1.6, zorder=3, clip_on=False)
    axis.plot(*at, marker, ms=8.4, mfc="none", mec="0.1", mew=0.7, zorder=4, clip_on=False)


def _label(structure, component: int | str) -> str:
    n = structure.n_floors
    at = "(0)"
    if isinstance(component, str):
        label = labels.displacement if component[0] == "u" else labels.velocity
        return label(structure, coordinate_of(structure, component[2:]).symbol, at)
    if component >= 2 * n:
        name = structure.slider_names[component - 2 * n]
        return rf"$p_\mathrm{{{name}}}${at}" + labels.unit(structure, "length")
    label = labels.displacement if component < n else labels.velocity
    return label(structure, floor_coordinate(structure, component % n).symbol, at)


def _rest(study: SliceGrid) -> str:
    """Format the components that all starts share."""
    names = study.coordinates["state"].values
    state = study.initial_state
    others = [k for k in range(state.size) if k not in study.components]
    slipped = "; sliders slipped from there as far as they must" if study.structure.sliders else ""
    if len(others) > state.size - 2:
        return f"each start the nearest to the initial state{slipped}"
    if not np.any(state[others]):
        return f"all other components of the state 0 at the start{slipped}"
    return ", ".join(f"{names[k]} = {state[k]:.4g}" for k in others) + slipped
