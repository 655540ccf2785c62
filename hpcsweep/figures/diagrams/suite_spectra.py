"""Response spectra of the records as they are, 5 % damping, with fractiles; needs the records.

Marked are the natural periods of the structure, or of each building.
"""

import numpy as np

from hpcsweep.earthquakes.spectrum import spectrum
from hpcsweep.earthquakes.stripes import fractiles
from hpcsweep.figures import palette, style, view
from hpcsweep.figures.diagrams import responses
from hpcsweep.model.modes import natural_modes
from hpcsweep.studies.ground_motion.records import Records

NAME = "spectra"
DRAWS = "responses"
OPTIONS = ()
load = responses.load_run
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


def draw(results):
    """Draw Sa over the period, in g."""
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
