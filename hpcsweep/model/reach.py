r"""The lengths that motions are measured by, the contacts within reach, and a bound.

The bound is that of the energy, including contacts.

With |.| the norm of the masses, |w|^2 = w . M w, U^2 = u . K u and the potentials W_k of the
contacts, the energy is

    H = |u'|^2 / 2 + U^2 / 2 + sum_k kappa_k W_k,    W_k(x) = int_(-inf)^x S(rho s) s ds + e >= 0,

e = pi^2 / (12 rho^2), at most that of an open contact. Let c_1 and c_2 be the
least and the largest eigenvalue of M^-1 C, omega_1 the lowest frequency, p = |M^-1 b| and G the
sum of |a_h|. Of V = H + eps u' . M u, with eps <= omega_1 / 4,

    3/4 H <= V <= 5/4 H,
    V' = -u' . C u' + A G b . u' + eps (|u'|^2 - u . C u' - U^2 - sum_k kappa_k d_k . u S x_k
                                         + A G b . u).

A contact with gap g_k >= 0 does work (x_k + g_k) S x_k >= W_k - e - 0.28 g_k / rho, since
s S(rho s) is -0.28 / rho at least. The mixed term is below U^2 / 2 + (c_2 / omega_1)^2 |u'|^2 / 2,
so that with eps = c_1 / (2 + (c_2 / omega_1)^2) at most

    V' <= -eps H + a sqrt(H) + eps P,    a = 1.5 |A| G p,
    P = sum_k kappa_k (e + 0.28 g_k / rho).

Where sqrt(H) is above a / eps + sqrt(P), V falls: H stays below 5/3 of the square of that, or of
the initial energy, however the amplitude varies below A.

Dashpots take energy. While a contact pushes with F = kappa x + c x', its terms of V' are

    -c x'^2 - eps (x + g) F <= -eps kappa x^2 / 2 + eps^2 c g^2 / 2    for eps <= kappa / c,

since half of c x'^2 outweighs eps c x x' and half of it eps g c |x'|; the last term, by which P
grows, is needed only where F may pull. Once it has let go x' < -kappa x / c, and the energy of the
spring falls by kappa x |x'| >= eps kappa x^2 / 2. A dashpot without a spring has no bound.

A row d then moves no farther than |d . u| <= sqrt(d . K^-1 d) sqrt(2 H). Without damping, with a
negative gap or stiffness, with a C that is not symmetric, or where a motion has no spring (K is
singular) there is no bound.
"""

import math
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from hpcsweep.model.definite import is_symmetric
from hpcsweep.model.linear_dynamics import LinearDynamics

REACH = 64.0
"""Factor of the linear response within which a contact counts as reached. Motions with contact
exceed it by 1 / (2 zeta) where the contact brings the structure into resonance."""
LONGEST = 1e100
"""Largest length by which motions are measured: they overflow before."""
MIN_DAMPING = 0.05
"""Least damping ratio in the bound of the linear response."""


