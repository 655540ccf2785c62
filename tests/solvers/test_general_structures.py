"""General structures: both solvers against the Taylor reference, closed forms and symmetries."""

import math

import numpy as np
import pytest
from piecewise import one_mass_points
from reference import reference_monodromy, reference_points, reference_window
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag
from together import together
from tools import flat

from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.outcome import Outcome

SEEDS = [(seed, 1 + seed % 3, (math.inf, 1e3)[seed % 2]) for seed in range(20)]
"""With numbers of floors and sharpnesses."""


def pounding(sharpness):
    """Two buildings of two and three storeys, whose two lower floors pound."""
    stiffness = block_diag(Structure(2).stiffness_matrix, 2 * Structure(3).stiffness_matrix)
    contacts = [Contact((1, 0, -1, 0, 0), 0.1, 500.0), Contact((0, 1, 0, -1, 0), 0.1, 500.0)]
    masses = (1.0, 1.0, 2.0, 2.0, 2.0)
    return Structure.from_matrices(
        masses, stiffness, contacts, damping_ratio=0.03, sharpness=sharpness
    )


def random_structure(seed, sharpness, n=4, m=5):
    """Full matrices, contacts with random directions, gaps of any sign, two harmonics."""
    rng = np.random.default_rng(seed)
    mass, stiffness, damping = (x @ x.T for x in rng.normal(size=(3, n, n)))
    contacts = [
        Contact(tuple(rng.normal(size=n)), gap, 10 ** rng.uniform(1, 3))
        for gap in rng.choice([0.0, -0.05, 0.1, 0.2], size=m)
    ]
    return Structure.from_matrices(
        mass + np.eye(n),
        stiffness + np.eye(n),
        contacts,
        damping=0.02 * damping,
        sharpness=sharpness,
        harmonics=((1, 1.0, 0.0), (2, 0.5, 1.0)),
    )


CASES = {
    "stops on both sides": (Structure(gap=0.5, gap_left=(0.6, 0.7, math.inf)), 0.1, 0.445),
    "masses and storeys": (
        Structure(
            4,
            (100.0, 200.0, 300.0, 400.0),
            damping_ratio=0.02,
            mass=(1.0, 2.0, 0.5, 4.0),
            storey_stiffness=(1.0, 3.0, 2.0, 1.0),
            gap=(0.5, 0.4, 0.3, 0.2),
        ),
        0.1,
        0.3,
    ),
    "harmonics": (Structure(2, harmonics=((1, 1.0, 0.3), (3, 0.5, -1.0)), gap=0.5), 0.2, 0.5),
    "a mean, sharp": (
        Structure(2, 100.0, math.inf, harmonics=((0, -0.4, math.pi / 2), (1, 1.0, 0.0)), gap=0.5),
        0.2,
        0.5,
    ),
    "a mean, smooth": (
        Structure(2, 100.0, 200.0, harmonics=((2, 0.3, 1.0), (0, -0.4, math.pi / 2), (1, 1, 0))),
        0.4,
        0.5,
    ),
    "pounding, sharp": (pounding(math.inf), 0.1, 0.5),
    "pounding, smooth": (pounding(1e3), 0.1, 0.5),
    "oblique, sharp": (random_structure(1, math.inf), 0.5, 0.8),
    "oblique, smooth": (random_structure(2, 1e3), 0.5, 0.8),
    "bilinear": (Structure(1, 3.0, math.inf, gap=0.0), 0.5, 0.9),
    "SI units": (
        Structure(2, mass=2e4, storey_stiffness=(3e7, 2e7), gap=0.01, gap_left=0.02),
        3.0,
        20.0,
    ),
}


@pytest.fixture(params=CASES.values(), ids=CASES)
def case(request):
    structure, amplitude, omega = request.param
    start = 0.05 * structure.state_units * np.cos(np.arange(2 * structure.n_floors))
    return structure, amplitude, omega, start


def test_a_period_is_that_of_the_reference(case):
    structure, amplitude, omega, start = case
    solver = FlowMap(structure, omega)
    for state in (start, *reference_points(structure, amplitude, omega, start, 3)):
        found, outcome = solver.points(state, amplitude, 1)
        assert outcome is Outcome.COMPLETE
        exact = reference_points(structure, amplitude, omega, state, 1)
        assert np.abs((found - exact) / structure.state_units).max() < 1e-9


