"""The flow map against independent references and closed forms."""

import dataclasses
import math

import numba
import numpy as np
import pytest
from reference import reference_points

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.state import shared
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import POLL_PERIODS
from hpcsweep.solvers.records import window_growth

compiled_only = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="many periods: too long as plain Python"
)

OMEGA = 0.445
PERIOD = 2 * math.pi / OMEGA


def on_the_attractor(structure, amplitude, omega=OMEGA, n_periods=40):
    flow = FlowMap(structure, omega)
    return flow, flow.advance(np.zeros(2 * structure.n_floors), amplitude, n_periods).state


def test_the_first_tenth_of_a_window_does_not_count_as_growth():
    assert window_growth(np.array([9.0, 9.0] + 18 * [0.5])) == pytest.approx(10.0)
    assert window_growth(np.array([2.0, -1.0])) == pytest.approx(1.0)


@pytest.mark.parametrize("sharpness", [1e4, math.inf])
def test_grazing_amplitude_is_the_closed_form(sharpness):
    structure = Structure(sharpness=sharpness)
    critical = structure.grazing_amplitude(OMEGA)
    assert critical == pytest.approx(0.016230, abs=5e-7)
    for factor, contact in ((1 - 1e-9, 0), (1 + 1e-9, 4)):
        response = structure.linear_steady_state(OMEGA) * critical * factor
        state = np.concatenate((response.imag, OMEGA * response.real))
        seen = FlowMap(structure, OMEGA).observe(state, critical * factor, 1)
        if sharpness == math.inf:
            assert seen.contact == contact
        else:  # the smooth spring already pushes inside its layer and pulls the floor in
            assert seen.contact in (0, 4)


def test_linear_steady_state_and_its_drift_are_exact():
    structure = Structure()
    amplitude = 0.012
    response = amplitude * structure.linear_steady_state(OMEGA)
    state = np.concatenate((response.imag, OMEGA * response.real))
    seen = FlowMap(structure, OMEGA).observe(state, amplitude, 5, modal_norm=True)
    assert np.abs(seen.points - state).max() < 1e-14
    drift = np.abs(np.diff(response, prepend=0)).max()
    assert seen.peak_drift == pytest.approx(drift, rel=1e-10)
    assert seen.contact == 0


@compiled_only
@pytest.mark.parametrize("sharpness", [1e4, 1e3, 100.0, 10.0, 0.0, math.inf])
@pytest.mark.parametrize("amplitude", [0.06, 0.25])
def test_monodromy_has_the_determinant_of_the_damping(sharpness, amplitude):
    structure = Structure(sharpness=sharpness)
    flow, state = on_the_attractor(structure, amplitude, n_periods=6)
    end, matrix = flow.monodromy(state, amplitude, 1)
    assert np.array_equal(end, flow.advance(state, amplitude, 1).state)
    exact = math.exp(-PERIOD * np.trace(structure.damping_matrix))
    assert np.linalg.det(matrix) == pytest.approx(exact, rel=1e-9)


@compiled_only
@pytest.mark.parametrize("amplitude", [0.01, 0.06, 0.0987, 0.25])
def test_monodromy_is_the_derivative_of_the_map(amplitude):
    flow, state = on_the_attractor(Structure(), amplitude)
    _, matrix = flow.monodromy(state, amplitude, 1)
    step = 1e-5
    columns = []
    for unit in np.eye(6):
        ends = [flow.advance(state + k * step * unit, amplitude, 1).state for k in (-2, -1, 1, 2)]
        columns.append((ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step))
    assert np.abs(matrix - np.array(columns).T).max() < 2e-6


@compiled_only
@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_more_floors_stay_bounded_and_keep_few_tables(n):
    structure = Structure(n_floors=n)
    flow = FlowMap(structure, structure.frequencies[0])
    seen = flow.observe(np.zeros(2 * n), 0.2, 40)
    assert seen.outcome is Outcome.COMPLETE
    assert np.abs(seen.points).max() < 50
    assert seen.contact != 0
    assert flow._shared.tables.count[0] <= min(2**n, 64)


def test_a_run_beyond_double_precision_is_an_outcome():
    structure = Structure(damping_ratio=0.0)
    flow = FlowMap(structure, 0.445)
    points, outcome = flow.points(np.full(6, 1e99), 0.1, 3)
    assert outcome in (Outcome.NON_FINITE, Outcome.COMPLETE)
    points, outcome = flow.points(np.full(6, 1e150), 0.1, 3)
    assert outcome is Outcome.NON_FINITE
    assert len(points) == 0


