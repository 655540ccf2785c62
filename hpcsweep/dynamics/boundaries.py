"""How mixed basins of attraction are: basin entropy and uncertainty exponent of a grid of starts.

The grid is divided into boxes of `BOX` x `BOX` starts. With p_j the shares of a box that go to the
attractors its entropy is S = -sum_j p_j ln p_j. The mean over all boxes is the basin entropy, the
mean over those with two attractors or more the boundary basin entropy: above ln 2 the boundary is
fractal (Daza, Wagemakers, Georgeot, Guery-Odelin, Sanjuan, Scientific Reports 6 (2016) 31416).

A start is uncertain to e if one that is e apart, along an axis of the grid, goes elsewhere. Their
share falls as e^alpha: alpha is the uncertainty exponent, 1 of a smooth boundary, and D = 2 - alpha
the dimension of the boundary in the slice (McDonald, Grebogi, Ott, Yorke, Physica D 17 (1985) 125).
It is the slope of ln f over ln e for e of 1, 2, 4, ... steps by least squares. Its interval is that
of the mean of the slopes between neighbouring e (Student's t), since f is no straight line where a
boundary is curved, or fractal by a ratio other than 2.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE
from hpcsweep.dynamics.stability import CONFIDENCE, UNKNOWN, MeanInterval, student_quantile
from hpcsweep.model.arguments import rows

BOX = 5
"""Starts along each side of a box, as in the paper."""
WIDEST = 16
"""Part of the shorter side of the grid that starts are apart at most."""
FEWEST = 3
"""Scales, at least, of which a slope is told."""


class BasinBoundary(NamedTuple):
    """Measures of the boundary between basins, of one grid of starts.

    Attributes
    ----------
    entropy, boundary_entropy : float
        Basin entropy, and boundary basin entropy, in nats; NaN without a whole box, or without one
        on the boundary.
    exponent : Interval
        Uncertainty exponent, with its 95 % interval; NaN where too few scales tell.
    """

    entropy: float
    boundary_entropy: float
    exponent: MeanInterval


def basin_boundary(labels: np.ndarray) -> BasinBoundary:
    """Return basin entropy and uncertainty exponent of the basins on a grid.

    Parameters
    ----------
    labels : array_like of int, shape (rows, columns)
        Attractor of each start of an evenly spaced grid, such as ``results.label[0, :, 0]`` of a
        study of basins: above 0, or -3 for one that is not listed. Others (0, not computed; -1,
        undecided; -2, failed) do not count.

    Returns
    -------
    BasinBoundary
        ``entropy``, ``boundary_entropy`` and ``exponent`` (mean, low, high).

    Raises
    ------
    ValueError
        If `labels` are no numbers of two dimensions; one line says so.

    References
    ----------
    Daza et al., Scientific Reports 6 (2016) 31416. McDonald et al., Physica D 17 (1985) 125.

    Examples
    --------
    Two basins side by side, on a boundary that cuts every box in its way 3 to 2:

    >>> labels = np.where(np.arange(100) < 53, 1, 2) * np.ones((100, 1))
    >>> found = hpcsweep.basin_boundary(labels)
    >>> round(found.boundary_entropy, 6), round(found.entropy, 6)
    (0.673012, 0.033651)
    >>> round(found.exponent.mean, 6)
    1.0
    """
    labels = rows("labels", labels)
    entropies = _entropies(labels)
    mixed = entropies[entropies > 0]
    mean = float(entropies.mean()) if entropies.size else math.nan
    return BasinBoundary(
        mean, float(mixed.mean()) if mixed.size else math.nan, _uncertainty_exponent(labels)
    )


def _counts(labels: np.ndarray) -> np.ndarray:
    return (labels > 0) | (labels == ELSEWHERE)


def _entropies(labels: np.ndarray) -> np.ndarray:
    """Return the entropy of each box in which any start counts."""
    high, wide = (side // BOX for side in labels.shape)
    boxes = labels[: high * BOX, : wide * BOX].reshape(high, BOX, wide, BOX)
    kinds = np.unique(labels[_counts(labels)])
    held = np.array([(boxes == kind).sum(axis=(1, 3)).ravel() for kind in kinds])
    if not held.any():
        return np.empty(0)
    held = held[:, held.sum(axis=0) > 0]
    shares = held / held.sum(axis=0)
    return -(shares * np.log(np.where(shares > 0, shares, 1.0))).sum(axis=0)


def _uncertainty_exponent(labels: np.ndarray) -> MeanInterval:
    """Return the slope of the logarithm of the share of uncertain starts."""
    apart, uncertain = [], []
    widest = min(labels.shape) // WIDEST
    steps = 2 ** np.arange(widest.bit_length())
    for step in steps.tolist():
        pairs = differ = 0
        for grid in (labels, labels.T):
            # the same starts at every distance
            here = grid[: len(grid) - steps[-1]]
            there = grid[step : step + len(here)]
            both = _counts(here) & _counts(there)
            pairs += int(both.sum())
            differ += int((both & (here != there)).sum())
        if differ:
            apart.append(math.log(step))
            uncertain.append(math.log(differ / pairs))
    if len(apart) < FEWEST:
        return UNKNOWN
    slope = float(np.polyfit(apart, uncertain, 1)[0])
    local = np.diff(uncertain) / np.diff(apart)
    half = student_quantile(local.size - 1, 0.5 + 0.5 * CONFIDENCE) * local.std(ddof=1)
    half = float(half) / math.sqrt(local.size)
    return MeanInterval(slope, slope - half, slope + half)
