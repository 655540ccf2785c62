"""Masses without a spring: motions between contacts, modes of frequency 0, what drifts away."""

import math

import numpy as np
import pytest
from reference import reference_points
from scipy.optimize import brentq
from together import together

import hpcsweep
from hpcsweep.model.confinement import unconfined
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure

KAPPA, GAPS = 100.0, (1.0, 0.8)


def free_mass(stiffness=0.0, **more):
    """One mass between two stops."""
    stops = [Contact((1.0,), GAPS[0], KAPPA), Contact((-1.0,), GAPS[1], KAPPA)]
    return Structure.from_matrices([1.0], [[stiffness]], stops, **more)


def closed_form(amplitude, omega, u, v, n_periods):
    """Points of the free mass: parabolas and a sine in flight, sines at a stop; roots by brentq."""
    time, end, points = 0.0, 2.0 * math.pi / omega, []
    side = 0

    def at(s, time, u, v, side):
        after, before = omega * (time + s), omega * time
        if not side:
            rate = amplitude / omega
            flown = (v - rate * math.cos(before)) * s
            sines = rate / omega * (math.sin(after) - math.sin(before))
            return u + flown + sines, v + rate * (math.cos(after) - math.cos(before))
        w, stop = math.sqrt(KAPPA), GAPS[0] if side > 0 else -GAPS[1]
        most = -amplitude / (w * w - omega * omega)
        x, p = u - stop - most * math.sin(before), v - most * omega * math.cos(before)
        c, sn = math.cos(w * s), math.sin(w * s)
        steady = most * math.sin(after), most * omega * math.cos(after)
        return stop + x * c + p / w * sn + steady[0], p * c - x * w * sn + steady[1]

    def past(s, *state):
        """Return how far the motion is past the border of its side, above 0 where it has left."""
        moved = at(s, *state)[0]
        if state[-1]:
            return -state[-1] * moved + GAPS[0 if state[-1] > 0 else 1]
        return max(moved - GAPS[0], -moved - GAPS[1])

    for k in range(n_periods):
        while time < (k + 1) * end:
            left, state = (k + 1) * end - time, (time, u, v, side)
            steps = np.linspace(0.0, left, math.ceil(left / 0.004) + 1)[1:]
            far = np.array([past(s, *state) for s in steps])
            out = np.flatnonzero(far > 0.0)
            if not out.size:
                u, v = at(left, *state)
                time = (k + 1) * end
                continue
            before = steps[out[0] - 1] if out[0] else 1e-9
            s = brentq(past, before, steps[out[0]], state, xtol=1e-16, rtol=1e-15)
            u, v = at(s, *state)
            time, side = time + s, 0 if side else (1 if u > 0.0 else -1)
        points.append((u, v))
    return np.array(points)


def test_a_free_mass_between_stops_is_that_of_the_closed_form():
    """Over its conditioning, the growth of a difference of 1e-8 at the start."""
    start, many = (0.1, -0.2), 5
    exact = closed_form(0.5, 1.0, *start, many)
    found = hpcsweep.stroboscopic_points(free_mass(), 0.5, 1.0, start, n_periods=many)
    nudged = [closed_form(0.5, 1.0, start[0] + d, start[1] + e, many) for d, e in np.eye(2) * 1e-8]
    growth = np.maximum.accumulate(np.abs(np.array(nudged) - exact).max(axis=(0, 2)) / 1e-8)
    assert np.all(np.abs(found - exact).max(axis=1) <= 1e-11 * growth)
    assert np.abs(exact[:, 0]).max() > GAPS[1]


def test_a_soft_spring_tends_to_none():
    """The orbit is off by the same times the spring: 1e-4 and 1e-6 differ by their ratio."""
    none = free_mass(damping=[[0.1]])
    point = hpcsweep.stroboscopic_points(none, 2.0, 1.0, (0.0, 0.0), n_periods=400)[-1]
    exact = hpcsweep.orbit(none, 2.0, 1.0, point, period=1).points
    off = []
    for spring in (1e-4, 1e-6):
        soft = free_mass(spring, damping=[[0.1]])
        off.append(np.abs(hpcsweep.orbit(soft, 2.0, 1.0, point, period=1).points - exact).max())
    assert off[0] < 1e-2
    assert off[0] / off[1] == pytest.approx(100.0, rel=0.02)


