"""The measures of storeys, floors and contacts that results hold, labelled for all figures."""

from typing import NamedTuple

import numpy as np

from hpcsweep.figures import labels
from hpcsweep.studies.variables import DRIFT_RATIO, percent_of_height

LABELS = {
    "storey_drift": ("peak storey drift", "length", "storey"),
    "displacement": ("peak displacement", "length", "floor"),
    "acceleration": ("peak floor acceleration", "acceleration", "floor"),
    "contact_force": ("peak contact force", "force", "stop"),
    "impacts": ("impacts a forcing period", "1", "stop"),
    "impact_velocity": ("largest closing speed", "velocity", "stop"),
    "impulse": ("impulse a forcing period", "impulse", "stop"),
    "contact_time": ("share of time in contact", "1", "stop"),
}
"""What each measure is, its quantity, and the dimension of its places."""


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
    label, quantity, dim = LABELS[name]
    word = "contact" if dim == "stop" else dim
    places = tuple(f"{word} {place}" for place in results[dim].values.tolist())
    percent = percent_of_height(results)
    if name == "storey_drift" and percent is not None:
        return ShownMeasure(DRIFT_RATIO, "  [%]", dim, places, percent)
    own = "" if quantity == "1" else labels.unit(structure, quantity)
    return ShownMeasure(label, own, dim, places, np.ones(len(places)))
