"""The measures of storeys, floors and contacts that results hold, labelled for all figures."""

from typing import NamedTuple

import numpy as np

from hpcsweep.figures import labels
from hpcsweep.studies.variables import DRIFT_RATIO, measures_of_each, percent_of_height

LABELS = {
    "storey_drift": "peak storey drift",
    "displacement": "peak displacement",
    "acceleration": "peak floor acceleration",
    "contact_force": "peak contact force",
    "impacts": "impacts a forcing period",
    "impact_velocity": "largest closing speed",
    "impulse": "impulse a forcing period",
    "contact_time": "share of time in contact",
}
"""What each measure is."""


class ShownMeasure(NamedTuple):
    """A measure as figures show it."""

    label: str
    """Without its unit ..."""
    unit: str
    """... which follows it; empty where it has no name."""
    dim: str
    places: tuple[str, ...]
    """Each storey, floor or contact by its name."""
    factor: np.ndarray
    """By which the values of each place are multiplied."""


def held_measures(results) -> list[str]:
    """Return the names of the measures that results hold."""
    return [name for name in LABELS if name in results]


def measure_of(results, structure, name: str) -> ShownMeasure:
    """Return how a measure is shown; drifts as ratios to the storeys' heights where known.

    Parameters
    ----------
    results : xarray.Dataset
    structure : Structure
    name : str
        One of `held_measures`.
    """
    (variable,) = (each for each in measures_of_each(()) if each.name == name)
    quantity, dim = variable.units, variable.dims[-1]
    word = "contact" if dim == "stop" else dim
    places = tuple(f"{word} {place}" for place in results[dim].values.tolist())
    percent = percent_of_height(results)
    if name == "storey_drift" and percent is not None:
        return ShownMeasure(DRIFT_RATIO, "  [%]", dim, places, percent)
    unit = labels.unit(structure, quantity)
    return ShownMeasure(LABELS[name], unit, dim, places, np.ones(len(places)))
