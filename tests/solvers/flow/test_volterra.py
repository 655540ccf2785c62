"""Steps with a few contacts in their layers, in modes: tables, length, motion, measures."""

import itertools
import math

import numpy as np
import pytest
from reference import reference_points
from scipy.linalg import expm
from together import together
from tools import flat

from hpcsweep import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.layer.volterra import plan
from hpcsweep.solvers.flow.rules.volterra_rule import NODES, WEIGHTS
from hpcsweep.solvers.flow.state import shared
from hpcsweep.solvers.outcome import Outcome

PLAIN, OBLIQUE = ((0, 1, 0), (0, 0, 1)), ((0, 0, 1), (-1, 1, 0))
START = np.array([0.1, 0.2, 0.25, 0.3, 0.5, 0.9])
OMEGA, TWO = 3.0, ((1, 1.0, 0.3), (3, 0.5, 0.1))
BARELY = 1e-11
"""By which modes are coupled, of their damping, where a structure is to be collocated."""


def small(directions, sharpness=2000.0, coupled=False, **more):
    springs = np.array([[40.0, -20, 0], [-20, 40, -20], [0, -20, 20]])
    stops = [Contact(d, g, k) for d, g, k in zip(directions, (0.2, 0.15), (300, 500), strict=True)]
    of = {"damping_ratio": (0.02, 0.3, 1.5), "sharpness": sharpness, **more}
    made = Structure.from_matrices((1.0,) * 3, springs, stops, **of)
    if not coupled:
        return made
    damping = made.damping_matrix + BARELY * np.eye(3, k=2) + BARELY * np.eye(3, k=-2)
    return Structure.from_matrices(
        (1.0,) * 3, springs, stops, damping=damping, sharpness=sharpness, **more
    )


def test_tables_are_those_of_the_exponential():
    structure = small(PLAIN, harmonics=TWO)
    flow = FlowMap(structure, OMEGA)
    flow.advance(START, 3.0, 2)
    own, model = flow._shared.volterra, flow._shared.model
    spectrum, contacts = flow._shared.tables.spectrum, model.contacts
    n, unit, rates = 3, structure.frequency_unit, [h[0] * model.omega for h in TWO]
    # of displacements, speeds and pairs
    field = np.zeros((10, 10))
    field[:n, n : 2 * n] = np.eye(n)
    field[n : 2 * n, :n] = -structure.stiffness_matrix / unit**2
    field[n : 2 * n, n : 2 * n] = -structure.damping_matrix / unit
    for k, rate in enumerate(rates):
        field[n : 2 * n, 2 * n + 2 * k] = model.forcing[:n]
        field[2 * n + 2 * k, 2 * n + 2 * k + 1] = rate
        field[2 * n + 2 * k + 1, 2 * n + 2 * k] = -rate
    shapes, width = spectrum.shapes[:n, :n], spectrum.squares.size
    fastest = max(spectrum.squares.max() ** 0.5, -spectrum.rates.min(), *rates)
    to_rows = np.zeros((10, 10))
    to_rows[:n, :n] = to_rows[n : 2 * n, n : 2 * n] = shapes
    to_rows[2 * n :, 2 * n :] = np.eye(4)
    places = [*range(n), *range(width, width + n), *range(2 * width, 2 * width + 4)]
    x, w = np.polynomial.legendre.leggauss(40)
    seen = set()
    for level, k, other in np.argwhere(own.place > 0):
        h = 2.0 / fastest * 2.0 ** (-0.5 * level)
        kick = np.concatenate((np.zeros(n), contacts.kick[other, :n], np.zeros(4)))
        row = np.concatenate((contacts.reach[k], np.zeros(n + 4)))
        if (k, other) in seen:
            continue
        seen.add((k, other))
        ends = np.linalg.solve(to_rows, expm(field * h) @ to_rows)[: 2 * n].reshape(2, n, 10)
        for j in range(n):
            of_units = ends[:, j, [j, n + j, *range(2 * n, 10)]]
            np.testing.assert_allclose(own.steps[level, :, :, j], of_units, atol=1e-13)
            for node in (0, 7, 15):
                late = np.linalg.solve(to_rows, expm(field * (1.0 - NODES[node]) * h) @ to_rows)
                late = WEIGHTS[node] * h * late[[j, n + j], n + j]
                np.testing.assert_allclose(own.late[level, :, node, j], late, atol=1e-14 * h)
        table = own.responses[own.place[level, k, other] - 1]
        for i, p in ((3, 7), (15, 0), (9, 15)):
            free = row @ expm(field * NODES[i] * h) @ to_rows
            assert own.linear[level, k, places, i] == pytest.approx(free, abs=1e-14)
            s = 0.5 * NODES[i] * (x + 1.0)
            others = np.delete(NODES, p)
            lagrange = np.prod((s[:, None] - others) / (NODES[p] - others), axis=1)
            kernel = [row @ expm(field * (NODES[i] - t) * h) @ kick for t in s]
            integral = 0.5 * NODES[i] * h * float(np.sum(w * lagrange * kernel))
            assert table[p, i] == pytest.approx(integral, abs=1e-15 * h)
    assert len(seen) == 4


