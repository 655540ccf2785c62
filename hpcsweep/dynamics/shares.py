"""Shares of a box of states: estimates, confidence intervals, and how many starts are enough.

Of N independent starts, uniform in the box, the number k that reach an attractor whose basin fills
the share s of the box is binomial. An attractor of share s is missed by all of them with
probability (1 - s)^N, which is at most alpha from N = ln alpha / ln(1 - s) on: 459 starts for
s = alpha = 1 %.

The interval is that of Clopper and Pearson (Biometrika 26 (1934) 404): all shares that a test at
level (1 - confidence) / 2 on either side does not refuse. It holds the true share at least as often
as its confidence says for every share and N, also for k = 0 and k = N, where an interval from the
normal distribution has no width. The price is that it is wider than necessary; low-discrepancy
starts, whose numbers scatter less than independent ones, make it safer still.
"""

import math


def starts_needed(share: float, risk: float) -> int:
    """Return the number of starts that miss an attractor of a share with probability <= `risk`.

    Parameters
    ----------
    share, risk : float
        Between 0 and 1.
    """
    return math.ceil(math.log(risk) / math.log1p(-share) - 1e-9)


def share_interval(hits: int, starts: int, confidence: float) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a share.

    Parameters
    ----------
    hits, starts : int
        k of N.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    low, high : float
        (0, 1) without starts.
    """
    from scipy.special import betaincinv  # the other commands do not need it

    tail = 0.5 * (1.0 - confidence)
    low = float(betaincinv(hits, starts - hits + 1, tail)) if hits else 0.0
    high = float(betaincinv(hits + 1, starts - hits, 1.0 - tail)) if hits < starts else 1.0
    return low, high