def random_structure(seed):
    """Full matrices, K of a rank below n, contacts that face each other, some with dashpots."""
    rng = np.random.default_rng(seed)
    n = 1 + seed % 4
    rigid = 1 + int(rng.integers(n))
    root, springs = rng.normal(size=(n, n)), rng.normal(size=(n, n - rigid))
    contacts = []
    for direction in rng.normal(size=(int(rng.integers(2, 5)), n)):
        gap, other = rng.choice([0.0, -0.05, 0.1, 0.2], 2)
        contacts.append(Contact(direction, gap, 10 ** rng.uniform(1, 3), 0.2 * rng.integers(2)))
        contacts.append(Contact(-direction, abs(other), 10 ** rng.uniform(1, 3)))
    drag = rng.normal(size=(n, n))
    made = Structure.from_matrices(
        root @ root.T / n + np.eye(n),
        springs @ springs.T,
        contacts,
        damping=0.02 * drag @ drag.T * rng.integers(2),
        harmonics=((1, 1.0, 0.0), (2, 0.5, 1.0)),
    )
    assert made.n_rigid == rigid
    return made, 0.05 * rng.normal(size=2 * n)


def agrees(structure, amplitude, omega, state, most=1e-11):
    """Compare a period with the Taylor reference, over its growth of differences of 1e-9."""
    units, exact = structure.state_units, reference_points(structure, amplitude, omega, state, 1)
    found = hpcsweep.stroboscopic_points(structure, amplitude, omega, state, n_periods=1)
    growth = 1.0
    for nudge in np.diag(1e-9 * units):
        other = reference_points(structure, amplitude, omega, state + nudge, 1)
        growth = max(growth, float(np.abs((other - exact) / units).max()) / 1e-9)
    return float(np.abs((found - exact) / units).max()) <= most * growth


def test_random_structures_with_rigid_modes_are_those_of_the_reference():
    for seed in (1, 6):
        made, state = random_structure(seed)
        assert agrees(made, 0.3, 0.7, state), seed


@pytest.mark.slow
def test_forty_random_structures_with_rigid_modes():
    for seed in range(40):
        made, state = random_structure(seed)
        assert agrees(made, 0.3, 0.7, state), seed


@pytest.mark.parametrize("sharpness", [math.inf, 2e3])
def test_a_chain_of_many_with_two_free_parts(sharpness):
    """The springs below two floors of 24 are missing: steps are those in modes."""
    n, at = 24, (12, 13)
    springs = np.where(np.isin(np.arange(n), at), 0.0, 100.0)
    steps = np.eye(n) - np.eye(n, k=-1)
    contacts = [
        Contact(sign * steps[i], gap, 500.0) for i in at for sign, gap in ((1, 0.02), (-1, 0.03))
    ]
    stiffness = steps.T @ np.diag(springs) @ steps
    damping = 0.01 * stiffness + 0.02 * np.eye(n)
    made = Structure.from_matrices(
        np.ones(n), stiffness, contacts, damping=damping, sharpness=sharpness
    )
    assert made.n_rigid == 2
    assert made.rigid_rates == pytest.approx([0.02, 0.02], rel=1e-12)
    exact = reference_points(made, 0.5, 2.0, np.zeros(2 * n), 3)
    found = hpcsweep.stroboscopic_points(made, 0.5, 2.0, np.zeros(2 * n), n_periods=3)
    assert np.abs((found - exact) / made.state_units).max() < 1e-10


PAIR = {"mass": (2.0, 1.0), "stiffness": [[4.0, 0.0], [0.0, 0.0]]}
FLANKS = [Contact((1.0, -1.0), 0.05, 400.0), Contact((-1.0, 1.0), 0.05, 400.0)]


def test_rigid_modes_have_the_frequency_0_and_no_ratio():
    made = Structure.from_matrices(**PAIR, contacts=FLANKS, damping_ratio=(0.05,))
    assert made.frequencies[0] == 0.0
    assert made.frequencies[1] == pytest.approx(math.sqrt(2.0), rel=1e-15)
    assert made.damping_ratios.tolist() == [0.0, 0.05]
    assert made.longest_period == pytest.approx(math.pi * math.sqrt(2.0), rel=1e-15)
    drag = Structure.from_matrices(**PAIR, contacts=FLANKS, rayleigh=(0.3, 0.1))
    assert drag.rigid_rates.tolist() == [0.3]
    assert drag.damping_ratios == pytest.approx([0.0, (0.3 + 0.2) / 2.0 / math.sqrt(2.0)])
    # u'' + 0.3 u' = -sin(w tau) of the free wheel
    w = 1.7
    steady = drag.linear_steady_state(w)
    assert steady[1] == pytest.approx(-1.0 / (-w * w + 0.3j * w), rel=1e-12)
    assert math.isnan(made.grazing_amplitude(1.0))
    assert np.all(np.isfinite(made.lengths(1.0, [0.0, 0.1])))
    assert made.within_reach(1.0, np.zeros((1, 4))) is made


