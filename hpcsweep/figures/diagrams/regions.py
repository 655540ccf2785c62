"""Contact regions of an orbit diagram: ranges of amplitude with the same contact sets.

As in Figure 3 of the paper, a region is identified by the contact sets of the sweeps up and down,
and by whether sweeps with the same set are on one solution or on two.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hpcsweep.dynamics.classify import MotionClass

APART = 0.02
"""Distance (in units of the state) between the points of two orbits above which they are two."""
FREE = (0,)
"""Sets seen where both sweeps are free of contact."""
MIN_COEXISTENCE = 0.02
"""Part of the amplitudes over which two solutions of one contact set must last to be a region:
hysteresis at the ends of a periodic window is shorter and belongs to the window."""


@dataclass(frozen=True)
class Region:
    """A range of amplitudes in which the pair of contact sets does not change.

    Attributes
    ----------
    first, last : int
        Amplitude indices, inclusive.
    contacts : tuple of int
        Contact sets seen, up first, each once; twice the same if two solutions have it.
    """

    first: int
    last: int
    contacts: tuple[int, ...]


def contact_regions(
    contact: np.ndarray, valid: np.ndarray, least: int, coexisting: np.ndarray
) -> list[Region]:
    """Divide the amplitudes into regions of equal contact sets.

    Parameters
    ----------
    contact : ndarray of int, shape (n_directions, n_amplitudes)
    valid : ndarray of bool, same shape
        Computed runs that did not fail.
    least : int
        A shorter stretch (e.g. a single run in a chaotic band) belongs to the one before it, but
        successive first contacts do not belong to the stretch without contact.
    coexisting : ndarray of bool, shape (n_amplitudes,)
        Where up and down are on different solutions; see `coexistence`.

    Returns
    -------
    list of Region
        In ascending amplitude; amplitudes without a valid run are in none.
    """
    n_amplitudes = contact.shape[1]
    seen = [
        tuple(dict.fromkeys(int(c) for c in contact[valid[:, index], index]))
        for index in range(n_amplitudes)
    ]
    longest = max(least, round(MIN_COEXISTENCE * n_amplitudes))
    regions = []
    for first, last, sets in _merge(seen, least):
        inside = [sets * 2 if there else sets for there in coexisting[first : last + 1]]
        parts = _merge(inside, longest, sets) if len(sets) == 1 else [(0, last - first, sets)]
        regions += [Region(first + a, first + b, part) for a, b, part in parts if part]
    return regions


def _merge(seen: list[tuple[int, ...]], least: int, start: tuple[int, ...] | None = None):
    """Join equal neighbours into (first, last, value), short stretches to the one before.

    The first contact after none is a region of its own, however short, unless it is lost again. A
    short stretch at the beginning counts as `start`, if given.
    """
    groups: list[list] = []
    for index, value in enumerate(seen):
        if groups and groups[-1][2] == value:
            groups[-1][1] = index
        else:
            groups.append([index, index, value])
    if start is not None and groups[0][1] - groups[0][0] + 1 < least:
        groups[0][2] = start
    merged: list[tuple[int, int, tuple[int, ...]]] = []
    for place, (first, last, value) in enumerate(groups):
        short = last - first + 1 < least
        if merged and merged[-1][2] == FREE and value and 0 not in value:
            # consecutive short stretches with contact are not free of it
            short &= place + 1 == len(groups) or 0 in groups[place + 1][2]
        if merged and (short or merged[-1][2] == value):
            merged[-1] = (merged[-1][0], last, merged[-1][2])
        else:
            merged.append((first, last, value))
    return merged


def coexistence(frame, classes: np.ndarray, units_at: Callable) -> np.ndarray:
    """Return the amplitudes at which the sweeps up and down of a frame are on different solutions.

    Two periodic motions differ if their periods do or if a point of one is farther than `APART`
    from all points of the other; a periodic motion and a chaotic one differ. Two chaotic motions
    are not distinguished, and undecided ones differ from nothing.

    Parameters
    ----------
    frame : xarray.Dataset
        One frame of a campaign, with ``poincare``.
    classes : ndarray of int, shape (n_directions, n_amplitudes)
        `MotionClass` of its runs.
    units_at : callable (omega, amplitude, place)
        Units of the states, as of `RunGrid`.

    Returns
    -------
    ndarray of bool, shape (n_amplitudes,)
    """
    differ = np.zeros(classes.shape[1], bool)
    if classes.shape[0] < 2:
        return differ
    repeats = np.isin(classes, (MotionClass.PERIODIC, MotionClass.NO_CONTACT))
    chaos = classes == MotionClass.CHAOTIC
    differ |= (repeats[0] & chaos[1]) | (chaos[0] & repeats[1])
    points, counts = frame["poincare"].values, frame["n_points"].values
    period = frame["orbit_period"].values
    for index in np.flatnonzero(repeats.all(axis=0)).tolist():
        forcing = (frame[name].values for name in ("omega", "amplitude"))
        omega, amplitude = (float(x[index] if x.ndim else x) for x in forcing)
        units = units_at(omega, amplitude, index)
        up, down = (points[d, index, : counts[d, index]] / units for d in (0, 1))
        gaps = np.abs(up[:, None] - down[None]).max(axis=2)
        differ[index] = (
            period[0, index] != period[1, index]
            or max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) > APART
        )
    return differ
