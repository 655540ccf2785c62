"""The flow map against independent references and closed forms; its parts by themselves."""

import dataclasses
import itertools
import math

import numba
import numpy as np
import pytest
from building import generator
from numpy.polynomial import chebyshev
from reference import reference_points

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd import vectors
from hpcsweep.kernels.simd.vectors import LANES, load, store
from hpcsweep.model.contact import layer_half_width, less_contact_forces
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.layer import scheme, visit
from hpcsweep.solvers.flow.linear import forcing, polynomials, propagators
from hpcsweep.solvers.flow.observe import modal_norm
from hpcsweep.solvers.flow.orbit.transient import MAX_WORK
from hpcsweep.solvers.flow.passage import crossing, tangent
from hpcsweep.solvers.flow.rules import tableau
from hpcsweep.solvers.flow.search import search
from hpcsweep.solvers.flow.state import shared, tables
from hpcsweep.solvers.flow.state.state import accelerations
from hpcsweep.solvers.flow.state.tables import economisation
from hpcsweep.solvers.linear import LinearOrbit
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


def test_gauss_rule_integrates_polynomials_against_the_fermi_weight():
    # int_0^inf y^(k+1) / (1 + e^y) dy = (1 - 2^-(k+1)) Gamma(k + 2) zeta(k + 2)
    zeta = {2: math.pi**2 / 6, 4: math.pi**4 / 90, 6: math.pi**6 / 945}
    for k in (0, 2, 4):
        exact = (1 - 2.0 ** -(k + 1)) * math.gamma(k + 2) * zeta[k + 2]
        assert crossing.WEIGHTS @ crossing.NODES**k == pytest.approx(exact, rel=1e-13)
    assert pytest.approx(crossing.WEIGHTS.sum(), rel=1e-13) == crossing.FULL_POTENTIAL


def test_collocation_is_exact_for_the_polynomials_it_should_be():
    for degree in range(tableau.N_STAGES):
        powers = tableau.NODES**degree
        assert tableau.STAGES @ powers == pytest.approx(
            tableau.NODES ** (degree + 1) / (degree + 1)
        )
    for degree in range(2 * tableau.N_STAGES):
        assert tableau.WEIGHTS @ tableau.NODES**degree == pytest.approx(1 / (degree + 1), rel=1e-13)


def test_the_rule_that_checks_a_layer_step_sees_what_the_gauss_rule_misses():
    def difference(degree):
        values = tableau.CHECK_GAUSS @ tableau.NODES**degree + tableau.CHECK_START * 0.0**degree
        return values + tableau.CHECK_ADDED @ tableau.CHECK_NODES**degree

    for degree in range(2 * tableau.N_STAGES):
        assert abs(difference(degree)) < 1e-14
    degree = 2 * tableau.N_STAGES
    missed = 1 / (degree + 1) - tableau.WEIGHTS @ tableau.NODES**degree
    assert difference(degree) == pytest.approx(missed, rel=1e-4)  # 2e-10, of terms of 1
    # displacements at its nodes from accelerations c^k: c^(k + 2) / ((k + 1) (k + 2))
    for degree in range(tableau.N_STAGES):
        exact = tableau.CHECK_NODES ** (degree + 2) / ((degree + 1) * (degree + 2))
        assert tableau.NODES**degree @ tableau.CHECK_ROWS == pytest.approx(exact, abs=1e-15)