def test_units_of_what_has_no_spring_are_scaled_with_it():
    one = free_mass()
    for factor in (2.0**20, 2.0**-20):
        stops = [Contact(c.direction, c.gap, factor * c.stiffness) for c in one.contacts]
        other = Structure.from_matrices([1.0], [[0.0]], stops)
        assert other.frequency_unit == one.frequency_unit * math.sqrt(factor)


def test_what_is_pressed_rests_at_the_stop_and_the_rest_stays():
    press = [Contact((1.0, 0.0, 0.0), -0.1, 50.0), Contact((0.0, 1.0, 0.0), -0.2, 50.0)]
    made = Structure.from_matrices(np.ones(3), np.diag([1.0, 0.0, 0.0]), press)
    # 1 u = 50 (-0.1 - u)
    assert made.rest[:3] == pytest.approx([-5.0 / 51.0, -0.2, 0.0], rel=1e-12)


FREE = np.zeros((2, 2))
HELD = [
    (PAIR["stiffness"], FLANKS, 0.0, 1.0, ""),
    (PAIR["stiffness"], FLANKS[:1], 0.0, 1.0, "lets coordinate 2 drift away: neither"),
    (FREE, FLANKS, 0.0, 1.0, "lets coordinates 1, 2 drift away"),
    (FREE, [*FLANKS, Contact((1.0, 0.0), 1.0, 1.0)], 0.0, 1.0, "lets coordinates 1, 2 drift"),
    (FREE, [*FLANKS, Contact((1.0, 0.0), 1, 1), Contact((-1.0, 0.0), 1, 1)], 0.0, 1.0, ""),
    # a mean force towards the only stop, and away from it
    (PAIR["stiffness"], FLANKS[:1], 0.5, 1.0, ""),
    (PAIR["stiffness"], FLANKS[:1], -0.5, 1.0, "lets coordinate 2 drift away"),
    (PAIR["stiffness"], FLANKS[:1], -0.5, -1.0, ""),
]


@together("stiffness, contacts, mean, amplitude, told", HELD)
def test_what_nothing_holds_is_told(stiffness, contacts, mean, amplitude, told):
    """By the base: b = -M 1, which drives the second mass back against the flank on its left."""
    harmonics = ((1, 1.0, 0.0), *([(0, mean, math.pi / 2)] if mean else []))
    made = Structure.from_matrices([2.0, 1.0], stiffness, contacts, harmonics=harmonics)
    found = unconfined(made, amplitude)
    assert found.startswith(told)
    assert bool(found) == bool(told)


def test_confinement_in_the_plane_is_that_of_the_angles():
    """Two free coordinates are held where no two neighbouring directions are half a turn apart."""
    rng = np.random.default_rng(1)
    for _ in range(12):
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(2, 6))))
        contacts = [Contact((math.cos(a), math.sin(a)), 1.0, 1.0) for a in angles]
        made = Structure.from_matrices([1.0, 1.0], FREE, contacts)
        widest = np.diff(np.append(angles, angles[0] + 2.0 * math.pi)).max()
        assert bool(unconfined(made)) == bool(widest >= math.pi)


def test_studies_of_what_drifts_are_refused_and_records_follow_it():
    loose = Structure.from_matrices(**PAIR, contacts=FLANKS[:1])
    for study in (
        lambda: hpcsweep.attractors(loose, 0.1, 1.0, starts=2),
        lambda: hpcsweep.orbit(loose, 0.1, 1.0, np.zeros(4), period=1),
        lambda: hpcsweep.lyapunov_spectrum(loose, 0.1, 1.0, np.zeros(4)),
    ):
        with pytest.raises(ValueError, match="structure lets coordinate 2 drift away"):
            study()
    # absolutely the free wheel stays where it is: its displacement is minus that of the base
    ground = hpcsweep.Record(np.concatenate(([0.0], np.ones(100), -np.ones(100), [0.0])), 0.01)
    alone = Structure.from_matrices(**PAIR, contacts=[], forcing=None)
    seen = hpcsweep.history(alone, ground, step=0.01)
    speed = np.append(0.0, np.cumsum(0.5 * (ground.acceleration[1:] + ground.acceleration[:-1])))
    assert np.abs(seen.velocity[: speed.size, 1] + 0.01 * speed).max() < 1e-12


def test_motions_that_float_between_contacts_are_one_attractor():
    floating = free_mass(damping=[[0.1]])
    (found,) = hpcsweep.attractors(floating, 0.05, 1.0, starts=2, seed=1)
    assert (found.contact, found.families, found.orbit_period) == (0, 1, 1)
    assert found.multiplier == pytest.approx(math.exp(-0.1 * 2.0 * math.pi), rel=1e-9)
    with pytest.raises(ValueError, match="on one of many orbits"):
        hpcsweep.branch(floating, 0.05, 1.0, found.points[0], period=1, span=(0.01, 0.1))
