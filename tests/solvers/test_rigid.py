"""Rigid stops: closed forms, the independent reference of `rigid`, tangents by differences."""

import math

import numpy as np
import pytest
import rigid_laws
from numpy.testing import assert_allclose
from rigid import Rigid, random_case
from rigid_grazing import misses
from scipy.linalg import expm
from together import together

import hpcsweep
from hpcsweep import Contact, Slider, Structure
from hpcsweep.dynamics.stability import TangentMaps
from hpcsweep.dynamics.verification import VerifiedOrbit
from hpcsweep.model.observed import IMPACT
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.record_map import RecordMap
from hpcsweep.studies.ground_motion.variables import peaks_of
from hpcsweep.studies.settings import SweepSettings

MEAN = (0, 1.0, math.pi / 2)


def one(e: float, gap: float = 0.0, k: float = 1.0, zeta: float = 0.0, **more) -> Structure:
    stop = Contact((1.0,), gap, math.inf, restitution=e)
    return Structure.from_matrices([1.0], [[k]], [stop], damping_ratio=zeta, **more)


PRESSED = hpcsweep.Record(np.full(401, -1.0), 0.05)


def stops(**more) -> Structure:
    more = {"sharpness": math.inf, "restitution": 0.5} | more
    return Structure(2, (math.inf, 0.0), damping_ratio=0.05, **more)


REFUSED = [
    (lambda: Contact((1.0,), 0.1, math.inf), "contact.restitution is missing"),
    (lambda: Contact((1.0,), 0.1, math.inf, restitution=1.1), "from 0 to 1"),
    (lambda: Contact((1.0,), 0.1, 5.0, restitution=0.5), "goes with stiffness = inf"),
    (lambda: Contact((1.0,), 0.1, math.inf, 1.0, restitution=0.5), "contact.damping"),
    (lambda: one(0.5, -0.1), "contact.gap must be at least 0"),
    (lambda: stops(sharpness=1e4), "stiffness_ratio = inf needs sharpness"),
    (lambda: stops(restitution=None), "stiffness_ratio = inf must have restitution"),
    (lambda: one(0.5, sliders=[Slider((1.0,), 1.0, 1.0)]), "springs that yield"),
    (lambda: BdfMap(one(0.5), 1.0), "are rigid"),
    (lambda: hpcsweep.floor_spectra(one(0.5), PRESSED, [1.0]), "without rigid stops: knows no acc"),
]


@together("make, told", REFUSED)
def test_what_is_not_offered_is_refused_in_one_line(make, told):
    with pytest.raises(ValueError, match=told) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_floors_pairs_and_matrices_have_the_same_stops():
    contact = stops().contacts[0]
    assert (contact.stiffness, contact.restitution, contact.damping) == (math.inf, 0.5, 0.0)
    pair = [hpcsweep.Building([1.0], 1.0, damping_ratio=0.05) for _ in range(2)]
    found = hpcsweep.adjacent(pair, gap=0.1, stiffness=math.inf, restitution=0.0)
    assert found.contacts == (Contact((1.0, -1.0), 0.1, math.inf, restitution=0.0),)
    names = [variable.name for variable in peaks_of(found, SweepSettings())[0]]
    assert "impulse" in names
    assert "contact_force" not in names


@together("e", (0.0, 0.3, 0.7, 0.9))
def test_chatter_under_a_constant_force_ends_as_the_closed_form_says(e):
    """An oscillator pressed by a = 1 hops for (2 / w) atan(v w / a) and lands with v."""
    dt, h = 0.05, 0.3
    solver = RecordMap(one(e), dt)
    found = solver.respond(np.full(401, -1.0), state=np.array([-h, 0.0]))
    speed, ends = (1 + h) * math.sin(math.acos(1 / (1 + h))), math.acos(1 / (1 + h))
    while (speed := e * speed) > 1e-18:
        ends += 2.0 * math.atan(speed)
    assert_allclose(20.0 - found.contact_time, ends, rtol=0, atol=1e-12)
    assert_allclose(found.final_state, 0.0, atol=1e-14)
    assert np.isnan(found.contact_force).all()
    assert_allclose(found.dissipated, 0.5 * h * h + h, rtol=1e-12)  # of the spring and the force


