"""The battery both solvers pass: closed forms, conservation laws and the Taylor references."""

import inspect
import math

import numpy as np
import pytest
from reference import (
    CASES,
    OMEGA,
    reference_monodromy,
    reference_points,
    reference_window,
)
from scipy.linalg import expm
from together import together

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver, stroboscopic_points
from hpcsweep.solvers.yielding_map import YieldingMap

RTOL = {"flow": 1e-9, "bdf": 1e-8}
FACTOR = {"flow": 1.0, "bdf": 1e3}
"""Error over two or three periods allowed, in units of the tolerance: bdf controls a step only."""
IMPACTING = Structure(3, 1000.0, 1e4, 0.05)


@pytest.fixture(params=["flow", "bdf"])
def name(request):
    return request.param


@pytest.fixture
def allowed(name):
    return FACTOR[name] * RTOL[name]


def each_solver(names: str, *cases: tuple):
    """Parametrise a test over solvers and cases: with bdf the last one is quick."""
    slow = [pytest.param("bdf", *case, marks=pytest.mark.slow) for case in cases[:-1]]
    both = [*(("flow", *case) for case in cases), *slow, ("bdf", *cases[-1])]
    return pytest.mark.parametrize(f"name, {names}", both)


def solver_for(name, structure, omega=OMEGA, rtol=None):
    return make_solver(name, structure, omega, rtol or RTOL[name])


def assert_near_reference(name, structure, amplitude, omega, state, n_periods, allowed):
    points, outcome = solver_for(name, structure, omega).points(state, amplitude, n_periods)
    assert outcome is Outcome.COMPLETE
    exact = reference_points(structure, amplitude, omega, state, n_periods)
    assert np.abs(points - exact).max() <= allowed


def harmonic_state(structure, amplitude, omega):
    response = amplitude * structure.linear_steady_state(omega)
    return np.concatenate((response.imag, omega * response.real))


@together("solver", [FlowMap, YieldingMap])
def test_solvers_have_the_same_methods_with_the_same_arguments(solver):
    methods = inspect.getmembers(BdfMap, inspect.isfunction)
    names = [name for name, _ in methods if not name.startswith("_")]
    assert len(names) == 7
    for name in names:
        arguments, others = (inspect.signature(getattr(x, name)) for x in (BdfMap, solver))
        assert [*arguments.parameters] == [*others.parameters], name


@each_solver("n", (1,), (2,), (5,), (3,))
def test_linear_steady_state(name, allowed, n):
    structure = Structure(n, 1000.0, 1e4, 0.05)
    amplitude = 0.9 * structure.grazing_amplitude(0.4)
    state = harmonic_state(structure, amplitude, 0.4)
    seen = solver_for(name, structure, 0.4).observe(state, amplitude, 2, modal_norm=True)
    assert seen.outcome is Outcome.COMPLETE
    assert np.abs(seen.points - state).max() <= allowed
    assert seen.contact == 0
    response = structure.linear_steady_state(0.4)
    drift = amplitude * np.abs(np.diff(response, prepend=0)).max()
    assert seen.peak_drift == pytest.approx(drift, abs=allowed)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_free_decay(name, allowed, n):
    structure = Structure(n, 1000.0, 1e4, np.linspace(0.0, 1.5, n))
    z = np.concatenate((np.linspace(-0.1, 0.3, n), np.linspace(0.2, -0.2, n)))
    zero = np.zeros((n, n))
    field = np.block([[zero, np.eye(n)], [-structure.stiffness_matrix, -structure.damping_matrix]])
    points, _ = solver_for(name, structure, 0.8).points(z, 0.0, 2)
    for k, point in enumerate(points, start=1):
        assert np.abs(point - expm(k * 2 * math.pi / 0.8 * field) @ z).max() <= allowed


def test_zero_sharpness_is_a_pretensioned_linear_spring(name, allowed):
    beta, omega, amplitude = 40.0, 0.8, 0.3
    structure = Structure(2, beta, 0.0, 0.1)
    stiffness = structure.stiffness_matrix + 0.5 * beta * np.eye(2)
    rest = np.linalg.solve(stiffness, 0.5 * beta * np.ones(2))
    dynamic = stiffness - omega**2 * np.eye(2) + 1j * omega * structure.damping_matrix
    response = np.linalg.solve(dynamic, -amplitude * np.ones(2))
    state = np.concatenate((rest + response.imag, omega * response.real))
    points, outcome = solver_for(name, structure, omega).points(state, amplitude, 2)
    assert outcome is Outcome.COMPLETE
    assert np.abs(points - state).max() <= allowed


