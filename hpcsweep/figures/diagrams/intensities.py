"""Figures over the intensity of records: responses, shares that reach a threshold, gaps needed."""

import numpy as np

from hpcsweep.earthquakes.separation import Separation, separation
from hpcsweep.earthquakes.stripes import Capacity, fractiles, median_band, response_fractiles
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.options import UNITS, figure_of
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import (
    COLLAPSE,
    capacities,
    falls_alone,
    fit,
    stripes_of,
)

POINTS = 400
BEYOND, FARTHEST = 1.1, 3.0
"""Of the axis over the largest median, or exact capacity, beyond the stripes; over these at most,
unless all is exact."""
FAILURE = responses.THRESHOLD, responses.COLLAPSES, responses.RESPONSE, responses.PLACE, UNITS
RULES = {"sum of peaks": ":", "SRSS": (0, (5, 2)), "double difference": (0, (1, 3))}
"""Their dashes, since two may coincide."""
SHORT = 1.0 - 1e-9
"""Share of the need below which a rule is too small, not by rounding."""
MOVES = 1e-9
"""Of the largest entry of a mode, from which on a floor moves in it."""


@figure_of("ida", "responses", responses.load, responses.RESPONSE, responses.PLACE, UNITS)
def ida(results, response: str = "drift", place: str | None = None, units: str | None = None):
    """Response of each record against the intensity, with the 16, 50 and 84 % fractiles.

    Also the 50 % without contacts (of what has none and yields the elastic motion); flat lines to
    the edge where a structure collapses.
    """
    stripes = responses.opened(results, response, place, units)
    figure, (axis,) = style.new_figure(1, 5.0)
    intensity = np.append(0.0, stripes.intensity)
    shown = [response_fractiles(stripes.values)]
    if responses.touches(stripes):
        shown.append(response_fractiles(stripes.alone, (0.5,)))
    edge, beyond = responses.within(stripes.values, *shown)
    edge = edge or responses.edge_of(stripes.values, *shown)

    def curve(values, *dashes, **looks) -> None:
        x, y = np.append(0.0, values), intensity
        if np.isinf(values).any():
            at = int(np.isinf(x).argmax())
            x = np.insert(x, at, np.array((x[at - 1], edge)))
            y = np.insert(y, at, (0.5 * (y[at - 1] + y[at]),) * 2)
        axis.plot(x, y, *dashes, **looks)

    responses.draw_suite(curve, stripes.values, response_fractiles)
    for (median,) in shown[1:]:
        label = f"50 %, {responses.alone(results)}"
        curve(median, ":", color=palette.STOP, linewidth=2.0, label=label)
    axis.set(xlabel=stripes.label, ylabel=stripes.measure, xlim=(0, edge), ylim=(0, intensity[-1]))
    responses.legend(axis, responses.counted(stripes), handlelength=3.5)
    labels.suit(figure)
    return style.head(figure, responses.title(results), beyond, fontsize=9)


