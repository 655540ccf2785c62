"""Contacts with dashpots: one impact, energies, the Taylor reference, tangents."""

import math
from dataclasses import replace

import numpy as np
import pytest
import random_records
from dashpots import measure, on_a_stop, random_case
from reference import reference_points, reference_record, system
from scipy.integrate import solve_ivp

import hpcsweep
from hpcsweep import Contact, Record, Structure
from hpcsweep.model.dashpot import ratio_of_restitution
from hpcsweep.model.observed import ANY_PEAK, IMPACT, ROUNDING
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.trajectory import trajectory

ALL = ANY_PEAK + IMPACT
STILL = Record(np.zeros(2), 0.05)
RULES = pytest.mark.parametrize("tension", [False, True])
ONE_QUICK = pytest.mark.parametrize("tension", [False, pytest.param(True, marks=pytest.mark.slow)])
"""By the integrator, which takes seconds."""
START = np.array([0.1, 0.2, 0.9, 0.3, 0.5, 0.8])


def storeys(tension: bool, n: int = 3) -> Structure:
    return Structure(n, 1000.0, math.inf, 0.05, restitution=0.6, tension=tension)


def free_mass(restitution: float, tension: bool) -> Structure:
    """A mass of 2 that nothing holds, but for a spring of no account, before a stop."""
    contact = Contact.from_restitution([1.0], 0.02, 500.0, restitution, [2.0], tension)
    return Structure.from_matrices([2.0], [[1e-12]], [contact])


def neighbours(tension: bool, damping_ratio: float = 0.0) -> Structure:
    """Two buildings of two storeys side by side, which pound at both levels."""
    both = [hpcsweep.Building([1.0, 1.0], 100.0), hpcsweep.Building([1.0, 2.0], 180.0)]
    made = hpcsweep.adjacent(both, [0.01, 0.015], 5e3, restitution=0.5, tension=tension)
    return Structure.from_matrices(
        made.mass_matrix, made.stiffness_matrix, made.contacts, damping_ratio=damping_ratio
    )


@RULES
@pytest.mark.parametrize("e", [0.95, 0.65, 0.2])
def test_one_impact_restores_the_speed_that_is_asked(e, tension):
    speed, mass, kappa = 0.4, 2.0, 500.0
    structure = free_mass(e, tension)
    found = hpcsweep.response(structure, STILL, tail=1.0, state=[0.0, speed], rtol=1e-10)
    off = 1e-11
    assert found.impacts.tolist() == [1]
    assert -found.final_state[1] / speed == pytest.approx(e, rel=off)
    energy = 0.5 * mass * speed**2
    assert found.dissipated[0] == pytest.approx(energy * (1 - e * e), rel=off)
    assert found.impulse[0] == pytest.approx(mass * speed * (1 + e), rel=off)
    assert found.impact_velocity[0] == pytest.approx(speed, rel=off)
    xi, omega = ratio_of_restitution(e, tension), math.sqrt(kappa / mass)
    s = math.sqrt(1 - xi * xi)
    pushed = (math.pi if tension else math.pi - 2 * math.asin(xi)) / (s * omega)
    if tension:
        assert found.contact_time[0] == pytest.approx(pushed, rel=off)
    # the force is largest where x'' turns, or at once
    t = (math.pi - 3 * math.asin(xi) - math.pi / 2) / (s * omega)
    top = 2 * xi * math.sqrt(kappa * mass) * speed
    if t > 0:
        top = mass * omega * speed * math.exp(-xi * omega * t)
    assert found.force[0] == pytest.approx(top, rel=off)


def test_a_dashpot_without_a_spring_takes_all_the_energy():
    # x'' = -c x' / m: it stops at v m / c, after infinite time, and never lets go
    contact = Contact([1.0], 0.02, 0.0, 50.0)
    structure = Structure.from_matrices([2.0], [[1e-12]], [contact])
    found = hpcsweep.response(structure, STILL, tail=2.0, state=[0.0, 0.4])
    assert found.final_state == pytest.approx([0.02 + 0.4 * 2 / 50, 0.0], abs=1e-12)
    assert found.force == pytest.approx([50.0 * 0.4], rel=1e-12)
    assert found.dissipated == pytest.approx([0.16], rel=1e-12)


