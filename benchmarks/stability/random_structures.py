"""Draw random structures of any kind, and states at their stops."""

import math
from typing import Any

import numpy as np

from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure


def log_uniform(rng, low: float, high: float) -> float:
    """Draw a number from `low` to `high`, log-uniformly."""
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def _decades(rng, number, half):
    """Draw numbers over 2 `half` decades."""
    return 10 ** rng.uniform(-half, half, number)


def _full(rng, diagonal):
    """Draw a full symmetric definite matrix with a diagonal of the given magnitude."""
    n = len(diagonal)
    part = rng.normal(size=(n, n)) / math.sqrt(n)
    root = np.sqrt(diagonal)
    matrix = root[:, None] * (part @ part.T + 0.2 * np.eye(n)) * root
    return 0.5 * (matrix + matrix.T)


def _gap(rng):
    """Draw a gap, before units are chosen."""
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


def random_structure(
    rng, sharpness: float, half: float = 2.0, rows: tuple[int, int] | None = None
) -> Structure:
    """Draw a structure.

    Chains and full matrices; one to eight contacts with random directions, on one side and on
    both, gaps of any sign and 0; one to three harmonics; damping by ratios, by Rayleigh's formula
    and by a matrix; lengths and times of any unit.

    Parameters
    ----------
    rng : Generator
    sharpness : float
        Of a gap of 1.
    half : float
        Masses, storeys and contacts each spread over 2 `half` decades.
    rows : (int, int), optional
        Fewest and most rows, of matrices alone. Default: few.
    """
    unit = log_uniform(rng, 1e-3, 1e3)
    rate = log_uniform(rng, 1e-1, 1e1)
    more: dict[str, Any] = {
        "sharpness": sharpness / unit,
        "harmonics": tuple(
            (int(order), log_uniform(rng, 0.1, 1.0), float(rng.uniform(-3.0, 3.0)))
            for order in rng.choice(5, size=rng.integers(1, 4), replace=False) + 1
        ),
    }
    damping = rng.choice(["ratio", "rayleigh", "matrix"])
    zeta = log_uniform(rng, 0.002, 0.3)
    if rows is None and rng.random() < 0.4:
        n = int(rng.integers(1, 5))
        gaps = np.array([_gap(rng) * unit for _ in range(2 * n)])
        gaps[rng.random(2 * n) < 0.4] = math.inf
        gaps[rng.integers(2 * n)] = _gap(rng) * unit
        if damping != "ratio":
            more["rayleigh"] = (zeta * rate, zeta / rate / 10.0)
        return Structure(
            n,
            tuple(10 ** rng.uniform(0.0, 2.0 * half, n)),
            damping_ratio=zeta,
            mass=tuple(_decades(rng, n, half)),
            storey_stiffness=tuple(_decades(rng, n, half) * rate**2),
            gap=tuple(gaps[:n]),
            gap_left=tuple(gaps[n:]),
            **more,
        )
    n = int(rng.integers(1, 7) if rows is None else rng.integers(rows[0], rows[1] + 1))
    mass, stiffness = _decades(rng, n, half), _decades(rng, n, half) * rate**2
    masses = np.diag(mass) if rng.random() < 0.5 else _full(rng, mass)
    springs = _full(rng, stiffness)
    if damping == "ratio":
        more["damping_ratio"] = zeta
    elif damping == "rayleigh":
        more["rayleigh"] = (zeta * rate, zeta / rate / 10.0)
    else:
        more["damping"] = _full(rng, 0.5 * zeta * np.sqrt(mass * stiffness))
    contacts: list[Contact] = []
    for _ in range(int(rng.integers(1, 9))):
        if contacts and rng.random() < 0.2:
            direction = -np.array(contacts[-1].direction)
        else:
            direction = _direction(rng, n)
        kappa = log_uniform(rng, 1.0, 10.0 ** (2.0 * half)) * rate**2
        contacts.append(Contact(tuple(direction), _gap(rng) * unit, kappa))
    forcing = None if rng.random() < 0.5 else rng.normal(size=n) * np.sqrt(mass)
    return Structure.from_matrices(masses, springs, contacts, forcing=forcing, **more)


def highest_frequency(structure: Structure) -> float:
    """Return the largest natural frequency with all contacts closed."""
    inverse = np.linalg.inv(structure.mass_matrix)
    stiffness = structure.stiffness_matrix.copy()
    for contact in structure.contacts:
        stiffness += contact.stiffness * np.outer(contact.direction, contact.direction)
    return math.sqrt(max(np.linalg.eigvals(inverse @ stiffness).real))


def put(structure: Structure, z: np.ndarray, wanted: list[tuple[int, float, float]]) -> np.ndarray:
    """Change z, least in the norm of the masses, so that contacts have given distances and speeds.

    Parameters
    ----------
    structure : Structure
    z : ndarray, shape (2n,)
    wanted : list of (int, float, float)
        Index of a contact, its distance past the stop, its speed.
    """
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
