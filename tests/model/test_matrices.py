"""General structures: what their parameters mean, and what is said of wrong ones."""

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from claims.reading import foreign
from scipy.linalg import eigh
from together import together

from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units

CHAIN = np.array([[1.0, -1.0], [-1.0, 2.0]])
ANY = Contact((1.0, 0.0), 1.0, 100.0)


def of(mass=(1.0, 1.0), stiffness=CHAIN, contacts=(ANY,), **more):
    return Structure.from_matrices(mass, stiffness, contacts, **more)


def test_masses_and_storeys_of_a_building():
    structure = Structure(3, mass=(1.0, 2.0, 4.0), storey_stiffness=(3.0, 2.0, 1.0))
    assert structure.mass_matrix.tolist() == np.diag([1.0, 2.0, 4.0]).tolist()
    assert structure.stiffness_matrix.tolist() == [[5, -2, 0], [-2, 3, -1], [0, -1, 1]]
    assert [contact.stiffness for contact in structure.contacts] == [3000.0, 2000.0, 1000.0]
    assert structure.forcing_vector.tolist() == [-1.0, -2.0, -4.0]
    phi, mass = structure.modes, structure.mass_matrix
    assert np.allclose(phi.T @ mass @ phi, np.eye(3), atol=1e-13)
    assert np.allclose(structure.modal_transform @ phi, np.eye(3), atol=1e-13)
    values = eigh(structure.stiffness_matrix, mass, eigvals_only=True)
    assert structure.frequencies**2 == pytest.approx(values, rel=1e-12)
    modal = phi.T @ structure.damping_matrix @ phi
    assert np.allclose(modal, np.diag(0.1 * structure.frequencies), atol=1e-13)


def test_ones_are_the_uniform_building():
    plain, reported = Structure(4), Structure(4, mass=1.0, storey_stiffness=(1.0,) * 4)
    for name in ("stiffness_matrix", "mass_matrix", "forcing_vector", "drift_rows"):
        assert np.array_equal(getattr(plain, name), getattr(reported, name))
    for name in ("frequencies", "modes", "damping_matrix"):
        assert np.allclose(getattr(plain, name), getattr(reported, name), atol=1e-13)
    assert plain.contacts == reported.contacts
    assert not foreign(plain)
    assert list(foreign(reported)) == ["mass", "storey_stiffness"]


def test_stops_on_both_sides_and_their_numbers():
    structure = Structure(3, gap=(0.5, math.inf, 0.7), gap_left=(math.inf, 0.0, -0.1))
    assert [(c.direction, c.gap) for c in structure.contacts] == [
        ((1.0, 0.0, 0.0), 0.5),
        ((0.0, 0.0, 1.0), 0.7),
        ((0.0, -1.0, 0.0), 0.0),
        ((0.0, 0.0, -1.0), -0.1),
    ]
    assert structure.contact_numbers == (1, 3, 5, 6)
    assert structure.contact_bits(0b1011) == 0b100101
    model = kernel_model(structure, 1.0)
    assert model.contacts.row.tolist() == [0, 2, 1, 2]
    assert model.contacts.sign.tolist() == [1.0, 1.0, -1.0, -1.0]
    assert model.rows.shape == (0, 3)
    assert model.contacts.solo.tolist() == [0, 2, 1]
    assert model.contacts.others.tolist() == [3]


