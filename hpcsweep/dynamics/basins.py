"""Basins of attraction at one point (structure, A, Omega): to which attractor a state goes.

The attractors are found once, from starts that are given, and ordered by how many reach each. Then
any number of states is told by them, group by group. What a group finds besides is forgotten after
it: the label of a state depends on the attractors and on its group alone, so that groups can be
told in any order, on any number of processes.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hpcsweep.dynamics.attractor import Attractor
from hpcsweep.dynamics.attractors import LARGEST_GROUP, AttractorSearch

ELSEWHERE = -3
"""In place of an attractor's number: one that is not listed."""


class Basins:
    """The attractors of a point, and what states go to.

    Parameters
    ----------
    solver : Solver
        Of the structure and the frequency.
    amplitude : float
    starts : ndarray, shape (N, 2n)
        Of which the attractors are found.
    settings : SweepSettings
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    most : int
        Attractors that are listed, those that most of `starts` reach.
    poll : callable, optional
        Called before each start and within long ones; may raise to leave.

    Attributes
    ----------
    attractors : list of Attractor
        By falling `hits`.
    """

    def __init__(
        self,
        solver,
        amplitude: float,
        starts: np.ndarray,
        settings,
        max_cycles: int,
        most: int,
        poll: Callable[[], None] | None = None,
    ):
        self._search = AttractorSearch(solver, amplitude, settings, max_cycles, poll)
        labels = self._search.confirmed(self._search.labels(starts))
        found = self._search.attractors
        hits = np.bincount(labels[labels >= 0], minlength=len(found))
        order = np.argsort(-hits, kind="stable")[:most]
        self.attractors: list[Attractor] = [
            replace(found[place], hits=int(hits[place])) for place in order.tolist()
        ]
        self._listed = np.full(len(found), ELSEWHERE)
        self._listed[order] = np.arange(order.size)

    def labels(
        self, states: np.ndarray, poll: Callable[[], None] | None = None
    ) -> tuple[np.ndarray, int]:
        """Classify a group of states.

        Parameters
        ----------
        states : ndarray, shape (k, 2n)
        poll : callable, optional
            As above.

        Returns
        -------
        labels : ndarray of int, shape (k,)
            Place in `attractors`, or `attractor.UNDECIDED`, `FAILED`, or `ELSEWHERE`.
        cycles : int
            Forcing periods integrated.
        """
        search = self._search.fork(poll)
        labels = search.labels(states, LARGEST_GROUP)
        known = (labels >= 0) & (labels < self._listed.size)
        labels[labels >= self._listed.size] = ELSEWHERE
        labels[known] = self._listed[labels[known]]
        return labels, search.cycles
