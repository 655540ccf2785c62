"""Response spectra of a floor at one intensity, 5 % damping, with fractiles.

Of the floor --place (default: the top of the first building), also the 50 % without contacts; those
of the file (output.floor_spectra), or computed from the records, a second or two of each.
"""

import numpy as np

from hpcsweep.earthquakes.floor_spectra import floor_spectra
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO
from hpcsweep.earthquakes.stripes import fractiles
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses, suite_spectra
from hpcsweep.model.reduction import physical
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion.records import Records

NAME = "floor-spectra"
DRAWS = "responses"
OPTIONS = (responses.SCALE, responses.PLACE)


def load(frames, **_options):
    """Read the floor spectra, if there are some, and the facts about the records."""
    return frames.gather([name for name in ("floor_spectrum", "outcome") if name in frames])


def draw(results, scale: float | None = None, place: str | None = None):
    """Draw the spectral acceleration over the period, in g."""
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
        periods, ratio = suite_spectra.periods_of(structure, samples[0].dt), DAMPING_RATIO

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
    beyond = suite_spectra.finish(axis, study, periods, curves, *inside)
    axis.set_ylabel(f"pseudo-acceleration on {place}, {100 * ratio:g} %  [g]")
    responses.legend(axis, f"{len(curves)} records", handlelength=3.5)
    where = f"floor {place},  {responses.at_scale(study, at)}"
    return style.head(figure, responses.title(results), where, beyond, fontsize=9)
