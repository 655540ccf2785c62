"""Steps with several contacts in their layers, in modes: tables, motion, tangent, measures."""

import math

import numpy as np
import pytest
from reference import reference_points
from scipy.linalg import expm

from hpcsweep import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.rules.solitary_rule import NODES
from hpcsweep.solvers.flow.state import shared, tables
from hpcsweep.solvers.outcome import Outcome

PLAIN, OBLIQUE = ((0, 1, 0), (0, 0, 1)), ((0, 0, 1), (-1, 1, 0))
START = np.array([0.1, 0.2, 0.25, 0.3, 0.5, 0.9])


def small(directions, sharpness=2000.0):
    springs = np.array([[40.0, -20, 0], [-20, 40, -20], [0, -20, 20]])
    stops = [Contact(d, g, k) for d, g, k in zip(directions, (0.2, 0.15), (300, 500), strict=True)]
    more = {"damping_ratio": (0.02, 0.3, 1.5), "sharpness": sharpness}
    return Structure.from_matrices((1.0,) * 3, springs, stops, **more)


@pytest.fixture
def in_modes(monkeypatch):
    """Return what makes something of a small structure, in modes or by tables."""

    def make(of_solver, wanted=True):
        monkeypatch.setattr(tables, "LARGE", 1 if wanted else 100)
        shared._pattern_of.cache_clear()
        made = of_solver()
        shared._pattern_of.cache_clear()
        return made

    return make


def test_responses_are_those_of_the_exponential(in_modes):
    structure = small(PLAIN)
    flow = in_modes(lambda: FlowMap(structure, 3.0))
    flow.advance(START, 3.0, 2)
    own, contacts = flow._shared.coupled, flow._shared.model.contacts
    n, unit = 3, structure.frequency_unit
    field = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-structure.stiffness_matrix / unit**2, -structure.damping_matrix / unit],
        ]
    )
    fastest = max(
        flow._shared.tables.spectrum.squares.max() ** 0.5, -flow._shared.tables.spectrum.rates.min()
    )
    x, w = np.polynomial.legendre.leggauss(40)
    seen = set()
    for level, k, other in np.argwhere(own.place > 0):
        if (k, other) in seen:
            continue
        seen.add((k, other))
        h = 2.0 / fastest * 2.0 ** (-0.5 * level)
        table = own.responses[own.place[level, k, other] - 1]
        row = np.concatenate((contacts.reach[k], np.zeros(n)))
        kick = np.concatenate((np.zeros(n), contacts.kick[other, :n]))
        for i, p in ((3, 7), (15, 0), (9, 15)):
            s = 0.5 * NODES[i] * (x + 1.0)
            others = np.delete(NODES, p)
            lagrange = np.prod((s[:, None] - others) / (NODES[p] - others), axis=1)
            kernel = [row @ expm(field * (NODES[i] - t) * h) @ kick for t in s]
            integral = 0.5 * NODES[i] * h * float(np.sum(w * lagrange * kernel))
            assert table[p, i] == pytest.approx(integral, abs=1e-15 * h)
    assert len(seen) == 4


@pytest.mark.parametrize("directions", [PLAIN, OBLIQUE], ids=["plain", "oblique"])
@pytest.mark.parametrize("sharpness", [40.0, 2000.0])
def test_all_is_as_by_tables(directions, sharpness, in_modes):
    def gather():
        flow = FlowMap(small(directions, sharpness), 3.0)
        seen = flow.observe(START, 3.0, 3, modal_norm=True, measures=shared.ANY_MEASURE)
        moved = flow.advance(START, 3.0, 3)
        # what is gathered does not change the motion
        np.testing.assert_array_equal(moved.state, seen.points[-1])
        assert wanted == (flow._shared.coupled.count[0] > 0)
        return seen.points, seen.measures, flow.monodromy(START, 3.0, 3)[1], seen.modal_norm

    wanted = False
    expected = in_modes(gather, wanted)
    wanted = True
    found = in_modes(gather, wanted)
    for value, right, error in zip(found, expected, (1e-11, 2e-9, 1e-9, 3e-4), strict=True):
        np.testing.assert_allclose(value, right, rtol=error, atol=error)


def chain(n, m, sharpness):
    """A chain of n masses, m of which have stops ahead, the top first."""
    springs = 0.4 * n * n * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    springs[-1, -1] *= 0.5
    rows = [n - 1 - k * n // m for k in range(m)]
    stops = [Contact(tuple(np.eye(n)[i]), (i + 1) / n, 50.0 * n) for i in rows]
    more = {"damping_ratio": 0.03, "sharpness": sharpness}
    return Structure.from_matrices((1.0,) * n, springs, stops, **more)


@pytest.mark.parametrize("n", [24, 40])
def test_many_rows_agree_with_the_reference(n):
    structure = chain(n, 6, 1000.0)
    omega = 1.5 * float(structure.frequencies[2])
    state = np.concatenate((np.linspace(0.0, 1.1, n), np.linspace(0.0, 0.8, n)))
    flow = FlowMap(structure, omega)
    points, outcome = flow.points(state, 5.0, 1)
    assert outcome is Outcome.COMPLETE
    assert flow._shared.coupled.count[0] > 0
    expected = reference_points(structure, 5.0, omega, state, 1)
    assert np.abs(points - expected).max() < 2e-12 * max(1.0, np.abs(expected).max())
    _, matrix = flow.monodromy(state, 5.0, 1)
    volume = -2.0 * math.pi / omega * np.trace(structure.damping_matrix)
    assert np.linalg.slogdet(matrix)[1] == pytest.approx(volume, rel=1e-9)
