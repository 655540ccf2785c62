"""Random structures whose contacts have dashpots, and how they compare with the Taylor reference.

``bash benchmarks/run.sh dashpots 1000`` prints the errors of the map of one period and of the
tangent map, over the conditioning of each.
"""

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from reference import reference_points
from stability.random_structures import highest_frequency, log_uniform, random_structure

from hpcsweep.model.dashpot import damping_of_restitution
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome

STEP = 1e-6
"""Of the differences, in units of the state: their own error is some 1e-10 of the conditioning."""


class Case(NamedTuple):
    """A structure with dashpots, and a motion of it."""

    structure: Structure
    amplitude: float
    omega: float
    state: np.ndarray


def with_dashpots(rng, structure: Structure) -> Structure:
    """Give the contacts of a structure dashpots of either rule, most of them."""
    tension = bool(rng.random() < 0.5)
    if structure.matrices is None:
        e = np.where(rng.random(structure.n_floors) < 0.2, 1.0, rng.uniform(0.05, 1.0))
        return replace(structure, restitution=tuple(e.tolist()), tension=tension)
    contacts = []
    for k, contact in enumerate(structure.contacts):
        own = bool(rng.random() < 0.5)
        felt = 1.0 / structure.contact_softness[k]
        e = float(rng.uniform(0.05, 1.0))
        c = damping_of_restitution(e, contact.stiffness, felt, own) * (rng.random() < 0.8)
        contacts.append(replace(contact, damping=float(c), tension=own))
    return replace(structure, matrices=replace(structure.matrices, contacts=tuple(contacts)))


def random_case(rng) -> Case:
    """Draw a case whose contacts have at least one dashpot."""
    while True:
        structure = with_dashpots(rng, random_structure(rng, np.inf, half=1.0))
        if structure.contact_damping.any():
            return case_of(rng, structure)


def case_of(rng, structure: Structure) -> Case:
    """Draw a motion of a structure."""
    units = structure.state_units
    omega = highest_frequency(structure) / log_uniform(rng, 3.0, 100.0)
    push = np.linalg.solve(structure.mass_matrix, structure.forcing_vector)
    size = log_uniform(rng, 0.1, 10.0) * units[-1] * structure.frequency_unit
    state = rng.normal(0.0, 0.7, units.size) * units
    return Case(structure, float(size / np.abs(push).max()), float(omega), state)


def on_a_stop(rng, case: Case) -> Case:
    """Return the case with a start on one of its stops, hardly moving if at all."""
    structure, n = case.structure, case.structure.n_floors
    k = int(rng.integers(len(structure.contacts)))
    d, state = structure.directions[k], case.state.copy()
    slow = (-1e-9, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7)
    if np.count_nonzero(d) == 1:  # others are at rest to rounding alone, which the reference is not
        slow += (0.0,)
    speed = float(rng.choice(slow)) * structure.state_units[-1]
    for part, value in ((state[:n], structure.contacts[k].gap), (state[n:], speed)):
        part -= d * (d @ part - value) / (d @ d)
        if np.count_nonzero(d) == 1:  # to the last bit
            part[np.flatnonzero(d)] = value / d[np.flatnonzero(d)]
    return case._replace(state=state)


def differences(end_of, case: Case) -> np.ndarray:
    """Return the tangent map of a reference, central differences in units of the state."""
    units = case.structure.state_units
    columns = []
    for row in np.diag(STEP * units):
        above, below = end_of(case.state + row), end_of(case.state - row)
        columns.append((above - below) / units / (2 * STEP))
    return np.array(columns).T


def scaled(found, exact, case: Case, growth: np.ndarray) -> float:
    """Return the error of an end over the size of the motion and its conditioning."""
    units = case.structure.state_units
    size = max(1.0, float(np.abs(exact / units).max()), float(np.abs(case.state / units).max()))
    return float(np.abs((found - exact) / units).max() / size / max(1.0, np.abs(growth).max()))


class Errors(NamedTuple):
    """Of a period and of the tangent map, over the conditioning."""

    period: float
    tangent: float


def measure(case: Case) -> Errors:
    """Compare a period of a case with the reference."""
    structure, amplitude, omega, state = case

    def period_of(start):
        return reference_points(structure, amplitude, omega, start, 1)[0]

    growth = differences(period_of, case)
    solver = FlowMap(structure, omega)
    points, outcome = solver.points(state, amplitude, 1)
    assert outcome is Outcome.COMPLETE
    units = structure.state_units
    tangent = solver.monodromy(state, amplitude, 1)[1] * units / units[:, None]
    off = float(np.abs(tangent - growth).max() / max(1.0, np.abs(growth).max()))
    return Errors(scaled(points[0], period_of(state), case, growth), off)


def main(number: int, seed: int = 0) -> None:
    """Print the errors of so many cases."""
    rng = np.random.default_rng(seed)
    errors = [measure(random_case(rng)) for _ in range(number)]
    for name, values in zip(Errors._fields, np.array(errors).T, strict=True):
        shares = np.quantile(values, (0.5, 0.9, 0.99, 1.0))
        print(f"{name:8}", "  ".join(f"{value:.1e}" for value in shares))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