def reach_of_motions(structure, amplitude: float, states: np.ndarray) -> np.ndarray:
    """Bound |d_k . u| over all time for every contact k.

    Parameters
    ----------
    structure : Structure
    amplitude : float
        Largest amplitude, of either sign, that drives the motions.
    states : ndarray, shape (m, 2n)
        Initial states, or others with no component nearer to 0.

    Returns
    -------
    ndarray, shape (C,)
        inf where there is no bound.
    """
    directions, gaps = structure.directions, structure.gaps
    mass, stiffness = structure.mass_matrix, structure.stiffness_matrix
    root = np.linalg.cholesky(mass)
    damping = np.linalg.solve(root, np.linalg.solve(root, structure.damping_matrix).T)
    drags = np.linalg.eigvalsh(damping)
    least, most, lowest = float(drags[0]), float(drags[-1]), float(structure.frequencies[0])
    nothing = np.full(len(gaps), math.inf)
    kappa, rho = structure.contact_stiffness, structure.sharpness
    drag = structure.contact_damping
    skew = not is_symmetric(structure.damping_matrix)
    if not min(least, lowest) > 0 or np.any(gaps < 0) or np.any(kappa < 0) or skew or rho**2 == 0:
        return nothing
    if np.any((drag > 0) & (kappa == 0)):
        return nothing
    eps = min(least / (2.0 + (most / lowest) ** 2), lowest / 4.0)
    has = drag > 0
    eps = min(eps, float((kappa[has] / drag[has]).min(initial=eps)))
    push = np.linalg.norm(np.linalg.solve(root, structure.forcing_vector))
    a = 1.5 * abs(amplitude) * structure.forcing.size * push
    open_energy = math.pi**2 / (12.0 * rho**2)
    pulls = np.array([contact.tension for contact in structure.contacts], bool)
    held = float(kappa @ (open_energy + 0.28 * gaps / rho))
    held = math.sqrt(held + 0.5 * eps * float((drag * pulls) @ gaps**2))
    n = structure.n_floors
    states = np.abs(np.asarray(states, float).reshape(-1, 2 * n))
    u, v = states[:, :n], states[:, n:]
    beyond = np.maximum(u @ np.abs(directions).T - gaps, 0.0)
    energy = 0.5 * np.einsum("si,ij,sj->s", v, np.abs(mass), v)
    energy += 0.5 * np.einsum("si,ij,sj->s", u, np.abs(stiffness), u)
    energy += (0.5 * beyond**2 + 2.0 * open_energy) @ kappa
    with np.errstate(over="ignore"):
        largest = 5.0 / 3.0 * max((a / eps + held) ** 2, float(energy.max(initial=0.0)))
        soft = np.einsum("ki,ki->k", directions, np.linalg.solve(stiffness, directions.T).T)
        bound = np.sqrt(soft) * math.sqrt(2.0 * largest)
    return np.where(np.isfinite(bound), bound, nothing)


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

        Once a slider may slip, its elongation A |b . L| above F / k, the structure without any is
        what limits motions, and L_i the larger of both: of dry friction by a spring 1e6 times as
        stiff as the one beside it the former alone is the 1e6th part of the motion. What has no
        spring drifts on to any contact.

        Parameters
        ----------
        omega : float
        amplitudes : array_like of k floats

        Returns
        -------
        ndarray, shape (k,)
        """
        size = np.abs(np.asarray(amplitudes, float))[..., None]
        ratios = np.maximum(self.damping_ratios, MIN_DAMPING)
        sticking = self._bound_of(self.frequencies**2, self.modes, ratios, omega)
        limits = np.array([slider.limit for slider in self.sliders])
        slips = (size * (np.abs(self.slider_directions) @ sticking) > limits).any(axis=-1)
        response = np.where(slips[..., None], np.maximum(sticking, self._slipping(omega)), sticking)
        reach = REACH * (response @ np.abs(self.directions).T)
        reach[..., self.felt.any(axis=1)] = LONGEST
        gaps = np.array([abs(contact.gap) for contact in self.contacts])
        close = np.where(gaps <= reach * size, gaps, 0.0).max(axis=-1, initial=0.0)
        length = np.where(close > 0, close, response.max(axis=-1) * size[..., 0])
        is_finite = (length > 0) & (length < LONGEST)
        exponents = np.round(np.log2(np.where(is_finite, length, 1.0)))
        return np.where(is_finite, np.exp2(exponents), self.length_unit)

    def units_at(self, omega: float, amplitudes) -> np.ndarray:
        """Return `state_units`, (k, 2n + L), of motions at k amplitudes."""
        lengths = self.lengths(omega, amplitudes)
        units = {length: self.measured_by(length).state_units for length in np.unique(lengths)}
        return np.array([units[length] for length in lengths.ravel()]).reshape(*lengths.shape, -1)

    def _slipping(self, omega: float) -> np.ndarray:
        """Return L_i of `lengths` at A = 1, shape (n,), while all sliders slip."""
        if not self.sliders:
            return np.zeros(self.n_floors)
        return self._bound_of(*self._elastic_modes, MIN_DAMPING, omega)

    @cached_property
    def _elastic_modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Squares of the frequencies, and modes, M = 1, while all sliders slip."""
        from scipy.linalg import eigh

        return eigh(self.elastic_stiffness, self.mass_matrix)

    def _bound_of(self, squares, shapes, ratios, omega: float) -> np.ndarray:
        """Return L_i of modes, M = 1, by the squares of their frequencies."""
        push, bound = shapes.T @ self.forcing_vector, np.zeros(self.n_floors)
        for order, size, _ in self.forcing.terms:
            w = order * omega
            denominator = squares - w**2 + 2j * ratios * np.sqrt(np.abs(squares)) * w
            denominator[denominator == 0.0] = math.inf  # a mean force on what has no spring
            bound += abs(size) * np.abs(shapes @ (push / denominator))
        return bound

    def measured_by(self, length: float) -> Self:
        """Return the same structure with motions measured by a length, a power of two.

        Tolerances are then relative to this length, see `lengths`; states, amplitudes and results
        stay in the units of the structure.
        """
        if length == self.length_unit:
            return self
        if length not in self._measured:
            self._measured[length] = replace(self, motion_length=length)
        return self._measured[length]

    @cached_property
    def _measured(self) -> dict[float, Self]:
        """Those of `measured_by`: along a path a few lengths recur, each with its modes."""
        return {}

    def measured_at(self, omega: float, amplitude: float) -> Self:
        """Return the structure with motions measured at a frequency and an amplitude."""
        return self.measured_by(float(self.lengths(omega, amplitude)))

    def within_reach(self, amplitude: float, states: np.ndarray) -> Self:
        """Return the structure without the contacts that no motion can reach.

        The bound knows no sliders: with these all are kept.
        Contacts keep their numbers. Those left out change no bit of any result: no unit, layer or
        bound depends on them.

        Parameters
        ----------
        amplitude : float
            Largest amplitude, of either sign.
        states : ndarray, shape (m, 2n)
            Initial states of motions.
        """
        if self.sliders:
            return self
        bound = reach_of_motions(self, amplitude, states)
        pairs = zip(self.contact_numbers, self.contacts, bound.tolist(), strict=True)
        out = tuple(number for number, contact, most in pairs if contact.gap > most)
        return replace(self, unreached=self.unreached + out) if out else self
