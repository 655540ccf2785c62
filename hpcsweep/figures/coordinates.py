"""Coordinates of a motion that a figure shows."""

from collections.abc import Sequence

from hpcsweep.figures.style import PlotError, choose_floors
from hpcsweep.model.coordinates import Coordinate, coordinate_of, floor_coordinate, place_of
from hpcsweep.model.structure import Structure


def coordinates(structure: Structure, chosen: Sequence[int | str] = ()) -> list[Coordinate]:
    """Return the coordinates to show: floors, ascending, then others as they are given.

    Parameters
    ----------
    structure : Structure
    chosen : sequence of int or str, optional
        Floors, see `style.choose_floors`, or other words of `coordinate_of`.

    Raises
    ------
    PlotError
        If there is none such.
    """
    floors, others = list[str](), dict[Coordinate, None]()
    for word in map(str, chosen):
        is_floor = place_of(structure.floor_names, word) is not None or word.isdigit()
        if is_floor:
            floors.append(word)
            continue
        try:
            others[coordinate_of(structure, word)] = None
        except ValueError as error:
            raise PlotError(f"--row {word}: {error}") from None
    shown = choose_floors(structure.floor_names, floors) if floors or not others else []
    return [*(floor_coordinate(structure, floor) for floor in shown), *others]