@pytest.mark.slow
@compiled_only
def test_error_of_a_layer_step_is_measured():
    """Against six parts of the step, at random places, speeds and lengths."""
    rng = np.random.default_rng(5)
    ratios, n_seen = [], 0
    for _ in range(400):
        n, rho, beta = int(rng.integers(1, 4)), 10 ** rng.uniform(2, 5), 10 ** rng.uniform(1, 5)
        flow = FlowMap(Structure(n, beta, rho, 0.05), OMEGA)
        model, work = flow._shared.model, flow._shared.work.layer
        z = np.concatenate((rng.uniform(-0.5, 0.9, n), rng.uniform(-0.3, 0.3, n)))
        z[n - 1] = 1 + rng.uniform(-25, 10) / rho
        z[2 * n - 1] = 10 ** rng.uniform(-4, 0) * rng.choice([-1, 1])
        tau = rng.uniform(0, PERIOD)
        a = np.zeros(n)
        pairs = np.zeros(2)
        forcing.forcing_at(tau, 0.3, model, pairs, 0)
        accelerations(pairs[0], z, model, a)
        length, stiffness = visit.step_limit(z, a, model, visit.longest_step(model))
        ends, measured = [], math.inf
        for parts in (1, 6):
            h, end = length / parts, z.copy()
            for part in range(parts):
                start = end.copy()
                begun = tau + part * h
                forcing.forcing_at(begun, 0.3, model, pairs, 0)
                accelerations(pairs[0], start, model, a)
                if scheme.collocate((begun, h), start, a, 0.3, pairs, stiffness, model, work):
                    scheme.finish(h, start, work.g, end)
                    if parts == 1:
                        measured = scheme.quadrature_error(h, z, model, work)
                else:
                    end[:] = np.nan
            ends.append(end)
        off = np.abs(ends[0] - ends[1]).max()
        if measured <= 1e-12:
            assert off <= 10 * measured + 1e-13
            n_seen += 1
        if 1e-13 < off < 1e-9:
            ratios.append(measured / off)
    assert n_seen > 200
    assert len(ratios) > 30
    assert np.median(ratios) < 10


def test_contact_forces_in_lanes_are_those_of_the_equations():
    @kernel
    def forces(u, beta, rho, out):
        for k in range(0, out.size, LANES):
            store(out, k, less_contact_forces(load(out, k), load(u, k) - 1.0, beta, rho))

    y = np.concatenate((np.linspace(-45, 45, 2001), [-1e4, -700.1, -699.9, 0.0, 700.1, 1e4, 1e12]))
    for rho in (0.0, 3.0, 1e4):
        u = 1 + y / max(rho, 1.0)
        x = u.astype(np.longdouble) - 1
        weight = np.where(x < 0, np.exp(np.minimum(rho * x, 0)), 1) / (1 + np.exp(-rho * abs(x)))
        out = np.ones(u.size)
        forces(u, 2.0, rho, out)
        exact = 2 * weight * x
        assert np.all(abs(1 - out - exact) <= 4e-16 * (1 + abs(exact) * (1 + abs(rho * x))))
    out = np.zeros(LANES)
    forces(np.full(LANES, np.nan), 1.0, 1e4, out)
    assert np.all(np.isnan(out))


def test_lanes_reckon_as_numbers_do():
    @kernel
    def reckon(a, b, out, folded):
        x, y = vectors.load(a, 0), vectors.load(b, 0)
        vectors.store(out, 0, vectors.fma(x, y, 3.0) / (1.0 + y * 2) - x)
        vectors.store(out, LANES, vectors.root(y))
        vectors.store(out, 2 * LANES, vectors.greatest(vectors.modulus(x), 0.5))
        folded[0], folded[1], folded[2] = vectors.total(x), vectors.maximum(x), vectors.negative(x)

    rng = np.random.default_rng(2)
    a, b = rng.standard_normal(LANES), rng.random(LANES)
    out, folded = np.zeros((3, LANES)), np.zeros(3)
    reckon(a, b, out, folded)
    assert out[0] == pytest.approx((a * b + 3) / (1 + 2 * b) - a, rel=1e-14)
    assert np.array_equal(out[1:], [np.sqrt(b), np.maximum(abs(a), 0.5)])
    assert folded[:2] == pytest.approx([a.sum(), a.max()], rel=1e-14)
    assert folded[2] == np.sum((a < 0) * 2 ** np.arange(LANES))
    for place in range(LANES):
        a[:] = 1.0
        a[place] = np.nan
        reckon(a, b, out, folded)
        assert np.isnan(folded[1])


