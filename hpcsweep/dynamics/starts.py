"""Draw starting states in a box: a scrambled Sobol sequence, shifted at every point.

The sequence fills the unit cube more evenly than independent states do (Owen, J. Complexity 14
(1998) 466: the variance of a mean over scrambled points never exceeds that over independent ones by
more than a constant, and falls faster where the integrand allows). It is scrambled with the seed,
the same for all points (A, Omega), and shifted modulo 1 by a vector determined by the seed, Omega
and A: each start is uniform in the box, the starts of different points are independent, and they do
not depend on what else a study computes.
"""

from functools import lru_cache

import numpy as np

from hpcsweep.model.arguments import array, refused


def usual_reach(structure) -> np.ndarray:
    """Return the default reach of the starts of a structure, shape (2n,).

    Displacements reach to the widest gap, velocities to that times omega_0; for a structure in the
    user's units, times its lowest natural frequency: the speed of that mode through the gap, or of
    a contact where none vibrates. Where all contacts are pressed, as far as the most pressed one.
    """
    n, gaps = structure.n_floors, structure.gaps.tolist()
    gap = max([abs(gap) for gap in gaps if gap > 0.0 or max(gaps) <= 0.0], default=0.0)
    gap = gap or structure.length_unit
    rate = 1.0 if structure.is_uniform else structure.lowest or structure.frequency_unit
    return np.repeat((gap, gap * rate), n)


def box_of(value: object, reach: np.ndarray) -> np.ndarray:
    """Return a validated box of states: pairs (low, high), one for each component.

    Parameters
    ----------
    value : array_like, shape (2n, 2), or None
        None: minus to plus the reach.
    reach : ndarray, shape (2n,)

    Raises
    ------
    ValueError
    """
    if value is None:
        return np.stack((-reach, reach), axis=1)
    box = array("box", value)
    if box.shape != (reach.size, 2):
        raise ValueError(f"box must have shape ({reach.size}, 2), has shape {box.shape}")
    if not (np.all(np.isfinite(box)) and np.all(box[:, 0] < box[:, 1])):
        raise refused("box", "finite, each low below its high", value)
    return box


def starting_states(
    box: np.ndarray, starts: int, seed: int, omega: float, amplitude: float
) -> np.ndarray:
    """Return the starting states of one point.

    Parameters
    ----------
    box : ndarray, shape (2n, 2)
    starts, seed : int
    omega, amplitude : float

    Returns
    -------
    ndarray, shape (starts, 2n)
        The first k of them are those of k starts.
    """
    key = [seed, *np.array([omega, amplitude]).view(np.uint64).tolist()]
    shift = np.random.default_rng(key).random(len(box))
    unit = (_sobol(len(box), max(starts - 1, 0).bit_length(), seed)[:starts] + shift) % 1.0
    return box[:, 0] + unit * (box[:, 1] - box[:, 0])


@lru_cache(maxsize=4)
def _sobol(size: int, power: int, seed: int) -> np.ndarray:
    """Return 2^power scrambled points of the unit cube, shape (2^power, size)."""
    from scipy.stats import qmc  # takes a second to load

    return qmc.Sobol(size, scramble=True, seed=np.random.default_rng(seed)).random_base2(power)