def test_pounding_floors_get_a_row_of_their_own():
    contacts = [Contact((1.0, -1.0), 0.1, 50.0), Contact((-1.0, 1.0), 0.3, 80.0)]
    structure = of(mass=(2.0, 3.0), contacts=contacts)
    model = kernel_model(structure, 1.0)
    assert model.rows.tolist() == [[1.0, -1.0]]
    assert model.contacts.row.tolist() == [2, 2]
    assert model.contacts.sign.tolist() == [1.0, -1.0]
    softness = 1 / 2 + 1 / 3
    scale = structure.frequency_unit**2
    assert model.contacts.beta == pytest.approx([50 * softness / scale, 80 * softness / scale])
    assert model.contacts.kick[0, 2] == pytest.approx(1.0, rel=1e-15)
    assert model.contacts.oblique.tolist() == [[0.0, -1.0], [-1.0, 0.0]]
    assert np.allclose(model.stiffness[2], model.stiffness[0] - model.stiffness[1])
    state = np.array([0.3, 0.1, 0.2, -0.5])
    frame = Units(structure, model)
    z = frame.into(state)
    assert z[2] * structure.length_unit == pytest.approx(0.2, rel=1e-15)
    assert np.array_equal(frame.out_of(z), state)


def test_units_are_powers_of_two():
    structure = Structure(2, mass=1e3, storey_stiffness=4e7, gap=0.02)
    for unit in (structure.length_unit, structure.frequency_unit):
        assert math.frexp(unit)[0] == 0.5
    assert 0.5 < 0.02 / structure.length_unit < 2.0
    assert 0.3 < structure.frequencies[0] / structure.frequency_unit < 3.0
    plain = Structure()
    assert (plain.length_unit, plain.frequency_unit) == (1.0, 1.0)


def test_damping_by_ratios_rayleigh_or_matrix():
    ratios = of(damping_ratio=(0.01, 0.02))
    rayleigh = of(rayleigh=(0.1, 0.03))
    matrix = of(damping=[[0.3, 0.0], [0.0, 0.1]])
    assert ratios.damping_ratios == pytest.approx([0.01, 0.02])
    assert np.array_equal(rayleigh.damping_matrix, 0.1 * np.eye(2) + 0.03 * CHAIN)
    w = rayleigh.frequencies
    assert rayleigh.damping_ratios == pytest.approx(0.05 / w + 0.015 * w)
    assert of(damping=0.03 * CHAIN).is_modal
    assert not matrix.is_modal
    assert of().damping_matrix.tolist() == [[0.0, 0.0], [0.0, 0.0]]


ODD = {"mass": (2.0, 1.0, 3.0, 1.5), "storey_stiffness": (50.0, 40.0, 30.0, 20.0)}


def ratios_of(structure) -> np.ndarray:
    """Return the damping ratios of the free vibrations, from the matrices alone."""
    m, n = structure.mass_matrix, structure.n_floors
    lower = -np.linalg.solve(m, np.hstack((structure.stiffness_matrix, structure.damping_matrix)))
    roots = np.linalg.eigvals(np.vstack((np.eye(n, 2 * n, n), lower)))
    roots = roots[roots.imag > 0]
    return (-roots.real / abs(roots))[np.argsort(abs(roots))]


def test_rayleigh_by_a_ratio_at_two_modes_or_periods_has_it_there():
    """zeta (w v + w_i^2) / (w_i (w + v)), w and v the frequencies that have zeta."""
    w = Structure(4, **ODD).frequencies
    for given in ({"periods": (2 * np.pi / w[0], 2 * np.pi / w[2])}, {"modes": (3, 1)}):
        structure = Structure(4, **ODD, rayleigh={"ratio": 0.04, **given})
        right = 0.04 * (w[0] * w[2] + w**2) / (w * (w[0] + w[2]))
        assert right[[0, 2]] == pytest.approx(0.04)
        assert structure.damping_ratios == pytest.approx(right, rel=1e-12)
        assert ratios_of(structure) == pytest.approx(right, rel=1e-10)
        assert structure.is_modal
    # a structure that is made of it has an alpha and a beta of its own
    heavier = dataclasses.replace(structure, mass=8.0)
    assert ratios_of(heavier)[[0, 2]] == pytest.approx(0.04)
    assert heavier.rayleigh_factors[0] < 0.7 * structure.rayleigh_factors[0]