def test_lanes_are_moved_read_and_looked_through():
    @kernel
    def move(a, out, found):
        x = vectors.load(a, 0)
        vectors.store(out, 0, vectors.shifted(7.0, x))
        for k in range(LANES):
            out[LANES + k] = vectors.lane(x, k)
        found[0] = vectors.first_not_negative(x)

    a, out, found = np.arange(1.0, LANES + 1.0), np.zeros(2 * LANES), np.zeros(1)
    move(a, out, found)
    assert np.array_equal(out[:LANES], [7.0, *a[:-1]])
    assert np.array_equal(out[LANES:], a)
    for number in (0.0, 3.0, math.inf, math.nan):
        for place in range(LANES):
            a[:] = -1.0
            a[place:] = number
            move(a, out, found)
            assert found[0] == place
    a[:] = -5e-324
    move(a, out, found)
    assert found[0] == LANES


def test_a_polynomial_and_its_slope_are_evaluated_at_many_times():
    @kernel
    def evaluate(rows, h, times, out):
        value, slope = polynomials.values_and_slopes(rows, 1, h, vectors.load(times, 0))
        vectors.store(out, 0, value)
        vectors.store(out, LANES, slope)

    rng = np.random.default_rng(5)
    rows, h, out = rng.standard_normal((2, 16)), 0.3, np.zeros(2 * LANES)
    times = np.sort(rng.uniform(0.0, h, LANES))
    evaluate(rows, h, times, out)
    for k, s in enumerate(times):
        value, slope = polynomials.value_and_slope(rows, 1, h, s)
        assert out[k] == pytest.approx(value, abs=1e-14)
        assert out[LANES + k] == pytest.approx(slope, abs=1e-12)


def test_a_modulus_is_bounded_by_the_larger_of_both_sides():
    rng = np.random.default_rng(6)
    reported = 0
    for _ in range(200):
        g0, slope0, g1, slope1 = rng.standard_normal(4)
        d, bound4, size = 10.0 ** rng.uniform([-2, 0, -1], [0, 3, 1])
        d = float(d)
        tops = [
            search._top(d, sign * g0, sign * slope0, sign * g1, sign * slope1, bound4)
            for sign in (1.0, -1.0)
        ]
        may = search.may_exceed(size, d, g0, slope0, g1, slope1, bound4)
        if abs(max(tops) - size) > 1e-12 * size:
            assert may == (max(tops) >= size)
            reported += may
    assert 20 < reported < 180


@pytest.mark.parametrize("v", [0.7, -0.7])
def test_derivatives_of_a_passage_are_those_of_its_moments(v):
    @kernel
    def differentiate(v, a, j, beta, rho, out):
        stop = crossing.at_stop(v, a, j, beta, rho)
        free = tangent._differentiated(-1.0, stop)
        contact = tangent._differentiated(1.0, stop)
        found = crossing.sums(free[0], contact[0])
        moments = crossing.since_linear(found, stop)
        for k in range(7):
            out[0, k] = moments[k]
        for row in range(1, 3):
            by_v, by_a = 2.0 - row, row - 1.0
            rates = crossing.sums(
                tangent._rates(free, by_v, by_a), tangent._rates(contact, by_v, by_a)
            )
            rates = crossing.rates_since_linear(found, rates, by_v, stop)
            for k in range(7):
                out[row, k] = rates[k]

    a, j, beta, rho = 3.0, 40.0, 1000.0, 3000.0
    out = np.zeros((3, 7))
    differentiate(v, a, j, beta, rho, out)
    exact = np.array(crossing.moments(v, a, j, beta, rho))
    assert out[0] == pytest.approx(exact, rel=1e-12)
    step = 1e-4
    for row, (dv, da) in enumerate(((step, 0.0), (0.0, step)), start=1):
        ends = [crossing.moments(v + k * dv, a + k * da, j, beta, rho) for k in (1, -1)]
        assert out[row] == pytest.approx(np.subtract(*ends) / (2 * step), rel=2e-5)


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-250])
def test_a_window_without_motion_is_observed(size):
    seen = FlowMap(Structure(), OMEGA).observe(np.full(6, size), 0.0, 2, modal_norm=True)
    assert seen.contact == 0
    assert seen.peak_drift <= 10 * size


