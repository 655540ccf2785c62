"""Floor response spectra that a study of records stores of every run."""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.floor_spectra import SHORTEST
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, LONGEST
from hpcsweep.earthquakes.suite import Facts
from hpcsweep.model.structure import Structure
from hpcsweep.studies.variable import Coordinate, real
from hpcsweep.studies.variables import named

RUN = ("record", "scale")
"""Dimensions of a run."""
MAX_PERIODS = 1000
FLOOR_SPECTRUM = real(
    *("floor_spectrum", ("place", "period"), "acceleration"),
    "pseudo-acceleration of oscillators on floors, see hpcsweep.floor_spectra",
)


class FloorSpectra(NamedTuple):
    """Floor spectra that are stored of every run; none without periods."""

    periods: tuple[float, ...] = ()
    damping_ratio: float = DAMPING_RATIO
    places: tuple[str, ...] = ()

    @property
    def dimensions(self) -> dict[str, Coordinate]:
        """Dimensions of the variable; empty if it is not stored."""
        if not self.periods:
            return {}
        what = f"natural period of oscillators of {100 * self.damping_ratio:g} % damping"
        return {
            "place": named(self.places, "floor whose response spectrum is stored"),
            "period": Coordinate(np.array(self.periods), "time", what),
        }


def read_floor_spectra(values: Any, suite: tuple[Facts, ...], structure: Structure) -> FloorSpectra:
    """Read the floor spectra that are stored of every run.

    Raises
    ------
    JobError
    """
    key = "output.floor_spectra"
    table = values.get(key, False)
    if table is False:
        return FloorSpectra()
    if not isinstance(table, dict):
        limit = 'must be a table such as {periods = [0.1, 0.2, 0.5, 1.0], places = ["A3"]}'
        raise values.error(key, table, limit)
    values.check_keys(key, table, FloorSpectra._fields)
    periods = values.numbers(f"{key}.periods", table.get("periods"), True, MAX_PERIODS)
    for facts in suite:
        for period in periods[[0, -1]].tolist():
            values.positive(f"{key}.periods", period, SHORTEST * facts.dt, LONGEST * facts.dt)
    names = tuple(map(str, structure.floor_names))
    places = table.get("places", [*names])
    if not isinstance(places, list) or not places or len({*places}) < len(places):
        raise values.error(f"{key}.places", places, "must be names of floors, each once")
    for place in places:
        values.choice(f"{key}.places", place, names)
    damping = table.get("damping_ratio", DAMPING_RATIO)
    ratio = read_damping_ratio(values, f"{key}.damping_ratio", damping)
    return FloorSpectra(tuple(periods.tolist()), ratio, tuple(places))


def read_damping_ratio(values: Any, key: str, value: Any) -> float:
    """Take a damping ratio."""
    ratio = values.number(key, value)
    if not 0 <= ratio < 1:
        raise values.error(key, ratio, "must be from 0 to below 1")
    return ratio