def test_dashpots_of_storeys():
    steps = np.eye(4) - np.eye(4, k=-1)
    c = (0.0, 0.3, 0.0, 0.1)
    structure = Structure(4, **ODD, damping_ratio=0.02, storey_damping=c)
    more = structure.damping_matrix - Structure(4, **ODD, damping_ratio=0.02).damping_matrix
    assert np.abs(more - steps.T @ np.diag(c) @ steps).max() < 1e-14
    assert not structure.is_modal
    # in proportion to the stiffness they add c w / 2 to the ratios, and keep the modes
    equal = Structure(3, damping_ratio=0.02, storey_damping=0.01)
    assert equal.is_modal
    right = 0.02 + 0.005 * equal.frequencies
    assert equal.damping_ratios == pytest.approx(right, rel=1e-12)
    assert ratios_of(equal) == pytest.approx(right, rel=1e-10)


@together("structure", [of(damping=[[0.3, 0], [0, 0.1]]), Structure(2, mass=(1, 3))])
def test_steady_state_solves_the_equation(structure):
    for order in (1, 3):
        w = 0.7 * order
        response = structure.linear_steady_state(0.7, order)
        dynamic = structure.stiffness_matrix - w**2 * structure.mass_matrix
        residual = (dynamic + 1j * w * structure.damping_matrix) @ response
        assert np.abs(residual - structure.forcing_vector).max() < 1e-13


def test_grazing_of_two_masses():
    """NLvib's example 3: the linear motion grazes at the frequencies of its closed form."""
    structure = of(damping=0.03 * CHAIN, forcing=(0.0, 1.0))
    for omega in (0.581899639039312, 0.653440140416260):
        assert structure.grazing_amplitude(omega) == pytest.approx(0.1, rel=1e-10)


def test_grazing_of_a_soft_impact_oscillator():
    """u'' + 2 zeta u' + u = -A sin: the gap over the amplification, in closed form."""
    zeta, omega, gap = 0.01, 0.8, 1.26
    structure = Structure(1, 29.0, math.inf, zeta, gap=gap)
    exact = gap * math.hypot(1 - omega**2, 2 * zeta * omega)
    assert structure.grazing_amplitude(omega) == pytest.approx(exact, rel=1e-14)
    # the base moves by a sin: A = a omega^2
    assert exact / omega**2 == pytest.approx(0.709450, abs=1e-6)


def test_several_harmonics_graze_at_the_top_of_their_sum():
    structure = Structure(2, harmonics=((1, 1.0, 0.3), (3, 0.5, -1.0)), gap=0.5)
    orders, responses = structure.steady_harmonics(0.4)
    theta = np.linspace(0, 2 * np.pi, 200_001)
    u = np.imag(responses.T @ np.exp(1j * np.outer(orders, theta)))
    assert structure.grazing_amplitude(0.4) == pytest.approx(0.5 / u.max(), rel=1e-9)


