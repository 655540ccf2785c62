"""Lifetimes of motions without a period: how long they last, and when one counts as an attractor.

Chaos may be a transient. Near a chaotic saddle the share of motions that are still there after t
forcing periods falls as exp(-kappa t), once they have forgotten where they began (Lai and Tel,
Transient Chaos, 2011, 1.2), so that no window tells it from an attractor, and only lifetimes do.
If motions were followed for S periods together, and d of them ended, the likelihood is kappa^d
exp(-kappa S), whether each was followed to its end or left before: the most likely rate of escape
is d / S, the mean lifetime S / d, and the interval is that of a Poisson mean of which d was counted
(Garwood, Biometrika 28 (1936) 437),

    chi2(2 d, (1 - c) / 2) / 2  <=  kappa S  <=  chi2(2 d + 2, (1 + c) / 2) / 2.

Where none ended, mean lifetimes below S / -ln(1 - c) are refused with confidence c, in S periods of
one motion or of many alike. A motion counts as an attractor if none of its own motions ended within
`periods_at_risk`, that is if its mean lifetime exceeds `HORIZON` times the length for which single
motions are followed.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hpcsweep.dynamics.stability import UNKNOWN, MeanInterval
from hpcsweep.model.arguments import array, number, refused

HORIZON = 8
"""Mean lifetime, in units of ``max_cycles``, that a motion without period must exceed."""
CHUNK = 512
"""Forcing periods after which a motion that is followed is looked at."""
MAX_STRETCHES = 10
"""Stretches for which transient motions are followed, each with twice the periods at risk of the
one before: so that no motion passes one of many tests by chance."""

End = TypeVar("End")


class Survival(NamedTuple):
    """Motions of one kind that were followed: how many ended, and the periods of all together."""

    escapes: int = 0
    at_risk: float = 0

    def lifetime(self, confidence: float) -> MeanInterval:
        """Return the mean lifetime in forcing periods, with the interval of a confidence.

        Where none ended, the mean is infinite and the lower end one-sided; NaN where none was
        followed.
        """
        from scipy.special import gammaincinv  # the other commands do not need it

        d, periods = self
        if periods == 0:
            return UNKNOWN
        if d == 0:
            return MeanInterval(math.inf, periods / -math.log1p(-confidence), math.inf)
        tail = 0.5 * (1.0 - confidence)
        high = periods / float(gammaincinv(d, tail))
        return MeanInterval(periods / d, periods / float(gammaincinv(d + 1, 1.0 - tail)), high)


def mean_lifetime(periods: Any, ended: Any, confidence: float = 0.95) -> MeanInterval:
    """Return the mean lifetime of motions that were followed, also of those that had not ended.

    Lifetimes are exponential, as of transient chaos that has forgotten where it began: leave out
    the first periods.

    Parameters
    ----------
    periods : array_like, shape (k,)
        Forcing periods, above 0, for which each motion was followed.
    ended : array_like of bool, shape (k,)
        Whether it has then ended, or was left.
    confidence : float
        Of the interval, between 0 and 1.

    Returns
    -------
    Interval
        ``mean``, ``low`` and ``high`` in forcing periods; where none ended the mean is infinite,
        and ``low`` one-sided.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.

    References
    ----------
    Garwood, Biometrika 28 (1936) 437. Lai and Tel, *Transient Chaos*, 2011, 1.2.

    Examples
    --------
    Two of three motions have ended:

    >>> found = hpcsweep.mean_lifetime([400, 150, 1000], [True, True, False])
    >>> found.mean, round(found.low), round(found.high)
    (775.0, 215, 6399)
    """
    lives, over = array("periods", periods), np.asarray(ended)
    if lives.ndim != 1 or not np.all((lives > 0) & (lives < math.inf)):
        raise refused("periods", "numbers above 0, one a motion", periods)
    if over.dtype != bool or over.shape != lives.shape:
        raise refused("ended", f"true or false of each of the {lives.size} motions", ended)
    confidence = number("confidence", confidence, "between 0 and 1", 1e-9, 1 - 1e-9)
    return Survival(int(over.sum()), float(lives.sum())).lifetime(confidence)


def periods_at_risk(max_cycles: int, confidence: float) -> int:
    """Return the forcing periods that refuse mean lifetimes up to `HORIZON` `max_cycles`."""
    return math.ceil(-math.log1p(-confidence) * HORIZON * max_cycles)


def outlive(
    step: Callable[[np.ndarray, int], tuple[np.ndarray, int, End | None]],
    state: np.ndarray,
    periods: int,
) -> tuple[np.ndarray, int, End | None]:
    """Follow a motion until it ends, for so many forcing periods.

    Parameters
    ----------
    step : callable
        Follows a state for at most so many forcing periods: returns the state it has come to, how
        many it took, and how the motion has ended, None if it has not.
    state : ndarray, shape (2n,)
    periods : int

    Returns
    -------
    state : ndarray, shape (2n,)
    n_periods : int
    end : object or None
    """
    done = 0
    while done < periods:
        state, n_periods, end = step(state, min(CHUNK, periods - done))
        done += max(n_periods, 1)
        if end is not None:
            return state, done, end
    return state, done, None


def follow_to_ends(
    follow: Callable[[np.ndarray, int], tuple[np.ndarray, int, End | None]],
    states: np.ndarray,
    at_risk: int,
) -> tuple[list[End | None], np.ndarray, bool]:
    """Follow motions that look alike to their ends, for ever longer stretches.

    Parameters
    ----------
    follow : callable
        As `step` of `outlive`, for as long as it is asked to.
    states : ndarray, shape (N, 2n)
        Replaced by those that the motions have come to.
    at_risk : int
        Forcing periods of the first stretch, of all together.

    Returns
    -------
    ends : list of object or None
        None of those that have not ended.
    ages : ndarray of int, shape (N,)
        Forcing periods for which each was followed.
    outlived : bool
        Whether those that have not ended have outlived a stretch in which none did.
    """
    ends: list[End | None] = [None] * len(states)
    ages, left = np.zeros(len(states), int), list(range(len(states)))
    for _ in range(MAX_STRETCHES if left else 0):
        length = max(math.ceil(at_risk / len(left)), CHUNK)
        for k in left:
            states[k], n_periods, ends[k] = follow(states[k], length)
            ages[k] += n_periods
        still = [k for k in left if ends[k] is None]
        if len(still) in (0, len(left)):
            return ends, ages, bool(still)
        left, at_risk = still, 2 * at_risk
    return ends, ages, False
