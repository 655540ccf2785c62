"""Random general structures, and states of them that are hard for the map of one period.

The structures are those of `stability.random_structures`, spread over four decades.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from stability.random_structures import (
    highest_frequency,
    log_uniform,
    put,
    random_structure,
)

from hpcsweep.model.structure import Structure

GENERAL_KINDS = (
    "anywhere, general",
    "slow at a stop",
    "peak in a layer",
    "two contacts",
    "three contacts",
)
FASTEST = 300.0
"""Largest ratio of a natural frequency, all contacts closed, to the forcing's."""


@dataclass(frozen=True)
class GeneralCase:
    """One period of a general structure; `number` and the seed make it again."""

    kind: str
    number: int
    structure: Structure
    omega: float
    amplitude: float
    state: tuple[float, ...]


def linear_field(structure, amplitude, omega, closed):
    """Matrix of x' = M x, x = (u, v, pairs of sine and cosine, 1), with contacts `closed`."""
    n, n_pairs = structure.n_floors, len(structure.harmonics)
    inverse = np.linalg.inv(structure.mass_matrix)
    field = np.zeros((2 * n + 2 * n_pairs + 1,) * 2)
    field[:n, n : 2 * n] = np.eye(n)
    field[n : 2 * n, :n] = -inverse @ structure.stiffness_matrix
    field[n : 2 * n, n : 2 * n] = -inverse @ structure.damping_matrix
    for k in closed:
        contact = structure.contacts[k]
        push = contact.stiffness * (inverse @ np.array(contact.direction))
        field[n : 2 * n, :n] -= np.outer(push, contact.direction)
        field[n : 2 * n, -1] += push * contact.gap
    for place, (order, size, _) in enumerate(structure.harmonics):
        at = 2 * n + 2 * place
        field[n : 2 * n, at] = amplitude * size * (inverse @ structure.forcing_vector)
        field[at, at + 1], field[at + 1, at] = order * omega, -order * omega
    return field


def distances(structure, u):
    """Distances past all stops."""
    return np.array([np.dot(c.direction, u) - c.gap for c in structure.contacts])


def backwards(structure, amplitude, omega, z, tau, closed=()):
    """State at time 0 from which the linear motion reaches z at time tau."""
    pairs = []
    for order, _, phase in structure.harmonics:
        angle = order * omega * tau + phase
        pairs += [math.sin(angle), math.cos(angle)]
    field = linear_field(structure, amplitude, omega, closed)
    return (expm(-tau * field) @ np.array([*z, *pairs, 1.0]))[: len(z)]


def somewhere(rng, structure):
    """Draw a forcing and a state of the structure, not near anything."""
    n = structure.n_floors
    omega = log_uniform(rng, 0.1, 10.0) * float(rng.choice(structure.frequencies))
    omega = max(omega, highest_frequency(structure) / FASTEST)
    length, rate = structure.length_unit, structure.frequency_unit
    size = log_uniform(rng, 1e-2, 1.0) * length * min(max(omega, rate), 10 * rate) ** 2
    unit_push = np.abs(np.linalg.solve(structure.mass_matrix, structure.forcing_vector)).max()
    state = np.concatenate((rng.uniform(-0.5, 0.9, n), rng.uniform(-0.5, 0.5, n)))
    return omega, float(size / unit_push), state * structure.state_units


def random_general_case(rng, kind, number=0, rows=None):
    """Draw a case."""
    sharpness = math.inf if rng.random() < 0.35 else log_uniform(rng, 1e2, 1e6)
    structure = random_structure(rng, sharpness, rows=rows)
    omega, amplitude, state = somewhere(rng, structure)
    case = GeneralCase(kind, number, structure, omega, amplitude, tuple(state.tolist()))
    if kind == "anywhere, general":
        return case
    length, speed = structure.state_units[[0, -1]]
    width = 1.0 / min(structure.sharpness, 1e7 / length)
    most = {"two contacts": 2, "three contacts": 3}.get(kind, 1)
    n_contacts = len(structure.contacts)
    chosen = rng.choice(n_contacts, size=min(most, n_contacts), replace=False)
    wanted = []
    for k in chosen:
        if kind == "peak in a layer":
            x = float(rng.uniform(-1, 1)) * width * log_uniform(rng, 1e-2, 10.0)
            wanted.append((k, x, 0.0))
        else:
            v = log_uniform(rng, 1e-8, 1e-1) * float(rng.choice([-1, 1])) * speed
            wanted.append((k, float(rng.normal()) * 2 * width, v))
    z = put(structure, state, wanted)
    if rng.random() < 0.7:
        z = earlier(rng, structure, amplitude, omega, z, chosen)
    return GeneralCase(kind, number, structure, omega, amplitude, tuple(z.tolist()))


def earlier(rng, structure, amplitude, omega, z, chosen):
    """Go back from z, some time that leaves it of ordinary size, through no change of contacts."""
    n = structure.n_floors
    past = distances(structure, z[:n])
    closed = [k for k, x in enumerate(past) if x > 0 and k not in chosen]
    fastest = highest_frequency(structure)
    tau = min(2 * math.pi / omega, 6.0 / structure.frequency_unit) * float(rng.random())
    for _ in range(30):
        start = backwards(structure, amplitude, omega, z, tau, closed)
        if np.abs(start / structure.state_units).max() < 30.0 + np.abs(
            z / structure.state_units
        ).max() and (not closed or tau * fastest < 10.0):
            return start
        tau *= 0.5
    return z


def random_general_cases(number, seed=0, rows=None):
    """Return as many cases of each kind; each has a generator of its own. `rows`: fewest, most."""
    for k in range(number):
        rng = np.random.default_rng([seed, k])
        yield random_general_case(rng, GENERAL_KINDS[k % len(GENERAL_KINDS)], k, rows)
