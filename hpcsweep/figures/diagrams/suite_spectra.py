"""Response spectra of the records of a suite, as they are, with fractiles."""

import numpy as np

from hpcsweep.earthquakes.spectrum import spectrum
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.studies.ground_motion.records import Records

NAME = "spectra"
DRAWS = "responses"
HELP = """\
response spectra of the records as they are, 5 % damping, with fractiles and the
structure's natural periods; needs the records"""
OPTIONS = ()
PERIODS = 60
LONGEST = 4.0
"""Periods drawn, in longest natural periods."""
MAX_MODES = 3


def load(frames, **_options):
    """Read the facts about the records of one structure."""
    return frames.gather(["outcome"])


def draw(results):
    """Draw Sa over the period, in g."""
    from matplotlib.ticker import LogLocator, NullFormatter

    n = min(results.sizes["record"], responses.MAX_GREY)
    study = style.study_of(results, Records)
    first = responses.samples_of(study, 0)
    natural = 2.0 * np.pi / study.structure.frequencies
    shortest = max(2.0 * first.dt, natural[0] / 50.0)
    periods = np.geomspace(shortest, LONGEST * natural[0], PERIODS)
    found = [spectrum(responses.samples_of(study, i), periods).acceleration for i in range(n)]
    curves = np.array(found) / study.gravity
    figure, (axis,) = style.new_figure(1, 4.2)
    responses.draw_suite(lambda *curve, **looks: axis.plot(periods, *curve, **looks), curves)
    for k, period in enumerate(natural[:MAX_MODES]):
        axis.axvline(period, color=palette.series_colour(1), linewidth=0.8)
        where = {"xycoords": ("data", "axes fraction"), "va": "top", "fontsize": 8}
        axis.annotate(rf" $T_{k + 1}$", (period, 0.98), **where)
    time = study.structure.unit_names.time or "time"
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set(xlabel=f"period  [{time}]", ylabel="pseudo-acceleration, 5 %  [g]")
    axis.set(xlim=(periods[0], periods[-1]), ylim=(0, None))
    responses.legend(axis, f"{n} records as they are", handlelength=3.5)
    return style.head(figure, str(results.attrs["name"]), fontsize=9)
