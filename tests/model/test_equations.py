"""The right-hand side and its Jacobian, at ordinary and at extreme arguments."""

import math

import numpy as np
import pytest
from together import together

from hpcsweep.model.contact import contact_stiffness, sigmoid, switch
from hpcsweep.model.equations import MODEL, derivative, jacobian_matrix
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure

SHARPNESS = [0.0, 3.0, 1e4, 1e8, math.inf]


def field(structure, tau, z, amplitude=0.0, omega=1.0):
    model = kernel_model(structure, omega)
    return derivative(tau, z, amplitude, MODEL.pack(model))


def matrix(structure, z):
    model = kernel_model(structure, 1.0)
    return jacobian_matrix(z, MODEL.pack(model))


@together("y", [-800.0, -50.0, -1.0, 0.0, 1.0, 50.0, 800.0, -1e308, 1e308])
def test_sigmoid_is_symmetric_and_never_overflows(y):
    assert 0.0 <= sigmoid(y) <= 1.0
    assert sigmoid(y) + sigmoid(-y) == pytest.approx(1.0, abs=1e-15)
    if abs(y) <= 50.0:
        assert sigmoid(y) == pytest.approx(1 / (1 + math.exp(-y)), rel=1e-15)


def test_sigmoid_of_infinities():
    assert sigmoid(math.inf) == 1.0
    assert sigmoid(-math.inf) == 0.0


def test_switch_at_infinite_sharpness_is_the_unit_step():
    assert [switch(x, math.inf) for x in (-1e-300, 0.0, 1e-300)] == [0.0, 0.5, 1.0]


@together("x", [-0.3, -1e-4, 0.0, 2e-4, 0.3])
def test_switch_at_zero_sharpness_is_one_half(x):
    assert switch(x, 0.0) == 0.5


@together("rho", SHARPNESS)
@together("n", [1, 2, 5])
def test_right_hand_side_is_equation_8(n, rho):
    structure = Structure(n, 50.0, rho, 0.1)
    rng = np.random.default_rng(n)
    u, v = 1.0 + 0.01 * rng.standard_normal(n), rng.standard_normal(n)
    tau, amplitude, omega = 2.0, 0.3, 0.7
    with np.errstate(over="ignore"):
        s = 1 / (1 + np.exp(-rho * (u - 1)))
    acceleration = (
        -amplitude * math.sin(omega * tau)
        - structure.stiffness_matrix @ u
        - structure.damping_matrix @ v
        - 50.0 * s * (u - 1)
    )
    found = field(structure, tau, np.concatenate((u, v)), amplitude, omega)
    assert np.allclose(found, np.concatenate((v, acceleration)), rtol=0, atol=1e-13)


@together("rho", SHARPNESS)
@together("past", [-0.2, -1.3e-4, -2e-5, 2e-5, 1.3e-4, 0.2])
def test_jacobian_is_the_derivative(rho, past):
    structure = Structure(3, 1000.0, rho, (0.05, 0.1, 0.0))
    z = np.array([0.4, 1.0 + past, 1.0 - past, 0.3, -0.2, 0.1])
    exact = matrix(structure, z)
    delta = 1e-6 / max(rho, 1.0) if rho < math.inf else 1e-6
    differences = np.empty((6, 6))
    for k in range(6):
        step = np.zeros(6)
        step[k] = delta if k < 3 else 1e-4
        up, down = field(structure, 0.0, z + step), field(structure, 0.0, z - step)
        # the difference of the arguments as rounded
        differences[:, k] = (up - down) / ((z + step)[k] - (z - step)[k])
    rounding = 1e-15 / delta * (1 + 1000.0 * abs(past))
    assert np.abs(exact - differences).max() < 1e-6 + 4 * rounding


@together("rho", [3.0, 1e4, 1e8])
def test_contact_stiffness_against_the_complex_step(rho):
    for y in (-30.0, -2.0, -0.1, 0.0, 0.5, 3.0, 30.0):
        x = y / rho
        z = complex(x, 1e-30)
        force = 1000.0 * z / (1 + np.exp(-rho * z))
        exact = force.imag / 1e-30
        assert contact_stiffness(x, 1000.0, rho) == pytest.approx(exact, rel=1e-12, abs=1e-9)


@together("rho", SHARPNESS)
@together("u", [-1e150, -10.0, 1.0, 10.0, 1e150])
def test_extremes_do_not_overflow(rho, u):
    structure = Structure(2, 1e7, rho, 2.0)
    z = np.array([u, 1.0, 0.0, 0.0])
    assert np.all(np.isfinite(field(structure, 1e6, z, 1e3, 50.0)))
    assert np.all(np.isfinite(matrix(structure, z)))
