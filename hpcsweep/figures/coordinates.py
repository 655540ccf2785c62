"""Coordinates of a motion that figures show: floors, differences of two, contacts, drifts.

A coordinate is a row d of the displacements u, d . u; its stops are those of the contacts whose
direction is a multiple of it.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hpcsweep.figures.style import PlotError, choose_floors, place_of
from hpcsweep.model.structure import Structure

PARALLEL = 1e-9
"""Part of a row by which it may differ from a multiple of another."""


class Coordinate(NamedTuple):
    """A row d of displacements.

    Attributes
    ----------
    row : tuple of n floats
        d.
    symbol : str
        Of the displacement, in mathtext, with ``@`` for u; ``v`` in its place is the velocity.
    """

    row: tuple[float, ...]
    symbol: str

    def of(self, states: np.ndarray, is_velocity: bool = False) -> np.ndarray:
        """Return d . u, or d . v, of states (..., 2n and more), shape (...)."""
        n, (at, *more) = len(self.row), np.flatnonzero(self.row).tolist()
        part = states[..., n : 2 * n] if is_velocity else states[..., :n]
        return part[..., at] if not more and self.row[at] == 1.0 else part @ np.array(self.row)

    def stops(self, structure: Structure) -> tuple[list[float], list[float]]:
        """Return its values at its right and its left stops."""
        sides: tuple[list[float], list[float]] = [], []
        row = np.array(self.row)
        for direction, contact in zip(structure.directions, structure.contacts, strict=True):
            share = direction @ row / (row @ row)
            if share and np.abs(direction - share * row).max() <= PARALLEL * abs(share):
                sides[bool(share < 0)].append(float(contact.gap / share))
        return sides


def floor_coordinate(structure: Structure, floor: int) -> Coordinate:
    """Return that of a floor, from 0."""
    name = structure.floor_names[floor]
    symbol = rf"@_{{\mathrm{{{name}}}}}" if structure.names.floors else f"@_{{{name}}}"
    return Coordinate(tuple(np.eye(structure.n_floors)[floor].tolist()), symbol)


def coordinates(structure: Structure, chosen: Sequence[int | str] = ()) -> list[Coordinate]:
    """Return the coordinates to show: floors, ascending, then others as they are given.

    Parameters
    ----------
    structure : Structure
    chosen : sequence of int or str, optional
        Floors, see `style.choose_floors`; ``2-1`` the difference of two, ``contact:1`` and
        ``drift:1`` the row of a contact or of a drift, by number or name.

    Raises
    ------
    PlotError
        If there is none such.
    """
    floors, others = list[str](), list[Coordinate]()
    for word in map(str, chosen):
        found = _other(structure, word)
        if found is None:
            floors.append(word)
        elif found not in others:
            others.append(found)
    shown = choose_floors(structure.floor_names, floors) if floors or not others else []
    return [*(floor_coordinate(structure, floor) for floor in shown), *others]


def _other(structure: Structure, word: str) -> Coordinate | None:
    """Return a coordinate that is no floor; None for the name or the number of one."""
    names = structure.floor_names
    kind, colon, name = word.partition(":")
    if place_of(names, word) is not None:
        return None
    if colon and kind in ("contact", "drift"):
        labels, rows = [*structure.storey_names], structure.drift_rows
        if kind == "contact":
            labels = [structure.contact_names[k] for k in structure.contact_numbers]
            rows = structure.directions
        place = place_of(labels, name)
        if place is None:
            limit = f"must be one of {', '.join(labels)}" if labels else f"there is no {kind}"
            raise PlotError(f"--row {word}: {limit}")
        symbol = rf"@\ \mathrm{{of\ {kind}\ {re.sub(' ', chr(92) + ' ', name)}}}\ "
        return Coordinate(tuple(rows[place].tolist()), symbol)
    numbers = [str(i + 1) for i in range(len(names))]
    for dash in (match.start() for match in re.finditer("-", word)):
        pair = word[:dash], word[dash + 1 :]
        listed = next(([*each] for each in (names, numbers) if {*pair} <= {*each}), [])
        if listed and pair[0] != pair[1]:
            first, second = (floor_coordinate(structure, listed.index(end)) for end in pair)
            row = np.subtract(first.row, second.row).tolist()
            return Coordinate(tuple(row), f"{first.symbol} - {second.symbol}")
    return None