@pytest.mark.parametrize("case", range(len(CASES)))
def test_flow_is_within_1e_8_of_the_reference_for_20_periods(case):
    beta, amplitude = CASES[case]
    structure = Structure(3, beta, 1e4, 0.05)
    points = stroboscopic_points(structure, amplitude, OMEGA, np.zeros(6), 20)
    exact = reference_points(structure, amplitude, OMEGA, np.zeros(6), 20)
    assert np.abs(points - exact).max(axis=1).max() <= 1e-8


@each_solver("amplitude", (0.06,), (0.25,), (0.0987,))
def test_contact_from_rest(name, allowed, amplitude):
    assert_near_reference(name, IMPACTING, amplitude, OMEGA, np.zeros(6), 3, allowed)


@each_solver("n", (1,), (5,), (2,))
def test_other_numbers_of_floors(name, allowed, n):
    structure = Structure(n, 300.0, 1e4, 0.02)
    amplitude = 1.5 * structure.grazing_amplitude(0.6)
    state = harmonic_state(structure, amplitude, 0.6)
    state[:n] = np.minimum(state[:n], 0.9)
    assert solver_for(name, structure, 0.6).observe(state, amplitude, 2).contact > 0
    assert_near_reference(name, structure, amplitude, 0.6, state, 2, allowed)


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.5, 30.0, 1e3, 1e6, 1e8, math.inf])
def test_sharpness(name, allowed, rho):
    # a soft sigmoid pulls with beta / 2 all the time: a weaker one keeps the motion moderate
    structure = Structure(3, 200.0 if rho > 100 else 10.0, rho, 0.05)
    assert_near_reference(name, structure, 0.06, OMEGA, np.zeros(6), 2, allowed)


@pytest.mark.parametrize("over", [1 - 1e-4, 1 + 1e-5, 1 + 1e-3])
def test_grazing(name, allowed, over):
    amplitude = over * IMPACTING.grazing_amplitude(OMEGA)
    state = harmonic_state(IMPACTING, amplitude, OMEGA)
    assert_near_reference(name, IMPACTING, amplitude, OMEGA, state, 1, allowed)


@pytest.mark.parametrize("past", [0.0, 1e-4, -1e-4, 0.01])
def test_states_at_rest_against_the_stop(name, allowed, past):
    state = np.array([0.9, 1.0 + past, 1.0 + past, 0.0, 0.0, 0.0])
    assert_near_reference(name, IMPACTING, 0.1, 1.1, state, 1, allowed)


def test_first_contact_inside_a_step_is_not_stepped_over(name):
    # peaks that pass the stop by 1e-6 to 1e-2 gaps; unseen, 1e-4 alone would cost 2e-3
    structure = Structure(1, 1000.0, math.inf, 0.0)
    for past in (1e-6, 1e-4, 1e-2):
        peak = 1 + past
        phase = 2.0
        state = np.array([peak * math.cos(phase), peak * math.sin(phase)])
        seen = solver_for(name, structure, 1.0, rtol=1e-7).observe(state, 0.0, 1)
        assert seen.contact == 1, past
        exact = reference_points(structure, 0.0, 1.0, state, 1)
        assert np.abs(seen.points - exact).max() < 1e-4


@each_solver("rho", (1e4,), (math.inf,))
def test_energy_is_kept_without_damping_and_forcing(name, allowed, rho):
    structure = Structure(2, 200.0, rho, 0.0)
    state = np.array([0.9, 0.2, 0.6, 1.1])

    def energy(z):
        u, v = z[:2], z[2:]
        return 0.5 * (v @ v + u @ structure.stiffness_matrix @ u)

    seen = solver_for(name, structure, 1.0).observe(state, 0.0, 4)
    assert seen.contact > 0
    out = seen.points[(seen.points[:, :2] < 1 - 4e-3).all(axis=1)]
    assert len(out) >= 2
    assert max(abs(energy(z) - energy(state)) for z in out) <= 2 * allowed


@pytest.mark.slow
@each_solver("amplitude, rho", (0.25, 1e4), (0.1, math.inf), (0.06, 1e4))
def test_window_against_the_dense_reference(name, allowed, amplitude, rho):
    structure = Structure(3, 1000.0, rho, 0.05)
    state = reference_points(structure, amplitude, OMEGA, np.zeros(6), 3)[-1]
    contact, drift, modal = reference_window(structure, amplitude, OMEGA, state, 2)
    assert contact > 0
    seen = solver_for(name, structure).observe(state, amplitude, 2, modal_norm=True)
    assert seen.contact == contact
    assert seen.peak_drift == pytest.approx(drift, abs=allowed)
    assert seen.modal_norm == pytest.approx(modal, abs={"flow": 1e-7, "bdf": 3e-5}[name])
    plain = solver_for(name, structure).observe(state, amplitude, 1)
    assert np.all(np.isnan(plain.modal_norm))
    assert np.array_equal(plain.points, seen.points[:1])