@RULES
def test_a_ball_comes_to_rest_after_finitely_many_bounces(tension):
    # a spring cannot be hit infinitely often: below some speed the ball stays in contact
    weight, e, kappa = 9.81, 0.7, 5e5
    contact = Contact.from_restitution([1.0], 0.0, kappa, e, [2.0], tension)
    structure = Structure.from_matrices([2.0], [[1e-9]], [contact])
    steady = Record(np.full(2000, -weight), 0.005)
    found = hpcsweep.response(structure, steady, state=[-0.5, 0.0])
    deep = 2.0 * weight / kappa
    assert found.final_state == pytest.approx([deep, 0.0], abs=1e-9)
    first = math.sqrt(2 * weight * 0.5)
    assert found.impact_velocity[0] == pytest.approx(first, rel=1e-8)
    assert 5 <= found.impacts[0] <= 30
    fallen = 2.0 * weight * (0.5 + deep) - 0.5 * kappa * deep**2
    assert found.dissipated[0] == pytest.approx(fallen, rel=1e-7)


@RULES
def test_what_the_dashpots_take_is_what_the_buildings_lose(tension):
    structure = neighbours(tension)
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.6, -0.2, -0.5])
    found = hpcsweep.response(structure, STILL, tail=7.0, state=start)

    def energy(z):
        past = np.maximum(structure.directions @ z[:4] - [0.01, 0.015], 0.0)
        own = z[4:] @ structure.mass_matrix @ z[4:] + z[:4] @ structure.stiffness_matrix @ z[:4]
        return 0.5 * (own + structure.contact_stiffness @ past**2)

    assert found.impacts.min() > 3
    lost = energy(start) - energy(found.final_state)
    assert lost > 0.3 * energy(start)
    assert found.dissipated.sum() == pytest.approx(lost, rel=1e-11)


def test_scaling_a_record_is_shrinking_the_gaps():
    structure = neighbours(False, 0.05)
    contacts = tuple(replace(one, gap=one.gap / 3.0) for one in structure.contacts)
    wide = replace(structure, matrices=replace(structure.matrices, contacts=contacts))
    record = Record(3.0 * np.random.default_rng(3).standard_normal(200), 0.02)
    found = hpcsweep.response(structure, record, 3.0, tail=0.5)
    other = hpcsweep.response(wide, record, tail=0.5)
    assert found.impacts.tolist() == other.impacts.tolist()
    assert found.force == pytest.approx(3.0 * other.force, rel=1e-11)
    assert found.dissipated == pytest.approx(9.0 * other.dissipated, rel=1e-11)
    assert found.final_state == pytest.approx(3.0 * other.final_state, rel=1e-10, abs=1e-13)


@RULES
def test_results_under_a_record_are_those_of_the_steps_of_the_reference(tension):
    """Force, impulse, energy and acceleration along the reference's series."""
    structure = storeys(tension)
    samples = 0.6 * np.random.default_rng(1).standard_normal(40)
    found = hpcsweep.response(structure, Record(samples, 0.4), state=START)
    end, steps = reference_record(structure, samples, 0.4, 1.0, START)
    assert found.final_state == pytest.approx(end, abs=1e-12)
    parts = system(structure, 1.0, 1.0)[2]
    nodes, weights = np.polynomial.legendre.leggauss(16)
    top, impulse, energy = np.zeros((3, 3))
    pushed = np.zeros(3)
    for begun, h, c in steps:
        times = 0.5 * h * (np.concatenate((nodes, np.linspace(-1, 1, 400))) + 1)
        series = np.vander(times, c.shape[1], increasing=True).T
        x = parts.reach @ (c[:3] @ series) - parts.gap[:, None]
        w = parts.reach @ (c[3:] @ series)
        force = np.where(x > 0, parts.kappa[:, None] * x + parts.drag[:, None] * w, 0.0)
        if not tension:
            force = np.maximum(force, 0.0)
        top = np.maximum(top, force.max(axis=1))
        impulse += 0.5 * h * force[:, :16] @ weights
        energy += 0.5 * h * (force * w)[:, :16] @ weights
        rates = c[3:, 1:] * np.arange(1, c.shape[1]) @ series[:-1]
        ground = np.interp(begun + times, 0.4 * np.arange(40), samples)
        pushed = np.maximum(pushed, np.abs(rates + ground).max(axis=1))
    assert (found.impacts > 0).all()
    assert found.impulse == pytest.approx(impulse, rel=1e-10)
    assert found.dissipated == pytest.approx(energy, rel=1e-9)
    assert (found.force >= top * (1 - 1e-12)).all()
    assert found.force == pytest.approx(top, rel=1e-4)
    assert (found.floor_acceleration >= pushed * (1 - 1e-12)).all()
    assert found.floor_acceleration == pytest.approx(pushed, rel=1e-4)