WRONG = [
    (lambda: Structure(2, mass=0.0), "mass must be finite and above 0, is 0.0"),
    (lambda: Structure(2, mass=(1.0,)), "mass must have 2 numbers, one per floor, has 1"),
    (lambda: Structure(2, mass="heavy"), "mass must be a number, is 'heavy'"),
    (lambda: Structure(2, mass={1.0, 2.0}), "mass must be a list of numbers"),
    (lambda: Structure(2, mass=(1.0, math.nan)), "mass must be a number, is nan"),
    (lambda: Structure(2, mass=(1.0, 1e17)), r"a ratio above 1e\+16 looks like mixed units"),
    (lambda: Structure(2, mass=math.inf), "mass must be finite and above 0, is inf"),
    (lambda: Structure(2, storey_stiffness=-1.0), "storey_stiffness must be finite and at least 0"),
    (
        lambda: Structure(2, storey_stiffness=(1.0, 0.0)),
        "storey_stiffness must be above 0 at a floor",
    ),
    (lambda: Structure(2, gap=-math.inf), "gap must not be -inf"),
    (lambda: Structure(2, gap=math.nan), "gap must be a number, is nan"),
    (lambda: Structure(2, gap_left=(1.0, 2.0, 3.0)), "gap_left must have 2 numbers, one per floor"),
    (lambda: Structure(2, gap_left=True), "gap_left must be a number, is True"),
    (lambda: Structure(40, gap_left=1.0), "gap_left: 40 floors have stops on the left"),
    (lambda: Structure(2, (1.0, -1.0)), "stiffness_ratio must be at least 0, or inf, is -1.0"),
    (lambda: Structure(2, rayleigh=(0.1,)), "rayleigh must have 2 numbers: alpha, beta, has 1"),
    (lambda: Structure(2, rayleigh=(0.1, -1.0)), "rayleigh must be at least 0, is -1.0"),
    (lambda: Structure(2, storey_damping=-1.0), "storey_damping must be finite and at least 0"),
    (lambda: Structure(2, rayleigh={"ratio": 0.1}), "must be .alpha, beta., or ratio and modes"),
    (lambda: Structure(2, rayleigh={"ratio": 0.1, "mode": (1, 2)}), "or ratio .*, has 'mode'"),
    (
        lambda: Structure(2, rayleigh={"ratio": 5, "modes": (1, 2)}),
        "rayleigh.ratio must be from 0 to 1, a share of critical, is 5.0",
    ),
    (
        lambda: Structure(2, rayleigh={"ratio": 0.1, "modes": (1, 3)}),
        "rayleigh.modes must be a whole number from 1 to 2, is 3",
    ),
    (
        lambda: Structure(2, rayleigh={"ratio": 0.1, "periods": (0.5, 0.5)}),
        "rayleigh.periods must differ, are both 0.5",
    ),
    (lambda: Structure(2, harmonics=()), "harmonics must be 1 to 16, are 0"),
    (lambda: Structure(2, harmonics=((0, 1.0, 0.0),)), "harmonics.phase must be pi / 2 at order 0"),
    (lambda: Structure(2, harmonics=((0, 1.0, math.pi / 2),)), "harmonics.order must hold one abo"),
    (lambda: Structure(2, harmonics=((-1, 1.0, 0.0),)), "harmonics.order must be a whole number"),
    (lambda: Structure(2, harmonics=((1.5, 1.0, 0.0),)), "frequencies without a common period"),
    (lambda: Structure(2, harmonics=((1, 1, 0), (1, 2, 0))), "harmonics.order must not hold"),
    (lambda: Structure(2, harmonics=((1, math.inf, 0.0),)), "harmonics.amplitude must be finite"),
    (lambda: Structure(2, harmonics=((1, 1.0),)), "harmonics must have 3 numbers each, has 2"),
    (lambda: Structure(2, harmonics="sine"), "harmonics must be a list"),
    (lambda: Contact((0.0, 0.0), 1.0, 1.0), "must not be 0: such a contact can never be reached"),
    (lambda: Contact((1.0,), math.inf, 1.0), "contact.gap must be finite, is inf"),
    (lambda: Contact((1.0,), 1.0, -1.0), "contact.stiffness must be at least 0, is -1.0"),
    (lambda: Contact((1.0,), 1.0, Fraction), "contact.stiffness must be a number"),
    (lambda: Contact((math.inf,), 1.0, 1.0), "contact.direction must be finite, is inf"),
    (lambda: Contact({1.0}, 1.0, 1.0), "contact.direction must be a list of numbers"),
    (
        lambda: of(mass=[[1, 0.1], [0, 1]]),
        r"matrices.mass must be symmetric: entry \(1, 2\) is 0.1",
    ),
    (lambda: of(mass=[[1, 2], [2, 1]]), "matrices.mass must be positive definite"),
    (lambda: of(mass=[[1, 0]]), "matrices.mass must have 1 entries in each row, has 2"),
    (
        lambda: of(stiffness=np.ones((3, 3))),
        "must have 2 rows, one per mass, has 3",
    ),
    (lambda: of(stiffness=[[1, -2], [-2, 1]]), "matrices.stiffness must not be negative, has the"),
    (
        lambda: of(stiffness=[[1, -1], [-1, 1]], damping_ratio=(0.1, 0.2)),
        "damping_ratio must have 1 numbers, one per mode that vibrates, has 2",
    ),
    (
        lambda: of(stiffness=np.zeros((2, 2)), rayleigh={"ratio": 0.1, "modes": (2, 1)}),
        "rayleigh.modes must be above 2: modes up to that have no spring",
    ),
    (lambda: of(stiffness=[[1, -2], [-1, 3]]), "matrices.stiffness must be symmetric"),
    (lambda: of(stiffness=7), "matrices.stiffness must be a list of rows of numbers, is 7"),
    (lambda: of(damping=[[-1, 0], [0, 1]]), "matrices.damping must not feed energy in"),
    (lambda: of(damping=[[1, 3], [0, 1]]), "matrices.damping must not feed energy in"),
    (lambda: of(forcing=(1.0,)), "matrices.forcing must have 2 entries, has 1"),
    (lambda: of(forcing=(1.0, math.inf)), "matrices.forcing must be finite, is inf"),
    (lambda: of(drift=[[1.0]]), "matrices.drift must have 2 entries in each row, has 1"),
    (lambda: of(contacts=[Contact((1.0,), 1, 1)]), "contact 1 must have 2 entries, has 1"),
    (lambda: of(contacts=[(1.0, 0.0)]), "contacts must be a list of Contact, holds"),
    (lambda: of(contacts=5), "contacts must be a list of Contact, is 5"),
    (lambda: of(contacts=[ANY] * 65), "contacts must be at most 64, are 65"),
    (lambda: of(damping_ratio=0.1, damping=CHAIN), "damping_ratio and damping must not be given"),
    (lambda: of(mass=np.eye(513)), "matrices.mass must have at most 512 rows, has 513"),
]


