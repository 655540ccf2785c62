"""Floquet multipliers of orbits, and the largest Lyapunov exponent of motions.

Over a stretch of a motion the exponent has a confidence interval. The logarithms l_1, ..., l_k of
the factor by which a tangent vector grows in each forcing period are correlated: an impact that
stretches it is followed by others. Means over batches of k / B of them are nearly independent once
a batch is longer than the correlation, and nearly normal; their mean is that of the growth a
period, and Student's t with B - 1 degrees of freedom gives its interval (method of batch means;
Law, Simulation Modeling and Analysis, 5th ed., section 9.5.3).
"""

import math
from functools import cached_property, lru_cache, reduce
from typing import NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import ISOLATED

STICKS = 1e-6
"""Difference from 1 of what is 1: derivatives of p of sliders that stick, which are differences."""
MAX_PRODUCT = 1e6
"""Growth of errors of tangent maps up to which their product has its multipliers to 1e-10."""
BATCHES = 10
"""B of a stretch; each must have at least one period."""
CONFIDENCE = 0.95
"""Confidence of both sides of the interval together."""
ALIGNING = 10
"""The first 1/10 of a stretch is dropped."""


def floquet_multipliers(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of a monodromy matrix, largest modulus first, shape (2n,).

    The system is forced, so no multiplier is trivial and all are returned. Their product is
    exp(-p T tr(2 gamma C)).

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is not finite.
    """
    multipliers = np.linalg.eigvals(matrix)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def without_families(structure: Structure, matrix: np.ndarray) -> np.ndarray:
    """Return the monodromy matrix of an orbit of sliders transverse to the family that it is in.

    A slider that sticks over the whole orbit keeps its p, whatever that is: the row of p is that of
    the identity. Nor does it matter where a structure stands along directions that no spring
    opposes once the others slip (`Structure.mechanisms`), unless a contact does over the orbit,
    which M tells. Each of these gives a multiplier of 1: in a basis of these directions first M is
    [[1, X], [0, R]].

    Parameters
    ----------
    structure : Structure
    matrix : ndarray, shape (2n + L, 2n + L)
        M, in units of the state (u, u', p).

    Returns
    -------
    ndarray, shape (m, m)
        R.
    """
    from scipy.linalg import null_space  # reading results does not need it

    size, rows = 2 * structure.n_floors, structure.slider_directions
    sticks = np.abs(matrix - np.eye(len(matrix)))[size:].max(axis=1, initial=0.0) <= STICKS
    kept = np.append(np.full(size, True), ~sticks)
    matrix, along = matrix[kept][:, kept], structure.mechanisms
    along = along @ null_space(rows[sticks] @ along) if sticks.any() and along.size else along
    if along.size:
        moved = np.vstack((along, np.zeros_like(along), rows[~sticks] @ along))
        moved = np.linalg.qr(moved / structure.state_units[kept][:, None])[0]
        _, changes, combined = np.linalg.svd(matrix @ moved - moved)
        moved = moved @ combined[changes <= STICKS].T
        rest = null_space(moved.T) if moved.size else np.eye(len(matrix))
        matrix = rest.T @ matrix @ rest
    return matrix


def held(matrices: np.ndarray, count: int) -> np.ndarray:
    """Return tangent maps of an orbit on which each of `count` sliders that sticks forgets its p.

    See `hpcsweep.dynamics.continuation.borders`.

    Parameters
    ----------
    matrices : ndarray, shape (p, 2n + L, 2n + L)
        In units of the state (u, u', p); changed in place.
    count : int
        L.
    """
    size = matrices.shape[-1] - count
    moved = np.abs(matrices - np.eye(size + count))[:, size:].max(axis=(0, 2))
    matrices[-1, size + np.flatnonzero(moved <= STICKS)] = 0.0
    return matrices


class Tests(NamedTuple):
    """Functions of multipliers that vanish at special points.

    Attributes
    ----------
    fold : float
        prod (1 - mu) / (1 + |mu|).
    doubling : float
        prod (1 + mu) / (1 + |mu|).
    torus : float
        Product over pairs of (1 - mu_i mu_j) / (1 + |mu_i mu_j|).
    """

    fold: float
    doubling: float
    torus: float

    @classmethod
    def of(cls, multipliers: list[complex]) -> "Tests":
        """Evaluate them for some multipliers: Python numbers, since there are few."""
        fold = doubling = torus = complex(1.0)
        for i, mu in enumerate(multipliers):
            size = 1.0 + abs(mu)
            fold *= (1.0 - mu) / size
            doubling *= (1.0 + mu) / size
            for other in multipliers[:i]:
                pair = mu * other
                torus *= (1.0 - pair) / (1.0 + abs(pair))
        return cls(fold.real, doubling.real, torus.real)


class TangentMaps:
    """The tangent maps along an orbit, shape (p, N, N), and what follows from them."""

    def __init__(self, matrices: np.ndarray):
        self.matrices = matrices

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, the eigenvalues of M_{p-1} ... M_0, largest modulus first.

        To first order a relative error of each M_i changes their product P by up to it times

            sum_i |M_{p-1} ... M_{i+1}| |M_i| |M_{i-1} ... M_0|.

        Where this is large they are the p-th powers of the eigenvalues of the block cyclic matrix
        of the M_i, which has each p times and is as well scaled as each M_i (Kressner, Numerical
        Methods for General and Structured Eigenvalue Problems, 2005, 3.3).
        """
        p, n, _ = self.matrices.shape
        if p == 1:
            return floquet_multipliers(self.matrices[0])
        before, after = [np.eye(n)], [np.eye(n)]
        for first, last in zip(self.matrices, self.matrices[::-1], strict=True):
            before.append(first @ before[-1])
            after.append(after[-1] @ last)
        factors = before[:-1], self.matrices, after[-2::-1]
        sizes = [np.linalg.norm(each, axis=(1, 2)) for each in factors]
        if np.prod(sizes, axis=0).sum() <= MAX_PRODUCT:
            return floquet_multipliers(before[-1])
        return self.cyclic_multipliers

    @cached_property
    def cyclic_multipliers(self) -> np.ndarray:
        """The multipliers as powers of eigenvalues of the block cyclic matrix: small ones, too."""
        from scipy.linalg import block_diag  # it is seldom needed

        p, n, _ = self.matrices.shape
        cyclic = np.roll(block_diag(*self.matrices), n, axis=0)
        powers = np.linalg.eigvals(cyclic) ** p
        multipliers = np.empty(n, complex)
        for k in range(n):
            largest = powers[np.argmax(np.abs(powers))]
            order = np.argsort(np.abs(powers - largest), kind="stable")
            multipliers[k] = powers[order[:p]].mean()
            powers = powers[order[p:]]
        return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]

    @cached_property
    def outside(self) -> tuple[int, int]:
        """Numbers of real and of complex multipliers outside the unit circle."""
        outside = [mu for mu in self.multipliers.tolist() if abs(mu) > 1.0]
        paired = sum(mu.imag != 0.0 for mu in outside)
        return len(outside) - paired, paired

    @cached_property
    def tests(self) -> Tests:
        """Functions of the multipliers that vanish at special points."""
        return Tests.of(self.multipliers.tolist())

    @cached_property
    def product(self) -> np.ndarray:
        """M_{p-1} ... M_0, shape (N, N); not finite where it overflows."""
        size = self.matrices.shape[1]
        with np.errstate(over="ignore", invalid="ignore"):
            return reduce(lambda product, matrix: matrix @ product, self.matrices, np.eye(size))


def orbit_exponent(solver, state: np.ndarray, amplitude: float, period: int) -> float:
    """Return the largest Lyapunov exponent per unit time of a periodic orbit: ln |mu_1| / (p T).

    mu_1 is the largest Floquet multiplier. For other motions the exponent is the growth of a
    tangent vector over a window, divided by its time (`hpcsweep.solvers.records`).

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
        Point of the orbit at tau = 0; of L sliders (2n + L,).
    amplitude : float
    period : int
        Orbit period p.

    Returns
    -------
    float
        -inf if the tangent map vanishes, NaN if the solver fails.
    """
    structure, units = solver.structure, solver.structure.state_units
    try:
        _, matrix = solver.monodromy(state, amplitude, period)
        if not ISOLATED.of(structure):
            matrix = without_families(structure, matrix * units / units[:, None])
        largest = float(abs(floquet_multipliers(matrix)[0]))
    except (ArithmeticError, np.linalg.LinAlgError):
        return math.nan
    return exponent_of_multiplier(largest, structure.forcing.period(solver.omega, period))


def exponent_of_multiplier(multiplier: float, time: float) -> float:
    """Return the exponent for the modulus of an orbit's largest multiplier over a time."""
    return math.log(multiplier) / time if multiplier > 0 else -math.inf


class MeanInterval(NamedTuple):
    """A mean with its confidence interval, in whatever unit."""

    mean: float
    low: float
    high: float

    @classmethod
    def exact(cls, mean: float) -> "MeanInterval":
        """Return the interval of an exactly known mean."""
        return cls(mean, mean, mean)

    def times(self, factor: float) -> "MeanInterval":
        """Return the interval in another unit; `factor` > 0."""
        return MeanInterval(self.mean * factor, self.low * factor, self.high * factor)


UNKNOWN = MeanInterval(math.nan, math.nan, math.nan)


def aligned(logarithms: np.ndarray) -> np.ndarray:
    """Drop the first tenth, in which the tangent vector aligns with the direction of growth."""
    return logarithms[len(logarithms) // ALIGNING :]


def growth_interval(logarithms: np.ndarray) -> MeanInterval:
    """Return the mean growth a period with its confidence interval.

    Parameters
    ----------
    logarithms : ndarray, shape (k,)
        Logarithms of the growth factor in each forcing period, `aligned`.

    Returns
    -------
    Interval
        In units of 1/T; NaN if there are too few periods, -inf if a factor is 0.
    """
    length = len(logarithms) // BATCHES
    # a sum with an infinite term is not finite
    if length == 0 or not math.isfinite(total := float(logarithms.sum())):
        return MeanInterval.exact(total) if length and total < 0 else UNKNOWN
    kept = logarithms[len(logarithms) - length * BATCHES :]
    means = (kept.reshape(BATCHES, length).sum(axis=1) / length).tolist()
    mean = math.fsum(means) / BATCHES
    variance = math.fsum((batch - mean) ** 2 for batch in means) / (BATCHES - 1)
    half = math.sqrt(variance / BATCHES) * student_quantile(BATCHES - 1, 0.5 + 0.5 * CONFIDENCE)
    return MeanInterval(mean, mean - half, mean + half)


@lru_cache(maxsize=64)
def student_quantile(freedom: int, probability: float) -> float:
    """Return the quantile of Student's t distribution."""
    from scipy.special import stdtrit  # reading results does not need it

    return float(stdtrit(freedom, probability))
