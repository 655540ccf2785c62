"""The model's closed forms, and what the validation says."""

import math

import numpy as np
import pytest
from reference import reference_window
from scipy.linalg import eigh
from together import together

from hpcsweep.model.contact import layer_half_width
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.matrices import MAX_FLOORS
from hpcsweep.model.structure import Structure


@together("n", [1, 2, 3, 7, 20, MAX_FLOORS])
def test_modes_diagonalise_the_stiffness(n):
    structure = Structure(n, damping_ratio=np.linspace(0.01, 0.2, n))
    phi, omega = structure.modes, structure.frequencies
    values, vectors = eigh(structure.stiffness_matrix)
    assert np.allclose(omega**2, values, rtol=0, atol=1e-12)
    assert np.allclose(np.abs(phi.T @ vectors), np.eye(n), atol=1e-10)
    assert np.allclose(phi.T @ phi, np.eye(n), atol=1e-13)
    assert np.all(phi[0] > 0)
    modal = phi.T @ structure.damping_matrix @ phi
    assert np.allclose(modal, np.diag(2 * structure.damping_ratios * omega), atol=1e-13)


def test_three_storeys_of_the_paper():
    structure = Structure()
    assert structure.stiffness_matrix.tolist() == [[2, -1, 0], [-1, 2, -1], [0, -1, 1]]
    assert structure.frequencies == pytest.approx([0.44504, 1.24698, 1.80194], abs=5e-6)
    assert structure.grazing_amplitude(0.445) == pytest.approx(0.016230, abs=5e-7)


def test_grazing_amplitude_of_the_described_damping():
    frequencies = Structure().frequencies
    structure = Structure(damping_ratio=0.05 / (2 * frequencies**2))
    assert structure.damping_ratios == pytest.approx([0.1262, 0.0161, 0.0077], abs=5e-5)
    assert structure.grazing_amplitude(0.445) == pytest.approx(0.0410, abs=5e-5)


def test_an_undamped_resonance_grazes_at_any_amplitude():
    structure = Structure(damping_ratio=0.0)
    for resonance in structure.frequencies.tolist():
        assert structure.grazing_amplitude(resonance) == 0.0


def test_grazing_amplitude_of_one_storey():
    omega, zeta = 0.7, 0.1
    exact = math.sqrt((1 - omega**2) ** 2 + (2 * zeta * omega) ** 2)
    assert Structure(1, damping_ratio=zeta).grazing_amplitude(omega) == pytest.approx(
        exact, rel=1e-14
    )


def test_linear_steady_state_solves_the_equation():
    structure = Structure(4, damping_ratio=(0.1, 0.2, 0.0, 1.5))
    omega = 0.9
    response = structure.linear_steady_state(omega)
    residual = (
        -(omega**2) * response
        + 1j * omega * structure.damping_matrix @ response
        + structure.stiffness_matrix @ response
        + 1.0
    )
    assert np.abs(residual).max() < 1e-13


@together("factor, contact", [(1 - 1e-6, 0), (1 + 1e-6, 4)])
def test_contact_begins_at_the_grazing_amplitude(factor, contact):
    structure = Structure(3, 1000.0, math.inf, 0.05)
    amplitude = factor * structure.grazing_amplitude(0.445)
    response = amplitude * structure.linear_steady_state(0.445)
    state = np.concatenate((response.imag, 0.445 * response.real))
    assert reference_window(structure, amplitude, 0.445, state, 1)[0] == contact


def test_undamped_resonance_has_no_steady_state():
    structure = Structure(1, damping_ratio=0.0)
    with pytest.raises(ZeroDivisionError, match="undamped resonance at omega"):
        structure.linear_steady_state(float(structure.frequencies[0]))


def test_equal_values_make_equal_structures():
    one = Structure(2, 100, 1e4, [0.1, 0.2])
    other = Structure(2, 100.0, 1e4, np.array([0.1, 0.2]))
    assert one == other
    assert hash(one) == hash(other)
    assert one != Structure(2, 100, 1e4, 0.1)


