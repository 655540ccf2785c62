"""Is this building plausible? Bounds beyond which a number is likely to be in another unit.

Nothing here is refused: a warning tells the value, the bounds, and with which unit it would lie
within them, if there is one. A mass or a stiffness that is mistaken by the factor c changes periods
by sqrt(c).
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from hpcsweep.model.isolation import SLAB, isolated_period
from hpcsweep.model.modes import longest_period
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import COLUMN, OF_SOIL, is_level, known_unit

PERIOD = 0.02, 0.5
"""Longest period of a building on a fixed base over its number of storeys, in seconds."""
OSCILLATOR = 8
"""Storeys of the building that one of a single storey may stand for, as oscillators do."""
ISOLATED = 0.5, 12.0
"""Longest period while bearings slide, in seconds; only the upper bound is warned of."""
YIELDS = 0.05, 5.0
"""Drift at which a storey yields, in percent of its height."""
HEIGHTS = 10.0
"""Largest storey height over the smallest."""
ROOT = 1e3**0.5
Mistakes = tuple[tuple[float, str], ...]
IN_KILOGRAMS: Mistakes = (
    *((ROOT, "masses are in t"), (1.0 / ROOT, "stiffnesses are in kN/m")),
    (1e-3, "stiffnesses are in kN/mm, or periods in ms"),
)
IN_TONNES: Mistakes = (ROOT, "stiffnesses are in N/m"), (1.0 / ROOT, "masses are in kg")
OF_PERIODS = {"": IN_KILOGRAMS, "kg": IN_KILOGRAMS, "t": IN_TONNES}
"""What a period is multiplied by, and why, by the unit of mass of the job."""
OF_RADII = (1.0 / ROOT, "the radius is in mm, or the stiffness in kN/m"), (0.1, "it is in cm")
IN_METRES: Mistakes = (
    *((1e-3, "yield drifts are in mm"), (1e-2, "yield drifts are in cm")),
    (1e3, "yield forces are in kN"),
)
OF_DRIFTS = {"": IN_METRES, "m": IN_METRES, "mm": ((1e3, "yield drifts are in m"),)}
"""Likewise of yield drifts, by the unit of length."""
RATIOS: Mistakes = (0.01, "it is a percentage of the height"), (1.0, "it is a share of it")
"""What a share is multiplied by beside the height, and why."""
GAPS = 3e-3, 100.0
"""Distance of two floors, or of a floor and a stop, in percent of the height of a storey."""
GAPS_IN_METRES: Mistakes = (1e-3, "gaps are in mm"), (1e-2, "gaps are in cm")
OF_GAPS = {"": GAPS_IN_METRES, "m": GAPS_IN_METRES, "mm": ((1e3, "gaps are in m"),)}
STOREY = {"m": 3.0, "mm": 3e3}
"""Height of a storey, by the unit of length, where it is not known."""
OF_HEIGHTS = (1e3, "mm"), (1e2, "cm")


def implausible(structure: Structure, second: float | Fraction | None) -> Iterator[str]:
    """Return one line for each number of a building that looks as if in another unit.

    Parameters
    ----------
    structure : Structure
        Of matrices or of a model nothing is known.
    second : float, optional
        The structure's unit of time in seconds; without it periods are not judged.
    """
    if not _has_storeys(structure):
        return
    if text := heights_apart(structure.names.storey_heights):
        yield text
    if second is not None:
        yield from _periods(structure, float(second))
    yield from _yield_drifts(structure)
    yield from _gaps(structure)


def _has_storeys(structure: Structure) -> bool:
    """Return whether it is known to consist of storeys."""
    of_storeys = structure.matrices is None or bool(structure.names.storeys)
    return of_storeys and structure.reduction is None


def told(structure: Structure, gravity: float) -> Iterator[str]:
    """Tell the numbers of each building by which engineers judge it, a line each.

    Its weight W, that given or g times its mass; the force V_y at which its lowest storey yields
    over that; the largest P / (k h) of its storeys of stiffness k, which carry P, theta =
    P d / (V h) of codes; and its longest period on a fixed base. With P-Delta k is that before
    P / h is taken from it.
    """
    if not _has_storeys(structure):
        return
    force, time = (known_unit(structure, name) for name in ("force", "time"))
    limits = {slider.direction: slider.limit for slider in structure.sliders}
    heights = structure.names.storey_heights
    for name, floors, rows, period in _on_fixed_bases(structure):
        real = [i for i in floors.tolist() if is_level(structure.floor_names[i])]
        above = gravity * np.diag(structure.mass_matrix)[real][::-1].cumsum()[::-1]
        directions = structure.drift_rows[rows]
        taken = np.array(structure.names.taken or np.zeros(len(structure.drift_rows)))[rows]
        stiffness = springs(structure, structure.stiffness_matrix, directions) + taken
        if heights:
            above = np.where(taken > 0.0, taken * np.array(heights)[rows], above)
        words = [f"{name}: " * (name != "building") + f"weight {above[0]:.4g}{force}"]
        if (limit := limits.get(tuple(directions[0].tolist()), np.inf)) < np.inf:
            words.append(f"V_y/W {limit * stiffness[0] / above[0]:.3g}")
        if heights:
            theta = above / np.array(heights)[rows] / stiffness
            words.append(f"theta at most {theta.max():.3g}")
        each = f"{period / rows.size:.3g}{time} a storey"
        yield ", ".join([*words, f"period {period:.4g}{time} on a fixed base, {each}"])


def springs(structure: Structure, stiffness: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the springs of a stiffness matrix along rows, of two floors or one and the ground."""
    for i, name in enumerate(structure.floor_names):
        if COLUMN in name:
            column = stiffness[i] / np.sqrt(stiffness[i, i])
            stiffness = stiffness - np.outer(column, column)
    kept = [k for k, name in enumerate(structure.floor_names) if not name.endswith(OF_SOIL)]
    stiffness, found = stiffness[np.ix_(kept, kept)], []
    for row in rows[:, kept]:
        first, *second = np.flatnonzero(row)[:2].tolist()
        along = stiffness[first, second[0]] if second else stiffness[first].sum()
        found.append(along / (row[first] * row[second[0] if second else first]))
    return np.array(found)


