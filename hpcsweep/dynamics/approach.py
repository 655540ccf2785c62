"""Integrate starts until they come near a known orbit."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.attractor import FAILED, UNDECIDED
from hpcsweep.dynamics.neighbourhood import Neighbourhood, inside
from hpcsweep.solvers.outcome import Outcome

STRIDE = 8
"""Forcing periods between two tests of the starts."""
WINDOW = 64
"""Last points kept of a start that comes near no known orbit."""


class Approached(NamedTuple):
    """Starts after their approach.

    Attributes
    ----------
    labels : ndarray of int, shape (k,)
        Index of the orbit, `FAILED`, or `UNDECIDED` for a start near none.
    cycles : ndarray of int, shape (k,)
        Forcing periods integrated.
    windows : dict of int to ndarray
        Last points of each undecided start, at most `WINDOW`.
    failures : list of Outcome
    """

    labels: np.ndarray
    cycles: np.ndarray
    windows: dict[int, np.ndarray]
    failures: list[Outcome]


def approach(
    solver,
    amplitude: float,
    starts: np.ndarray,
    known: list[Neighbourhood | None],
    longest: int,
    poll: Callable[[], None] | None = None,
) -> Approached:
    """Integrate each start until it is in a neighbourhood, for some `longest` forcing periods.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    starts : ndarray, shape (k, 2n)
    known : list of Neighbourhood or None
        Of the known attractors.
    longest : int
        Forcing periods after which a start is left at the next test.
    poll : callable, optional
        Called before each stride; may raise to leave.
    """
    labels, cycles = np.full(len(starts), UNDECIDED), np.zeros(len(starts), int)
    failures: list[Outcome] = []
    left, gone = np.arange(len(starts)), 0
    trail = np.empty((len(starts), longest + STRIDE, starts.shape[1]))
    trail[:, 0] = starts
    while left.size:
        there = inside(trail[left, gone], known)
        labels[left[there >= 0]] = there[there >= 0]
        left = left[there < 0]
        if gone >= longest:
            break
        for k in left.tolist():
            if poll is not None:
                poll()
            points, outcome = solver.points(trail[k, gone], amplitude, STRIDE)
            cycles[k] += len(points)
            if outcome is Outcome.COMPLETE:
                trail[k, gone + 1 : gone + 1 + STRIDE] = points
            else:
                labels[k] = FAILED
                failures.append(outcome)
        left = left[labels[left] != FAILED]
        gone += STRIDE
    first = max(gone + 1 - WINDOW, 0)
    windows = {k: trail[k, first : gone + 1] for k in left.tolist()}
    return Approached(labels, cycles, windows, failures)
