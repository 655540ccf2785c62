"""The measures of storeys, floors and contacts that results hold, labelled for all figures."""

from typing import NamedTuple

import numpy as np

from hpcsweep.figures import labels
from hpcsweep.studies.quantities import MEASURES, of_motions
from hpcsweep.studies.variables import percent_of_height

RUN_LABELS = {
    "drift": r"normalised drift $\delta$  [$A/\Omega^2$]",
    "modal_norm": r"mean modal norm $\eta_j$ free of contact",
    "lyapunov": r"largest Lyapunov exponent $\lambda$",
    "ductility": "largest ductility of the sliders",
    "share": "share of the starts",
}
"""What the other numbers of a run are."""


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
    return [name for name in MEASURES if name in results]


def measure_of(results, structure, name: str) -> ShownMeasure:
    """Return how a measure is shown; drifts as ratios to the storeys' heights where known.

    Parameters
    ----------
    results : xarray.Dataset
    structure : Structure
    name : str
        One of `held_measures`.
    """
    variable = of_motions(name)
    (dim,) = variable.dims
    word = "contact" if dim == "stop" else dim
    places = tuple(f"{word} {place}" for place in results[dim].values.tolist())
    percent = percent_of_height(results)
    if name == "storey_drift" and percent is not None:
        return ShownMeasure(f"{variable.label} ratio", "  [%]", dim, places, percent)
    unit = labels.unit(structure, variable.units)
    return ShownMeasure(variable.label, unit, dim, places, np.ones(len(places)))