@pytest.mark.slow
def test_what_is_observed_is_what_the_reference_sees(case):
    structure, amplitude, omega, start = case
    seen = FlowMap(structure, omega).observe(start, amplitude, 2, modal_norm=True)
    contact, drift, norms = reference_window(structure, amplitude, omega, start, 2)
    assert seen.contact == contact
    assert seen.contact
    assert seen.peak_drift == pytest.approx(drift, rel=1e-7)
    if np.isfinite(norms).any():
        # the free part of a step inside a layer is interpolated
        assert seen.modal_norm == pytest.approx(norms, abs=1e-4)


def test_the_tangent_map_is_that_of_the_reference(case):
    structure, amplitude, omega, start = case
    exact = reference_monodromy(structure, amplitude, omega, start, 1)[1]
    found = FlowMap(structure, omega).monodromy(start, amplitude, 1)[1]
    units = structure.state_units
    off = np.abs((found - exact) * units / units[:, None]).max()
    assert off < 1e-7 * max(1.0, np.abs(exact * units / units[:, None]).max())


@pytest.mark.slow
def test_the_solvers_agree_in_motion_and_tangent(case):
    structure, amplitude, omega, start = case
    exact, tangent = FlowMap(structure, omega).monodromy(start, amplitude, 1)
    bdf = BdfMap(structure, omega, 1e-7)
    found, matrix = bdf.monodromy(start, amplitude, 1)
    units = structure.state_units
    growth = max(np.abs(tangent * units / units[:, None]).max(), 1.0)
    assert np.abs((found - exact) / units).max() < 1e-4 * growth
    assert np.abs((matrix - tangent) * units / units[:, None]).max() < 1e-2 * growth**2
    seen = bdf.observe(start, amplitude, 1)
    assert seen.contact == FlowMap(structure, omega).observe(start, amplitude, 1).contact


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gap", "gap_left", "beta"),
    [(1.0, math.inf, 1000.0), (0.0, math.inf, 3.0), (0.3, 0.4, 500.0), (-0.1, 0.5, 50.0)],
)
def test_one_mass_follows_its_closed_solution(gap, gap_left, beta):
    structure = Structure(1, beta, math.inf, 0.02, gap=gap, gap_left=gap_left)
    state, amplitude, omega = (0.1, 0.2), 0.9, 0.37
    exact, n_changes = one_mass_points(structure, amplitude, omega, state, 8)
    solver = FlowMap(structure, omega)
    assert n_changes > 15
    start = np.array(state)
    for point in exact:
        # period by period: what 8 add up is amplified by the motion, that of one by up to 1e4
        found, _ = solver.points(start, amplitude, 1)
        assert np.abs(found - point).max() < 5e-12
        start = np.array(point)


@pytest.mark.parametrize(
    ("gap", "gap_left", "zeta", "omega", "least"),
    # with both gaps 0 one stop opens as the other closes: one change
    [
        (0.0, 0.0, 0.02, 0.37, 130),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in ((0.3, 0.4, 0.1, 0.2, 500), (0.0, math.inf, 0.1, 0.37, 200))
        ),
    ],
)
def test_hundreds_of_contacts_of_one_mass_in_closed_form(gap, gap_left, zeta, omega, least):
    structure = Structure(1, 20.0, math.inf, zeta, gap=gap, gap_left=gap_left)
    exact, n_changes = one_mass_points(structure, 0.9, omega, (0.1, 0.2), 20)
    assert n_changes > least
    found, _ = FlowMap(structure, omega).points(np.array([0.1, 0.2]), 0.9, 20)
    assert np.abs(found - np.array(exact)).max() < 1e-12


@together("seed, n, sharpness", SEEDS)
def test_mirrored_motions_under_odd_harmonics(seed, n, sharpness):
    """z(tau) -> -z(tau + T/2): the map of two half periods apart commutes with the mirror."""
    rng = np.random.default_rng(seed)
    harmonics = tuple((h, rng.uniform(0.1, 1.0), rng.uniform(-3, 3)) for h in (1, 3, 5))
    shifted = tuple((h, size, phase + h * math.pi) for h, size, phase in harmonics)
    gaps = tuple(rng.choice([0.0, 0.2, 0.4, math.inf], size=n).tolist())
    given = dict(
        gap=gaps,
        gap_left=gaps,
        mass=tuple(rng.uniform(0.5, 3.0, n)),
        stiffness_ratio=tuple(rng.uniform(10.0, 500.0, n)),
        sharpness=sharpness,
    )
    here = FlowMap(Structure(n, harmonics=harmonics, **given), 0.5)
    there = FlowMap(Structure(n, harmonics=shifted, **given), 0.5)
    z = rng.uniform(-0.4, 0.4, 2 * n)
    mirrored, outcome = there.points(-z, 0.3, 1)
    assert outcome is Outcome.COMPLETE
    found, _ = here.points(z, 0.3, 1)
    growth = max(1.0, np.abs(here.monodromy(z, 0.3, 1)[1]).max())
    assert np.abs(mirrored + found).max() < 1e-11 * growth