@RULES
def test_a_record_by_an_integrator_of_its_own(tension):
    """scipy's DOP853 on the law as it is written, which finds the jumps by its error estimate."""
    structure = storeys(tension, 2)
    samples = 0.8 * np.random.default_rng(5).standard_normal(8)
    start = np.array([0.5, 0.9, 0.2, 0.8])
    given = {"state": start}
    found = hpcsweep.response(structure, Record(samples, 0.5), **given)
    (kappa, _), (c, _) = structure.contact_stiffness, structure.contact_damping

    def rates(t, z, j):
        x, w = z[:2] - 1.0, z[2:]
        push = np.where(x > 0, kappa * x + c * w, 0.0)
        push = push if tension else np.maximum(push, 0.0)
        ground = samples[j] + (samples[j + 1] - samples[j]) * t / 0.5
        inner = structure.stiffness_matrix @ z[:2] + structure.damping_matrix @ w
        return np.concatenate((w, -ground - inner - push))

    z = start
    for j in range(len(samples) - 1):
        done = solve_ivp(rates, (0, 0.5), z, "DOP853", args=(j,), rtol=1e-12, atol=1e-13)
        z = done.y[:, -1]
    assert (found.impacts > 0).all()
    assert found.final_state == pytest.approx(z, abs=1e-8)


@RULES
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("speed", [-1e-9, 0.0, 1e-15, 1e-12, 1e-9, 1e-7])
def test_a_start_exactly_on_the_stops_goes_on(speed, n, tension):
    structure = Structure(n, 50.0, math.inf, 0.02, restitution=0.3, tension=tension)
    start = np.repeat([1.0, speed], n)
    points, outcome = FlowMap(structure, 0.9).points(start, 0.5, 1)
    assert outcome is Outcome.COMPLETE
    exact = reference_points(structure, 0.5, 0.9, start, 1)
    assert points == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize(
    ("mass", "stiffness", "contact", "samples", "impacts"),
    [
        # critically damped, a mass that leaves its stop does not come back
        (1.0, 58.86343618, Contact([-0.119], 0.0, 0.0, 15.05, True), [-17.16, 0.0], 0),
        (3.7, 218.38110265, Contact([-0.0893], 0.0, 8.18, 0.0149, True), [0.1231, 0.0], 1),
        (1.0, 60.0, Contact([0.1], 0.0, 8.0, 1.0, True), [-0.125], 1),
    ],
)
def test_what_closes_by_rounding_does_not_count(mass, stiffness, contact, samples, impacts):
    structure = Structure.from_matrices([mass], [[stiffness]], [contact] * 3, damping_ratio=1.0)
    record = Record(np.append(np.zeros(20), samples), 0.05)
    found = hpcsweep.response(structure, record, tail=100.0)
    assert found.impacts.tolist() == [impacts] * 3


def test_a_chain_of_impacts_counts_down_to_rounding():
    # half a cycle beside the stop, half past it, smaller by the same factor each time
    zeta, omega, drag, speed = 0.05, 4.0, 0.4, 1e3
    contact = Contact([1.0], 0.0, 0.0, drag, True)
    structure = Structure.from_matrices([1.0], [[omega**2]], [contact], damping_ratio=zeta)
    found = hpcsweep.response(structure, STILL, tail=400.0, state=[0.0, -speed])
    within = zeta + drag / (2 * omega)
    a_cycle = sum(z * math.pi / math.sqrt(1 - z * z) for z in (zeta, within))
    assert found.impacts[0] == pytest.approx(-math.log(ROUNDING) / a_cycle, abs=1.5)


