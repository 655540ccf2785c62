"""Linear dynamics of a structure, and the units that bring its numbers near 1."""

import math
from functools import cached_property
from typing import cast

import numpy as np

from hpcsweep.model import modes
from hpcsweep.model.arguments import number, wrong
from hpcsweep.model.forcing import Harmonics
from hpcsweep.model.natural import NaturalModes
from hpcsweep.model.observed import ROUNDING
from hpcsweep.model.rayleigh import Rayleigh
from hpcsweep.model.system import frozen

MAX_OMEGA = 1e150
"""Of the closed forms, which square it."""
ROUNDED = 1e-12
"""Part of a stiffness, of its trace say, that is rounding."""
NO_SPRING = 1e-10
"""Least bound of frequencies, in units of these, where there is no spring: kernels divide by it."""


class LinearDynamics(NaturalModes):
    """Linear dynamics from the matrices, the contacts and the forcing of a structure."""

    @cached_property
    def forcing(self) -> Harmonics:
        """Forcing of the structure."""
        return Harmonics(tuple(self.harmonics))

    @property
    def shakes(self) -> bool:
        """Whether the base moves, b = -M r, rather than forces act on the structure."""
        if "influence" in self.load:
            return True
        return bool(np.array_equal(self.forcing_vector, -self.mass_matrix.sum(axis=1)))

    @cached_property
    def length_unit(self) -> float:
        """Length to which tolerances are relative, a power of two.

        That is `motion_length`, or else the smallest gap that is not 0, or without one the smallest
        elongation at which a slider slips, up to a factor.
        """
        gaps = [abs(contact.gap) for contact in self.contacts if contact.gap]
        gaps = gaps or [slider.limit for slider in self.sliders]
        return self.motion_length or modes.power_of_two(min(gaps, default=1.0))

    @cached_property
    def frequency_unit(self) -> float:
        """Unit of frequency, a power of two.

        Of motions that are longer than a slider is before it slips, its stiffness is F over their
        length. Where there is no spring it is that of the contacts.
        """
        if self.is_uniform:
            return 1.0
        stiffness = float(np.trace(self.stiffness_matrix))
        stiffness = stiffness or float(self.contact_stiffness @ np.square(self.directions).sum(1))
        if self.motion_length and self.sliders:
            shares = [min(1.0, slider.limit / self.motion_length) for slider in self.sliders]
            elastic = max(float(np.trace(self.elastic_stiffness)), 0.0)
            stiffness = elastic + np.dot(shares, self.slider_stiffness)
        return modes.power_of_two(math.sqrt(stiffness / np.trace(self.mass_matrix)) or 1.0)

    @cached_property
    def state_units(self) -> np.ndarray:
        """Units of the displacements and velocities of a state, shape (2n,).

        Behind them those of the lasting elongations p of the L sliders, of which the state of a
        motion under a harmonic forcing is made, too: (2n + L,).
        """
        n, length = self.n_floors, self.length_unit
        units = (length, length * self.frequency_unit, length)
        return frozen(np.repeat(units, (n, n, len(self.sliders))))

    @cached_property
    def free_drifts(self) -> np.ndarray:
        """Displacements that neither springs nor contacts oppose once all sliders slip, (n, m).

        N^T K N = 1 of `held_stiffness`. Along these alone a motion drifts under periodic forces.
        """
        return self._unopposed(self.directions)

    @cached_property
    def mechanisms(self) -> np.ndarray:
        """The same where no contact is closed: along these a motion may stand elsewhere, (n, m)."""
        return self._unopposed(self.directions[:0])

    def _unopposed(self, held: np.ndarray) -> np.ndarray:
        """Return what neither springs nor rows `held` oppose, (n, m)."""
        from scipy.linalg import eigh

        size = np.trace(self.stiffness_matrix)
        stiffness = self.elastic_stiffness + size * (held.T / (held**2).sum(axis=1)) @ held
        values, vectors = eigh(stiffness, self.held_stiffness)
        return frozen(vectors[:, np.abs(values) <= ROUNDED])

    def without_drift(self, states: np.ndarray) -> np.ndarray:
        """Return states (u, u', p), (..., 2n + L), less their displacement along `free_drifts`."""
        if not self.sliders or not self.free_drifts.size:
            return states
        n, along = self.n_floors, self.free_drifts
        moved = states[..., :n] @ (self.held_stiffness @ along @ along.T)
        drift = (moved, np.zeros_like(moved), moved @ self.slider_directions.T)
        return states - np.concatenate(drift, -1)

    def slipped(self, states: np.ndarray) -> np.ndarray:
        """Return states (u, u', p), (..., 2n + L), with sliders slipped until within strength.

        As far as their strengths demand at these displacements, from the p that is given, or from 0
        of states (u, u').
        """
        n, missing = self.n_floors, self.state_units.size - states.shape[-1]
        states = np.concatenate((states, np.zeros((*states.shape[:-1], missing))), axis=-1)
        along = states[..., :n] @ self.slider_directions.T
        limits = np.array([slider.limit for slider in self.sliders])
        states[..., 2 * n :] = np.clip(states[..., 2 * n :], along - limits, along + limits)
        return states

    def slider_losses(self, path: np.ndarray, excursions: np.ndarray) -> np.ndarray:
        """Return the energy that sliders take whose p has gone a path, in so many excursions."""
        taken = [(one.shares[0], one.lost) for one in self.sliders]
        drag, lost = np.reshape(taken, (-1, 2)).T
        return drag * path + lost * excursions

    @property
    def damping_ratios(self) -> np.ndarray:
        """zeta_i of every mode, shape (n,), 0 of rigid ones; the diagonal of a damping matrix."""
        over = np.where(self.frequencies > 0.0, self.frequencies, math.inf)
        if not self._is_by_ratios:
            return 0.5 * np.diag(self.modal_damping) / over
        if self.rayleigh is not None:
            alpha, beta = self.rayleigh_factors
            return 0.5 * (alpha / over + beta * self.frequencies)
        return self.given_ratios

    @property
    def rigid_rates(self) -> np.ndarray:
        """Phi^T C Phi of the rigid modes, of which speeds decay by these, shape (r,)."""
        if self._is_by_ratios:
            return np.full(self.n_rigid, self.rayleigh_factors[0])
        return np.diag(self.modal_damping)[: self.n_rigid]

    @property
    def given_ratios(self) -> np.ndarray:
        """Damping ratio of every mode as given, 0 of rigid ones, shape (n,)."""
        ratios = np.zeros(self.n_floors)
        ratios[self.n_rigid :] = self.damping_ratio
        return ratios

    @property
    def rayleigh_factors(self) -> tuple[float, float]:
        """(alpha, beta) of Rayleigh damping, 0 without."""
        if isinstance(self.rayleigh, Rayleigh):
            return self.rayleigh.factors(self.frequencies)
        return cast(tuple[float, float], self.rayleigh or (0.0, 0.0))

    @property
    def _is_by_ratios(self) -> bool:
        """Whether damping is given by modal ratios, or by Rayleigh's, alone."""
        of_matrix = self.matrices is not None and self.matrices.damping is not None
        return not (of_matrix or self.storey_dashpots.any())

    @cached_property
    def modal_damping(self) -> np.ndarray:
        """Phi^T C Phi, shape (n, n)."""
        return frozen(self.modes.T @ self.damping_matrix @ self.modes)

    @cached_property
    def is_modal(self) -> bool:
        """Whether damping leaves the modes uncoupled."""
        if self._is_by_ratios:
            return True
        off = self.modal_damping - np.diag(np.diag(self.modal_damping))
        return bool(np.abs(off).max() <= 1e-13 * np.abs(self.modal_damping).max())

    @property
    def stiffness_bound(self) -> float:
        """Bound of the eigenvalues of M^-1 K.

        Those of the uniform chain are 4 sin^2(.), below 4 for every n.
        """
        if self.is_uniform:
            return 4.0
        least = (NO_SPRING * self.frequency_unit) ** 2
        return max(float(self.frequencies[-1] ** 2) * (1.0 + 1e-12), least)

    @cached_property
    def directions(self) -> np.ndarray:
        """d_k of every contact, shape (m, n)."""
        listed = [contact.direction for contact in self.contacts]
        return frozen(np.array(listed, float).reshape(-1, self.n_floors))

    @cached_property
    def gaps(self) -> np.ndarray:
        """g_k of every contact, shape (m,)."""
        return frozen(np.array([contact.gap for contact in self.contacts], float))

    @cached_property
    def contact_stiffness(self) -> np.ndarray:
        """kappa_k of every contact, 0 of rigid ones, shape (m,)."""
        kappa = np.array([contact.stiffness for contact in self.contacts], float)
        return frozen(np.where(np.isfinite(kappa), kappa, 0.0))

    @cached_property
    def contact_damping(self) -> np.ndarray:
        """c_k of every contact, shape (m,)."""
        return frozen(np.array([contact.damping for contact in self.contacts], float))

    @property
    def force_per_length(self) -> np.ndarray:
        """Force per length by which kernels measure the force of each contact, shape (m,).

        That is kappa; of a dashpot without a spring c times the unit of frequency, and of a rigid
        contact the mass that it feels times the square of that unit.
        """
        kappa, unit = self.contact_stiffness, self.frequency_unit
        found = np.where(kappa != 0, np.abs(kappa), self.contact_damping * unit)
        return np.where(self.is_rigid, unit**2 / self.contact_softness, found)

    @property
    def is_rigid(self) -> np.ndarray:
        """Which contacts are rigid, shape (m,) of bool."""
        return np.array([contact.stiffness == math.inf for contact in self.contacts], bool)

    def switched(self, force: np.ndarray, past: np.ndarray) -> np.ndarray:
        """Return forces of the contacts, from those of their springs at distances past the stops.

        Beyond a stop they grow with the distance: those of the largest distances are the largest.
        """
        if not np.isfinite(self.sharpness):
            return force
        with np.errstate(over="ignore"):
            return force / (1.0 + np.exp(-self.sharpness * past))

    def contact_forces(self, states: np.ndarray) -> np.ndarray:
        """Return the force of each contact at states of shape (k, 2n), shape (k, m).

        Of a rigid one 0 while it is open, to rounding, and NaN at its stop.
        """
        moved, speed = np.split(states, 2, axis=-1)
        past = moved @ self.directions.T - self.gaps
        force = self.switched(self.contact_stiffness * past, past)
        if not np.isfinite(self.sharpness):
            drag = self.contact_damping * (speed @ self.directions.T)
            lets_go = [bool(contact.damping) and not contact.tension for contact in self.contacts]
            force = np.where(past > 0, force + drag, 0.0)
            force = np.where(lets_go, np.maximum(force, 0.0), force)
        size = np.maximum(np.abs(moved).max(axis=-1, keepdims=True), self.gaps)
        at_stop = self.is_rigid & (past >= -ROUNDING * size)
        return np.where(at_stop, math.nan, force + 0.0)  # -0.0 is 0.0

    def contact_energy(self, u: np.ndarray) -> float:
        r"""Return the energy that the springs of the contacts hold at displacements u.

        Of a smooth one it is the integral of kappa S(rho x) x from -inf on. With y = rho x,

            W = (kappa / rho^2) (y log(1 + exp(y)) + Li_2(-exp(y))),

        where Li_2(-exp(y)) = -pi^2 / 6 - y^2 / 2 - Li_2(-exp(-y)).
        """
        past = self.directions @ u - self.gaps
        if not np.isfinite(self.sharpness) or not self.contacts:
            return 0.5 * float(self.contact_stiffness @ np.maximum(past, 0.0) ** 2)
        if self.sharpness == 0.0:
            return 0.25 * float(self.contact_stiffness @ past**2)
        from scipy.special import spence  # reading results needs no scipy

        y = self.sharpness * past
        e = np.exp(-np.abs(y))
        before = spence(1.0 + e) - np.abs(y) * np.log1p(e)
        held = np.where(y > 0.0, 0.5 * y * y - math.pi**2 / 6.0 - before, before)
        return float(self.contact_stiffness @ held) / self.sharpness**2

    @cached_property
    def contact_softness(self) -> np.ndarray:
        """d_k . M^-1 d_k of every contact: the change of x_k'' per unit force, shape (m,)."""
        mass = self.mass_matrix
        return frozen(np.array([d @ modes.per_mass(mass, d) for d in self.directions], float))

    @property
    def stiffest_contact(self) -> float:
        """Largest beta = kappa d . M^-1 d of the contacts, in units of frequency."""
        felt = self.contact_stiffness * self.contact_softness / self.frequency_unit**2
        return float(felt.max(initial=0.0))

    @cached_property
    def layer_half_width(self) -> float:
        """Half-width of the contact layer, a length; see `contact.layer_half_width`."""
        # the law imports kernels and numba, which reading results does not need
        from hpcsweep.model.contact import layer_half_width

        rho = self.sharpness * self.length_unit
        return self.length_unit * layer_half_width(self.stiffest_contact, rho)

    @cached_property
    def rest(self) -> np.ndarray:
        """State of static equilibrium with the contacts, (u, 0), shape (2n,); see `equilibrium`."""
        from hpcsweep.model.equilibrium import static_equilibrium

        u = static_equilibrium(self)
        for name, slider in zip(self.slider_names, self.sliders, strict=True):
            force = abs(slider.spring * float(np.dot(slider.direction, u)))
            if force > slider.strength:
                limit = "would slip at rest: a contact with gap below 0 presses it with"
                strength = f"its strength is {slider.strength:.4g}"
                raise wrong(f"slider {name}", f"{limit} {force:.4g}, {strength}")
        return frozen(np.concatenate((u, np.zeros(self.n_floors))))

    @property
    def felt(self) -> np.ndarray:
        """Whether each contact feels each rigid mode, shape (m, r)."""
        shapes = self.modes[:, : self.n_rigid]
        sizes = np.abs(self.directions) @ np.abs(shapes)
        return np.abs(self.directions @ shapes) > ROUNDED * sizes

    @cached_property
    def held_stiffness(self) -> np.ndarray:
        """K, to which rigid modes N have a spring each, K + w^2 M N N^T M, w `frequency_unit`."""
        rigid = self.frequency_unit * self.modal_transform[: self.n_rigid]
        return self.stiffness_matrix + rigid.T @ rigid if self.n_rigid else self.stiffness_matrix

    @cached_property
    def damping_matrix(self) -> np.ndarray:
        """C = M Phi diag(2 zeta_i omega_i) Phi^T M, 2 gamma C of (8), and dashpots, (n, n)."""
        if self.matrices is not None and self.matrices.damping is not None:
            return frozen(np.array(self.matrices.damping))
        if self.rayleigh is not None:
            alpha, beta = self.rayleigh_factors
            damping = alpha * self.mass_matrix + beta * self.stiffness_matrix
        else:
            back = self.modal_transform.T
            damping = back @ np.diag(2 * self.given_ratios * self.frequencies) @ back.T
        return frozen(damping + self.storey_dashpots if self.storey_dashpots.any() else damping)

    def linear_steady_state(self, omega: float, order: int = 1) -> np.ndarray:
        """Return the complex response U of the free structure at unit amplitude, shape (n,).

        The period-1 solution without contact is u(tau) = A Im(U exp(i h Omega tau)) with h =
        `order`, the particular solution g of (14).

        Raises
        ------
        ZeroDivisionError
            At an undamped resonance, where there is no steady state.
        """
        w = order * number("omega", omega, f"at most {MAX_OMEGA:g}", -MAX_OMEGA, MAX_OMEGA)
        if not self.is_modal and (w or not self.n_rigid):
            matrices = self.mass_matrix, self.damping_matrix, self.stiffness_matrix
            return modes.damped_response(*matrices, self.forcing_vector, w)
        denominator = self.frequencies**2 - w**2 + 2j * self.damping_ratios * self.frequencies * w
        denominator[: self.n_rigid] += 1j * self.rigid_rates * w
        if np.any(denominator == 0):
            raise ZeroDivisionError(f"undamped resonance at omega = {omega!r}: no steady state")
        phi = self.modes
        push = -phi.sum(axis=0) if self.is_uniform else phi.T @ self.forcing_vector
        return phi @ (push / denominator)

    def steady_harmonics(self, omega: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the orders and the responses to all harmonics, shapes (H,) and (H, n)."""
        responses = [
            self.linear_steady_state(omega, order)
            * (size if phase == 0.0 else size * np.exp(1j * phase))
            for order, size, phase in self.forcing.terms
        ]
        return np.array([order for order, _, _ in self.forcing.terms], float), np.array(responses)

    def grazing_amplitude(self, omega: float) -> float:
        """Return the amplitude at which the linear steady state first touches a stop.

        For stops without layer; 0 if the structure rests at a stop, and at an undamped resonance,
        where every amplitude reaches one; inf if there is none. NaN where a motion has no spring:
        where it stands without contact is its history.
        """
        if self.n_rigid and self.contacts:
            return math.nan
        try:
            reach = modes.trigonometric_maxima(*self.steady_harmonics(omega), self.directions)
        except ZeroDivisionError:
            return 0.0 if self.contacts else math.inf
        lowest = math.inf
        for contact, most in zip(self.contacts, reach.tolist(), strict=True):
            if contact.gap <= 0:
                return 0.0
            lowest = min(lowest, contact.gap / most if most > 0 else math.inf)
        return lowest

    def steady_drift(self, omega: float) -> float:
        """Return the largest drift of the linear steady state at unit amplitude.

        Raises
        ------
        ZeroDivisionError
            At an undamped resonance, where there is no steady state.
        """
        rows = np.concatenate((self.drift_rows, -self.drift_rows))
        return float(modes.trigonometric_maxima(*self.steady_harmonics(omega), rows).max())