@compiled_only
@pytest.mark.parametrize("sharpness", [1e4, math.inf])
def test_energy_is_kept_without_damping_and_forcing(sharpness):
    structure = Structure(sharpness=sharpness, damping_ratio=0.0)
    state = np.array([0.2, 0.5, 0.7, 0.1, 0.3, 0.6])

    # the smooth spring's energy past its layer is the linear one's less the potential step
    step = 0.0 if sharpness == math.inf else 1000.0 * math.pi**2 / (6 * sharpness**2)

    def energy(z):
        u, v = z[:3], z[3:]
        x = np.maximum(u - 1, 0)
        spring = 0.5 * 1000.0 * x @ x - step * np.count_nonzero(x)
        return 0.5 * (v @ v + u @ structure.stiffness_matrix @ u) + spring

    flow = FlowMap(structure, 0.7)
    points, outcome = flow.points(state, 0.0, 200)
    assert outcome is Outcome.COMPLETE
    kept = [energy(z) for z in points if np.all(np.abs(z[:3] - 1) > 0.004)]
    assert len(kept) > 150
    assert flow.counts[1] + flow.counts[3] > 100  # it did hit the stop
    drift = np.abs(np.array(kept) / kept[0] - 1).max()
    assert drift < 1e-8


@compiled_only
def test_floors_that_pass_their_layers_together_do_so_as_the_reference_says():
    # offsets from far inside one layer (half-width 3e-3) to beyond it, both orders, both speeds
    rng = np.random.default_rng(3)
    structure = Structure(3, 1000.0, 1e4, 0.05)
    flow = FlowMap(structure, 0.8)
    worst, together = 0.0, 0
    for _ in range(40):
        speed = rng.uniform(0.4, 1.5, 3)
        start = 0.97 + rng.uniform(-1, 1, 3) * 10.0 ** rng.uniform(-5, -2)
        start[rng.integers(3)] = rng.uniform(0.2, 0.9)
        state = np.concatenate((start, speed))
        fast, steps = flow.counts[1:3].copy()
        found, outcome = flow.points(state, 0.3, 1)
        assert outcome is Outcome.COMPLETE
        together += flow.counts[1] - fast >= 4 and flow.counts[2] == steps
        exact = reference_points(structure, 0.3, 0.8, state, 1)
        _, tangent = flow.monodromy(state, 0.3, 1)
        worst = max(worst, np.abs(found - exact).max() / max(1.0, np.linalg.norm(tangent, 2)))
    assert worst < 1e-11
    assert together >= 5


@compiled_only
@pytest.mark.parametrize("size", [1, 7, POLL_PERIODS])
def test_pieces_of_any_size_change_nothing(size, monkeypatch):
    """Whatever a piece takes, and however often others are served, results are the same."""
    flow, z = on_the_attractor(Structure(), 0.0987)
    n_periods = 2 * POLL_PERIODS + 17
    # the first rules are of an orbit that never closes to 0 exactly: the whole way is integrated
    rules = ((n_periods, 6, -1.0, 1e-6), (n_periods, 16, 1e-8, 1e-6, 1e-2))

    def observed(poll):
        seen = flow.observe(z, 0.0987, n_periods, True, True, poll)
        return dataclasses.replace(seen, slid=len(seen.slid), measures=0)

    def everything(poll):
        return (
            flow.advance(z, 0.0987, n_periods, poll=poll).state,
            flow.points(z, 0.0987, n_periods, poll=poll)[0],
            *flow.monodromy(z, 0.0987, 200),
            *dataclasses.astuple(observed(poll)),
            *(
                value
                for rule in rules
                for start in (z, 0.5 * z)
                for value in dataclasses.astuple(flow.settle(start, 0.0987, *rule, poll=poll))
            ),
        )

    class Whole:
        def cut(self, n_periods, poll=None):
            yield 0, n_periods

        def begin(self, poll=None):
            return 10**9

        def end(self, n_periods):
            pass

    class Even:
        def cut(self, n_periods, poll=None):
            for first in range(0, n_periods, size):
                yield first, min(first + size, n_periods)

        def begin(self, poll=None):
            return size

        def end(self, n_periods):
            pass

    polls = []
    in_time = everything(lambda: polls.append(1))
    assert len(polls) >= 12
    monkeypatch.setattr(flow, "_polling", Whole())
    whole = everything(None)
    monkeypatch.setattr(flow, "_polling", Even())
    for left, middle, right in zip(in_time, everything(None), whole, strict=True):
        assert np.array_equal(left, right, equal_nan=True)
        assert np.array_equal(middle, right, equal_nan=True)