def test_forces_and_accelerations_are_told_where_nothing_is_at_its_stop():
    """An oscillator pressed by 1 bounces off its stop at 0.2, and rests there; open it has -u."""
    seen = hpcsweep.history(one(0.5, 0.2), PRESSED)
    rests = seen.approach[:, 0] > 0.2 - 1e-12
    assert 10 < np.count_nonzero(~rests) < 200
    assert rests[-100:].all()
    assert np.isnan(seen.force[rests]).all()
    assert (seen.force[~rests] == 0.0).all()
    assert np.isnan(seen.acceleration[rests]).all()
    assert_allclose(seen.acceleration[~rests], -seen.displacement[~rests], atol=1e-14)


def test_energy_is_kept_at_e_1_and_momentum_between_masses():
    """Two undamped masses, a stop between them and one at each wall, without forcing."""
    rows = ((1.0, -1.0), (-1.0, 0.0), (0.0, 1.0))
    contacts = [
        Contact(d, g, math.inf, restitution=1.0) for d, g in zip(rows, (0.1, 0.2, 0.3), strict=True)
    ]
    mass, stiffness = np.array([1.0, 2.0]), np.array([[1.5, -0.5], [-0.5, 1.0]])
    structure = Structure.from_matrices(mass, stiffness, contacts, damping_ratio=0.0)
    seen = FlowMap(structure, 1.0).observe(
        np.array([0.05, 0.0, 1.0, -0.7]), 0.0, 100, measures=IMPACT
    )
    u, v = np.split(seen.points, 2, axis=1)
    energy = 0.5 * (mass * v * v).sum(1) + 0.5 * np.einsum("pi,ij,pj->p", u, stiffness, u)
    assert seen.measures.impacts.sum() > 3.0
    assert_allclose(energy, energy[0], rtol=1e-12)


def test_closings_beside_a_mass_that_rests_are_simultaneous():
    """Both are pressed by 1; one rests at the wall, the other bounces off it as off a wall."""
    wall, pair = (
        Contact(d, g, math.inf, restitution=0.5) for d, g in (((0.0, 1.0), 0.0), ((1.0, -1.0), 0.1))
    )
    structure = Structure.from_matrices(
        np.ones(2), np.eye(2), [wall, pair], damping_ratio=0.0, harmonics=(MEAN, (1, 1e-3, 0.0))
    )
    seen = FlowMap(structure, 1.0).observe(
        np.array([-0.5, 0.0, 0.0, 0.0]), -1.0, 1, measures=IMPACT
    )
    assert seen.measures.impacts[1] > 10.0
    assert_allclose(seen.measures.simultaneous, [0.0, seen.measures.impacts[1]])


@together("n", (1, 2))
def test_a_table_bounces_a_ball_with_n_of_its_periods(n):
    """The phase of the impact has cos = -pi n (1 - e) / ((1 + e) Gamma): Gamma is that at least."""
    e, omega, k = 0.8, 2 * math.pi, 1e-8
    least = math.pi * n * (1 - e) / (1 + e)
    gamma, flight = 1.2 * least, n * 2 * math.pi / omega
    structure = one(e, k=k, harmonics=(MEAN, (1, gamma, 0.0)))
    bounced = 0
    for phase in (math.acos(-least / gamma), 2 * math.pi - math.acos(-least / gamma)):

        def moved(t, phase=phase):
            """Return u and u' of u'' = 1 + Gamma sin, a time t after the impact."""
            turned = omega * t + phase
            speed = gamma / omega * math.cos(phase) - flight * e / (1 + e)
            u = (speed + 0.5 * t) * t - gamma / omega**2 * (math.sin(turned) - math.sin(phase))
            return u, speed + t - gamma / omega * math.cos(turned)

        if all(moved(t)[0] < 0.0 for t in np.linspace(0.001, 0.999 * flight, 500)):
            start = np.array(moved((2 * math.pi - phase) / omega))
            back = FlowMap(structure, omega).advance(start, -1.0, n).state
            assert_allclose(back, start, rtol=0, atol=1e-6)
            bounced += 1
    assert bounced > 0