@figure_of("fragility", "responses", responses.load, *FAILURE)
def fragility(
    results,
    threshold: float | None = None,
    response: str = "drift",
    place: str | None = None,
    collapse: bool = False,
    units: str | None = None,
):
    """Share of records whose response reaches a threshold, against the intensity.

    Counted by their capacities, with the lognormal curve of largest likelihood and its 95 % band,
    dashed beyond the stripes; without contacts (of what has none and yields the elastic motion) the
    counted curve, exact at any intensity if elastic, and the intensity that half of them reach.

    Raises
    ------
    PlotError
        If there is no threshold, or none that some stripes reach and others do not.
    """
    if collapse:
        threshold, response = 1.0, COLLAPSE
    if threshold is None:
        raise style.PlotError("--threshold is missing: the response that is a failure")
    stripes = responses.opened(results, response, place, units)
    reached, fitted = capacities(stripes, threshold), fit(stripes, threshold)
    figure, (axis,) = style.new_figure(1, 4.2)
    touches = responses.touches(stripes)
    colour = palette.series_colour(0)
    n_runs = (~np.isnan(stripes.values)).sum(axis=0)
    shares = (stripes.values >= threshold).sum(axis=0) / np.maximum(n_runs, 1)
    at_stripes = {"color": colour, "markersize": 3, "label": "counted at each stripe"}
    axis.plot(stripes.intensity, shares, "o", **at_stripes)
    last, exact = stripes.intensity[-1], stripes.alone is stripes.values
    middles = [fitted.median]
    if touches:
        free = capacities(stripes, threshold, alone=True)
        middles.append(fractiles(free.scale, (0.5,)).item())
    farthest = min(BEYOND * max(middles), FARTHEST * last)
    if exact:
        farthest = BEYOND * reached.scale[np.isfinite(reached.scale)].max()
    edge = max(last, farthest)
    fine = np.linspace(stripes.intensity[0] / 10, edge, POINTS)
    low, high = fitted.band(fine)
    looks = {"color": colour, "alpha": 0.2, "linewidth": 0, "label": "95 % confidence"}
    axis.fill_between(fine, low, high, **looks)
    label = rf"median {fitted.median:.4g}, $\beta$ = {fitted.dispersion:.3f}"
    curve, inside = fitted.probability(fine), (fine <= last) | exact
    axis.plot(fine[inside], curve[inside], color=colour, label=label)
    axis.plot(fine[~inside], curve[~inside], "--", color=colour)
    looks = {"color": colour, "linewidth": 0.6, "label": "counted at it or below"}
    _count(axis, reached, edge if exact else last, **looks)
    if touches:
        name = f"{responses.alone(results)}, counted, 50 % at {middles[-1]:.4g}"
        _count(axis, free, edge if stripes.proportional else last, color=palette.STOP, label=name)
    reach = f"share of records that reach {threshold:g} {stripes.unit}".rstrip()
    if collapse:
        limits = np.unique(style.structure_of(results).drift_limits)
        some = ", ".join(f"{limit:g}" for limit in limits[limits < np.inf])
        unit = labels.named(style.structure_of(results), "length")
        reach = f"share of records that collapse,\ndrift beyond {some}{unit}"
    axis.set(xlabel=stripes.measure, ylabel=reach)
    axis.set(xlim=(0, edge), ylim=(0, 1.02))
    never = int(np.isinf(reached.scale).sum())
    words = responses.counted(stripes) + f", {never} above the last stripe" * bool(never)
    responses.legend(axis, f"{stripes.label}\n{words}")
    return style.head(figure, responses.title(results), fitted.caution or "", fontsize=9)


def _count(axis, capacity: Capacity, highest: float, **looks) -> None:
    """Draw the share of records whose capacity is at most the intensity."""
    scale = capacity.scale[~np.isnan(capacity.scale)]
    at = np.sort(scale[scale <= highest])
    shares = np.arange(at.size + 1) / scale.size
    axis.step([0.0, *at, highest], [*shares, shares[-1]], where="post", **looks)


@figure_of("pounding", "responses", responses.load, responses.RESPONSE)
def pounding(results, response: str = "drift"):
    """Largest response of each building over that without contacts, against the intensity.

    Median, and 16 to 84 %.
    """
    whole = responses.opened(results, response, None)
    if not style.structure_of(results).contacts:
        raise style.PlotError("--kind pounding: the structure has no contacts")
    if whole.alone is None:
        raise style.PlotError(
            f"the file holds no {response} without contacts: output.alone = true adds drift, "
            "displacement and acceleration, of what yields ductility and residual_drift"
        )
    study = style.study_of(results, Records)
    dim = "storey" if response == "drift" else "floor"
    figure, (axis,) = style.new_figure(1, 4.2)
    axis.axhline(1.0, color="0.4", linewidth=0.8)
    ratios = {}
    for building in responses.buildings(results[dim].values):
        stripes = stripes_of(results, study, response, building or None)
        free = np.asarray(stripes.alone)
        free = np.where(free > 0.0, free, np.nan)
        with np.errstate(invalid="ignore"):  # what collapses without contacts, too, is not counted
            ratios[building] = median_band(stripes.values / free)
    edge = responses.edge_of(*ratios.values())
    for series, (building, (low, median, high)) in enumerate(ratios.items()):
        ends = [np.minimum(part, edge or np.inf) for part in (low, high)]
        looks = {"color": palette.series_colour(series)}
        axis.fill_between(whole.intensity, *ends, alpha=0.2, linewidth=0, **looks)
        axis.plot(whole.intensity, median, label=f"building {building}".strip(), **looks)
    axis.set_ylabel(f"{whole.label.partition('  [')[0]}, over that without contact", fontsize=8)
    axis.set(xlabel=whole.measure, xlim=(0, whole.intensity[-1]), ylim=(0, edge))
    beyond = ", beyond the edge where records collapse" * bool(edge)
    responses.legend(axis, f"{len(whole.records)} records, 16 to 84 %{beyond}")
    return style.head(figure, responses.title(results), fontsize=9)


