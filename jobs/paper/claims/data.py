"""Sweeps and maps as arrays, and claims about them."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hpcsweep.dynamics.classify import MotionClass

CHAOS_GROWTH = 5.0
"""Least ln of the growth of a small difference over the steady window of a chaotic motion; the
finite window leaves an error of the order of 1."""


class Verdict(StrEnum):
    """Answer to a claim."""

    YES = "yes"
    NO = "no"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Claim:
    """One claim and its answer.

    Attributes
    ----------
    number : str
        As in the list of claims; parts have a letter.
    text : str
        Text of the paper's claim.
    verdict : Verdict
    finding : str
        Our numbers, or the missing data.
    """

    number: str
    text: str
    verdict: Verdict
    finding: str


@dataclass(frozen=True)
class Sweep:
    """One frame: amplitude sweeps at one frequency.

    Attributes
    ----------
    omega : float
    amplitude : ndarray, shape (k,)
        Ascending.
    directions : tuple of str
    period, contact : ndarray of int, shape (d, k)
        Orbit period (0: none found), contact set (bit i - 1: floor i).
    growth : ndarray, shape (d, k)
        Largest Lyapunov exponent times the length of the steady window; NaN if not known.
    drift : ndarray, shape (d, k)
        In A / Omega^2.
    modal_norm : ndarray, shape (d, k, n)
    state : ndarray, shape (d, k, 2n)
        A stroboscopic point of the motion at the end of the run.
    points : ndarray, shape (d, k, p, 2n)
        Stroboscopic points, NaN where there are no more.
    valid : ndarray of bool, shape (d, k)
        Computed runs that did not fail.
    motion : ndarray of int, shape (d, k), optional
        `MotionClass` where motions were classified.
    """

    omega: float
    amplitude: np.ndarray
    directions: tuple[str, ...]
    period: np.ndarray
    contact: np.ndarray
    growth: np.ndarray
    drift: np.ndarray
    modal_norm: np.ndarray
    state: np.ndarray
    points: np.ndarray
    valid: np.ndarray
    motion: np.ndarray | None = None

    @property
    def chaotic(self) -> np.ndarray:
        """Runs that are chaotic, as classified or by the exponent; shape (d, k)."""
        return is_chaotic(self.period, self.growth, self.motion) & self.valid

    @property
    def n_floors(self) -> int:
        """Number of floors."""
        return self.state.shape[-1] // 2

    def both(self) -> bool:
        """Return whether there are sweeps up and down."""
        return self.directions == ("up", "down")


@dataclass(frozen=True)
class Map:
    """Sweeps up at many frequencies.

    Attributes
    ----------
    stiffness_ratio : float
    omega : ndarray, shape (f,)
    period, contact : ndarray of int, shape (f, k)
    chaotic, valid : ndarray of bool, shape (f, k)
    drift, free_drift : ndarray, shapes (f, k) and (f,)
        With the stop, and in closed form without it, in A / Omega^2.
    exponents : bool
        Whether the largest Lyapunov exponent is known; nothing is chaotic without it.
    """

    stiffness_ratio: float
    omega: np.ndarray
    period: np.ndarray
    contact: np.ndarray
    chaotic: np.ndarray
    valid: np.ndarray
    drift: np.ndarray
    free_drift: np.ndarray
    exponents: bool


def is_chaotic(
    period: np.ndarray, growth: np.ndarray, motion: np.ndarray | None = None
) -> np.ndarray:
    """Return where runs are chaotic, as classified or by the exponent: no period, and growth."""
    if motion is not None:
        return np.asarray(motion) == MotionClass.CHAOTIC
    return (np.asarray(period) == 0) & (np.asarray(growth) > CHAOS_GROWTH)


def stretches(chosen: np.ndarray) -> list[tuple[int, int]]:
    """Return (first, last) of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], chosen.astype(np.int8), [0]))))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
