"""Lengths to which motions of a structure are relative, and the contacts within their reach."""

from dataclasses import replace
from typing import Any, Self, cast

import numpy as np

from hpcsweep.model.linear_dynamics import LinearDynamics
from hpcsweep.model.reach import reach_of_motions

REACH = 64.0
"""Factor of the linear response within which a contact counts as reached. Motions with contact
exceed it by 1 / (2 zeta) where the contact brings the structure into resonance."""
LONGEST = 1e100
"""Largest length by which motions are measured: they overflow before."""
MIN_DAMPING = 0.05
"""Least damping ratio in the bound of the linear response."""


class MeasuredDynamics(LinearDynamics):
    """Linear dynamics of a structure with motions measured by a length."""

    def lengths(self, omega: float, amplitudes) -> np.ndarray:
        """Return the lengths, powers of two, by which motions are measured at each amplitude.

        Tolerances are relative to the motion, and to the gaps that it can close. Without contact a
        coordinate u_i moves by L_i = A sum_h |U_hi| at most, with modes damped by `MIN_DAMPING`
        at least, since at a resonance contacts limit the motion. The length is the largest gap, of
        either sign, of the contacts with

            |g_k| <= REACH sum_i |d_ki| L_i ;

        a contact farther off is not reached, and changes nothing. Without such a contact (also with
        gaps of 0: a bilinear oscillator, whose motions are proportional to A) it is the largest
        L_i. At A = 0 it is that of the structure.

        Parameters
        ----------
        omega : float
        amplitudes : array_like of k floats

        Returns
        -------
        ndarray, shape (k,)
        """
        size = np.abs(np.asarray(amplitudes, float))[..., None]
        response = self._response_bound(omega)
        reach = REACH * (np.abs(self.directions) @ response)
        gaps = np.array([abs(contact.gap) for contact in self.contacts])
        close = np.where(gaps <= reach * size, gaps, 0.0).max(axis=-1, initial=0.0)
        length = np.where(close > 0, close, response.max() * size[..., 0])
        known = (length > 0) & (length < LONGEST)
        exponents = np.round(np.log2(np.where(known, length, 1.0)))
        return np.where(known, np.exp2(exponents), self.length_unit)

    def units_at(self, omega: float, amplitudes) -> np.ndarray:
        """Return the units of states, like `state_units`, of motions at k amplitudes, (k, 2n)."""
        speeds = self.state_units / self.length_unit
        return self.lengths(omega, amplitudes)[..., None] * speeds

    def _response_bound(self, omega: float) -> np.ndarray:
        """Return L_i of `lengths` at A = 1, shape (n,)."""
        frequencies = self.frequencies
        ratios = np.maximum(self.damping_ratios, MIN_DAMPING)
        push = self.modes.T @ self.forcing_vector
        bound = np.zeros(self.n_floors)
        for order, size, _ in self.forcing.terms:
            w = order * omega
            denominator = frequencies**2 - w**2 + 2j * ratios * frequencies * w
            bound += abs(size) * np.abs(self.modes @ (push / denominator))
        return bound

    def measured_by(self, length: float) -> Self:
        """Return the same structure with motions measured by a length, a power of two.

        Tolerances are then relative to this length, see `lengths`; states, amplitudes and results
        stay in the units of the structure.
        """
        return self if length == self.length_unit else self._changed(motion_length=length)

    def measured_at(self, omega: float, amplitude: float) -> Self:
        """Return the structure with motions measured at a frequency and an amplitude."""
        return self.measured_by(float(self.lengths(omega, amplitude)))

    def within_reach(self, amplitude: float, states: np.ndarray) -> Self:
        """Return the structure without the contacts that no motion can reach.

        Contacts keep their numbers. Those left out change no bit of any result: no unit, layer or
        bound depends on them.

        Parameters
        ----------
        amplitude : float
            Largest amplitude, of either sign.
        states : ndarray, shape (m, 2n)
            Initial states of motions.
        """
        bound = reach_of_motions(self, amplitude, states)
        pairs = zip(self.contact_numbers, self.contacts, bound.tolist(), strict=True)
        out = tuple(number for number, contact, most in pairs if contact.gap > most)
        return self._changed(unreached=self.unreached + out) if out else self

    def _changed(self, **fields: Any) -> Self:
        return replace(cast(Any, self), **fields)
