"""Response spectra of records and of floors; motions under a record: over time, loops, energies."""

import math
from functools import partial

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, spectrum
from hpcsweep.earthquakes.stripes import PARTS, fractiles
from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.diagrams import mesh, responses
from hpcsweep.figures.options import figure_of
from hpcsweep.model.isolation import SLAB
from hpcsweep.model.modes import longest_period
from hpcsweep.model.plausibility import springs
from hpcsweep.model.reduction import physical
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.counted import counted
from hpcsweep.solvers.history import SAME_STEP
from hpcsweep.solvers.offers import FORCES
from hpcsweep.studies.ground_motion.describe import elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records

PERIODS = 60
LONGEST = 4.0
"""Periods drawn, in longest natural periods."""
MAX_MODES = 3
NEAR = 1.2
"""Ratio of periods whose names would lie over each other."""


def periods_of(structure, dt: float) -> np.ndarray:
    """Return the periods of a spectrum that shows a structure."""
    longest = structure.longest_period if structure.lowest > 0.0 else 100.0 * dt
    return np.geomspace(max(2.0 * dt, longest / 50.0), LONGEST * longest, PERIODS)


def natural_periods(structure) -> list[tuple[str, float]]:
    """Return names and values of the longest periods, or of the longest of each building."""
    if structure.buildings.max() == 0:
        periods = 2.0 * np.pi / structure.frequencies[structure.n_rigid :][:MAX_MODES]
        return [(f"T_{k + 1}", period) for k, period in enumerate(periods.tolist())]
    named = []
    for number, name in enumerate(structure.building_names):
        block = np.ix_(*2 * [structure.buildings == number])
        period = longest_period(structure.mass_matrix[block], structure.stiffness_matrix[block])
        named += [(rf"T_{{1,\mathrm{{{name}}}}}", period)] * math.isfinite(period)
    return named