def _on_fixed_bases(structure: Structure) -> Iterator[tuple[str, np.ndarray, np.ndarray, float]]:
    """Yield name, places of floors and of storeys, and longest period of each building."""
    fixed = np.array([not name.endswith((SLAB, *OF_SOIL)) for name in structure.floor_names])
    for number, name in enumerate(structure.building_names):
        floors = (structure.buildings == number) & fixed
        if not floors.any():
            continue
        of_own = np.ix_(floors, floors)
        matrices = structure.mass_matrix[of_own], structure.stiffness_matrix[of_own]
        if (period := longest_period(*matrices)) < np.inf:
            (rows,) = np.nonzero(structure.drift_rows[:, floors].any(axis=1))
            yield name, np.flatnonzero(floors), rows, period


def heights_apart(heights: Sequence[float] | np.ndarray) -> str:
    """Return a warning of heights in different units; empty without."""
    low, high = min(heights, default=1.0), max(heights, default=1.0)
    if high <= HEIGHTS * low:
        return ""
    units = (f": {name} beside m?" for size, name in OF_HEIGHTS if high > size * low / HEIGHTS)
    return f"storey heights of {low:g} and {high:g} are given together{next(units, '')}"


def _periods(structure: Structure, second: float) -> Iterator[str]:
    """Judge the period of each building on a fixed base, and that of bearings that slide."""
    mistakes = OF_PERIODS.get(structure.unit_names.mass, ())
    for name, _, rows, period in _on_fixed_bases(structure):
        n, period = rows.size, period * second
        low, high = PERIOD[0] * n, PERIOD[1] * (n if n > 1 else OSCILLATOR)
        if not low <= period <= high:
            building = "the building" if name == "building" else f"building {name}"
            yield (
                f"{building} has a period of {period:.3g} s on a fixed base, {n} storeys have "
                f"{low:g} to {high:g} s" + _were(period, low, high, mistakes, " s")
            )
    sliding = (isolated_period(structure) or 0.0) * second
    if sliding > ISOLATED[1]:
        text = f"bearings that slide have a period of {sliding:.3g} s, above {ISOLATED[1]:g} s"
        yield text + _were(sliding, *ISOLATED, OF_RADII, " s")


def _yield_drifts(structure: Structure) -> Iterator[str]:
    """Judge the drifts at which storeys of known heights yield."""
    limits = {slider.direction: slider.limit for slider in structure.sliders}
    rows = map(tuple, structure.drift_rows.tolist())
    storeys = zip(structure.storey_names, rows, structure.names.storey_heights, strict=False)
    drifts = [(name, limits[row], height) for name, row, height in storeys if row in limits]
    mistakes = OF_DRIFTS.get(structure.unit_names.length, ())
    words = "storey {} yields at a drift of {:.4g}, {} of its"
    yield from _shares(drifts, words, YIELDS, mistakes, RATIOS)


def _gaps(structure: Structure) -> Iterator[str]:
    """Judge gaps by the height of the highest storey, or a usual one where none is known."""
    length = structure.unit_names.length
    height = max(structure.names.storey_heights, default=STOREY.get(length, 0.0))
    stops = zip(structure.contact_numbers, structure.contacts, strict=True)
    names = structure.contact_names
    gaps = [(names[k], abs(stop.gap), height) for k, stop in stops if stop.gap and height]
    mistakes = OF_GAPS.get(length, ())
    yield from _shares(gaps, "contact {} has a gap of {:.4g}, {} of the storey", GAPS, mistakes)


def _shares(
    lengths: Sequence[tuple[str, float, float]],
    words: str,
    bounds: tuple[float, float],
    mistakes: Mistakes,
    of_height: Mistakes = (),
) -> Iterator[str]:
    """Yield one line for all lengths (name, length, height) that are implausible."""
    outside = [each for each in lengths if not bounds[0] <= 100.0 * each[1] / each[2] <= bounds[1]]
    if not outside:
        return
    name, length, height = outside[0]
    share, more = 100.0 * length / height, f" (and {len(outside) - 1} more)" * (len(outside) > 1)
    mistakes = (*mistakes, *((height * factor, text) for factor, text in of_height))
    yield (
        f"{words.format(name + more, length, f'{share:.3g} %')} height {height:g}, outside "
        f"{bounds[0]:g} to {bounds[1]:g} %{_were(share, *bounds, mistakes, ' %')}"
    )


def _were(value: float, low: float, high: float, mistakes: Mistakes, unit: str) -> str:
    """Write which mistakes would bring a value within its bounds."""
    explanations = [
        f"{factor * value:.3g}{unit} if {words}"
        for factor, words in mistakes
        if low <= factor * value <= high
    ]
    return "".join(f": {text}" if not k else f", {text}" for k, text in enumerate(explanations))
