"""All Lyapunov exponents of a motion, to a requested error, and the dimension they imply.

The tangent maps M_k of the forcing periods are exact. With Q_0 = 1 and M_k Q_k = Q_(k+1) R_k the
exponents are the means of ln |R_k,ii| over the time of a period, largest first (Benettin et al.,
Meccanica 15 (1980) 9; Geist, Parlitz, Lauterborn, Prog. Theor. Phys. 83 (1990) 875). Their error is
half the interval of batch means (`stability.growth_interval`), so that periods are added until it
is small enough. Those of an orbit are ln |mu_i| / (p T), to the rounding of its multipliers.

What a period contracts to less than the rounding of its tangent map is not told but NaN; where all
of the map vanishes, as of one mass that comes to rest on a rigid stop, each exponent is -inf.

With exponents l_1 >= l_2 >= ... and j the most of which the sum is not negative, the Kaplan-Yorke
dimension of the stroboscopic points is j + (l_1 + ... + l_j) / |l_(j+1)|: 0 of an orbit, 1 of a
torus. It rises with every exponent: at the ends of their intervals it has its own. In continuous
time the set has one dimension more.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.stability import MeanInterval, TangentMaps, aligned, growth_interval
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll

FIRST, GROWTH = 200, 1.5
"""Forcing periods after which the error is first judged, and the factor between judgements."""
CHUNK = 256
"""Tangent maps that are held at once."""
EPSILON = float(np.finfo(float).eps)
MANY = 400
"""Size of the block cyclic matrix of an orbit from which its maps are multiplied instead."""
ROUNDED = 1e3 * EPSILON
"""Contraction of a period, in units of its norm, that rounding changes by a thousandth or more."""


class LyapunovSpectrum(NamedTuple):
    """Lyapunov exponents of a motion, largest first.

    Attributes
    ----------
    exponents, errors : ndarray, shape (2n,)
        Per unit of time, and half their 95 % confidence intervals; of an orbit what rounding
        leaves.
    dimension : Interval
        Kaplan-Yorke dimension of the stroboscopic points, at the exponents and at the ends of
        their intervals.
    n_periods : int
        Forcing periods averaged over; 0 for an orbit.
    """

    exponents: np.ndarray
    errors: np.ndarray
    dimension: MeanInterval
    n_periods: int

    @classmethod
    def of(cls, exponents, errors, n_periods: int = 0) -> "LyapunovSpectrum":
        """Complete exponents, in any order, by their dimension."""
        order = np.argsort(-exponents, kind="stable")
        exponents, errors = exponents[order], errors[order]
        ends = (exponents, exponents - errors, exponents + errors)
        dimension = MeanInterval(*(kaplan_yorke_dimension(np.sort(end)[::-1]) for end in ends))
        return cls(exponents, errors, dimension, n_periods)


def kaplan_yorke_dimension(exponents: np.ndarray) -> float:
    """Return the Kaplan-Yorke dimension for exponents, largest first; NaN if one needed is NaN."""
    total = 0.0
    for j, exponent in enumerate(exponents.tolist()):
        if math.isnan(exponent):
            return math.nan
        if total + exponent < 0:
            return j + total / -exponent
        total += exponent
    return float(len(exponents))


def spectrum_of_orbit(solver, points: np.ndarray, amplitude: float) -> LyapunovSpectrum:
    """Return the spectrum of an orbit from its p points, shape (p, 2n).

    Raises
    ------
    ArithmeticError
        If the solver fails.
    """
    units, time = solver.structure.state_units, solver.structure.forcing.period(solver.omega)
    p, size = points.shape
    matrices = solver.images(points, amplitude, True)[1] * units / units[:, None]
    maps = TangentMaps(matrices)
    if not matrices.any(axis=(1, 2)).all():
        return LyapunovSpectrum.of(np.full(size, -np.inf), np.zeros(size))
    if p * size <= MANY:
        # |mu|^(1/p), which rounding changes by that of one map
        sizes = np.abs(maps.cyclic_multipliers) ** (1 / p)
        norm = np.linalg.norm(matrices, 2, axis=(1, 2)).max()
    else:
        sizes, norm, time = np.abs(maps.multipliers), np.linalg.norm(maps.product, 2), p * time
    sizes[sizes <= ROUNDED * norm] = np.nan
    return LyapunovSpectrum.of(np.log(sizes) / time, EPSILON * norm / sizes / time)


def spectrum_of_motion(
    solver, state: np.ndarray, amplitude: float, error: float, max_cycles: int, poll: Poll = None
) -> LyapunovSpectrum:
    """Average over a motion until no exponent has a larger error, or a limit is reached.

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
        On the motion, at tau = 0.
    amplitude : float
    error : float
        Requested half length of the 95 % confidence intervals, per unit of time.
    max_cycles : int
        Most forcing periods to average over.
    poll : callable, optional
        Called within long work; may raise to leave.

    Raises
    ------
    ArithmeticError
        If the solver fails.
    """
    units, time = solver.structure.state_units, solver.structure.forcing.period(solver.omega)
    z, frame = np.array(state, dtype=float), np.eye(units.size)
    parts: list[np.ndarray] = []
    done, judged = 0, min(FIRST, max_cycles)
    while True:
        length = min(CHUNK, judged - done)
        points, outcome = solver.points(z, amplitude, length, poll)
        if outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"{outcome.name} in forcing period {done + len(points) + 1}")
        starts, z = np.concatenate((z[None], points[:-1])), points[-1]
        maps = solver.images(starts, amplitude, True, poll)[1] * units / units[:, None]
        stretches = np.empty((length, units.size))
        for k, matrix in enumerate(maps):
            frame, upper = np.linalg.qr(matrix @ frame)
            stretches[k] = np.abs(np.diag(upper))
            stretches[k, stretches[k] < ROUNDED * np.linalg.norm(upper)] = np.nan
        with np.errstate(divide="ignore"):
            parts.append(np.log(stretches))
        done += length
        if done < judged:
            continue
        growths = [growth_interval(growth) for growth in aligned(np.concatenate(parts)).T]
        means = np.array([growth.mean for growth in growths]) / time
        errors = np.array([0.0 if g.mean == -math.inf else g.high - g.mean for g in growths]) / time
        if done >= max_cycles or np.nanmax(errors, initial=0.0) <= error:
            return LyapunovSpectrum.of(means, errors, done)
        judged = min(math.ceil(GROWTH * judged), max_cycles)
