"""Contacts that are at their stops at one instant: n of them cost n, and give what one gives."""

import math

import numpy as np
import pytest

from hpcsweep import Contact, Structure
from hpcsweep.solvers.flow.flow_map import FlowMap
from hpcsweep.solvers.outcome import Outcome

PERIODS = 20


def points_of(structure, amplitude=0.3, omega=1.0):
    solver = FlowMap(structure, omega, 1e-9)
    points, outcome = solver.points(np.zeros(2 * structure.n_floors), amplitude, PERIODS)
    assert outcome is Outcome.COMPLETE
    return points, solver


def pair(n: int, sharpness: float = math.inf) -> Structure:
    """Two masses, n equal contacts of the first, which together are as stiff as one."""
    contacts = [Contact((1.0, 0.0), 1.0, 640.0 / n)] * n
    return Structure.from_matrices(
        np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], contacts, damping_ratio=0.05, sharpness=sharpness
    )


@pytest.mark.parametrize("n", [2, 8, 16, 33, 64])
def test_equal_contacts_are_one_of_their_stiffness(n):
    one, _ = points_of(pair(1))
    many, _ = points_of(pair(n))
    np.testing.assert_allclose(many, one, rtol=0, atol=1e-12)


def test_a_sharp_but_smooth_stop_comes_near_them():
    many, _ = points_of(pair(8))
    smooth, _ = points_of(pair(8, 1e6))
    np.testing.assert_allclose(smooth, many, rtol=0, atol=1e-4)


def oscillators(n: int, gap_left: float = math.inf) -> Structure:
    """Equal oscillators that know nothing of each other, each with its stops."""
    directions = np.eye(n)
    contacts = [Contact(tuple(row), 1.0, 100.0) for row in directions]
    if gap_left < math.inf:
        contacts += [Contact(tuple(-row), gap_left, 50.0) for row in directions]
    return Structure.from_matrices(np.ones(n), np.eye(n), contacts, damping_ratio=0.05)


@pytest.mark.parametrize("gap_left", [math.inf, 1.0])
def test_equal_oscillators_move_as_one_does_and_cost_as_many_events(gap_left):
    alone, single = points_of(oscillators(1, gap_left), 0.6, 0.9)
    assert np.abs(alone).max() > 0.5
    for n in (2, 8, 32):
        points, solver = points_of(oscillators(n, gap_left), 0.6, 0.9)
        for own, column in ((alone[:, :1], points[:, :n]), (alone[:, 1:], points[:, n:])):
            np.testing.assert_allclose(column, np.repeat(own, n, axis=1), rtol=0, atol=1e-11)
        steps = [int(one.counts[0]) for one in (single, solver)]
        tables = [one.n_tables for one in (single, solver)]
        assert steps[1] <= 1.2 * steps[0]
        assert tables[1] == tables[0]


def test_all_that_touched_are_in_the_contact_set():
    solver = FlowMap(oscillators(16), 0.9, 1e-9)
    seen = solver.observe(np.zeros(32), 0.6, 10)
    assert seen.contact == 2**16 - 1
    _, monodromy = solver.monodromy(np.zeros(32), 0.6, 2)
    single = FlowMap(oscillators(1), 0.9, 1e-9).monodromy(np.zeros(2), 0.6, 2)[1]
    expected = np.kron(single, np.eye(16))
    np.testing.assert_allclose(monodromy, expected, rtol=0, atol=1e-9)