def test_one_impact_orbits_have_the_multipliers_of_the_closed_form():
    """The orbit follows from a linear system; one impact has the saltation matrix of `rigid`."""
    e, omega, zeta, gap, amplitude = 0.6, 1.7, 0.05, 0.2, 1.0
    structure = one(e, gap, zeta=zeta)
    solver = FlowMap(structure, omega)
    end = solver.settle(np.zeros(2), amplitude, 4000, 8, 1e-12, 1e-9)
    z, m = solver.monodromy(end.state, amplitude, 1)
    assert end.period == 1
    assert_allclose(z, end.state, atol=1e-11)
    field = np.array([[0.0, 1.0], [-1.0, -2 * zeta]])
    period = 2 * math.pi / omega
    # w before the impact and its phase: x(T) = gap with v = w after v = -e w at x = gap
    b = np.zeros((4, 4))
    b[:2, :2], b[1, 2] = field, -amplitude
    b[2, 3], b[3, 2] = omega, -omega
    flow = expm(b * period)
    # unknown w, s, c: flow (gap, -e w, s, c) = (gap, w)
    left = np.column_stack((-e * flow[:2, 1] - [0.0, 1.0], flow[:2, 2:]))
    right = np.array([gap, 0.0]) - flow[:2, 0] * gap
    particular, null = np.linalg.lstsq(left, right, rcond=None)[0], np.linalg.svd(left)[2][-1]
    roots = np.roots(
        [
            null[1:] @ null[1:],
            2 * null[1:] @ particular[1:],
            particular[1:] @ particular[1:] - 1.0,
        ]
    )
    expected = []
    for root in roots[np.isreal(roots)].real:
        w, s, _ = particular + root * null
        before, after = -gap - 2 * zeta * w - amplitude * s, -gap + 2 * zeta * e * w - amplitude * s
        jump = np.array([[-e, 0.0], [(after + e * before) / w, -e]])
        expected.append(np.sort_complex(np.linalg.eigvals(jump @ expm(field * period))))
    found = np.sort_complex(np.linalg.eigvals(m))
    assert min(np.abs(found - one).max() for one in expected) < 1e-9


def against_reference(seed: int, periods: int, most: int) -> None:
    case = random_case(seed, most)
    mass, damping, stiffness, rows, gaps, e, _, omega, amplitude, harmonics = case
    contacts = [
        Contact(tuple(d), g, math.inf, restitution=b) for d, g, b in zip(rows, gaps, e, strict=True)
    ]
    structure = Structure.from_matrices(
        mass, stiffness, contacts, damping=damping, harmonics=harmonics
    )
    n, reference = len(mass), Rigid(*case)
    seen = FlowMap(structure, omega).observe(np.zeros(2 * n), amplitude, periods, measures=IMPACT)
    u = v = np.zeros(n)
    for period in range(1, periods + 1):
        u, v = reference.advance(u, v, period * 2 * math.pi / omega)
        size = max(1.0, np.abs(u).max(), np.abs(v).max())
        found = seen.points[period - 1]
        assert_allclose(found, np.r_[u, v], rtol=0, atol=1e-11 * size, err_msg=f"{seed} {period}")
    # of bounces as high as rounding it is chance which count, of their sum what is left of it
    moves = reference.closed == 0.0
    closings = np.round(seen.measures.impacts * periods)
    assert (closings[moves] == reference.counts[moves]).all(), (seed, closings, reference.counts)
    together = np.round(seen.measures.simultaneous * periods)
    assert (together[moves] == reference.together[moves]).all(), (seed, together)
    at_rest = seen.measures.contact_share * periods * 2 * math.pi / omega
    assert_allclose(at_rest, reference.closed, rtol=0, atol=1e-4)


def test_a_free_ball_in_a_shaken_cavity_moves_as_the_reference():
    rows, one_by_one = np.array([[1.0], [-1.0]]), np.ones((1, 1))
    contacts = [Contact(tuple(row), 0.5, math.inf, restitution=0.8) for row in rows]
    structure = Structure.from_matrices([1.0], [[0.0]], contacts)
    points = FlowMap(structure, 2.0).points(np.array([0.0, 0.3]), 1.0, 20)[0]
    laws = rows, np.full(2, 0.5), np.full(2, 0.8), -np.ones(1)
    matrices = one_by_one, 0.0 * one_by_one, 0.0 * one_by_one
    reference = Rigid(*matrices, *laws, 2.0, 1.0, ((1, 1.0, 0.0),))
    u, v = np.array([0.0]), np.array([0.3])
    for period, found in enumerate(points, 1):
        u, v = reference.advance(u, v, period * math.pi)
        assert_allclose(found, np.r_[u, v], rtol=0, atol=1e-13)


def test_a_random_structure_moves_as_the_reference():
    against_reference(14, 3, 3)


