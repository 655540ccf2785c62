"""Response spectra of records, and of floors under them; 5 % damping, with fractiles."""

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, spectrum
from hpcsweep.earthquakes.stripes import fractiles
from hpcsweep.figures import palette, style, view
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.options import figure_of
from hpcsweep.model.modes import natural_modes
from hpcsweep.model.reduction import physical
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion.records import Records

PERIODS = 60
LONGEST = 4.0
"""Periods drawn, in longest natural periods."""
MAX_MODES = 3
NEAR = 1.2
"""Ratio of periods whose names would lie over each other."""


def periods_of(structure, dt: float) -> np.ndarray:
    """Return the periods of a spectrum that shows a structure."""
    longest = 2.0 * np.pi / float(structure.frequencies[0])
    return np.geomspace(max(2.0 * dt, longest / 50.0), LONGEST * longest, PERIODS)


def natural_periods(structure) -> list[tuple[str, float]]:
    """Return names and values of the longest periods, or of the longest of each building."""
    if structure.buildings.max() == 0:
        periods = 2.0 * np.pi / structure.frequencies[:MAX_MODES]
        return [(f"T_{k + 1}", period) for k, period in enumerate(periods.tolist())]
    named = []
    for number, name in enumerate(structure.building_names):
        block = np.ix_(*2 * [structure.buildings == number])
        omega = natural_modes(structure.mass_matrix[block], structure.stiffness_matrix[block])[0][0]
        named.append((rf"T_{{1,\mathrm{{{name}}}}}", 2.0 * np.pi / float(omega)))
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

    Marked are the natural periods of the structure, or of each building.
    """
    n = min(results.sizes["record"], responses.MAX_GREY)
    study = style.study_of(results, Records)
    periods = periods_of(study.structure, responses.samples_of(study, 0).dt)
    spectra = [spectrum(responses.samples_of(study, i), periods).acceleration for i in range(n)]
    curves = np.array(spectra) / study.gravity
    figure, (axis,) = style.new_figure(1, 4.2)
    responses.draw_suite(lambda *curve, **looks: axis.plot(periods, *curve, **looks), curves)
    beyond = finish(axis, study, periods, curves)
    axis.set_ylabel("pseudo-acceleration, 5 %  [g]")
    responses.legend(axis, f"{n} records as they are", handlelength=3.5)
    return style.head(figure, str(results.attrs["name"]), beyond, fontsize=9)


FLOORS = responses.loading("floor_spectrum", "outcome")


@figure_of("floor-spectra", "responses", FLOORS, responses.SCALE, responses.PLACE)
def of_floors(results, scale: float | None = None, place: str | None = None):
    """Response spectra of a floor at one intensity, 5 % damping, with fractiles.

    Of the floor --place (default: the top of the first building), also the 50 % without contacts;
    those of the file (output.floor_spectra), or computed from the records, a second or two of each.
    """
    study, at = style.study_of(results, Records), responses.scale_index(results, scale)
    structure, stored = study.structure, study.floors
    names = [str(name) for name in structure.floor_names]
    top = names[[k for k in physical(names) if structure.buildings[k] == 0][-1]]
    place = place or (stored.places[0] if stored.places else top)
    responses.check_place(place, names, "a floor, of")
    n, alone = min(results.sizes["record"], responses.MAX_GREY), None
    if place in stored.places:
        periods, ratio = np.array(stored.periods), stored.damping_ratio
        acceleration = (
            results["floor_spectrum"].isel(scale=at, place=stored.places.index(place))[:n].values
        )
    else:
        samples = [responses.samples_of(study, i) for i in range(n)]
        periods, ratio = periods_of(structure, samples[0].dt), DAMPING_RATIO

        def spectra(of) -> np.ndarray:
            made, tell = [], counted("floor spectrum" + " without contacts" * (of is not structure))
            for i, sample in enumerate(samples):
                factor = float(study.factor[i, at])
                motion = of, sample, periods, ratio, factor, study.tail
                of_one = floor_spectra(*motion, places=[place])
                made.append(of_one.acceleration[0])
                tell(i + 1, n)
            return np.array(made)

        acceleration = spectra(structure)
        if structure.contacts:
            (alone,) = fractiles(spectra(structure.without_contacts()), (0.5,)) / study.gravity
    curves = acceleration[np.isfinite(acceleration).all(axis=1)] / study.gravity
    if not len(curves):
        raise style.PlotError("no run is complete yet")
    figure, (axis,) = style.new_figure(1, 4.4)
    responses.draw_suite(lambda *curve, **looks: axis.plot(periods, *curve, **looks), curves)
    inside = [] if alone is None else [alone]
    if alone is not None:
        looks = {"color": palette.STOP, "linewidth": 2.0, "label": "50 %, no contact"}
        axis.plot(periods, alone, ":", **looks)
    beyond = finish(axis, study, periods, curves, *inside)
    axis.set_ylabel(f"pseudo-acceleration on {place}, {100 * ratio:g} %  [g]")
    responses.legend(axis, f"{len(curves)} records", handlelength=3.5)
    where = f"floor {place},  {responses.at_scale(study, at)}"
    return style.head(figure, responses.title(results), where, beyond, fontsize=9)
