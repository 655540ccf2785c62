"""Steps with one contact alone in its layer: tables, length, error, tangent, dense output."""

import itertools
import math

import numpy as np
import pytest
from building import generator
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import expit

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.layer.solitary import equation, plan, step
from hpcsweep.solvers.flow.linear import step as linear_step
from hpcsweep.solvers.flow.rules import solitary_rule as rule
from hpcsweep.solvers.flow.rules import tableau
from hpcsweep.solvers.flow.state.shared import MAXIMA, NO_TALLY
from hpcsweep.solvers.flow.state.tables import forget

OMEGA, AMPLITUDE = 0.445, 0.05
RHO = 1e4
NO_TANGENT = np.empty((6, 0))


@pytest.mark.parametrize(("key", "contact", "level"), [(0, 2, 6), (4, 2, 1), (5, 1, 4), (0, 0, 9)])
def test_tables_are_those_of_the_exponential(key, contact, level):
    structure = Structure(3, 1000.0, RHO, (0.05, 0.3, 1.4))
    flow = FlowMap(structure, OMEGA)
    index = linear_step.lookup(np.uint64(key), flow._packed)
    place = equation.build_response(index, contact, level, flow._packed)
    responses, matrix = flow._shared.responses, generator(structure, key, OMEGA)
    h = flow._shared.tables.h[index] * 2.0 ** (-0.5 * level)
    pushed = np.eye(9)[3 + contact]
    scale = math.sqrt(1.0 + structure.stiffness_ratio)  # of velocities by displacements
    assert pytest.approx(expm(matrix * h)[:6], abs=3e-14 * scale) == responses.step[place][:, :6].T
    x, w = np.polynomial.legendre.leggauss(40)
    for j, node in enumerate(rule.NODES):
        exact = expm(matrix * node * h)
        assert responses.linear[place][:, j] == pytest.approx(exact[contact], abs=3e-14)
        kick = rule.WEIGHTS[j] * h * (expm(matrix * (1.0 - node) * h) @ pushed)
        assert responses.kick[place][j, :6] == pytest.approx(kick[:6], abs=1e-13 * h)
        for k in (0, 7, 15):
            s = 0.5 * node * (x + 1.0)
            others = np.delete(rule.NODES, k)
            lagrange = np.prod((s[:, None] - others) / (rule.NODES[k] - others), axis=1)
            kernel = [(expm(matrix * (node - t) * h) @ pushed)[contact] for t in s]
            integral = 0.5 * node * h * float(np.sum(w * lagrange * kernel))
            assert responses.response[place][k, j] == pytest.approx(integral, abs=1e-14 * h)


class Steps:
    """Single steps from a state at tau = 0, of no more than a length."""

    def __init__(self):
        self.structure = Structure(3, 1000.0, RHO, 0.05)
        self.flow = FlowMap(self.structure, OMEGA)

    def rates(self, tau, z):
        structure = self.structure
        x = z[:3] - 1.0
        push = structure.stiffness_ratio * x * expit(RHO * x)
        ground = AMPLITUDE * math.sin(OMEGA * tau)
        pull = structure.stiffness_matrix @ z[:3] + structure.damping_matrix @ z[3:]
        return np.concatenate((z[3:], -pull - push - ground))

    def take(self, z, most, wanted=NO_TALLY, tangent=NO_TANGENT):
        """Return the length of the step and the state at its end."""
        shared = self.flow._shared
        shared.work.a[:] = self.rates(0.0, z)[3:]
        shared.work.forcing[:] = 0.0, AMPLITUDE
        h = step.solitary_step(most, z, wanted, tangent, self.flow._packed)
        return h, shared.work.z_end.copy()

    def follow(self, z, times):
        """Return the states at these times, by an explicit Runge-Kutta method; shape (times, 6)."""
        solution = solve_ivp(
            self.rates, (0.0, times[-1]), z, "DOP853", times, rtol=1e-13, atol=1e-15, max_step=1e-3
        )
        return solution.y.T


