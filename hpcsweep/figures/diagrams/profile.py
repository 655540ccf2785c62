"""Peak drift, displacement or acceleration, ductility or residual drift over the storeys.

Of each building at one intensity: median, 16 to 84 %, and the median of the motion without contacts
(elastic, where something yields).
"""

import numpy as np

from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import responses_of

NAME = "profile"
DRAWS = "responses"
OPTIONS = (responses.RESPONSE, responses.SCALE)
load = responses.load
ROOM = 0.2
"""Room of the legend above the storeys, over their height."""


def draw(results, response: str = "drift", scale: float | None = None):
    """Draw a panel for each building, storeys upwards."""
    if response in ("force", "impacts", "base_shear"):
        raise style.PlotError(f"--response {response}: has no profile over the height")
    at, study = responses.scale_index(results, scale), style.study_of(results, Records)
    whole = responses.opened(results, response, None)
    profile = responses_of(results, study, response)
    if study.structure.reduction is not None:
        raise style.PlotError("a profile is for buildings: a finite element model has no storeys")
    panels = responses.heights(profile.names)
    figure, axes = style.new_grid(1, len(panels), (1.2 + 2.6 * len(panels), 4.2), sharex=True)
    counted = median_band(profile.values[:, at])
    beside = [np.asarray(profile.alone)[:, at]] if responses.touches(whole) else []
    edge = responses.edge_of(counted, *beside)
    for axis, (building, places, level) in zip(axes[0], panels, strict=True):
        low, median, high = counted[:, places]
        band = [np.minimum(end, edge or np.inf) for end in (low, high)]
        colour = palette.series_colour(0)
        axis.fill_betweenx(level, *band, color=colour, alpha=0.2, linewidth=0, label="16 to 84 %")
        axis.plot(median, level, "o-", color=colour, markersize=3, label="median")
        if responses.touches(whole):
            free = median_band(np.asarray(profile.alone)[:, at, places])[1]
            looks = {"color": palette.STOP, "markersize": 3, "label": responses.alone(results)}
            axis.plot(free, level, "s:", **looks)
        axis.set_title(f"building {building}" if building else "", fontsize=9)
        axis.set_yticks(level)
        axis.grid(True, color="0.92", linewidth=0.6)
        axis.set_xlabel(whole.label, fontsize=8)
    ends = [tick for axis in axes[0] for tick in axis.get_yticks()]
    room = ROOM * (max(ends) - min(ends) + 1.0)
    for axis in axes[0]:
        axis.set_ylim(min(ends) - 0.5, max(ends) + 0.5 + room)
    axes[0, 0].set(xlim=(0, edge), ylabel=profile.dim)
    responses.legend(axes[0, 0])
    where = f"{responses.at_scale(study, at)}, {len(whole.records)} records"
    if fallen := int(np.isinf(whole.values[:, at]).sum()):
        where += f", {fallen} of which collapse, beyond the edge"
    return style.head(figure, f"{where}\n{responses.title(results)}", fontsize=9)
