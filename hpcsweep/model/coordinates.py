"""Coordinates of a motion, in figures and outputs: floors, rows of contacts, drifts, sliders.

A coordinate is a row d of the displacements u, d . u; its stops are those of the contacts whose
direction is a multiple of it.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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


def place_of(names: Sequence[str], word: str) -> int | None:
    """Return the place of a name, or of a number from 1 that is none; None of another word."""
    listed = [*names] if word in names else [str(i) for i in range(1, len(names) + 1)]
    return listed.index(word) if word in listed else None


def coordinate_of(structure: Structure, word: str) -> Coordinate:
    """Return the coordinate that a word names.

    Parameters
    ----------
    structure : Structure
    word : str
        A floor; ``2-1`` the difference of two, ``contact:1``, ``drift:1`` and ``slider:1`` the row
        of one of these, each by number or name.

    Raises
    ------
    ValueError
        If there is none such; the message says what there is.
    """
    names = structure.floor_names
    kind, colon, name = word.partition(":")
    if (place := place_of(names, word)) is not None:
        return floor_coordinate(structure, place)
    contacts = structure.all_contacts.values()
    listed = {
        "contact": (structure.contact_names.values(), [each.direction for each in contacts]),
        "drift": (structure.storey_names, structure.drift_rows),
        "slider": (structure.slider_names, structure.slider_directions),
    }
    if colon and kind in listed:
        labels, rows = [*listed[kind][0]], np.array(listed[kind][1])
        place = place_of(labels, name)
        if place is None:
            limit = f"must be one of {', '.join(labels)}" if labels else f"there is no {kind}"
            raise ValueError(limit)
        symbol = rf"@\ \mathrm{{of\ {kind}\ {re.sub(' ', chr(92) + ' ', name)}}}\ "
        return Coordinate(tuple(rows[place].tolist()), symbol)
    numbers = [str(i + 1) for i in range(len(names))]
    for dash in (match.start() for match in re.finditer("-", word)):
        pair = word[:dash], word[dash + 1 :]
        floors = next(([*each] for each in (names, numbers) if {*pair} <= {*each}), [])
        if floors and pair[0] != pair[1]:
            first, second = (floor_coordinate(structure, floors.index(end)) for end in pair)
            row = np.subtract(first.row, second.row).tolist()
            return Coordinate(tuple(row), f"{first.symbol} - {second.symbol}")
    named = f"1 to {len(names)}" if [*names] == numbers else ", ".join(names)
    words = [f"{kind}:{next(iter(labels))}" for kind, (labels, _) in listed.items() if labels]
    raise ValueError(f"must be a floor, {named}, a difference of two, {' or '.join(words)}")