def test_a_step_is_as_long_as_its_ellipse_keeps_off_the_poles():
    places, speeds, pushes = (-3e-3, -2e-4, 0.0, 1e-3), (0.08, 0.0, -0.03), (-2.0, -1e-3, 0.0, 1.5)
    for x, v, pushed in itertools.product(places, speeds, pushes):
        h = plan.until_poles(x, v, pushed, 1e4)
        times = np.roots([0.5 * pushed, v, x - 1j * math.pi / 1e4])
        if not times.size:
            assert h == math.inf
            continue
        ellipses = 2.0 * (np.abs(times) + np.abs(times - h)) / h
        assert ellipses.min() == pytest.approx(plan.ELLIPSE, rel=1e-9), (x, v, pushed)


@together("sharpness, error", [(20.0, 1e-12), (100.0, 1e-12), (2000.0, 1e-12)])
def test_motions_are_those_of_the_reference(sharpness, error):
    for directions in (PLAIN, OBLIQUE):
        structure = small(directions, sharpness, harmonics=TWO)
        flow = FlowMap(structure, OMEGA)
        points, _ = flow.points(START, 3.0, 2)
        assert flow._shared.volterra.count[0] > 0
        expected = reference_points(structure, 3.0, OMEGA, START, 2)
        kappa = np.abs(flow.monodromy(START, 3.0, 2)[1]).max()
        assert np.abs(points - expected).max() < error * max(1.0, kappa)


@together("sharpness", [40.0, 2000.0])
def test_all_is_as_collocated(sharpness):
    for directions in (PLAIN, OBLIQUE):
        found = []
        for coupled in (False, True):
            flow = FlowMap(small(directions, sharpness, coupled), OMEGA)
            seen = flow.observe(START, 3.0, 3, modal_norm=True, measures=shared.ANY_MEASURE)
            moved = flow.advance(START, 3.0, 3)
            # what is gathered does not change the motion
            np.testing.assert_array_equal(moved.state, seen.points[-1])
            assert coupled == (flow._shared.volterra.count[0] == 0)
            tangent = flow.monodromy(START, 3.0, 3)[1]
            found.append((seen.points, flat(seen.measures), tangent, seen.modal_norm))
        for value, right, error in zip(*found, (1e-10, 2e-9, 1e-8, 3e-4), strict=True):
            np.testing.assert_allclose(value, right, rtol=error, atol=error)


def test_an_emptied_store_changes_nothing():
    flow = FlowMap(Structure(3, 1000.0, 1e4, 0.05), 0.21)
    start = flow.advance(np.zeros(6), 0.22, 20).state
    points, _ = flow.points(start, 0.22, 30)
    own = flow._shared.volterra
    assert own.count[0] > 0
    own.count[0] = len(own.responses)
    again, _ = flow.points(start, 0.22, 30)
    assert np.array_equal(points, again)
    assert own.count[0] < len(own.responses)


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
    assert flow._shared.volterra.count[0] > 0
    expected = reference_points(structure, 5.0, omega, state, 1)
    assert np.abs(points - expected).max() < 2e-12 * max(1.0, np.abs(expected).max())
    _, matrix = flow.monodromy(state, 5.0, 1)
    volume = -2.0 * math.pi / omega * np.trace(structure.damping_matrix)
    assert np.linalg.slogdet(matrix)[1] == pytest.approx(volume, rel=1e-9)
