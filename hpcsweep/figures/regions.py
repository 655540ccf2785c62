"""Contact regions of an orbit diagram: where the contact sets up and down are the same."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Region:
    """A range of amplitudes in which the pair of contact sets does not change.

    Attributes
    ----------
    first, last : int
        Amplitude indices, inclusive.
    contacts : tuple of int
        Contact sets seen, up first, each once.
    """

    first: int
    last: int
    contacts: tuple[int, ...]


def contact_regions(contact: np.ndarray, valid: np.ndarray, least: int = 3) -> list[Region]:
    """Divide the amplitudes into regions of equal contact sets.

    Parameters
    ----------
    contact : ndarray of int, shape (n_directions, n_amplitudes)
    valid : ndarray of bool, same shape
        Runs that are there and did not fail.
    least : int
        A shorter stretch (a single run in a chaotic band, say) belongs to the one before it.

    Returns
    -------
    list of Region
        In ascending amplitude; amplitudes without a valid run are in none.
    """
    groups: list[tuple[int, int, tuple[int, ...]]] = []
    for index in range(contact.shape[1]):
        seen = tuple(dict.fromkeys(int(c) for c in contact[valid[:, index], index]))
        if groups and groups[-1][2] == seen:
            groups[-1] = (groups[-1][0], index, seen)
        else:
            groups.append((index, index, seen))
    merged: list[tuple[int, int, tuple[int, ...]]] = []
    for first, last, seen in groups:
        short = last - first + 1 < least
        if merged and (short or merged[-1][2] == seen):
            merged[-1] = (merged[-1][0], last, merged[-1][2])
        else:
            merged.append((first, last, seen))
    return [Region(*group) for group in merged if group[2]]