def test_the_first_tenth_of_a_window_does_not_count_as_growth():
    assert window_growth(np.array([9.0, 9.0] + 18 * [0.5])) == pytest.approx(10.0)
    assert window_growth(np.array([2.0, -1.0])) == pytest.approx(1.0)


@pytest.mark.parametrize("key", [0, 1, 5, 7])
def test_tables_are_the_matrix_exponential(key):
    from scipy.linalg import expm

    structure = Structure(3, 1000.0, 1e4, (0.05, 0.3, 1.4))
    flow = FlowMap(structure, OMEGA)
    store = flow._shared.tables
    index = propagators.lookup(np.uint64(key), flow._packed)
    assert propagators.lookup(np.uint64(key), flow._packed) == index
    n = 3
    field = generator(structure, key, OMEGA)
    h = store.h[index]
    exact = expm(field * h)[: 2 * n]
    scale = np.abs(exact).max()
    assert np.abs(store.step[index, :, : 2 * n].T - exact).max() < 2e-13 * scale
    for s in (0.0, 0.31 * h, h):
        powers = (2 * s / h - 1) ** np.arange(tables.N_COEFFICIENTS)
        assert np.abs(store.poly[index] @ powers - expm(field * s)[: 2 * n]).max() < (2e-13 * scale)


def test_fourth_derivative_bound_holds():
    flow = FlowMap(Structure(), OMEGA)
    index = propagators.lookup(np.uint64(0), flow._packed)
    h = flow._shared.tables.h[index]
    rng = np.random.default_rng(3)
    sigma = np.linspace(-1, 1, 401)
    for _ in range(20):
        x = rng.standard_normal(9)
        rows = np.einsum("rkp,k->rp", flow._shared.tables.poly[index], x)
        for i in range(3):
            fourth = np.polynomial.polynomial.polyder(rows[i], 4)
            largest = np.abs(np.polynomial.polynomial.polyval(sigma, fourth)).max() * (2 / h) ** 4
            assert flow._shared.tables.bound4[index, :, i] @ np.abs(x) >= largest


def first_root(rows, h, level, bound, stack):
    """Time at which polynomial 0 first reaches the level on the step; -1 if it does not."""
    (u0, v0), (u1, v1) = (polynomials.value_and_slope(rows, 0, h, s) for s in (0.0, h))
    curve, upwards = search.Curve(rows, 0, h), search.Level(1.0, level)
    part = search.Part(0.0, u0 - level, v0, h, u1 - level, v1)
    bracket = search.first_passage(curve, part, upwards, bound, stack)
    return bracket.a if bracket.a < 0 else search.rising_root(curve, bracket, upwards)


def test_first_passage_finds_the_first_root_and_proves_there_is_none():
    rng = np.random.default_rng(5)
    stack = np.zeros((search.MAX_DEPTH + 2, 3))
    h, fine = 0.7, np.linspace(0, 0.7, 20001)
    found = missed = 0
    for _ in range(300):
        rows = np.zeros((1, tables.N_COEFFICIENTS))
        rows[0, :7] = rng.standard_normal(7) / np.arange(1, 8) ** 1.5
        fourth = np.polynomial.polynomial.polyder(rows[0], 4)
        bound = np.abs(fourth).sum() * (2 / h) ** 4
        values = np.polynomial.polynomial.polyval(2 * fine / h - 1, rows[0])
        level = values[0] + 10 ** rng.uniform(-6, 0.3)
        time = first_root(rows, h, level, bound, stack)
        above = np.flatnonzero(values >= level)
        if above.size:
            found += 1
            assert fine[above[0] - 1] <= time <= fine[above[0]]
        else:
            missed += 1
            # a touch between two of the fine samples is all that may be found
            assert time < 0 or level - values.max() < 1e-6
    assert min(found, missed) > 50


