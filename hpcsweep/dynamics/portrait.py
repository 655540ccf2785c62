"""Find all attractors at one point (structure, A, Omega), with their shares of starts."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hpcsweep.dynamics.attractor import UNDECIDED, Portrait
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.solvers.outcome import Outcome


def portrait(
    solver,
    amplitude: float,
    seeds: np.ndarray,
    starts: np.ndarray,
    settings,
    max_cycles: int,
    confidence: float,
    poll: Callable[[], None] | None = None,
) -> Portrait:
    """Find the attractors at one point and their shares.

    Parameters
    ----------
    solver : Solver
        Of the structure and the frequency.
    amplitude : float
    seeds : ndarray, shape (m, 2n)
        States whose motions are classified first and do not count for shares.
    starts : ndarray, shape (N, 2n)
    settings : SweepSettings
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    confidence : float
        Confidence of the intervals of the shares, and of the tests of lifetimes.
    poll : callable, optional
        Called before each start and within long ones; may raise to leave.
    """
    search = AttractorSearch(solver, amplitude, settings, max_cycles, confidence, poll)
    for seed in seeds:
        search.classify(seed)
    labels = search.labels(starts)
    found = []
    for place, attractor in enumerate(search.attractors):
        hits, total = int((labels == place).sum()), len(starts)
        low, high = share_interval(hits, total, confidence)
        share = hits / total if total else 0.0
        found.append(replace(attractor, hits=hits, share=share, share_low=low, share_high=high))
    outcome = Outcome.COMPLETE
    if search.failures and not found and not np.any(labels == UNDECIDED):
        outcome = search.failures.most_common(1)[0][0]
    return Portrait(
        found,
        labels,
        search.cycles,
        outcome,
        search.n_transient,
        search.transient.lifetime(confidence),
    )