def test_modal_norms_are_nan_if_a_floor_always_touches(name):
    # a constant push is no forcing: a weak stop in which the floor starts deep, for a short time
    structure = Structure(1, 1.0, math.inf, 0.05)
    seen = solver_for(name, structure, 50.0).observe(np.array([2.0, 0.0]), 0.0, 1, True)
    assert seen.contact == 1
    assert np.all(np.isnan(seen.modal_norm))


@pytest.mark.parametrize("rho", [10.0, 1e4, math.inf])
def test_monodromy(name, rho):
    structure = Structure(3, 1000.0 if rho > 10 else 20.0, rho, 0.05)
    state = reference_points(structure, 0.06, OMEGA, np.zeros(6), 2)[-1]
    final, matrix = solver_for(name, structure).monodromy(state, 0.06, 1)
    exact_final, exact = reference_monodromy(structure, 0.06, OMEGA, state, 1)
    limit = {"flow": 1e-8, "bdf": 2e-5}[name]
    assert np.abs(final - exact_final).max() <= limit
    assert np.abs(matrix - exact).max() <= limit * max(1.0, np.abs(exact).max())


@pytest.mark.slow
def test_growth_is_that_of_the_exact_tangent_map(name):
    structure = Structure(3, 1000.0, 1e4, 0.05)
    start = reference_points(structure, 0.06, OMEGA, np.zeros(6), 2)[-1]
    z, vector, exact = start, np.full(6, math.sqrt(1 / 6)), 0.0
    for _ in range(2):
        z, matrix = reference_monodromy(structure, 0.06, OMEGA, z, 1)
        vector = matrix @ vector
        exact += math.log(np.linalg.norm(vector))
        vector /= np.linalg.norm(vector)
    seen = solver_for(name, structure).observe(start, 0.06, 2, growth=True)
    assert seen.growth == pytest.approx(exact, abs={"flow": 1e-9, "bdf": 1e-3}[name])
    assert math.isnan(solver_for(name, structure).observe(start, 0.06, 1).growth)


@each_solver("rho", (1e4,), (math.inf,))
def test_determinant_of_the_monodromy(name, rho):
    # Liouville: the divergence of the field is -tr(2 gamma C) everywhere
    structure = Structure(2, 1000.0, rho, (0.02, 0.05))
    omega = 0.9
    _, matrix = solver_for(name, structure, omega).monodromy(np.zeros(4), 0.5, 2)
    assert solver_for(name, structure, omega).observe(np.zeros(4), 0.5, 2).contact > 0
    exact = math.exp(-2 * 2 * math.pi / omega * np.trace(structure.damping_matrix))
    limit = {"flow": 1e-8, "bdf": 2e-4}[name]
    assert np.linalg.det(matrix) == pytest.approx(exact, rel=limit)


def test_methods_agree_exactly_and_leave_the_state_alone(name):
    solver = solver_for(name, IMPACTING)
    state = np.array([0.1, 0.2, 0.3, 0.1, 0.0, -0.1])
    before = state.copy()
    points, _ = solver.points(state, 0.06, 2)
    advance = solver.advance(state, 0.06, 2)
    assert advance.n_periods == 2
    assert advance.outcome is Outcome.COMPLETE
    assert np.array_equal(advance.state, points[-1])
    # a period is a function of its start state alone
    second, _ = solver_for(name, IMPACTING).points(points[0], 0.06, 1)
    assert np.array_equal(second[0], points[1])
    assert np.array_equal(state, before)


def test_no_periods(name):
    solver = solver_for(name, IMPACTING)
    state = np.full(6, 0.1)
    points, outcome = solver.points(state, 0.06, 0)
    assert points.shape == (0, 6)
    assert outcome is Outcome.COMPLETE
    assert np.array_equal(solver.advance(state, 0.06, 0).state, state)
    final, matrix = solver.monodromy(state, 0.06, 0)
    assert np.array_equal(final, state)
    assert np.array_equal(matrix, np.eye(6))


def test_what_is_at_rest_stays_there(name):
    done = solver_for(name, IMPACTING).advance(np.zeros(6), 0.0, 5)
    assert done.n_periods == 5
    assert not done.state.any()


def test_settling_ends_where_the_motion_does(name):
    solver = solver_for(name, IMPACTING)
    end = solver.settle(np.zeros(6), 0.06, 3, 2, 1e-10, 1e-6)
    done = solver.advance(np.zeros(6), 0.06, 3)
    assert (end.n_periods, end.n_newton, end.period) == (3, 0, 0)
    assert math.isnan(end.multiplier)
    assert end.outcome is Outcome.COMPLETE
    assert np.array_equal(end.state, done.state)