def test_matrices_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Structure().stiffness_matrix[0, 0] = 1.0


@together(
    "key, value, said",
    [
        ("n_floors", 0, "n_floors must be a whole number from 1 to 64, is 0"),
        ("n_floors", 65, "n_floors must be a whole number from 1 to 64, is 65"),
        ("n_floors", 3.0, "n_floors must be a whole number from 1 to 64, is 3.0"),
        ("n_floors", True, "n_floors must be a whole number from 1 to 64, is True"),
        ("n_floors", "3", "n_floors must be a whole number from 1 to 64, is '3'"),
        ("stiffness_ratio", -1.0, "stiffness_ratio must be at least 0, or inf, is -1.0"),
        ("stiffness_ratio", math.inf, "stiffness_ratio = inf must have restitution beside it"),
        ("stiffness_ratio", math.nan, "stiffness_ratio must be a number, is nan"),
        ("stiffness_ratio", "stiff", "stiffness_ratio must be a number, is 'stiff'"),
        ("sharpness", -1, "sharpness must be at least 0 (inf is allowed), is -1.0"),
        ("sharpness", math.nan, "sharpness must be a number, is nan"),
        ("sharpness", None, "sharpness must be a number, is None"),
        ("damping_ratio", -0.1, "damping_ratio must be finite and at least 0, is -0.1"),
        ("damping_ratio", math.inf, "damping_ratio must be finite and at least 0, is inf"),
        ("damping_ratio", "no", "damping_ratio must be a number, is 'no'"),
        ("damping_ratio", [0.1, 0.1], "must have 3 numbers, one per mode, has 2"),
        ("damping_ratio", [0.1, 0.1, -1], "damping_ratio must be finite and at least 0, is -1.0"),
        ("damping_ratio", [0.1, 0.1, "x"], "damping_ratio must be a number, is 'x'"),
    ],
)
def test_validation_names_key_value_and_limit(key, value, said):
    with pytest.raises(ValueError) as error:  # noqa: PT011 (the whole message is compared)
        Structure(**{key: value})
    assert said in str(error.value)


def test_limits_are_allowed():
    structure = Structure(MAX_FLOORS, 0.0, math.inf, 0.0)
    assert structure.stiffness_matrix.shape == (MAX_FLOORS, MAX_FLOORS)
    assert Structure(1, 1e7, 0.0, 2.0).damping_matrix == pytest.approx(4.0, rel=1e-15)


@together("n", [1, 2, 3, 7, 20, MAX_FLOORS])
def test_what_the_solvers_know_of_the_matrices_holds(n):
    structure = Structure(n)
    stiffness = structure.stiffness_matrix
    assert np.linalg.norm(stiffness, 2) <= structure.stiffness_bound == 4.0
    rows, columns = np.nonzero(stiffness)
    assert np.abs(rows - columns).max() == kernel_model(structure, 1.0).bandwidth
    assert np.allclose(structure.modal_transform @ structure.modes, np.eye(n), atol=1e-13)
    u = np.linspace(0.1, 0.9, n)
    q = structure.modal_transform @ u
    assert np.allclose(structure.modes @ q, u, atol=1e-13)


def test_the_kernels_know_the_structure_and_cannot_change_it():
    structure = Structure(3, 500.0, 2e3, (0.05, 0.1, 0.2))
    model = kernel_model(structure, 0.445)
    assert np.array_equal(model.stiffness, structure.stiffness_matrix)
    assert np.array_equal(model.damping, structure.damping_matrix)
    assert np.array_equal(model.modal_transform, structure.modal_transform)
    assert (model.rho, model.omega) == (2e3, 0.445)
    assert model.contacts.beta.tolist() == [500.0] * 3
    assert model.contacts.solo.tolist() == [0, 1, 2]
    assert model.contacts.others.size == 0
    assert model.layer == layer_half_width(500.0, 2e3) == structure.layer_half_width
    for field in (*model, *model.contacts):
        if isinstance(field, np.ndarray):
            assert field.flags.c_contiguous
            assert not np.shares_memory(field, structure.stiffness_matrix)
