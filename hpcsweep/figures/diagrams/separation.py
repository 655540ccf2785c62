"""Gap at which two floors do not touch, against the intensity, and what code rules ask for.

Exact from the motion without contacts, with fractiles and the 50 % fractiles of the rules ABS, SRSS
and DDC; in the legend how often and by how much a rule is too small.
"""

import numpy as np

from hpcsweep.earthquakes.separation import Separation, separation
from hpcsweep.earthquakes.stripes import fractiles
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.ground_motion.records import Records

NAME = "separation"
DRAWS = "responses"
OPTIONS = (responses.PLACE,)
RULES = "sum of peaks", "SRSS", "double difference"
SHORT = 1.0 - 1e-9
"""Share of the need below which a rule is too small, not by rounding."""
MOVES = 1e-9
"""Of the largest entry of a mode, from which on a floor moves in it."""
load = responses.load


def draw(results, place: str | None = None):
    """Draw the need of each record and the 50 % fractiles of the rules.

    Raises
    ------
    PlotError
        If there are no such floors, or no motion without contacts.
    """
    whole = responses.opened(results, "displacement", None)
    structure, pairs = style.study_of(results, Records).structure, {}
    for k, name in enumerate(map(str, results["stop"].values) if "stop" in results else ()):
        floors = np.flatnonzero(structure.directions[k]).tolist()
        if len(floors) == 2:
            pairs[name] = k, floors
    if not pairs:
        raise style.PlotError(f"--kind {NAME}: no contact is between two floors")
    if not LINEAR.of(structure):
        raise style.PlotError(
            f"--kind {NAME}: the gap that is needed is not known {LINEAR.lacks}: vary "
            "pounding.gap, and look where impacts end"
        )
    if "gap_needed" not in results:
        raise style.PlotError("the file holds no gap_needed: set output.alone = true")
    responses.check_place(place, pairs, "one of")
    needs = np.nanmedian(results["gap_needed"].values, axis=(0, 1))
    name = place or max(pairs, key=lambda one: needs[pairs[one][0]])
    k, floors = pairs[name]
    need = results["gap_needed"].values[..., k]
    asked = _rules(structure, floors, results["displacement_alone"].values)
    figure, (axis,) = style.new_figure(1, 4.6)
    scale = np.append(0.0, whole.intensity)

    def curve(values, *dashes, **looks) -> None:
        axis.plot(scale, np.append(0.0, values), *dashes, **looks)

    responses.draw_suite(curve, need)
    for series, (rule, values) in enumerate(zip(RULES, asked, strict=True), start=1):
        over = (values / need)[np.isfinite(need) & (need > 0)]
        label = rule
        if over.size:  # alike buildings need no gap
            label += f": {np.median(over):.2f} of the need, too small for "
            label += f"{100 * np.mean(over < SHORT):.0f} % of them"
        (middle,) = fractiles(values, (0.5,))
        curve(middle, ":", label=label, color=palette.series_colour(series), linewidth=1.5)
    gap, top = structure.contacts[k].gap, axis.get_ylim()[1]
    if gap <= 2.0 * top:
        axis.axhline(gap, color="0.4", linewidth=0.8, label="gap of the job")
        top = max(top, 1.05 * gap)
    ylabel = f"gap needed, {name}{labels.unit(structure, 'length')}"
    axis.set(xlabel=whole.measure, ylabel=ylabel, xlim=(0, scale[-1]), ylim=(0, top))
    words = f"{responses.counted(whole)}, {responses.alone(results)}; rules at 50 %"
    responses.legend(axis, words, handlelength=3.0)
    return style.head(figure, responses.title(results), fontsize=9)


def _rules(structure, floors: list[int], peaks: np.ndarray) -> Separation:
    """Return what the rules ask of two floors, whose longest periods are those they move with."""
    first = []
    for floor in floors:
        moves = np.abs(structure.modes[floor]) > MOVES * np.abs(structure.modes).max(axis=0)
        first.append(int(np.argmax(moves)))
    period, ratio = 2.0 * np.pi / structure.frequencies[first], structure.damping_ratios[first]
    u, other = (peaks[..., floor] for floor in floors)
    return separation(u, other, *period, *ratio)
