"""Linear steps: tables, polynomials and forcing against the matrix exponential."""

import numpy as np
import pytest
from building import generator

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd import vectors
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.state import tables
from hpcsweep.solvers.flow.step import forcing, polynomials, step

OMEGA = 0.445


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


@pytest.mark.parametrize("key", [0, 1, 5, 7])
def test_tables_are_the_matrix_exponential(key):
    from scipy.linalg import expm

    structure = Structure(3, 1000.0, 1e4, (0.05, 0.3, 1.4))
    flow = FlowMap(structure, OMEGA)
    store = flow._shared.tables
    index = step.lookup(np.uint64(key), flow._packed)
    assert step.lookup(np.uint64(key), flow._packed) == index
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
    index = step.lookup(np.uint64(0), flow._packed)
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