@figure_of("separation", "responses", responses.load, responses.PLACE)
def needed_gap(results, place: str | None = None):
    """Gap at which two floors do not touch, against the intensity, and what code rules ask for.

    Exact from the motion without contacts, with fractiles and the 50 % fractiles of the rules ABS,
    SRSS and DDC; in the legend how often and by how much a rule is too small.

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
        raise style.PlotError("--kind separation: no contact is between two floors")
    if "gap_needed" not in results:
        raise style.PlotError("the file holds no gap_needed: set output.alone = true")
    responses.check_place(place, pairs, "one of")
    gaps = np.where(falls_alone(results)[..., None], np.inf, results["gap_needed"].values)
    needs = np.nanmedian(gaps, axis=(0, 1))
    name = place or max(pairs, key=lambda pair: needs[pairs[pair][0]])
    k, floors = pairs[name]
    need = gaps[..., k]
    peaks = np.abs(structure.directions[k]) * results["displacement_alone"].values
    asked = _rules(structure, floors, np.nan_to_num(peaks))
    if np.prod(structure.directions[k][floors]) > 0.0:  # towards each other where both move alike
        asked = asked._replace(ddc=np.sqrt(2.0 * asked.srss**2 - asked.ddc**2))
    figure, (axis,) = style.new_figure(1, 4.6)
    scale = np.append(0.0, whole.intensity)

    def curve(values, *dashes, **looks) -> None:
        axis.plot(scale, np.append(0.0, values), *dashes, **looks)

    responses.draw_suite(curve, need)
    rules = zip(RULES.items(), asked, strict=True)
    for series, ((rule, dashes), values) in enumerate(rules, start=1):
        values = np.where(np.isfinite(need), values, need)  # what collapses, or is not computed
        known = np.isfinite(need) & (need > 0)
        over = values[known] / need[known]
        label = rule + ", elastic periods" * (series == len(RULES) and not LINEAR.of(structure))
        if over.size:  # alike buildings need no gap
            label += f": {np.median(over):.2f} of the need, too small for "
            label += f"{100 * np.mean(over < SHORT):.0f} % of them"
        (middle,) = fractiles(values, (0.5,))
        looks = {"color": palette.series_colour(series), "linewidth": 1.5, "linestyle": dashes}
        curve(middle, label=label, **looks)
    gap, top = structure.contacts[k].gap, axis.get_ylim()[1]
    if gap <= 2.0 * top:
        axis.axhline(gap, color="0.4", linewidth=0.8, label="gap of the job")
        top = max(top, 1.05 * gap)
    ylabel = f"gap needed, {name}{labels.unit(structure, 'length')}"
    axis.set(xlabel=whole.measure, ylabel=ylabel, xlim=(0, scale[-1]), ylim=(0, top))
    words = f"{responses.counted(whole)}, no contact; rules at 50 %"
    responses.legend(axis, words, handlelength=3.0)
    labels.suit(figure)
    return style.head(figure, responses.title(results), fontsize=9)


def _rules(structure, floors: list[int], peaks: np.ndarray) -> Separation:
    """Return what the rules ask of two floors, whose longest periods are those they move with.

    The peaks of all floors are times what each has in the row of the contact.
    """
    first = []
    for floor in floors:
        moves = np.abs(structure.modes[floor]) > MOVES * np.abs(structure.modes).max(axis=0)
        first.append(int(np.argmax(moves & (structure.frequencies > 0.0))))
    if not structure.frequencies[first].all():
        raise style.PlotError("--kind separation: a floor that moves without spring has no period")
    period, ratio = 2.0 * np.pi / structure.frequencies[first], structure.damping_ratios[first]
    u, other = (peaks[..., floor] for floor in floors)
    return separation(u, other, *period, *ratio)