@together("make, said", WRONG)
def test_a_wrong_structure_is_refused_in_one_line(make, said):
    with pytest.raises(ValueError, match=said) as caught:
        make()
    assert len(str(caught.value).splitlines()) == 1


def test_stiffest_contact():
    assert Structure(3, 5000.0).stiffest_contact == 5000.0
    assert Structure(1, 10.0, gap=math.inf).stiffest_contact == 0.0
    heavy = of((4.0,), [[4.0]], [Contact((2.0,), 0.1, 400.0)])
    assert heavy.stiffest_contact == 400.0


FULL = [[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 3.0]]
ALONE, OTHER = Contact((0, -1, 0), 0.1, 10.0), Contact((1, 0, 0), 0.3, 10.0)
BETWEEN = Contact((1, 0, -1), 0.2, 20.0)


SHARING = [
    Structure(),
    Structure(2, gap=math.inf),
    Structure(4, mass=(1.0, 2.0, 3.0, 4.0), rayleigh=(0.1, 0.1)),
    *(
        of(mass, stiffness, contacts)
        for mass in (np.eye(3), FULL, np.array(FULL, order="F"))
        for stiffness in (np.diag((1.0, 2.0, 3.0)), FULL)
        for contacts in ([], [ALONE], [ALONE, BETWEEN], [ALONE, OTHER], [OTHER, BETWEEN])
    ),
]


def test_all_structures_share_the_compiled_kernels():
    def kinds(value):
        if isinstance(value, tuple):
            return [kinds(field) for field in value]
        if isinstance(value, np.ndarray):
            return value.dtype, value.ndim, value.flags.c_contiguous, value.flags.writeable
        return type(value)

    for structure in SHARING:
        assert kinds(kernel_model(structure, 0.5)) == kinds(kernel_model(Structure(), 0.5))