def test_derivatives_of_a_step():
    rng = np.random.default_rng(8)
    rows = rng.standard_normal((3, tables.N_COEFFICIENTS))
    h, state = 0.7, np.empty(3)
    for s in np.linspace(0, 1.005 * h, 9):
        polynomials.evaluate_rows(rows, h, s, state)
        for row, value in enumerate(state):
            p = np.polynomial.Polynomial(rows[row], domain=[0, h])
            expected = p(s), p.deriv(1)(s), p.deriv(2)(s)
            assert value == pytest.approx(expected[0], rel=1e-13, abs=1e-13)
            found = polynomials.value_slope_bend(rows, row, h, s)
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-10)


def test_a_floor_said_to_leave_its_layer_stays_away():
    rng = np.random.default_rng(6)
    h, fine = 0.7, np.linspace(0, 0.7, 4001)
    said = 0
    for _ in range(3000):
        rows = np.zeros((1, tables.N_COEFFICIENTS))
        rows[0, :7] = rng.standard_normal(7) / np.arange(1, 8) ** 2
        fourth = np.polynomial.polynomial.polyder(rows[0], 4)
        bound = np.abs(fourth).sum() * (2 / h) ** 4
        u = np.polynomial.polynomial.polyval(2 * fine / h - 1, rows[0])
        level = u[0] - 10 ** rng.uniform(-6, 0)
        (u0, v0), (u1, v1) = (polynomials.value_and_slope(rows, 0, h, s) for s in (0.0, h))
        if search.leaves(h, u0 - level, v0, u1 - level, v1, bound):
            said += 1
            assert np.count_nonzero(np.diff((u >= level).astype(int))) == 1
    assert said > 50


def test_a_touch_just_over_the_level_is_found_however_short():
    stack = np.zeros((search.MAX_DEPTH + 2, 3))
    rows = np.zeros((1, tables.N_COEFFICIENTS))
    for over in 10.0 ** np.arange(-15, -2):
        peak = 0.2371
        rows[0, :3] = over - peak**2, 2 * peak, -1.0  # over - (sigma - peak)^2
        time = first_root(rows, 1.0, 0.0, 1e-3, stack)
        assert time == pytest.approx(0.5 * (1 + peak - math.sqrt(over)), abs=3e-8)
        rows[0, 0] = -1e-12 - peak**2
        assert first_root(rows, 1.0, 0.0, 1e-3, stack) == -1


def test_layer_width_leaves_out_only_a_negligible_force():
    for beta, rho in [(1000.0, 1e4), (1e5, 1e2), (1e7, 1e8), (1.0, 1e6)]:
        y = rho * layer_half_width(beta, rho)
        assert beta / rho * y / (1 + math.exp(y)) < 2e-13
    assert layer_half_width(1000.0, math.inf) == 0
    assert layer_half_width(1000.0, 0.0) == math.inf


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
def test_settle_finds_the_period_and_agrees_with_the_long_run():
    flow = FlowMap(Structure(), OMEGA)
    for amplitude, period in ((0.06, 1), (0.1, 2)):
        settled = flow.settle(np.zeros(6), amplitude, 200, 16, 1e-10, 1e-6)
        assert (settled.period, settled.n_newton) == (period, 0)
        assert math.isnan(settled.multiplier)
        assert settled.n_periods < 100
        further = flow.advance(settled.state, amplitude, 60 * period).state
        assert np.abs(further - settled.state).max() < 1e-9


@compiled_only
def test_a_jump_ends_on_the_orbit_with_its_multiplier():
    flow = FlowMap(Structure(), OMEGA)
    jumps = 0
    for amplitude, period in ((0.06, 1), (0.1, 2), (0.03, 1)):
        jump = flow.settle(np.zeros(6), amplitude, 300, 16, 1e-10, 1e-6, 1e-3)
        assert jump.period == period
        assert jump.n_newton >= period
        jumps += not math.isnan(jump.multiplier)
        image = flow.advance(jump.state, amplitude, period).state
        assert np.abs(image - jump.state).max() < 1e-11
        further = flow.advance(jump.state, amplitude, 60 * period).state
        assert np.abs(further - jump.state).max() < 1e-9
        _, matrix = flow.monodromy(jump.state, amplitude, period)
        exact = np.abs(np.linalg.eigvals(matrix)).max()
        assert jump.multiplier == pytest.approx(exact, rel=1e-5)
    assert jumps == 3


