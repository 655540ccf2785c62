"""Structures whose sliders slip under a harmonic forcing, against a reference and closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hpcsweep
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver

OMEGA = 0.7


def oscillator(hardening=0.0, damping=0.05, **given):
    """Return a mass 1 on a spring of initial stiffness 1 that yields at 1."""
    slider = hpcsweep.Slider((1.0,), 1.0 - hardening, 1.0 - hardening)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[hardening]], [], damping=[[damping]], sliders=[slider], **given
    )


def reference(structure, amplitude, omega, state, n_periods, track=None, parts=1):
    """Return the states (u, u', p) at the ends of periods or parts, by DOP853 between events."""
    n, sliders = structure.n_floors, structure.sliders
    inverse = np.linalg.inv(structure.mass_matrix)
    elastic, damping = structure.elastic_stiffness, structure.damping_matrix
    rows, push = structure.slider_directions, structure.forcing_vector
    spring = np.array([one.stiffness for one in sliders])
    strength = np.array([one.strength for one in sliders])
    terms, period = structure.forcing.terms, 2 * math.pi / omega / parts
    z, plastic, slip = np.array(state[: 2 * n]), np.array(state[2 * n :]), np.zeros(len(rows), int)
    found, t = [], 0.0

    def motion(t, z):
        u, v = z[:n], z[n:]
        force = np.where(slip, slip * strength, spring * (rows @ u - plastic))
        ground = sum(a * math.sin(h * omega * t + phase) for h, a, phase in terms)
        total = push * amplitude * ground - damping @ v - elastic @ u - rows.T @ force
        total = total - structure.contact_forces(z) @ structure.directions
        return np.concatenate((v, inverse @ total))

    def event(j, way):
        def guard(_, z):
            if slip[j]:
                return -slip[j] * (rows[j] @ z[n:])
            return way * spring[j] * (rows[j] @ z[:n] - plastic[j]) - strength[j]

        guard.terminal, guard.direction = True, 1.0
        return guard

    for number in range(n_periods * parts):
        while t < (number + 1) * period:
            guards = [(j, way) for j in range(len(rows)) for way in ((1,) if slip[j] else (1, -1))]
            done = solve_ivp(
                *(motion, (t, (number + 1) * period), z),
                method="DOP853",
                rtol=1e-13,
                atol=1e-14,
                max_step=period * parts / 200,
                events=[event(j, way) for j, way in guards],
            )
            if track is not None:
                track.append((done.t, done.y[:n]))
            t, z = done.t[-1], done.y[:, -1]
            for (j, way), times in zip(guards, done.t_events, strict=True):
                if len(times) and slip[j]:
                    plastic[j], slip[j] = rows[j] @ z[:n] - slip[j] * strength[j] / spring[j], 0
                elif len(times):
                    slip[j] = way
        lasting = np.where(slip, rows @ z[:n] - slip * strength / spring, plastic)
        found.append(np.concatenate((z, lasting)))
    return np.array(found)


def solver_of(structure, omega=OMEGA):
    return make_solver("flow", structure, omega, 1e-9, yields=True)


@pytest.mark.slow
@pytest.mark.parametrize("hardening", [0.0, 0.1])
def test_an_oscillator_moves_as_the_reference(hardening):
    structure = oscillator(hardening)
    points = hpcsweep.stroboscopic_points(structure, 1.3, OMEGA, np.zeros(3), 4)
    expected = reference(structure, 1.3, OMEGA, np.zeros(3), 4)
    assert abs(expected[:, 2]).min() > 0.1
    np.testing.assert_allclose(points, expected, rtol=0, atol=3e-11)


def test_two_storeys_and_a_damper_move_as_the_reference():
    """In units of their own, one row against its direction in the kernels, with two harmonics."""
    sliders = [
        hpcsweep.Slider((-1.0, 0.0), 3e4, 900.0),
        hpcsweep.Slider((-1.0, 1.0), 2e4, 120.0),
        hpcsweep.Slider((0.5, -2.0), 1e4, 400.0),
    ]
    structure = hpcsweep.Structure.from_matrices(
        [200.0, 150.0],
        [[5e3, -2e3], [-2e3, 2e3]],
        [],
        damping=[[120.0, -40.0], [-40.0, 60.0]],
        sliders=sliders,
        harmonics=((1, 1.0, 0.0), (2, 0.6, 1.0)),
    )
    points = hpcsweep.stroboscopic_points(structure, 4.0, 11.0, np.zeros(7), 3)
    expected = reference(structure, 4.0, 11.0, np.zeros(7), 3, parts=8)
    assert abs(expected[7::8, 4:]).max(axis=0).min() > 0.01
    np.testing.assert_allclose(points, expected[7::8], rtol=0, atol=1e-10)
    motion = hpcsweep.trajectory(structure, 4.0, 11.0, np.zeros(7), 3, samples=8)
    moved = motion.displacement, motion.velocity, motion.lasting_elongation
    np.testing.assert_allclose(np.vstack(moved).T[1:], expected, rtol=0, atol=1e-10)
    spring = np.array([one.stiffness for one in sliders])[:, None]
    stretched = structure.slider_directions @ motion.displacement.values
    force = spring * (stretched - motion.lasting_elongation.values)
    np.testing.assert_allclose(motion.slider_force, force, rtol=0, atol=1e-6)
    left = structure.mass_matrix @ motion.acceleration.values
    left += structure.damping_matrix @ motion.velocity.values
    left += structure.elastic_stiffness @ motion.displacement.values
    left += structure.slider_directions.T @ force
    t = motion.time.values
    ground = 4.0 * (np.sin(11.0 * t) + 0.6 * np.sin(22.0 * t + 1.0))
    np.testing.assert_allclose(left, np.outer(structure.forcing_vector, ground), atol=1e-6)


@pytest.mark.slow
def test_storeys_that_yield_beside_the_default_stops_move_as_the_reference():
    structure = hpcsweep.Structure(
        2, stiffness_ratio=30.0, gap=0.5, damping_ratio=0.05, yield_drift=0.4, hardening=0.1
    )
    assert structure.sharpness == 1e4
    points = hpcsweep.stroboscopic_points(structure, 0.5, OMEGA, np.zeros(6), 4)
    expected = reference(structure, 0.5, OMEGA, np.zeros(6), 4)
    assert abs(expected[:, 4:]).min(axis=0).max() > 0.05
    np.testing.assert_allclose(points, expected, rtol=0, atol=2e-10)
    solver = solver_of(structure)
    seen = solver.observe(np.zeros(6), 0.5, 4, modal_norm=True)
    assert seen.contact
    np.testing.assert_array_equal(seen.points, points)


def settled(structure, amplitude, state=None, periods=2000):
    """Return the orbit to which a motion closes, and what is seen over it."""
    solver = solver_of(structure.measured_at(OMEGA, amplitude))
    start = np.zeros(structure.state_units.size) if state is None else state
    end = solver.settle(start, amplitude, periods, 8, 1e-10, 1e-6)
    assert end.period > 0
    return end, solver.observe(end.state, amplitude, end.period, measures=4)


def test_plastic_shakedown_repeats_and_its_loop_takes_the_energy_of_the_reference():
    structure = oscillator(0.1)
    end, seen = settled(structure, 1.3)
    assert end.period == 1
    next_one = reference(structure, 1.3, OMEGA, end.state, 1)[0]
    np.testing.assert_allclose(next_one, end.state, rtol=0, atol=1e-9)
    assert abs(seen.slid["plastic"][0]) < 1e-9
    # forth and back once a period: the plastic path is twice the width of the loop, its largest
    # elongation that of a symmetric loop
    width = 2.0 * (seen.slid["ductility"][0] - 1.0)
    np.testing.assert_allclose(seen.slid["slider_energy"][0], 0.9 * 2.0 * width, rtol=1e-9)
    (drift,) = seen.measures.storey_drift
    assert drift == pytest.approx(seen.slid["ductility"][0], rel=1e-14)


def test_elastic_shakedown_is_the_linear_motion_about_what_has_stayed():
    """With p the oscillator stands at (1 - alpha) p, and swings as one that does not yield."""
    hardening = 0.3
    structure = oscillator(hardening)
    start = solver_of(structure).advance(np.zeros(3), 1.3, 7).state
    end, seen = settled(structure, 0.2, start)
    assert abs(end.state[2]) > 0.05
    assert seen.slid["slider_energy"][0] == seen.slid["plastic"][0] == 0.0
    assert seen.is_free
    swing = structure.linear_steady_state(OMEGA)[0] * 0.2
    stands = (1.0 - hardening) * end.state[2]
    expected = [stands + swing.imag, OMEGA * swing.real]
    np.testing.assert_allclose(end.state[:2], expected, rtol=0, atol=1e-9)
    assert seen.slid["ductility"][0] == pytest.approx(abs(stands) + abs(swing), rel=1e-9)


def test_an_asymmetric_forcing_ratchets_as_the_reference_does():
    """Without hardening: each period is the one before, farther on by the plastic drift."""
    structure = oscillator(0.0, 0.1, harmonics=((1, 1.0, 0.0), (2, 0.7, 0.9)))
    end, seen = settled(structure, 1.1)
    drift = seen.slid["plastic"][0]
    after = reference(structure, 1.1, OMEGA, end.state, 3)
    assert abs(drift) > 1e-2
    farther = end.state + drift * np.array([[1.0, 0.0, 1.0]]) * np.arange(1, 4)[:, None]
    np.testing.assert_allclose(after, farther, rtol=0, atol=1e-8)
    np.testing.assert_allclose(structure.without_drift(after), structure.without_drift(farther))


def test_a_wall_or_a_spring_stops_the_drift():
    """What a contact opposes is no drift: no motion is told to repeat on its way there."""
    free = oscillator(0.0)
    np.testing.assert_allclose(abs(free.free_drifts), [[1.0]])
    assert oscillator(0.01).free_drifts.size == 0
    walled = hpcsweep.Structure.from_matrices(
        [1.0], [[0.0]], [hpcsweep.Contact((1.0,), 5.0, 10.0)], sliders=free.sliders
    )
    assert walled.free_drifts.size == 0
    state = np.array([4.0, 1.0, 3.0])
    assert walled.without_drift(state) is state
    np.testing.assert_allclose(free.without_drift(state), [0.0, 1.0, -1.0], atol=1e-15)


def test_beyond_the_limit_of_its_drift_a_motion_has_collapsed():
    soft = oscillator(-0.05, collapse_drift=4.0)
    done = solver_of(soft).advance(np.zeros(3), 1.3, 50)
    assert done.outcome is Outcome.COLLAPSED
    assert done.n_periods < 50
    assert abs(done.state[0]) < 4.0


def test_pieces_of_a_motion_are_the_whole_of_it():
    structure = oscillator(0.02)
    solver = solver_of(structure)
    whole = solver.points(np.zeros(3), 1.3, 9)[0]
    first = solver.advance(np.zeros(3), 1.3, 4).state
    assert solver_of(structure).points(first, 1.3, 5)[0].tobytes() == whole[4:].tobytes()


def test_sliders_that_share_coordinates_stick_and_go_on():
    sliders = [
        hpcsweep.Slider((1.0, 0.0), stiffness=0.8, strength=0.3),
        hpcsweep.Slider((-1.0, 1.0), stiffness=0.8, strength=0.2),
    ]
    shared = hpcsweep.Structure.from_matrices(
        [1.0, 1.0], [[0.2, -0.1], [-0.1, 0.2]], [], damping=0.1 * np.eye(2), sliders=sliders
    )
    for amplitude in np.linspace(0.25, 0.35, 100):  # one in eight ended in STEP_LIMIT
        found = hpcsweep.stroboscopic_points(shared, amplitude, 1.0, [0.0] * 6, 1)
    right = reference(shared, amplitude, 1.0, [0.0] * 6, 1)
    assert np.abs(found - right).max() < 1e-10


@pytest.mark.parametrize("omega", [0.7, 0.9, 1.2])
def test_steady_amplitudes_are_caugheys_near_resonance(omega):
    """Caughey, Journal of Applied Mechanics 27 (1960) 640: x = a cos(theta), averaged.

    With cos(t) = 1 - 2 / a the force is C cos(theta) - S sin(theta) in the mean, C = a ((1 - alpha)
    (t - sin(2 t) / 2) / pi + alpha), S = a (1 - alpha) sin(t)^2 / pi, and the forcing balances (C -
    Omega^2 a, S + c Omega a). Where one harmonic prevails it is met within 1 %.
    """
    alpha, c = 0.1, 0.04
    structure = oscillator(alpha, c)
    for amplitude in (0.7, 1.0):
        solver = solver_of(structure.measured_at(omega, amplitude), omega)
        end = solver.settle(np.zeros(3), amplitude, 500, 8, 1e-10, 1e-6)
        assert end.period == 1
        a = solver.observe(end.state, amplitude, 1).slid["ductility"][0]
        assert a > 1.1
        t = math.acos(1.0 - 2.0 / a)
        along = a * ((1.0 - alpha) * (t - 0.5 * math.sin(2.0 * t)) / math.pi + alpha)
        across = a * (1.0 - alpha) * math.sin(t) ** 2 / math.pi
        needed = math.hypot(along - omega**2 * a, across + c * omega * a)
        assert needed == pytest.approx(amplitude, rel=0.01)


def test_modal_norms_of_sliders_that_slip_are_means_over_the_motion():
    """Sliders that slip have tables of their own: those of the free structure give other rows."""
    structure = hpcsweep.Structure(
        2, mass=1.0, gap=math.inf, sharpness=math.inf, yield_drift=0.3, hardening=0.05
    )
    solver, track = solver_of(structure.measured_at(0.3, 0.5), 0.3), []
    start = solver.advance(np.zeros(6), 0.5, 3).state
    reference(structure, 0.5, 0.3, start, 1, track)
    t, u = np.concatenate([t for t, _ in track]), np.hstack([u for _, u in track])
    q = np.abs(structure.modal_transform @ u)
    expected = np.trapezoid(q / np.linalg.norm(q, axis=0), t) / t[-1]
    found = solver.observe(start, 0.5, 1, modal_norm=True)
    assert found.slid["slider_energy"].min() > 0.0
    np.testing.assert_allclose(found.modal_norm, expected, rtol=0, atol=2e-3)


RIGID = [
    *((0.7, 0.3), (0.8, 0.3), (1.2, 0.3), (1.5, 0.2), (2.0, 0.1)),
    *((0.9, 0.4), (1.1, 0.7), (0.6, 0.1), (0.55, 0.1), (1.8, 0.3)),
]
STIFF = [(omega, ratio, 10.0 ** (5 + k % 4)) for k, (omega, ratio) in enumerate(RIGID)]


@pytest.mark.parametrize("points", [STIFF[4:6], pytest.param(STIFF, marks=pytest.mark.slow)])
def test_dry_friction_by_a_stiff_slider_has_the_orbits_of_its_closed_form(points):
    """Den Hartog's (1931), of rigid friction; the spring that stands for it vibrates by F/k^1/2."""
    for omega, ratio, stiffness in points:
        friction = hpcsweep.Slider((1.0,), stiffness, ratio)
        structure = hpcsweep.Structure.from_matrices(
            [1.0], [[1.0]], [], forcing=[1.0], sliders=[friction]
        )
        end = hpcsweep.stroboscopic_points(structure, 1.0, omega, [0.0] * 3, 120)[-1]
        found = hpcsweep.orbit(structure, 1.0, omega, end, period=1)
        assert found.residual < 1e-10
        solver = make_solver("flow", structure.measured_at(omega, 1.0), omega, 1e-9, yields=True)
        largest = solver.observe(found.points[0], 1.0, 1).peak_drift
        turn = math.sin(math.pi / omega) / (omega * (1.0 + math.cos(math.pi / omega)))
        exact = math.sqrt((1.0 - omega**2) ** -2 - (ratio * turn) ** 2)
        assert largest == pytest.approx(exact, abs=7.0 * ratio / math.sqrt(stiffness))
        assert abs(found.multipliers[0]) < 0.9
        np.testing.assert_array_less(abs(found.multipliers[2:]), 1e-6)


def test_a_jump_ends_where_the_motion_does():
    """Where nothing slips any more: with p of any size, from within the first periods on."""
    structure = oscillator(0.05, 0.1)
    solver = solver_of(structure)
    state = solver.advance(np.zeros(3), 0.9, 40).state
    rules = 400, 4, 1e-10, 1e-6
    for amplitude in (0.05, 0.15, 0.5):
        whole = solver.settle(state, amplitude, *rules)
        short = solver.settle(state, amplitude, *rules, 1e-3)
        assert whole.period == short.period == 1
        assert short.n_periods < whole.n_periods // 2 or amplitude == 0.5
        np.testing.assert_allclose(short.state, whole.state, rtol=0, atol=1e-9)
