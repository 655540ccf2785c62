"""The references themselves: extended precision, a second method, closed forms."""

import itertools
import math

import full_model
import numpy as np
import pytest
from extended import CERTIFIED, MATRIX_CASES, monodromy_mp, points_mp
from reference import (
    CASES,
    OMEGA,
    reference_monodromy,
    reference_points,
    reference_steps,
    reference_window,
)
from scipy.integrate import solve_ivp

from hpcsweep.model.structure import Structure


@pytest.fixture(scope="module")
def certified():
    with np.load(CERTIFIED) as data:
        return {name: data[name] for name in data}


@pytest.mark.parametrize("case", range(len(CASES)))
def test_double_precision_agrees_with_extended(certified, case):
    beta, amplitude = CASES[case]
    structure = Structure(3, beta, 1e4, 0.05)
    points = reference_points(structure, amplitude, OMEGA, np.zeros(6), 20)
    assert np.abs(points - certified["points"][case]).max() < 2e-13


@pytest.mark.parametrize("case", range(len(MATRIX_CASES)))
def test_complex_step_agrees_with_extended_differences(certified, case):
    beta, amplitude = MATRIX_CASES[case]
    structure = Structure(3, beta, 1e4, 0.05)
    state = certified["points"][CASES.index((beta, amplitude))][1]
    _, matrix = reference_monodromy(structure, amplitude, OMEGA, state, 1)
    assert np.abs(matrix - certified["matrices"][case]).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize(("dps", "order"), [(24, 26), (30, 36)])
def test_stored_points_are_what_the_integrator_gives(certified, dps, order):
    # two orders and precisions of the extended integrator, at the slow first contacts
    structure = Structure(3, 1000.0, 1e4, 0.05)
    start = certified["points"][CASES.index((1000.0, 0.06))]
    (end,) = points_mp(structure, 0.06, OMEGA, start[1], 1, dps, order)
    assert np.abs(np.array(end, dtype=float) - start[2]).max() < 1e-14


@pytest.mark.slow
def test_certified_data_can_be_made_again(certified):
    # of every second case a later period from its stored point, of every sixth the first from rest
    for case, (beta, amplitude) in list(enumerate(CASES))[::2]:
        structure, points = Structure(3, beta, 1e4, 0.05), certified["points"][case]
        if case % 3 == 0:
            first = points_mp(structure, amplitude, OMEGA, np.zeros(6), 1)
            assert np.abs(np.array(first, dtype=float) - points[:1]).max() < 1e-15
        later = 3 + 7 * case % 17
        (end,) = points_mp(structure, amplitude, OMEGA, points[later - 1], 1)
        assert np.abs(np.array(end, dtype=float) - points[later]).max() < 1e-14
    matrix = monodromy_mp(
        Structure(3, 1000.0, 1e4, 0.05),
        0.06,
        OMEGA,
        certified["points"][CASES.index((1000.0, 0.06))][1],
        [0, 5],
    )
    assert np.abs(matrix - certified["matrices"][0][:, [0, 5]]).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 50.0, 2000.0])
def test_agrees_with_a_runge_kutta_method(rho):
    # a method of another family, on scipy's sigmoid, with steps below the layer's transit time
    from scipy.special import expit

    structure = Structure(2, 300.0, rho, (0.03, 0.1))
    amplitude, omega = 0.4, 0.9

    def field(tau, z):
        u, v = z[:2], z[2:]
        force = structure.stiffness_matrix @ u + structure.damping_matrix @ v
        contact = 300.0 * expit(rho * (u - 1)) * (u - 1)
        return np.concatenate((v, -force - contact - amplitude * math.sin(omega * tau)))

    start = np.array([0.3, -0.2, 0.5, 1.5])
    period = 2 * math.pi / omega
    solution = solve_ivp(
        field, (0, period), start, method="DOP853", rtol=1e-13, atol=1e-13, max_step=5e-3
    )
    (end,) = reference_points(structure, amplitude, omega, start, 1)
    assert np.abs(end - solution.y[:, -1]).max() < 1e-10


def test_infinite_sharpness_is_the_limit_of_large_sharpness():
    start = np.array([0.1, 0.2, 0.9, 0.3, 0.5, 0.8])
    ends = [
        reference_points(Structure(3, 1000.0, rho, 0.05), 0.1, OMEGA, start, 1)[0]
        for rho in (1e6, 1e7, math.inf)
    ]
    # the layer changes v^2 / 2 by beta pi^2 / (6 rho^2)
    assert np.abs(ends[0] - ends[2]).max() < 1e-6
    assert np.abs(ends[1] - ends[2]).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("rho", [1e4, math.inf])
def test_energy_is_kept_without_damping_and_forcing(rho):
    structure = Structure(2, 500.0, rho, 0.0)
    start = np.array([0.9, 0.2, 0.6, 1.1])

    def energy(z):
        u, v = z[:2], z[2:]
        past = np.maximum(u - 1.0, 0.0)
        return 0.5 * (v @ v + u @ structure.stiffness_matrix @ u + 500.0 * past @ past)

    points = reference_points(structure, 0.0, 0.2, start, 10)
    assert reference_window(structure, 0.0, 0.2, start, 2)[0] > 0
    out = points[(points[:, :2] < 1 - 4e-3).all(axis=1)]
    assert len(out) > 3
    assert max(abs(energy(z) - energy(start)) for z in out) < 1e-12


def test_steps_join_and_fill_the_period():
    structure = Structure(3, 1000.0, 1e4, 0.05)
    steps = list(reference_steps(structure, 0.06, OMEGA, np.zeros(6), 2))
    assert sum(h for h, _ in steps) == pytest.approx(4 * math.pi / OMEGA, rel=1e-13)
    for (h, c), (_, following) in itertools.pairwise(steps):
        end = np.polynomial.polynomial.polyval(h, c.T)
        assert np.abs(end - following[:, 0]).max() < 1e-13


def test_window_of_a_linear_orbit_in_closed_form():
    structure = Structure(1, 1000.0, math.inf, 0.05)
    omega, amplitude = 0.7, 0.2
    response = structure.linear_steady_state(omega)[0] * amplitude
    state = np.array([response.imag, omega * response.real])
    contact, drift, modal = reference_window(structure, amplitude, omega, state, 2)
    assert contact == 0
    assert drift == pytest.approx(abs(response), rel=1e-13)
    assert modal == pytest.approx(1.0, rel=1e-13)


@pytest.mark.slow
def test_a_reduced_model_moves_as_all_its_modes_do_to_the_error_that_it_states():
    stated, error = full_model.main(["--periods", "20", "--steps", "4000"])
    assert 0 < error < stated < 1e-3
