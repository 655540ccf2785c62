"""Prove that a motion stays free of contact and tends to the steady state: the rule `linear`.

From a state z the motion is the steady state of `linear.LinearOrbit` plus modal transients whose
energy never grows, so that with q the transient part at 0

    d . u(tau) <= A max d . u_1 + sum_j |d . phi_j| a_j,   a_j = sqrt(q_j^2 + (q_j' / omega_j)^2),

u_1 being the steady state at unit amplitude. If that stays outside its layer for every contact,
contact is impossible. Where a damping matrix couples the modes their energies are not bounded one
by one but together: with E = sum_j omega_j^2 a_j^2 the sum is replaced by sqrt(d . K^-1 d) sqrt(E),
the largest d . u of that energy.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, VECTOR, entry_point
from hpcsweep.kernels.compile.places import allocate, zeros


class Free(NamedTuple):
    """Constants of the motions without contact for the kernel; C contacts, n modes."""

    known: bool
    """Whether there is a steady state."""
    coupled: bool
    most: float
    """Largest sum of the remaining transient."""
    levels: np.ndarray = zeros("C")
    """Edge of the layer of each contact."""
    largest: np.ndarray = zeros(2, "C")
    """Max d . u_1, and max -d . u_1."""
    point: np.ndarray = zeros("2n")
    """Stroboscopic point of the steady state at unit amplitude."""
    transform: np.ndarray = zeros("n", "n")
    """From displacements to modal coordinates."""
    frequencies: np.ndarray = zeros("n")
    reach: np.ndarray = zeros("C", "n")
    """|d . phi_j|."""
    softness: np.ndarray = zeros("C")
    """sqrt(d . K^-1 d)."""
    left: np.ndarray = zeros("2n", "2n")
    """Modal coordinates and speeds after the transient, in units of the state."""
    end: np.ndarray = zeros("2n", "2n")
    """The transient part of the state after the window."""
    modal: np.ndarray = zeros("2n")
    """Workspace."""
    size: np.ndarray = zeros("n")
    """Workspace."""


NOT_KNOWN = allocate(Free, {"C": 0, "n": 0, "2n": 0}, known=False, coupled=False, most=0.0)
DECAYS, LASTS = 1, 2
"""What is proved of a motion: it is free and its transient decays in time, or stays free only."""
FREE = Arena(NOT_KNOWN)
read_free = FREE.read
NOTHING = FREE.pack(NOT_KNOWN)
"""Packed; with it no motion is free."""


@entry_point(INT, BYTES, VECTOR, FLOAT, VECTOR)
def is_free(free, state, amplitude, end):
    """Return whether the motion from a state is free of contact and ends on the steady state.

    Parameters
    ----------
    free : ndarray of bytes
        A packed `Free`.
    state : ndarray, shape (2n,)
    amplitude : float
    end : ndarray, shape (2n,)
        Receives the state after the window, if the result is DECAYS.

    Returns
    -------
    int
        DECAYS, LASTS, or 0 if it is not proved.
    """
    motion = read_free(free)
    if not motion.known:
        return 0
    side = 0 if amplitude >= 0.0 else 1
    n_contacts, n = motion.reach.shape
    modal, size = motion.modal, motion.size
    for c in range(n_contacts):
        if not abs(amplitude) * motion.largest[side, c] < motion.levels[c]:
            return 0
    energy = 0.0
    for j in range(n):
        q = 0.0
        p = 0.0
        for k in range(n):
            q += motion.transform[j, k] * (state[k] - amplitude * motion.point[k])
            p += motion.transform[j, k] * (state[n + k] - amplitude * motion.point[n + k])
        modal[j] = q
        modal[n + j] = p
        size[j] = math.sqrt(q * q + (p / motion.frequencies[j]) ** 2)
        energy += (motion.frequencies[j] * size[j]) ** 2
    for c in range(n_contacts):
        reach = motion.softness[c] * math.sqrt(energy)
        if not motion.coupled:
            reach = 0.0
            for j in range(n):
                reach += motion.reach[c, j] * size[j]
        if not abs(amplitude) * motion.largest[side, c] + reach < motion.levels[c]:
            return 0
    left = 0.0
    for i in range(2 * n):
        value = 0.0
        for k in range(2 * n):
            value += motion.left[i, k] * modal[k]
        left += abs(value)
    if not left <= motion.most:
        return LASTS
    for i in range(2 * n):
        value = amplitude * motion.point[i]
        for k in range(2 * n):
            value += motion.end[i, k] * modal[k]
        end[i] = value
    return DECAYS
