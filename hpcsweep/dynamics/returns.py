"""Return times: how many forcing periods pass until a motion is again near a state.

By Kac's lemma their mean is the inverse of the share of the time that the motion spends there, in
chaos as on a torus; on a circle they take three values at most, of which one is the sum of the
others (Slater, Proc. Camb. Phil. Soc. 63 (1967) 1115). Their mean has the interval of batch means
(`stability`), since one return may tell of the next.
"""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.stability import MeanInterval, growth_interval
from hpcsweep.model.arguments import finite_vector, not_negative, rows


class ReturnTimes(NamedTuple):
    """Return times of a motion.

    Attributes
    ----------
    times : ndarray of int, shape (k,)
        Forcing periods between visits that follow each other.
    mean : Interval
        Their mean with its 95 % interval, (mean, low, high); NaN of fewer than 10.
    """

    times: np.ndarray
    mean: MeanInterval


def return_times(points: Any, state: Any, distance: float) -> ReturnTimes:
    """Return the times after which a motion returns to the neighbourhood of a state.

    Parameters
    ----------
    points : array_like, shape (N, 2n)
        Consecutive stroboscopic points, as of `stroboscopic_points`.
    state : array_like, shape (2n,)
        Centre of the neighbourhood.
    distance : float
        Largest difference of any component there, in the units of the points.

    Returns
    -------
    ReturnTimes
        ``times``, in forcing periods, and their ``mean`` (mean, low, high).

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.

    References
    ----------
    Kac, Bull. Amer. Math. Soc. 53 (1947) 1002.

    Examples
    --------
    A motion of period 3 returns to each of its points after 3 forcing periods:

    >>> points = [[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]] * 20
    >>> hpcsweep.return_times(points, [0.5, 0.5], 1e-6).mean.mean
    3.0
    """
    visited = rows("points", points)
    centre = finite_vector("state", state, visited.shape[1])
    near = np.abs(visited - centre).max(axis=1) <= not_negative("distance", distance)
    times = np.diff(np.flatnonzero(near))
    return ReturnTimes(times, growth_interval(times.astype(float)))