@pytest.mark.slow
def test_random_structures_move_as_the_reference():
    for seed in (*range(10), 20, 24, 42, 61):
        against_reference(seed, 4, 6)


@pytest.mark.slow
@together("seed, periods", ((51, 4), (103, 4), (210, 4), (452, 6)))
def test_stops_that_push_each_other_and_chatter_together_come_to_rest_as_the_reference(
    seed, periods
):
    """The times between their impacts fall as the square of the one before."""
    against_reference(seed, periods, 6)


def test_a_stop_at_the_largest_distance_is_struck_when_it_is_before_it():
    rng, found = np.random.default_rng(5), []
    while len(found) < 20:
        found += misses(random_case(int(rng.integers(2**31)), 3), rng) or []
    assert not any(missed for _, missed, _ in found)
    assert np.nanmax([error for *_, error in found]) < 1e-12


@pytest.mark.slow
@together("n", (1, 3))
def test_a_table_bounces_a_ball_from_the_least_acceleration_on_and_not_below(n):
    error, holds = rigid_laws.table(0.5, n)
    assert error < 1e-9
    assert holds


@pytest.mark.slow
def test_the_period_doubles_and_the_symmetry_breaks_where_the_multiplier_is_minus_1():
    for told, kind in (("one stop", "doubling"), ("two stops", "branch point")):
        for name, cases in rigid_laws.BIFURCATIONS.items():
            if name.startswith(told):
                *errors, kinds = rigid_laws.bifurcation(*cases[1])
                assert max(errors) < 1e-9
                assert kinds == {kind}


@pytest.mark.slow
@together("name", rigid_laws.KEPT)
def test_energy_and_momentum_drift_no_more_than_a_unit_of_rounding_an_impact(name):
    stops, stiffness = rigid_laws.KEPT[name]
    for impacts, energy, momentum in rigid_laws.kept(stops, stiffness, 1e4):
        assert abs(energy) < 1e-13 + 1e-15 * impacts
        assert stops is rigid_laws.WALLS or abs(momentum) < 1e-13 + 1e-15 * impacts


@together("seed", (2, 4, 8))
def test_the_tangent_map_is_that_of_differences(seed):
    mass, damping, stiffness, rows, gaps, e, _, omega, amplitude, harmonics = random_case(seed, 3)
    contacts = [
        Contact(tuple(d), g, math.inf, restitution=b) for d, g, b in zip(rows, gaps, e, strict=True)
    ]
    structure = Structure.from_matrices(
        mass, stiffness, contacts, damping=damping, harmonics=harmonics
    )
    solver, size = FlowMap(structure, omega), 2 * len(mass)
    start = solver.advance(np.zeros(size), amplitude, 3).state
    _, matrix = solver.monodromy(start, amplitude, 1)
    step = 1e-6 * np.eye(size)
    ends = [
        [solver.advance(start + sign * row, amplitude, 1).state for row in step]
        for sign in (1.0, -1.0)
    ]
    differences = (np.array(ends[0]) - np.array(ends[1])).T / 2e-6
    assert_allclose(matrix, differences, atol=1e-7)


def test_an_orbit_tells_its_impacts_and_where_a_floor_that_rests_is_let_go():
    """Pressed by the forcing alone it leaves where A sin falls below the spring."""
    structure, omega, gap = one(0.0, 0.2, zeta=0.05), 0.2, 0.2
    point = hpcsweep.stroboscopic_points(structure, 1.0, omega, np.zeros(2), 20)[-1]
    hit, leaves = hpcsweep.orbit(structure, 1.0, omega, point, 1).signature
    assert (hit.closes, leaves.closes) == (True, False)
    assert_allclose(leaves.phase, 1.0 - math.asin(gap) / (2 * math.pi), rtol=1e-12)
    share = FlowMap(structure, omega).observe(point, 1.0, 1, measures=IMPACT).measures
    assert_allclose(leaves.phase - hit.phase, share.contact_share[0], rtol=1e-12)


def test_an_orbit_whose_tangent_map_overflows_repels():
    """Of the impact oscillator, where impacts of orbits of long period hardly more than graze."""
    maps = TangentMaps(np.broadcast_to(np.diag([1e200, 1e-3]), (2, 2, 2)))
    assert VerifiedOrbit(np.zeros((2, 2)), maps, 0.0, 0.0).multiplier == math.inf
