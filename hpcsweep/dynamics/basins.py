"""All attractors at one point (structure, A, Omega): their shares of starts, and their basins.

A portrait counts the starts that reach each. For basins the attractors are found once, from given
starts, and ordered by how many starts reach each. Then any number of states are classified by them,
group by group. Further motions found in a group are dropped after it: the label of a state depends
only on the attractors and its group, so that groups can be classified in any order, on any number
of processes.
"""

from dataclasses import replace

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, UNDECIDED, Attractor, Portrait
from hpcsweep.dynamics.attractors import MAX_GROUP, AttractorSearch
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll

CONFIDENCE = 0.95
"""Confidence of the tests of lifetimes."""


class StateBasins:
    """Attractors of a point, and classification of states by them.

    Parameters
    ----------
    search : AttractorSearch
        At the point.
    starts : ndarray, shape (N, 2n)
        Starts from which the attractors are found.
    most : int
        Number of listed attractors, those that most of `starts` reach.

    Attributes
    ----------
    attractors : list of Attractor
        In order of decreasing `hits`.
    """

    def __init__(self, search: AttractorSearch, starts: np.ndarray, most: int):
        self._search = search
        labels = self._search.labels(starts)
        attractors = self._search.attractors
        hits = np.bincount(labels[labels >= 0], minlength=len(attractors))
        order = np.argsort(-hits, kind="stable")[:most]
        self.attractors: list[Attractor] = [
            replace(attractors[place], hits=int(hits[place])) for place in order.tolist()
        ]
        self._listed = np.full(len(attractors), ELSEWHERE)
        self._listed[order] = np.arange(order.size)

    def labels(self, states: np.ndarray, poll: Poll = None) -> tuple[np.ndarray, int]:
        """Classify a group of states.

        Parameters
        ----------
        states : ndarray, shape (k, 2n)
        poll : callable, optional
            Called before each start and within long ones; may raise to leave.

        Returns
        -------
        labels : ndarray of int, shape (k,)
            Index in `attractors`, or `attractor.UNDECIDED`, `FAILED`, or `ELSEWHERE`.
        cycles : int
            Forcing periods integrated.
        """
        search = self._search.fork(poll)
        return self._of_list(search.labels(states, MAX_GROUP)), search.cycles

    def alone(self, states: np.ndarray, poll: Poll = None) -> tuple[np.ndarray, np.ndarray]:
        """Classify states, each as a group of its own; see `labels`.

        Returns
        -------
        labels, cycles : ndarray of int, shape (k,)
            Of each state.
        """
        labels, cycles = self._search.fork(poll).alone(states)
        return self._of_list(labels), cycles

    def _of_list(self, labels: np.ndarray) -> np.ndarray:
        """Return the labels of a search as indices in `attractors`."""
        listed = (labels >= 0) & (labels < self._listed.size)
        labels[labels >= self._listed.size] = ELSEWHERE
        labels[listed] = self._listed[labels[listed]]
        return labels


def portrait(search: AttractorSearch, seeds: np.ndarray, starts: np.ndarray) -> Portrait:
    """Find the attractors at the point of a search and their shares.

    Parameters
    ----------
    search : AttractorSearch
        Its confidence is also that of the intervals of the shares.
    seeds : ndarray, shape (m, 2n)
        States whose motions are classified first and do not count for shares.
    starts : ndarray, shape (N, 2n)
    """
    for seed in seeds:
        search.classify(seed)
    labels = search.labels(starts)
    attractors = []
    for place, attractor in enumerate(search.attractors):
        hits, total = int((labels == place).sum()), len(starts)
        low, high = share_interval(hits, total, search.confidence)
        share = hits / total if total else 0.0
        attractors.append(
            replace(attractor, hits=hits, share=share, share_low=low, share_high=high)
        )
    outcome = Outcome.COMPLETE
    if search.failures and not attractors and not np.any(labels == UNDECIDED):
        outcome = search.failures.most_common(1)[0][0]
    transient = search.n_transient, search.transient.lifetime(search.confidence)
    return Portrait(attractors, labels, search.cycles, outcome, *transient)
