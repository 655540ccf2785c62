"""Windows that are observed: modal norms in closed form, and windows without motion."""

import itertools
import math

import numba
import numpy as np
import pytest

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.observe import modal_norm
from hpcsweep.solvers.linear import LinearOrbit

compiled_only = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="many periods: too long as plain Python"
)

OMEGA = 0.445


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-250])
def test_a_window_without_motion_is_observed(size):
    seen = FlowMap(Structure(), OMEGA).observe(np.full(6, size), 0.0, 2, modal_norm=True)
    assert seen.contact == 0
    assert seen.peak_drift <= 10 * size


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