@together("seed, n, sharpness", SEEDS)
def test_equal_buildings_in_phase_never_touch(seed, n, sharpness):
    rng = np.random.default_rng(seed)
    gap, amplitude, omega = 10 ** rng.uniform(-9, 0), rng.uniform(0.1, 20.0), rng.uniform(0.2, 2.0)
    stiffness = block_diag(Structure(n).stiffness_matrix, Structure(n).stiffness_matrix)
    rows = np.hstack((np.eye(n), -np.eye(n)))
    contacts = [Contact(tuple(row), gap, 500.0) for row in rows]
    structure = Structure.from_matrices(
        (1.0,) * (2 * n), stiffness, contacts, damping_ratio=0.05, sharpness=1e11 * sharpness
    )
    seen = FlowMap(structure, omega).observe(np.zeros(4 * n), amplitude, 20)
    assert seen.contact == 0
    apart = np.abs(seen.points[:, :n] - seen.points[:, n : 2 * n]).max()
    assert apart < 1e-13 * np.abs(seen.points).max()


@together("seed, n, sharpness", [(seed, n + 1, sharpness) for seed, n, sharpness in SEEDS])
def test_units_and_order_of_the_floors_mean_nothing(seed, n, sharpness):
    structure = random_structure(seed, sharpness, n, 3)
    rng = np.random.default_rng(seed)
    state, amplitude, omega = 0.1 * rng.normal(size=2 * n), 0.3, 0.8
    points, outcome = FlowMap(structure, omega).points(state, amplitude, 1)
    assert outcome is Outcome.COMPLETE
    kept = structure.matrices
    more = {"sharpness": sharpness, "harmonics": structure.harmonics}

    # masses and stiffnesses x 4, gaps and forcing x 2: exactly the same motion, twice as large
    scaled = Structure.from_matrices(
        4 * np.array(kept.mass),
        4 * np.array(kept.stiffness),
        [Contact(c.direction, 2 * c.gap, 4 * c.stiffness) for c in kept.contacts],
        damping=4 * np.array(kept.damping),
        **{**more, "sharpness": sharpness / 2},
    )
    found, _ = FlowMap(scaled, omega).points(2 * state, 2 * amplitude, 1)
    scale = 1 + np.abs(points).max()
    matrix = FlowMap(structure, omega).monodromy(state, amplitude, 1)[1]
    allowed = 1e-11 * scale * max(1.0, np.abs(matrix).max())
    assert np.abs(found / 2 - points).max() < allowed

    order = rng.permutation(n)
    both = np.concatenate((order, n + order))
    turned = Structure.from_matrices(
        np.array(kept.mass)[order][:, order],
        np.array(kept.stiffness)[order][:, order],
        [Contact(tuple(np.array(c.direction)[order]), c.gap, c.stiffness) for c in kept.contacts],
        damping=np.array(kept.damping)[order][:, order],
        **more,
    )
    found, _ = FlowMap(turned, omega).points(state[both], amplitude, 1)
    assert np.abs(found - points[:, both]).max() < allowed


@pytest.mark.parametrize("other", [(2, 0.3, 0.0), (0, 0.4, math.pi / 2), (0, -0.9, math.pi / 2)])
@pytest.mark.parametrize("damping", ["ratios", "matrix"])
def test_the_linear_state_in_closed_form(damping, other):
    given = {"damping_ratio": 0.05} if damping == "ratios" else {"damping": np.diag([0.3, 0.1])}
    structure = Structure.from_matrices(
        (1.0, 3.0),
        [[2.0, -1.0], [-1.0, 1.5]],
        [Contact((1.0, -1.0), 2.0, 100.0)],
        harmonics=((1, 1.0, 0.2), other),
        **given,
    )
    omega, amplitude = 0.4, 0.1
    free, solver = FreeMotion(structure, omega, 100, 100, 1e-6), FlowMap(structure, omega)
    start = np.array([0.01, 0.02, 0.0, 0.01])
    closed = free.window(start, amplitude)
    end = solver.advance(start, amplitude, 199).state
    seen = solver.observe(end, amplitude, 1, modal_norm=True)
    assert np.abs(closed.points[-1] - seen.points[-1]).max() < 1e-12
    assert closed.peak_drift == pytest.approx(seen.peak_drift, rel=1e-9)
    assert closed.modal_norm == pytest.approx(seen.modal_norm, abs=1e-7)
    assert free.orbit.lyapunov_exponent == pytest.approx(
        math.log(np.abs(np.linalg.eigvals(solver.monodromy(end, amplitude, 1)[1])).max())
        * omega
        / (2 * math.pi),
        rel=1e-9,
    )
    measures = solver.observe(end, amplitude, 1, measures=ANY_MEASURE).measures
    closed = free.orbit.measures(amplitude)
    np.testing.assert_allclose(flat(closed), flat(measures), rtol=0, atol=1e-9)
    # nothing is said of an amplitude that reaches the stop
    assert free.window(start, 1.01 * structure.grazing_amplitude(omega)) is None