def state(y, speed, second=0.6):
    """Return a state in which the top floor is at rho x = y; that it moves at this speed."""
    return np.array([0.3, second, 1.0 + y / RHO, 0.05, 0.1, speed])


def test_a_step_is_as_long_as_its_ellipse_keeps_off_the_poles():
    places, speeds, pushes = (-3e-3, -2e-4, 0.0, 1e-3), (0.08, 0.0, -0.03), (-2.0, -1e-3, 0.0, 1.5)
    for x, v, pushed in itertools.product(places, speeds, pushes):
        h = plan.until_poles(x, v, pushed, RHO)
        times = np.roots([0.5 * pushed, v, x - 1j * math.pi / RHO])
        if not times.size:
            assert h == math.inf
            continue
        ellipses = 2.0 * (np.abs(times) + np.abs(times - h)) / h
        assert ellipses.min() == pytest.approx(plan.ELLIPSE, rel=1e-9), (x, v, pushed)


ON_THEIR_WAY = [(-20.0, 0.06), (-3.0, 0.03), (0.5, 0.04), (8.0, -0.05), (15.0, 0.01), (-8.0, -0.02)]


@pytest.mark.parametrize(("y", "speed"), ON_THEIR_WAY)
def test_a_step_ends_where_the_motion_does(y, speed):
    steps, z = Steps(), state(y, speed)
    h, after = steps.take(z, 1.0)
    assert h > 2e-3
    assert after == pytest.approx(steps.follow(z, [h])[-1], abs=5e-13)


@pytest.mark.parametrize(("y", "speed"), ON_THEIR_WAY)
def test_the_tangent_is_the_derivative_of_the_step(y, speed):
    steps, z = Steps(), state(y, speed)
    tangent = np.eye(6)
    h, _ = steps.take(z, 1.0, tangent=tangent)
    for column in range(6):
        ends = []
        for sign in (1.0, -1.0):
            moved = z.copy()
            moved[column] += sign * 1e-8
            length, end = steps.take(moved, h * (1 + 1e-12))
            assert length == h
            ends.append(end)
        assert tangent[:, column] == pytest.approx((ends[0] - ends[1]) / 2e-8, abs=1e-5)


@pytest.mark.parametrize(("y", "speed"), ON_THEIR_WAY)
def test_what_is_observed_lies_on_the_motion(y, speed):
    steps, z = Steps(), state(y, speed)
    h, _ = steps.take(z, 1.0, wanted=MAXIMA)
    layer = steps.flow._shared.work.layer
    seen = np.vstack((layer.u, layer.v))
    there = steps.follow(z, tableau.NODES * h)
    assert seen[:3] == pytest.approx(there.T[:3], abs=1e-12)
    assert seen[3:] == pytest.approx(there.T[3:], abs=1e-10)


def test_steps_are_left_to_others_where_two_are_in_their_layers_or_none_is():
    steps = Steps()
    assert steps.take(state(-3.0, 0.03, second=1.0 - 5e-4), 1.0)[0] == 0.0
    assert steps.take(state(-60.0, 0.03), 1.0)[0] == 0.0
    alone, _ = steps.take(state(-3.0, 0.03), 1.0)
    nearer, _ = steps.take(state(-3.0, 0.03, second=1.0 - 4.5e-3), 1.0)
    assert 0.0 < nearer < alone


def test_an_emptied_store_changes_nothing():
    structure = Structure(3, 1000.0, RHO, 0.05)
    flow = FlowMap(structure, 0.21)
    start = flow.advance(np.zeros(6), 0.22, 20).state
    points, _ = flow.points(start, 0.22, 30)
    assert flow._shared.responses.count[0] > 0
    forget(flow._shared.responses)
    assert flow._shared.responses.count[0] == 0
    again, _ = flow.points(start, 0.22, 30)
    assert np.array_equal(points, again)
    assert flow._shared.responses.count[0] > 0
