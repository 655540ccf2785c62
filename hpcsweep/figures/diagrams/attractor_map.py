"""Number of attractors over amplitude and frequency.

With --sweep also the number of those that no run of a sweep over the same points ends on.
"""

from pathlib import Path

import numpy as np

from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.diagrams.attractor_diagram import starts_text
from hpcsweep.figures.fitting import LEGEND
from hpcsweep.figures.inferred import filled, gather, inferred, note_of
from hpcsweep.figures.options import CELLS, SWEEP
from hpcsweep.studies.attractors.search import UNSTORED

NAME = "number"
DRAWS = "attractors"
OPTIONS = (SWEEP, CELLS)
MOST = 5
"""Number from which on the colour is the same."""
MISSED = "missed"
"""Variable of the attractors that the sweep misses."""


VARIABLES = ("n_attractors", "attractor_id", "motion", "share", *map("n_{}".format, UNSTORED))
"""Variables of maps of attractors, beside those of motions."""


def load(
    frames, sweep: Path | None = None, cells: bool | None = None, value: str | None = "number"
):
    """Read the attractors for a value of a map, or numbers, and count those that a sweep misses."""
    mesh.need_map(frames.study.run_dims, frames.study.amplitude.size)
    each = () if value == "number" else (*mesh.VARIABLES, *([value] if value else []))
    results = gather(frames, (*VARIABLES, "outcome", *each), cells)
    if sweep is None:
        return results
    from hpcsweep.figures.missed import missed_attractors

    return results.assign({MISSED: (frames.study.run_dims[-2:], missed_attractors(frames, sweep))})


def draw(results, cells: bool | None = None, **_options):
    """Draw what `load` returned.

    Raises
    ------
    PlotError
        If the points do not form a map.
    """
    results = mesh.by_frequency(results)
    done = results["outcome"].values[0] > 0
    counted = done | inferred(results, "n_attractors")[0]
    number = np.where(counted, filled(results, "n_attractors")[0], -1)
    number = np.where(number == 0, -1, number)
    counts = [("number of attractors", number, 1)]
    if MISSED in results:
        missed = results[MISSED].transpose("omega", "amplitude")
        counts.append(("attractors that no sweep ends on", missed.values, 0))
    height = mesh.map_height(results, 5.2)
    figure, axes = mesh.panels(len(counts), (7.2, height), (5.3, height))
    for axis, (name, values, least) in zip(axes, counts, strict=True):
        _panel(axis, results, name, values, least)
    mesh.finish(axes, results, cells)
    return style.head(figure, style.caption(results), starts_text(results), note_of(results))


def _panel(axis, results, name: str, values: np.ndarray, least: int) -> None:
    """Draw one map, with the share of the points by number below it."""
    top = least + MOST - 1
    colours = [
        palette.OTHER_MOTION,
        *(palette.count_colour(place, MOST - 1) for place in range(MOST - 1)),
    ]
    index = np.where(values < 0, -1, np.clip(values, least, top) - least)
    mesh.grid_of(results).fill(axis, index, colours)
    names = [*map(str, range(least, top)), f"{top} or more"]
    entries = [*zip(names, colours, strict=True)]
    handles = mesh.share_keys(index, entries, "none, or not computed")
    handles += mesh.map_keys(results)
    axis.set_title(name, fontsize=9)
    where = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 3}
    axis.legend(handles=handles, **where, **LEGEND)