def test_stops_at_the_same_place_close_and_open_together():
    """A spring on both sides of 0: with equal stiffness it is one that always acts."""
    contacts = [Contact((1.0,), 0.0, 172.8), Contact((-1.0,), 0.0, 172.8)]
    both = Structure.from_matrices([1.0], [[1.0]], contacts, damping_ratio=0.0)
    one = Structure.from_matrices([1.0], [[173.8]], [], damping_ratio=0.0)
    state, amplitude, omega = np.array([0.1, -0.3]), 0.4, 0.7
    exact, _ = FlowMap(one, omega).points(state, amplitude, 1)
    for found in (
        FlowMap(both, omega).points(state, amplitude, 1)[0],
        reference_points(both, amplitude, omega, state, 1),
    ):
        assert np.abs(found - exact).max() < 1e-12


def test_stops_at_the_same_place_in_directions_of_different_length():
    """Each has a row of its own, and rounding parts their distances: they once opened in turn."""
    springs = [(1.39, 2.1), (-0.08, 12.2), (-0.64, 202.0), (-0.91, 1666.5)]
    contacts = [Contact((d,), 0.0, kappa) for d, kappa in springs]
    joined = [
        Contact((side,), 0.0, sum(kappa * d * d for d, kappa in springs if side * d > 0))
        for side in (1.0, -1.0)
    ]
    many, two = (
        FlowMap(Structure.from_matrices([1.0], [[1.0]], one, damping_ratio=0.02), 0.7)
        for one in (contacts, joined)
    )
    for j in range(30):
        state = np.array([0.1, -0.3]) * (1 + j / 30)
        found, outcome = many.points(state, 0.4, 1)
        assert outcome is Outcome.COMPLETE
        assert np.abs(found - two.points(state, 0.4, 1)[0]).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("sharpness", [math.inf, 200.0])
def test_drifts_along_any_rows_feel_the_contacts(sharpness):
    contacts = [Contact((1.0, 0.0), 0.3, 300.0), Contact((1.0, -1.0), 0.2, 100.0)]
    structure = Structure.from_matrices(
        (1.0, 2.0),
        [[2.0, -1.0], [-1.0, 1.5]],
        contacts,
        damping_ratio=0.03,
        sharpness=sharpness,
        drift=[[1.0, 0.5], [0.3, -1.0]],
    )
    state, amplitude, omega = np.array([0.1, -0.2, 0.3, 0.4]), 0.4, 0.5
    contact, drift, _ = reference_window(structure, amplitude, omega, state, 2)
    assert contact == 3
    for solver, allowed in ((FlowMap(structure, omega), 1e-9), (BdfMap(structure, omega), 1e-4)):
        assert solver.observe(state, amplitude, 2).peak_drift == pytest.approx(drift, rel=allowed)


def test_harmonics_of_no_order_are_refused():
    for order in (math.inf, -math.inf, 10**400):
        with pytest.raises(ValueError, match=r"^harmonics"):
            Structure(2, harmonics=((order, 1.0, 0.0),))


def test_a_stop_that_stiffens_beyond_a_depth_is_two_contacts():
    stops = [Contact((1.0,), gap, 30.0) for gap in (1.0, 1.02)]
    damping = {"damping": [[0.1]], "sharpness": math.inf}
    structure = Structure.from_matrices([[1.0]], [[1.0]], contacts=stops, **damping)

    def rate(tau, y):
        force = sum(30.0 * max(y[0] - stop.gap, 0.0) for stop in stops)
        return [y[1], -0.4 * math.sin(0.9 * tau) - y[0] - 0.1 * y[1] - force]

    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 2e-3}
    exact = solve_ivp(rate, (0.0, 2.0 * math.pi / 0.9), [0.9, 0.6], **tight).y
    assert exact[0].max() > 1.1
    points, _ = FlowMap(structure, 0.9).points(np.array([0.9, 0.6]), 0.4, 1)
    np.testing.assert_allclose(points[-1], exact[:, -1], rtol=0, atol=1e-8)