def check_random(number: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    period, tangent = np.array([measure(random_case(rng)) for _ in range(number)]).T
    assert period.max() < 1e-10
    assert np.median(period) < 1e-13
    # differences are off where a contact that grazes is near
    assert np.median(tangent) < 1e-7
    assert np.quantile(tangent, 0.9) < 1e-5


def by_dop853(structure, amplitude, omega, state):
    """Return the end of a forcing period by steps that no contact is missed by."""
    n, period = structure.n_floors, 2 * np.pi / omega
    inverse = np.linalg.inv(structure.mass_matrix)

    def motion(t, z):
        ground = sum(a * math.sin(h * omega * t + phase) for h, a, phase in structure.forcing.terms)
        force = structure.forcing_vector * amplitude * ground - structure.damping_matrix @ z[n:]
        force -= structure.stiffness_matrix @ z[:n]
        force -= structure.contact_forces(z) @ structure.directions
        return np.concatenate((z[n:], inverse @ force))

    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": period / 64}
    return solve_ivp(motion, (0.0, period), state, **tight).y[:, -1]


def check_starts_on_stops(number: int, seed: int) -> None:
    """Compare with the reference, and with DOP853 where it misses a closing of two stops."""
    rng = np.random.default_rng(seed)
    cases = [on_a_stop(rng, random_case(rng)) for _ in range(number)]
    errors = np.array([measure(case).period for case in cases])
    doubtful = np.flatnonzero(errors > 1e-10)
    assert len(doubtful) <= number // 200
    for structure, amplitude, omega, state in (cases[k] for k in doubtful):
        flow = FlowMap(structure, omega).advance(state, amplitude, 1).state
        other = by_dop853(structure, amplitude, omega, state)
        assert flow == pytest.approx(other, rel=1e-6, abs=1e-6)
    assert np.median(errors) < 1e-13


def check_records(number: int, seed: int) -> None:
    for errors in random_records.measure(number, seed).values():
        assert np.max(errors) < 1e-10
        assert (np.median(errors, axis=0) < 1e-13).all()


@pytest.mark.slow
def test_a_few_random_structures_follow_the_reference():
    check_random(4, seed=11)
    check_starts_on_stops(10, seed=13)
    check_records(4, seed=11)


@pytest.mark.slow
def test_random_structures_follow_the_reference():
    check_random(100, seed=12)
    check_starts_on_stops(400, seed=15)
    check_records(100, seed=12)


@RULES
def test_the_tangent_map_is_that_of_differences(tension):
    structure = storeys(tension)
    _, matrix = FlowMap(structure, 0.445).monodromy(START, 0.15, 1)
    shifts = 1e-6 * np.eye(6)
    ends = [
        reference_points(structure, 0.15, 0.445, START + side * shift, 1)[0]
        for shift in shifts
        for side in (1, -1)
    ]
    exact = (np.array(ends[::2]) - np.array(ends[1::2])).T / 2e-6
    np.testing.assert_allclose(matrix, exact, atol=1e-7)


def test_a_volume_shrinks_by_the_damping_and_the_time_in_which_contacts_push():
    # with tension a contact pushes as long as it is closed: det = exp(-T tr D - c t)
    structure = Structure(1, 300.0, math.inf, 0.02, restitution=0.7, tension=True)
    solver, state = FlowMap(structure, 0.9), np.array([0.9, 1.1])
    _, matrix = solver.monodromy(state, 0.3, 1)
    share = solver.observe(state, 0.3, 1, measures=ALL).measures.contact_share[-1]
    assert 0 < share < 1
    length = 2 * math.pi / 0.9
    own = length * (structure.damping_matrix[0, 0] + structure.contact_damping[0] * share)
    assert np.linalg.det(matrix) == pytest.approx(math.exp(-own), rel=1e-11)


@RULES
def test_bdf_leaves_dashpots_to_flow(tension):
    with pytest.raises(ValueError, match="solver must be flow where contacts have dashpots"):
        BdfMap(storeys(tension), 0.445)
    with pytest.raises(ValueError, match="solver must be flow where contacts have dashpots"):
        hpcsweep.stroboscopic_points(storeys(tension), 0.1, 0.445, START, 1, "bdf")


def test_no_motion_goes_beyond_its_reach():
    rng = np.random.default_rng(2)
    for tension in (False, True):
        structure = Structure(2, 40.0, math.inf, 0.2, gap=0.3, restitution=0.4, tension=tension)
        plain = replace(structure, restitution=None)
        states = rng.normal(size=(3, 4))
        reach = [one.within_reach(0.5, states) for one in (structure, plain)]
        assert not reach[0].unreached
        path = [trajectory(structure, 0.5, 0.8, z, 200)[:, :2].max() for z in states]
        far = replace(structure, gap=1e6).within_reach(0.5, states)
        assert tension or len(far.unreached) == 2
        assert max(path) < 1e3
    nothing = Contact([1.0], 1e9, 0.0, 5.0)
    only = Structure.from_matrices([1.0], [[1.0]], [nothing], damping_ratio=0.1)
    assert not only.within_reach(0.1, np.zeros(2)).unreached
