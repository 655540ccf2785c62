"""Random general structures, and states of them that are hard for the map of one period.

Masses and stiffnesses over four decades each, as chains and as full matrices; one to eight contacts
with random directions, on one side and on both, gaps of any sign and 0; one to three harmonics;
damping by ratios, by Rayleigh's formula and by a matrix; lengths and times of any unit.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from hpcsweep.model.matrices import Contact
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


def log_uniform(rng, low, high):
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def _decades(rng, number):
    """Draw numbers over four decades."""
    return 10 ** rng.uniform(-2.0, 2.0, number)


def _full(rng, diagonal):
    """Draw a full symmetric definite matrix whose diagonal is of the size of that given."""
    n = len(diagonal)
    part = rng.normal(size=(n, n)) / math.sqrt(n)
    root = np.sqrt(diagonal)
    matrix = root[:, None] * (part @ part.T + 0.2 * np.eye(n)) * root
    return 0.5 * (matrix + matrix.T)


def _gap(rng):
    """Draw a gap, in units that are chosen later."""
    kind = rng.random()
    if kind < 0.2:
        return 0.0
    return log_uniform(rng, 0.05, 1.0) if kind < 0.75 else -log_uniform(rng, 0.01, 0.3)


def _direction(rng, n):
    """Draw a coordinate, a difference of two or any direction."""
    kind = rng.choice(["coordinate", "difference", "any"] if n > 1 else ["coordinate", "any"])
    if kind == "any":
        return rng.normal(size=n)
    direction = np.zeros(n)
    one, *rest = rng.permutation(n)
    direction[one] = rng.choice([-1.0, 1.0])
    if kind == "difference":
        direction[rest[0]] = -direction[one]
    return direction


def random_structure(rng, sharpness):
    """Draw a structure; `sharpness` is that of a gap of 1."""
    unit = log_uniform(rng, 1e-3, 1e3)
    rate = log_uniform(rng, 1e-1, 1e1)
    more = {
        "sharpness": sharpness / unit,
        "harmonics": tuple(
            (int(order), log_uniform(rng, 0.1, 1.0), float(rng.uniform(-3.0, 3.0)))
            for order in rng.choice(5, size=rng.integers(1, 4), replace=False) + 1
        ),
    }
    damping = rng.choice(["ratio", "rayleigh", "matrix"])
    zeta = log_uniform(rng, 0.002, 0.3)
    if rng.random() < 0.4:
        n = int(rng.integers(1, 5))
        gaps = np.array([_gap(rng) * unit for _ in range(2 * n)])
        gaps[rng.random(2 * n) < 0.4] = math.inf
        gaps[rng.integers(2 * n)] = _gap(rng) * unit
        if damping != "ratio":
            more["rayleigh"] = (zeta * rate, zeta / rate / 10.0)
        return Structure(
            n,
            tuple(10 ** rng.uniform(0.0, 4.0, n)),
            damping_ratio=zeta,
            mass=tuple(_decades(rng, n)),
            storey_stiffness=tuple(_decades(rng, n) * rate**2),
            gap=tuple(gaps[:n]),
            gap_left=tuple(gaps[n:]),
            **more,
        )
    n = int(rng.integers(1, 7))
    mass, stiffness = _decades(rng, n), _decades(rng, n) * rate**2
    masses = np.diag(mass) if rng.random() < 0.5 else _full(rng, mass)
    springs = _full(rng, stiffness)
    if damping == "ratio":
        more["damping_ratio"] = zeta
    elif damping == "rayleigh":
        more["rayleigh"] = (zeta * rate, zeta / rate / 10.0)
    else:
        more["damping"] = _full(rng, 0.5 * zeta * np.sqrt(mass * stiffness))
    contacts = []
    for _ in range(int(rng.integers(1, 9))):
        if contacts and rng.random() < 0.2:
            direction = -np.array(contacts[-1].direction)
        else:
            direction = _direction(rng, n)
        kappa = log_uniform(rng, 1.0, 1e4) * rate**2
        contacts.append(Contact(tuple(direction), _gap(rng) * unit, kappa))
    forcing = None if rng.random() < 0.5 else rng.normal(size=n) * np.sqrt(mass)
    return Structure.from_matrices(masses, springs, contacts, forcing=forcing, **more)


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


def highest_frequency(structure):
    """Largest natural frequency with all contacts closed."""
    inverse = np.linalg.inv(structure.mass_matrix)
    stiffness = structure.stiffness_matrix.copy()
    for contact in structure.contacts:
        stiffness += contact.stiffness * np.outer(contact.direction, contact.direction)
    return math.sqrt(max(np.linalg.eigvals(inverse @ stiffness).real))


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


def put(structure, z, wanted):
    """Change z, as little as the masses allow, so that contacts have (distance, speed) wanted."""
    n = structure.n_floors
    inverse = np.linalg.inv(structure.mass_matrix)
    rows = np.array([structure.contacts[k].direction for k, _, _ in wanted])
    gaps = np.array([structure.contacts[k].gap for k, _, _ in wanted])
    flexible = inverse @ rows.T
    solve = flexible @ np.linalg.pinv(rows @ flexible, rcond=1e-8)
    z = z.copy()
    for _ in range(2):
        z[:n] += solve @ (gaps + [x for _, x, _ in wanted] - rows @ z[:n])
        z[n:] += solve @ (np.array([v for _, _, v in wanted]) - rows @ z[n:])
    return z


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


def random_general_case(rng, kind, number=0):
    """Draw a case."""
    sharpness = math.inf if rng.random() < 0.35 else log_uniform(rng, 1e2, 1e6)
    structure = random_structure(rng, sharpness)
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


def random_general_cases(number, seed=0):
    """Give as many cases of each kind; each has a generator of its own."""
    for k in range(number):
        rng = np.random.default_rng([seed, k])
        yield random_general_case(rng, GENERAL_KINDS[k % len(GENERAL_KINDS)], k)