@compiled_only
@pytest.mark.parametrize("omega", [0.399, 0.04, 0.021])
def test_without_contact_stiffness_the_monodromy_is_the_matrix_exponential(omega):
    from scipy.linalg import expm

    structure = Structure(4, 0.0, 1e4, 0.0077)
    flow = FlowMap(structure, omega)
    z = flow.advance(np.zeros(8), 0.4, 20).state
    _, matrix = flow.monodromy(z, 0.4, 1)
    field = np.block(
        [[np.zeros((4, 4)), np.eye(4)], [-structure.stiffness_matrix, -structure.damping_matrix]]
    )
    exact = expm(2 * math.pi / omega * field)
    assert np.abs(matrix - exact).max() < 1e-12


def test_what_the_kernels_would_misread_is_not_packed():
    given = FlowMap(Structure(2), OMEGA)._shared
    shared.SHARED.pack(given)
    for name, value in (("tolerance", 1), ("counts", np.zeros(4)), ("model", given.tables)):
        with pytest.raises(TypeError, match="the kernels read"):
            shared.SHARED.pack(given._replace(**{name: value}))


@pytest.mark.parametrize("sharpness", [1e4, math.inf])
@pytest.mark.parametrize("place", [0.0, 1e-16, -1e-16, 5e-324, 1e-12, -1e-12])
def test_floors_at_rest_against_the_stop_come_away(sharpness, place):
    structure = Structure(3, 1000.0, sharpness, 0.0)
    for omega in (0.445, 2.0):
        state = np.array([1.0 + place] * 3 + [0.0, -0.0, place])
        points, outcome = FlowMap(structure, omega).points(state, 0.0, 2)
        assert outcome is Outcome.COMPLETE
        exact = reference_points(structure, 0.0, omega, state, 2)
        assert np.abs(points - exact).max() < 1e-9


@pytest.mark.parametrize(
    ("structure", "omega", "amplitude", "state"),
    [
        (
            Structure(2, 6.080601496764445, math.inf, 0.00026299908830782853),
            0.1153360569798371,
            0.002390226251498504,
            [1.0, 1.0, 1.4201393440337693e-07, 0.0],
        ),
        (
            Structure(2, 32177.937784416823, math.inf, 0.04640026478487522),
            1.1289729326440363,
            3.5326261392257922e-09,
            [1.0, 0.9999999999999998, 5.398997376153249e-10, 1.2564435428552595e-08],
        ),
        (
            Structure(3, 9200907.402634297, math.inf, 0.007495611591940803),
            23.669928528932267,
            0.0047833464049873205,
            [0.9840169725099585, 1.0127601254144663, 1.0, -0.12247, 0.596, 1.966e-13],
        ),
    ],
)
def test_floors_that_stay_at_the_stop_within_rounding_are_not_given_up(
    structure, omega, amplitude, state
):
    points, outcome = FlowMap(structure, omega).points(np.array(state), amplitude, 1)
    assert outcome is Outcome.COMPLETE
    exact = reference_points(structure, amplitude, omega, np.array(state), 1)
    assert np.abs(points - exact).max() < 1e-10


def test_a_floor_that_moves_by_less_than_rounding_at_the_stop_is_not_held_there():
    structure = Structure(5, 143924.97344661702, math.inf, 0.6156771719378836)
    state = np.array([1.0, 1.0 - 3e-16, 1.0, 1.0, 1.0, 2e-8, -5e-4, 0.0, 1e-12, 0.0])
    flow_map = FlowMap(structure, 0.5027829265897744)
    points, _ = flow_map.points(state, 1.2e-5, 1)
    beside = state - np.repeat([1e-11, 0.0], 5)
    exact = reference_points(structure, 1.2e-5, flow_map.omega, beside, 1)
    assert np.abs(points - exact).max() < 1e-10