def finish(axis, study: Records, periods: np.ndarray, curves: np.ndarray, *inside) -> str:
    """Mark natural periods, limit and label the axes; return words about what lies beyond.

    See `responses.within`.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    before, raised = 0.0, False
    low, high = view.visible("x", 0.0, np.inf)
    for name, period in sorted(natural_periods(study.structure), key=lambda mark: mark[1]):
        raised, before = period < NEAR * before and not raised, period
        axis.axvline(period, color=palette.series_colour(1), linewidth=0.8)
        where = {"xycoords": ("data", "axes fraction"), "ha": "center", "fontsize": 8}
        if low <= period <= high:
            axis.annotate(f"${name}$", (period, 1.06 if raised else 1.01), **where)
    time = study.structure.unit_names.time or "time"
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    edge, beyond = responses.within(curves, fractiles(curves), *inside)
    axis.set(xlabel=f"period  [{time}]", xlim=(periods[0], periods[-1]), ylim=(0, edge))
    return beyond


@figure_of("spectra", "responses", responses.load_run)
def of_records(results):
    """Response spectra of the records as they are, 5 % damping, with fractiles; needs the records.

    Scaled to a target, if there is one, with their mean. Marked are the natural periods of the
    structure, or of each building.
    """
    n = min(results.sizes["record"], responses.MAX_GREY)
    study = style.study_of(results, Records)
    periods = periods_of(study.structure, responses.samples_of(study, 0).dt)
    ratio = study.measure.damping_ratio
    of = partial(spectrum, periods=periods, damping_ratio=ratio)
    spectra = [of(responses.samples_of(study, i)).acceleration for i in range(n)]
    curves = np.array(spectra) / study.gravity
    figure, (axis,) = style.new_figure(1, 4.2)
    if target := study.measure.target:
        curves /= study.measures[:n, None]
        axis.plot(periods, curves.mean(axis=0), color=palette.series_colour(2), lw=2, label="mean")
        fitted = np.array(study.measure.periods), np.array(target) / study.gravity
        axis.plot(*fitted, color="0.1", lw=2, label="target, where fitted", zorder=3)
    responses.draw_suite(lambda *curve, **looks: axis.plot(periods, *curve, **looks), curves)
    beyond = finish(axis, study, periods, curves)
    axis.set_ylabel(f"pseudo-acceleration, {100 * ratio:g} %  [g]")
    how = "scaled to the target" if target else "as they are"
    responses.legend(axis, f"{n} records {how}", handlelength=3.5)
    return style.head(figure, str(results.attrs["name"]), beyond, fontsize=9)


FLOORS = responses.loading("floor_spectrum", "floor_spectrum_alone", "outcome")


@figure_of("floor-spectra", "responses", FLOORS, responses.SCALE, responses.PLACE)
def of_floors(results, scale: float | None = None, place: str | None = None):
    """Response spectra of a floor at one intensity, 5 % damping, with fractiles.

    Of the floor --place (default: the top of the first building), without contacts also 50 and
    84 %; those of the file (output.floor_spectra), or computed from the records, a second or two of
    each.
    """
    study, _, at = responses.run_of(results, None, scale)
    structure, stored = study.structure, study.floors
    style.demand(FORCES, structure, "--kind floor-spectra", "history")
    names = [str(name) for name in structure.floor_names]
    top = names[[k for k in physical(names) if structure.buildings[k] == 0][-1]]
    place = place or (stored.places[0] if stored.places else top)
    responses.check_place(place, names, "a floor, of")
    n, alone = min(results.sizes["record"], responses.MAX_GREY), None
    if place in stored.places:
        periods, ratio = np.array(stored.periods), stored.damping_ratio
        held = results.isel(scale=at, place=stored.places.index(place), record=slice(n))
        acceleration = held["floor_spectrum"].values
        if "floor_spectrum_alone" in held:
            alone = held["floor_spectrum_alone"].values
    else:
        samples = [responses.samples_of(study, i) for i in range(n)]
        periods, ratio = periods_of(structure, samples[0].dt), DAMPING_RATIO

        def spectra(of) -> np.ndarray:
            made, doing = [], "floor spectrum" + " without contacts" * (of is not structure)
            for i, sample in counted(enumerate(samples), n, doing):
                motion = of, sample, periods, ratio, float(study.factor[i, at]), study.tail
                made.append(floor_spectra(*motion, places=[place]).acceleration[0])
            return np.array(made)

        acceleration = spectra(structure)
        if structure.contacts:
            alone = spectra(structure.without_contacts())
    curves = acceleration[np.isfinite(acceleration).all(axis=1)] / study.gravity
    if not len(curves):
        raise style.PlotError("no run is complete yet")
    figure, (axis,) = style.new_figure(1, 4.4)
    responses.draw_suite(lambda *curve, **looks: axis.plot(periods, *curve, **looks), curves)
    inside = () if alone is None else fractiles(alone / study.gravity, PARTS[1:])
    for width, part, values in zip((2.0, 1.0), PARTS[1:], inside, strict=False):
        looks = {"color": "0.1", "linewidth": width, "label": f"{100 * part:g} %, no contact"}
        axis.plot(periods, values, ":", **looks)
    beyond = finish(axis, study, periods, curves, *inside)
    axis.set_ylabel(f"pseudo-acceleration on {place}, {100 * ratio:g} %  [g]")
    responses.legend(axis, f"{len(curves)} records", handlelength=3.5)
    where = f"floor {place},  {responses.at_scale(study, at)}"
    return style.head(figure, responses.title(results), where, beyond, fontsize=9)


NAMES = "storey_drift", *responses.RUN
RUN = responses.RECORD, responses.SCALE
PART = *RUN, responses.PLACE, responses.TIME
IN_A_ROW = 4
"""Panels."""
EACH, MORE = (2.6, 2.3), (1.0, 0.6)
"""Inches of a panel, and of what is beside all ..."""
ONE = EACH[0] + MORE[0], EACH[1] + MORE[1]
"""... of a figure of one."""
TAKEN = {"sliders": [5], "contacts": [4], "damping": [3], "kinetic and strain": [1, 2]}
"""Fields of an `Energy`, from below."""


@figure_of("history", "responses", responses.loading("contact_force", *NAMES), *PART)
def history(
    results,
    record: str | None = None,
    scale: float | None = None,
    place: str | None = None,
    time: tuple[float, float] | None = None,
):
    """One record at one intensity over time: the ground and two facing floors; needs the record.

    Displacements with and without contacts, the gap and the force between them (the largest since
    the instant before: contacts may be shorter; not of rigid stops), and absolute accelerations.
    """
    study, i, at = responses.run_of(results, record, scale)
    samples = responses.samples_of(study, i)
    structure, factor = study.structure, float(study.factor[i, at])
    names = list(structure.contact_names.values())
    responses.check_place(place, names, "a contact, of")
    seen = responses.history_of(study, (i, at), time)
    shown, k = physical(structure.floor_names)[-1:], names.index(place) if place else 0
    if names:
        if place is None:
            k = int(seen.peak_force.max(axis=0).argmax())
        moved = np.flatnonzero(structure.directions[k]).tolist()
        shown = [i for i in physical(structure.floor_names) if i in moved] or moved
    rows = 4 + FORCES.of(structure) if names else 3
    figure, axes = style.new_figure(rows, 8.8 if names else 6.2, 7.6)

    def panel(axis, label: str, columns, quantity: str = "1", **looks) -> float:
        """Draw columns, one a line, in a unit that suits them; return how much of it is one."""
        unit, size = labels.sized(structure, quantity, columns)
        for series, column in enumerate(columns.T):
            colour = {"color": palette.series_colour(series), "lw": 0.8}
            axis.plot(seen.time, column / size, **colour | looks)
        axis.set_ylabel(label + unit, fontsize=8)
        return size

    ground = factor / study.gravity * np.interp(seen.time, samples.times, samples.acceleration)
    ground[seen.time > samples.times[-1]] = 0.0
    panel(axes[0], "ground  [g]", ground[:, None], color="0.3", lw=0.6)
    panel(axes[-1], "absolute\nacceleration  [g]", seen.acceleration[:, shown] / study.gravity)
    size = panel(axes[1], "displacement", seen.displacement[:, shown], "length")
    for line, floor in zip(axes[1].lines, shown, strict=True):
        line.set_label(structure.floor_names[floor])
    if names:
        free = responses.history_of(study, (i, at), time, structure.without_contacts())
        for line, column in zip(axes[1].lines[:], free.displacement[:, shown].T, strict=True):
            axes[1].plot(free.time, column / size, ":", color=line.get_color(), lw=0.7)
        axes[1].plot([], [], ":", color=palette.STOP, label="no contact")
        gap, force = structure.contacts[k].gap - seen.approach[:, [k]], seen.peak_force[:, [k]]
        touch = palette.series_colour(2)
        panel(axes[2], f"gap {names[k]}", gap, "length", color="0.3")
        axes[2].axhline(0.0, color=touch, lw=0.8)
        if rows > 4:
            panel(axes[3], f"force {names[k]}", force, "force", color=touch, drawstyle="steps-pre")
        pushes = {"where": force[:, 0] > 0.0, "color": touch, "alpha": 0.2, "linewidth": 0.6}
        for axis in axes[1:3]:
            axis.fill_between(seen.time, 0, 1, transform=axis.get_xaxis_transform(), **pushes)
    beside = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.0}
    axes[1].legend(frameon=False, fontsize=7, ncols=4, **beside)
    unit = labels.unit(structure, "time")
    axes[-1].set(xlabel="time" + unit, xlim=(seen.time[0], seen.time[-1]))
    note = elastic_words(elastic_drift(results.isel(record=[i], scale=[at]), structure))
    return style.head(figure, responses.run_title(results, study, i, at), note, fontsize=9)


def elastic_springs(structure: Structure) -> np.ndarray:
    """Return the stiffness of the elastic spring beside each slider of a storey, or of bearings."""
    rows = dict(zip(structure.storey_names, structure.drift_rows.tolist(), strict=True))
    named = zip(structure.slider_names, structure.sliders, strict=True)
    is_spring = [rows.get(name) == [*one.direction] or name.endswith(SLAB) for name, one in named]
    elastic = np.zeros(len(is_spring))
    directions = structure.slider_directions[is_spring]
    elastic[is_spring] = springs(structure, structure.elastic_stiffness, directions)
    return elastic


@figure_of("hysteresis", "responses", responses.load_run, *PART)
def hysteresis(
    results,
    record: str | None = None,
    scale: float | None = None,
    place: str | None = None,
    time: tuple[float, float] | None = None,
):
    """Force of each storey that yields against its drift, and of other sliders; needs the record.

    Of one record at one intensity. Of a storey, and of bearings, that is the force of the slider
    and of the elastic spring beside it, less what P-Delta takes; of another slider its own.
    """
    study, i, at = responses.run_of(results, record, scale)
    structure, names = study.structure, study.structure.slider_names
    if not names:
        raise style.PlotError("--kind hysteresis: the structure has no sliders, nothing yields")
    responses.check_place(place, names, "a slider, of")
    seen = responses.history_of(study, (i, at), time)
    shown = [names.index(place)] if place else range(len(names))
    is_base = [not name[-1].isdigit() for name in names]
    apart = len({is_base[j] for j in shown}) > 1
    figure, axes = mesh.panels(len(shown), ONE, EACH, MORE, not apart, IN_A_ROW, not apart)
    elongation = seen.displacement @ structure.slider_directions.T
    forces = seen.slider_force + elastic_springs(structure) * elongation
    for axis, j in zip(axes, shown, strict=True):
        alike = [k for k in shown if is_base[k] == is_base[j]]
        x_unit, length = labels.sized(structure, "length", elongation[:, alike])
        y_unit, force = labels.sized(structure, "force", forces[:, alike])
        ductility = np.abs(elongation[:, j]).max() / structure.sliders[j].limit
        loop = elongation[:, j] / length, forces[:, j] / force
        axis.plot(*loop, color=palette.series_colour(0), lw=0.7)
        if apart:
            most = [1.1 * abs(x[:, alike]).max() for x in (elongation / length, forces / force)]
            axis.set(xlim=(-most[0], most[0]), ylim=(-most[1], most[1]))
        axis.set_xlabel("drift" + x_unit, fontsize=8)
        axis.set_ylabel("force" + y_unit, fontsize=8)
        name = f"storey {names[j]}" if names[j].isdigit() else names[j]
        axis.set_title(f"{name}, ductility {ductility:.1f}", fontsize=9)
        axis.grid(True, color="0.92", linewidth=0.6)
        if not apart:
            axis.label_outer()
    return style.head(figure, responses.run_title(results, study, i, at), fontsize=9)


@figure_of("energy", "responses", responses.load_run, *RUN)
def energy(results, record: str | None = None, scale: float | None = None):
    """Work of the ground, and where it is, over time, of one record at one intensity.

    It needs the record. Taken by sliders, contacts and damping, kinetic and strain energy.
    """
    from hpcsweep.solvers.instants import InstantMap

    study, i, at = responses.run_of(results, record, scale)
    structure, samples = study.structure, responses.samples_of(study, i)
    count = samples.n_samples - 1 + int(study.tail / samples.dt + SAME_STEP)
    try:
        solver = InstantMap(structure, samples.dt, energy=True)
    except ValueError as error:
        raise style.PlotError(f"--kind energy: {error}") from None
    steps = solver.energies(samples.acceleration.copy(), float(study.factor[i, at]), count)
    energies, time = np.array(steps), samples.dt * np.arange(len(steps))
    unit, size = labels.sized(structure, "energy", energies)
    parts = {name: energies[:, fields].sum(axis=1) / size for name, fields in TAKEN.items()}
    parts = {name: values for name, values in parts.items() if values.any()}
    figure, (axis,) = style.new_figure(1, 4.2)
    colours = [palette.series_colour(series) for series in range(len(parts))]
    axis.stackplot(time, *parts.values(), labels=[*parts], colors=colours, alpha=0.6, linewidth=0)
    axis.plot(time, energies[:, 0] / size, color="0.1", lw=0.9, label="work of the ground")
    axis.set(xlabel="time" + labels.unit(structure, "time"), ylabel="energy" + unit)
    axis.set(xlim=(0, time[-1]), ylim=(0, None))
    responses.legend(axis, reverse=True)
    return style.head(figure, responses.run_title(results, study, i, at), fontsize=9)
