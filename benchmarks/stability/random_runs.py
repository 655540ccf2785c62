"""Draw random runs of one period, over all that the model defines, including its limits."""

import math

import numpy as np

from hpcsweep.model.structure import Structure
from stability.random_structures import highest_frequency, log_uniform, put, random_structure

NEAR_STOP = 0.4
"""Share of the states with contacts at rest, or nearly so, within rounding to 1 of their stops."""
HUGE = 0.02
"""Share of the states that are multiplied, by up to 1e120."""
FASTEST = 300.0
"""Largest ratio of a natural frequency, all contacts closed, to the forcing's, in most runs."""
HALF = 4.0
"""Masses, storeys and contacts of a structure of any kind are spread over twice as many decades."""


def uniform_building(rng) -> tuple[Structure, float]:
    """Draw a uniform building and a frequency."""
    n = int(rng.integers(1, 7)) if rng.random() < 0.97 else int(rng.integers(7, 51))
    beta = rng.choice([0.0, log_uniform(rng, 1e-3, 1e7)], p=[0.02, 0.98])
    sharp = [0.0, log_uniform(rng, 1e-3, 1e2), log_uniform(rng, 1e2, 1e8), math.inf]
    rho = rng.choice(sharp, p=[0.02, 0.03, 0.65, 0.3])
    zeta = rng.choice([0.0, 2.0, log_uniform(rng, 1e-4, 2.0)], p=[0.05, 0.05, 0.9])
    return Structure(n, float(beta), float(rho), float(zeta)), _frequency(rng)


def _frequency(rng) -> float:
    slow = rng.random() < 0.01
    return log_uniform(rng, 1e-3, 0.1) if slow else log_uniform(rng, 0.1, 50.0)


def random_state(rng, structure: Structure) -> np.ndarray:
    """Draw a state: anywhere, at rest, or with floors at the stop at 1; sometimes huge."""
    n = structure.n_floors
    z = rng.normal(0.0, 0.7, 2 * n)
    if rng.random() < NEAR_STOP:
        near = rng.random(n) < 0.5
        z[:n] = np.where(near, 1.0 + _tiny(rng, n), z[:n])
        z[n:] = np.where(near, _tiny(rng, n), z[n:])
    if rng.random() < HUGE:
        z *= 10.0 ** rng.uniform(0, 120)
    return z


def _tiny(rng, number: int) -> np.ndarray:
    return 10.0 ** rng.uniform(-17, 0, number) * rng.choice([-1.0, 0.0, 1.0], number)


def _share(rng) -> float:
    return float(rng.choice([0.0, log_uniform(rng, 1e-12, 1e3)], p=[0.02, 0.98]))


def random_run(rng, structure: Structure) -> tuple[float, np.ndarray]:
    """Draw an amplitude and a state of a uniform building."""
    amplitude = _share(rng)
    return amplitude, random_state(rng, structure)


def any_structure(rng) -> tuple[Structure, float]:
    """Draw a structure of any kind, masses and stiffnesses over eight decades, and a frequency."""
    sharp = [0.0, log_uniform(rng, 1e-3, 1e2), log_uniform(rng, 1e2, 1e8), math.inf]
    rho = float(rng.choice(sharp, p=[0.02, 0.03, 0.45, 0.5]))
    structure = random_structure(rng, rho, HALF)
    omega = _frequency(rng) * structure.frequency_unit
    if rng.random() < 0.9:
        # otherwise most periods exceed the step limit
        omega = max(omega, highest_frequency(structure) / FASTEST)
    return structure, omega


def any_run(rng, structure: Structure) -> tuple[float, np.ndarray]:
    """Draw an amplitude and a state, in the structure's units, with contacts near their stops."""
    units = structure.state_units
    z = rng.normal(0.0, 0.7, units.size) * units
    if structure.contacts and rng.random() < NEAR_STOP:
        number = len(structure.contacts)
        chosen = np.flatnonzero(rng.random(number) < 0.5)
        x, v = _tiny(rng, number) * units[0], _tiny(rng, number) * units[-1]
        if chosen.size:
            z = put(structure, z, [(int(k), float(x[k]), float(v[k])) for k in chosen])
    if rng.random() < HUGE:
        z *= 10.0 ** rng.uniform(0, 120)
    push = np.abs(np.linalg.solve(structure.mass_matrix, structure.forcing_vector)).max()
    return _share(rng) * float(units[-1] * structure.frequency_unit / push), z