def test_poll_may_stop_the_work(name):
    class Stop(Exception):
        pass

    def stop():
        raise Stop

    solver = solver_for(name, IMPACTING)
    for call in (solver.advance, solver.points, solver.observe):
        with pytest.raises(Stop):
            call(np.zeros(6), 0.06, 2, poll=stop)


@pytest.mark.parametrize(
    ("state", "amplitude"),
    [
        ([math.nan, 0.0], 0.1),
        ([0.0, math.inf], 0.1),
        ([0.0, 0.0], math.nan),
        ([1e308, 1e308], 0.1),
    ],
)
def test_failure_is_an_outcome(name, state, amplitude):
    solver = solver_for(name, Structure(1, 1e7, 1e4, 0.05))
    start = np.array(state)
    points, outcome = solver.points(start, amplitude, 2)
    assert outcome is Outcome.NON_FINITE
    assert points.shape == (0, 2)
    done = solver.advance(start, amplitude, 2)
    assert (done.n_periods, done.outcome) == (0, Outcome.NON_FINITE)
    assert np.array_equal(done.state, start, equal_nan=True)
    assert solver.observe(start, amplitude, 2, True).outcome is Outcome.NON_FINITE
    with pytest.raises(ArithmeticError, match=f"{name}: NON_FINITE in forcing period 1"):
        solver.monodromy(start, amplitude, 2)


def test_step_limit_is_an_outcome(name, monkeypatch):
    module = {"flow": "hpcsweep.solvers.flow.flow_map", "bdf": "hpcsweep.solvers.bdf"}[name]
    monkeypatch.setattr(f"{module}.MAX_STEPS", 5)
    points, outcome = solver_for(name, IMPACTING).points(np.zeros(6), 0.06, 2)
    assert outcome is Outcome.STEP_LIMIT
    assert points.shape == (0, 6)


@pytest.mark.parametrize("limit", [5, 60, 200])
def test_no_period_takes_more_steps_than_the_limit(monkeypatch, limit):
    """Those that no contact can end are taken in one go, after those before them."""
    monkeypatch.setattr("hpcsweep.solvers.flow.flow_map.MAX_STEPS", limit)
    solver = make_solver("flow", Structure(3, 1e4, math.inf, 0.05), 0.01, 1e-10)
    solver.points(np.full(6, 2.0), 1.0, 1)
    assert limit - 3 <= solver.counts[0] + solver.counts[2] <= limit


@pytest.mark.slow
def test_a_tangent_vector_goes_on_from_stretch_to_stretch(name):
    solver = solver_for(name, IMPACTING)
    whole = solver.grow(np.zeros(6), 0.08, 3)
    first = solver.grow(np.zeros(6), 0.08, 1)
    second = solver.grow(first.points[-1], 0.08, 2, direction=first.direction)
    put = first.followed_by(second)
    assert put.points == pytest.approx(whole.points, abs=1e-7)
    assert put.logarithms == pytest.approx(whole.logarithms, abs=1e-6)
    assert put.growth == pytest.approx(whole.growth, abs=1e-5)
    assert put.direction == pytest.approx(whole.direction, abs=1e-6)
    last = put.last(2)
    assert last.logarithms.tolist() == second.logarithms.tolist()
    assert last.points.tolist() == second.points.tolist()
    with pytest.raises(ValueError, match=r"direction must have shape \(6,\)"):
        solver.grow(np.zeros(6), 0.08, 1, direction=np.zeros(5))


def test_unknown_solver():
    with pytest.raises(ValueError, match="solver must be one of flow, bdf, is 'euler'"):
        make_solver("euler", IMPACTING, OMEGA, 1e-9)


@together(
    "change, said",
    [
        ({"state": np.zeros(5)}, r"state must have shape \(6,\), has shape \(5,\)"),
        ({"state": np.full(6, math.nan)}, "state must be finite"),
        ({"amplitude": math.inf}, "amplitude must be finite, is inf"),
        ({"omega": 0.0}, r"omega must be from 0.0001 to 1e\+06, is 0.0"),
        ({"n_periods": -1}, "n_periods must be a whole number from 0 to 1000000000000, is -1"),
        ({"rtol": 0.0}, "rtol must be between 0 and 1, is 0.0"),
        ({"solver": "x"}, "solver must be one of flow, bdf, is 'x'"),
    ],
)
def test_stroboscopic_points_names_what_is_wrong(change, said):
    arguments = {
        "structure": IMPACTING, "amplitude": 0.1, "omega": 0.5, "state": np.zeros(6),
        "n_periods": 1,
    }  # fmt: skip
    with pytest.raises(ValueError, match=said):
        stroboscopic_points(**{**arguments, **change})
