"""Is this building plausible? Bounds beyond which a number is likely to be in another unit.

Nothing here is refused: a warning tells the value and the bounds. A mass or a stiffness that is
mistaken by the factor c changes periods by sqrt(c).
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from hpcsweep.model.isolation import SLAB, isolated_period
from hpcsweep.model.modes import natural_modes
from hpcsweep.model.structure import Structure

PERIOD = 0.02, 0.5
"""Longest period of a building on a fixed base over its number of storeys, in seconds."""
OSCILLATOR = 8
"""Storeys of the building that one of a single storey may stand for, as oscillators do."""
ISOLATED = 12.0
"""Most of the longest period while bearings slide, in seconds."""
YIELDS = 0.05, 5.0
"""Drift at which a storey yields, in percent of its height."""
HEIGHTS = 10.0
"""Largest storey height over the smallest."""
GAPS = 3e-3, 100.0
"""Distance of two floors, or of a floor and a stop, in percent of the height of a storey."""
STOREY = {"m": 3.0, "mm": 3e3}
"""Height of a storey, by the unit of length, where it is not known."""


def implausible(structure: Structure, second: float | Fraction | None) -> Iterator[str]:
    """Return one line for each number of a building that looks as if in another unit.

    Parameters
    ----------
    structure : Structure
        Of matrices or of a model nothing is known.
    second : float, optional
        The structure's unit of time in seconds; without it periods are not judged.
    """
    of_storeys = structure.matrices is None or structure.names.storeys
    if structure.reduction is not None or not of_storeys:
        return
    if text := heights_apart(structure.names.storey_heights):
        yield text
    if second is not None:
        yield from _periods(structure, float(second))
    yield from _yield_drifts(structure)
    yield from _gaps(structure)


def heights_apart(heights: Sequence[float] | np.ndarray) -> str:
    """Return a warning of heights in different units; empty without."""
    low, high = min(heights, default=1.0), max(heights, default=1.0)
    if high <= HEIGHTS * low:
        return ""
    return f"storey heights of {low:g} and {high:g} are given together: in one unit?"


def _periods(structure: Structure, second: float) -> Iterator[str]:
    """Judge the period of each building on a fixed base, and that of bearings that slide."""
    fixed = np.array([not name.endswith(SLAB) for name in structure.floor_names])
    for number, name in enumerate(structure.building_names):
        floors = (structure.buildings == number) & fixed
        if not floors.any():
            continue
        of_own = np.ix_(floors, floors)
        matrices = structure.mass_matrix[of_own], structure.stiffness_matrix[of_own]
        omega = float(natural_modes(*matrices)[0][0])
        if not omega > 0.0:
            continue
        n = int(structure.drift_rows[:, floors].any(axis=1).sum())
        period = 2.0 * np.pi / omega * second
        low, high = PERIOD[0] * n, PERIOD[1] * (n if n > 1 else OSCILLATOR)
        if not low <= period <= high:
            building = "the building" if name == "building" else f"building {name}"
            yield (
                f"{building} has a period of {period:.3g} s on a fixed base, {n} storeys have "
                f"{low:g} to {high:g} s: are masses and stiffnesses in one system of units?"
            )
    sliding = (isolated_period(structure) or 0.0) * second
    if sliding > ISOLATED:
        yield f"bearings that slide have a period of {sliding:.3g} s, above {ISOLATED:g} s"


def _yield_drifts(structure: Structure) -> Iterator[str]:
    """Judge the drifts at which storeys of known heights yield."""
    limits = {slider.direction: slider.limit for slider in structure.sliders}
    rows = map(tuple, structure.drift_rows.tolist())
    storeys = zip(structure.storey_names, rows, structure.names.storey_heights, strict=False)
    drifts = [(name, limits[row], height) for name, row, height in storeys if row in limits]
    yield from _shares(drifts, "storey {} yields at a drift of {:.4g}, {:.3g} % of its", YIELDS)


def _gaps(structure: Structure) -> Iterator[str]:
    """Judge gaps by the height of the highest storey, or a usual one where none is known."""
    length = structure.unit_names.length
    height = max(structure.names.storey_heights, default=STOREY.get(length, 0.0))
    stops = zip(structure.contact_numbers, structure.contacts, strict=True)
    names = structure.contact_names
    gaps = [(names[k], abs(stop.gap), height) for k, stop in stops if stop.gap and height]
    yield from _shares(gaps, "contact {} has a gap of {:.4g}, {:.3g} % of the storey", GAPS)


def _shares(
    lengths: Sequence[tuple[str, float, float]], words: str, bounds: tuple[float, float]
) -> Iterator[str]:
    """Yield one line for all lengths (name, length, height) that are implausible."""
    outside = [each for each in lengths if not bounds[0] <= 100.0 * each[1] / each[2] <= bounds[1]]
    if outside:
        name, length, height = outside[0]
        more = f" and {len(outside) - 1} more" * (len(outside) > 1)
        what = words.format(name + more, length, 100.0 * length / height)
        yield f"{what} height {height:g}, outside {bounds[0]:g} to {bounds[1]:g} %: in which unit?"