@compiled_only
def test_a_jump_ends_as_near_the_orbit_as_rounding_lets_it():
    flow = FlowMap(Structure(), OMEGA)
    jumps = 0
    for amplitude in np.linspace(0.02, 0.11, 91):
        jump = flow.settle(np.zeros(6), amplitude, 300, 16, 1e-10, 1e-6, 1e-3)
        if math.isnan(jump.multiplier):
            continue
        jumps += 1
        image, matrix = flow.monodromy(jump.state, amplitude, jump.period)
        off = np.linalg.solve(matrix - np.eye(6), image - jump.state)
        assert np.abs(off).max() < 2e-13
        if amplitude == pytest.approx(0.086):
            exact = reference_points(flow.structure, amplitude, OMEGA, jump.state, jump.period)
            off = np.linalg.solve(matrix - np.eye(6), exact[-1] - jump.state)
            assert np.abs(off).max() < 2e-12
    assert jumps > 80


@compiled_only
def test_no_jump_to_an_orbit_that_repels():
    flow = FlowMap(Structure(), OMEGA)
    rules = (2000, 16, 1e-10, 1e-6, 1e-3)
    z = flow.settle(np.zeros(6), 0.07, *rules).state
    # the orbit of period 1, followed beyond where it doubles
    for amplitude in np.linspace(0.07, 0.0987, 60):
        for _ in range(6):
            image, matrix = flow.monodromy(z, amplitude, 1)
            z = z - np.linalg.solve(matrix - np.eye(6), image - z)
    assert np.abs(image - z).max() < 1e-10
    assert np.abs(np.linalg.eigvals(matrix)).max() > 1.1
    # the motion beside it stays near at first, and is not taken for one that approaches
    found = flow.settle(z + 1e-7, 0.0987, *rules)
    assert found.period == 2
    assert found.multiplier < 1.0
    assert np.abs(found.state - z).max() > 1e-3


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

    def everything(poll):
        return (
            flow.advance(z, 0.0987, n_periods, poll=poll).state,
            flow.points(z, 0.0987, n_periods, poll=poll)[0],
            *flow.monodromy(z, 0.0987, 200),
            *dataclasses.astuple(flow.observe(z, 0.0987, n_periods, True, True, poll)),
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
@pytest.mark.slow
def test_periods_that_become_slow_at_once_do_not_delay_polls():
    """With 52 stops hardly any set of them returns, and each needs a table of its own."""
    structure = Structure(52, 1000.0, 1e4, 0.05)
    flow = FlowMap(structure, 0.2772)
    rest, n_periods, work = np.zeros(104), 8, []
    flow.settle(rest, 0.01, 1000, 16, 1e-10, 1e-6)
    assert flow._polling.begin() >= n_periods

    def polled():
        work.append(flow.counts[0] + flow.counts[2] + 104 * flow.counts[4])

    end = flow.settle(rest, 0.25, n_periods, 16, 1e-10, 1e-6, poll=polled)
    polled()
    assert end.n_periods == n_periods
    pieces, work = np.diff(work), []
    for _ in range(n_periods):
        rest = flow.advance(rest, 0.25, 1).state
        polled()
    assert pieces.max() <= MAX_WORK / 104**2 + np.diff(work).max()
    assert pieces.size >= 3


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


@compiled_only
@pytest.mark.parametrize(
    ("structure", "omega", "amplitude"),
    [
        (Structure(2, 1000.0, 500.0, 0.03), 0.7, 0.025),  # sharp dip of ||q||
        (Structure(2), 0.5, 0.01),
        (Structure(5), 0.3, 0.002),
    ],
)
def test_modal_norms_are_those_of_the_closed_form(structure, omega, amplitude):
    orbit = LinearOrbit(structure, omega)
    n = structure.n_floors
    seen = FlowMap(structure, omega).observe(orbit.state(amplitude), amplitude, 1, modal_norm=True)
    modal = structure.modes.T @ structure.linear_steady_state(omega)
    theta = (np.arange(400_000) + 0.5) / 400_000 * math.pi
    q = np.abs(np.imag(modal[:, None] * np.exp(1j * theta)))
    dense = (q / np.linalg.norm(q, axis=0)).mean(axis=1)
    closed = orbit.window(amplitude).modal_norm
    assert seen.contact == 0
    assert seen.modal_norm == pytest.approx(closed, abs=1e-8)
    assert closed == pytest.approx(dense, abs=1e-9)
    assert closed.shape == (n,)


@pytest.mark.parametrize("s", [0.0, 1e-9, 0.3, 0.49, 0.51, 7.0])
def test_the_forcing_is_turned_as_it_is_taken(s):
    harmonics = ((1, 1.0, 0.4), (2, -0.3, 2.0))
    model = FlowMap(Structure(2, harmonics=harmonics), 1.0)._shared.model
    exact, turned, x = np.zeros(4), np.zeros(4), np.zeros(6)
    forcing.forcing_at(2.5, 0.7, model, x, 1)
    forcing.forcing_at(2.5 + s, 0.7, model, exact, 0)
    forcing.forcing_after(s, 2.5 + s, 0.7, x, 1, model, turned)
    assert turned == pytest.approx(exact, abs=1e-15)
    assert abs(exact).max() > 0.1


def test_between_its_nodes_an_interpolant_is_a_polynomial_of_lower_degree():
    coefficients = np.random.default_rng(4).standard_normal(16) * 2.0 ** -np.arange(16)
    series = np.polynomial.Legendre(coefficients)
    values, whole = series(modal_norm.MODAL_NODES), series.integ(lbnd=-1.0)
    ends = itertools.pairwise(modal_norm.PLACES)
    u = np.linspace(-1.0, 1.0, 9)
    for place, (a, b) in enumerate(ends):
        middle, half = 0.5 * (a + b), modal_norm.HALF[place]
        assert half == pytest.approx(0.5 * (b - a), rel=1e-14)
        local = np.polynomial.Polynomial(values @ modal_norm.LOCAL[place])
        assert local(u) == pytest.approx(series(middle + half * u), abs=1e-9)
        assert modal_norm.BEFORE[place] @ values == pytest.approx(whole(middle), abs=1e-14)


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


class Cautious(Structure):
    """The same chain with a larger bound of K."""

    @property
    def stiffness_bound(self):
        return 6.0


@pytest.mark.parametrize("sharpness", [1e4, 50.0])
def test_bound_of_the_stiffness_is_the_one_that_the_structure_tells(sharpness):
    z = np.repeat([0.9, 0.4], 3)
    plain, cautious = (FlowMap(kind(3, 1000.0, sharpness), OMEGA) for kind in (Structure, Cautious))
    exact, _ = plain.points(z, 0.06, 1)
    found, _ = cautious.points(z, 0.06, 1)
    assert np.abs(found - exact).max() < 1e-11
    a = np.zeros(3)
    z[2] = 1.0 - 1.0 / sharpness
    limits = [visit.step_limit(z, a, flow._shared.model, 1.0) for flow in (plain, cautious)]
    assert limits[1][1] == pytest.approx(limits[0][1] + 2.0)
    assert limits[1][0] <= limits[0][0]


def test_economisation_is_that_of_chebyshev_series_to_the_last_bit():
    found = economisation(30, 15)
    for k in range(31):
        series = chebyshev.poly2cheb(np.eye(31)[k])[:16]
        kept = chebyshev.cheb2poly(np.pad(series, (0, 16 - len(series))))
        assert found[k].tolist() == np.pad(kept, (0, 16 - len(kept))).tolist()
