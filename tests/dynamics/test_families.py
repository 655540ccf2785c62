"""Attractors of structures that yield: families of orbits, and single ones."""

import numpy as np
import pytest

import hpcsweep
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import portrait
from hpcsweep.dynamics.classify import MotionClass, Shakedown
from hpcsweep.dynamics.families import are_joined
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings
from tests.solvers.test_yielding_map import reference

OMEGA = 0.7


def oscillator(hardening=0.05, contacts=(), damping=0.2, **given):
    """Return a mass 1 on a spring of initial stiffness 1 that yields at 1."""
    slider = hpcsweep.Slider((1.0,), 1.0 - hardening, 1.0 - hardening)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[hardening]], contacts, damping=[[damping]], sliders=[slider], **given
    )


def beside_a_stop():
    return oscillator(0.2, [hpcsweep.Contact((1.0,), 0.267, 100.0)])


def found(structure, amplitude, omega=OMEGA, starts=8, box=((-3.0, 3.0), (-3.0, 3.0)), **given):
    """Return what is told of each attractor, by its share."""
    listed = hpcsweep.attractors(structure, amplitude, omega, starts=starts, box=box, **given)
    assert sum(one.hits for one in listed) == starts
    return [
        (one.orbit_period, one.families, one.sliders["shakedown"], one.contact) for one in listed
    ]


ELASTIC = [(1, 1, Shakedown.ELASTIC, 0)]
PLASTIC = [(1, 0, Shakedown.PLASTIC, 0)]


@pytest.mark.parametrize("hardening", [0.0, 0.05])
def test_motions_that_shake_down_elastically_are_one_family(hardening):
    assert found(oscillator(hardening), 0.1) == ELASTIC


@pytest.mark.slow
def test_of_a_thousand_starts_all_go_to_the_family():
    assert found(oscillator(), 0.1, starts=1000) == ELASTIC


@pytest.mark.parametrize("amplitude", [0.9, 1.3])
def test_plastic_shakedown_is_a_single_orbit(amplitude):
    """As Caughey's bilinear oscillator has one steady state, and Kalmar-Nagy's no chaos."""
    assert found(oscillator(), amplitude) == PLASTIC
    # without hardening it may stand anywhere
    assert found(oscillator(0.0), amplitude, starts=4) == [(1, 1, Shakedown.PLASTIC, 0)]


def test_a_motion_that_ratchets_is_periodic_less_its_drift():
    structure = oscillator(0.0, harmonics=((1, 1.0, 0.0), (2, 0.6, 1.0)))
    listed = hpcsweep.attractors(structure, 1.3, OMEGA, starts=4)
    assert [(one.kind, one.orbit_period, one.hits) for one in listed] == [
        (MotionClass.PERIODIC, 1, 4)
    ]
    assert listed[0].sliders["shakedown"] == Shakedown.RATCHETING
    state = listed[0].points[0]
    gain = (reference(structure, 1.3, OMEGA, state, 1)[0] - state)[[0, 2]]
    np.testing.assert_allclose(gain, listed[0].sliders["plastic"].repeat(2), atol=1e-9)
    assert abs(gain[0]) > 1e-3


@pytest.mark.slow
def test_members_that_touch_a_stop_and_plastic_motions_are_attractors_beside_the_family():
    box = (-2.0, 0.267), (-2.0, 2.0)
    kinds = found(beside_a_stop(), 0.36, 1.218, 40, box)
    assert sorted(kinds) == [
        (1, 0, Shakedown.PLASTIC, 1),
        (1, 1, Shakedown.ELASTIC, 0),
        (1, 1, Shakedown.ELASTIC, 1),
    ]


@pytest.mark.slow
def test_members_are_joined_and_others_are_not():
    structure = oscillator(0.05, [hpcsweep.Contact((1.0,), 0.15, 5.0)])
    solver = make_solver("flow", structure, OMEGA, 1e-9, yields=True)

    def orbit(plastic):
        end = solver.points([0.95 * plastic, 0.0, plastic], 0.1, 100)[0][-1]
        assert end[2] == plastic
        return hpcsweep.orbit(structure, 0.1, OMEGA, end, 1).points

    # off the stop each is a shift of the other, K^-1 B^T k p
    one, other = orbit(-4.0), orbit(-0.5)
    np.testing.assert_allclose(other - one, 3.5 * np.array([[0.95, 0.0, 1.0]]), atol=1e-5)
    assert are_joined(solver, 0.1, one, other, 1)
    # members that touch it differ in more, and beyond p = 0.15 a motion jumps to others
    other = orbit(0.1)
    shift = (other - one)[0] / (other - one)[0, 2]
    assert abs(shift[0] - 0.95) > 0.01
    assert are_joined(solver, 0.1, one, other, 1)
    assert not are_joined(solver, 0.1, one, orbit(0.3), 1)


@pytest.mark.slow
def test_chaos_of_a_mass_that_yields_and_pounds_is_told():
    structure = oscillator(0.05, [hpcsweep.Contact((1.0,), 1.3, 100.0)])
    listed = hpcsweep.attractors(structure, 1.386, 0.568, starts=4, max_cycles=500)
    assert [one.kind for one in listed] == [MotionClass.CHAOTIC]
    # p = d - F / k where it slips, so that one number tells the state: x -> f(x)
    x = np.sort(listed[0].points[:, 2])
    assert len(np.unique(x.round(6))) > 1000
    assert listed[0].lyapunov_low > 0.0


@pytest.mark.slow
def test_starts_go_where_the_reference_takes_them():
    structure, amplitude, omega = beside_a_stop(), 0.36, 1.218
    starts = structure.slipped(np.random.default_rng(1).uniform((-2, -2), (0.267, 2), (4, 2)))
    solver = make_solver("flow", structure.measured_at(omega, amplitude), omega, 1e-9, yields=True)
    search = AttractorSearch(solver, amplitude, SweepSettings(), 5000, 0.95, None)
    told = portrait(search, np.empty((0, 3)), starts)
    for start, label in zip(starts, told.labels.tolist(), strict=True):
        track = []
        points = reference(structure, amplitude, omega, start, 25, track)
        last = np.concatenate([u[0] for t, u in track if t[-1] > 24 * 2 * np.pi / omega])
        one = told.attractors[label]
        touches = bool(last.max() > 0.267)
        slips = abs(points[-1, 2] - points[-2, 2]) > 1e-6 or np.ptp(last) > 2.0
        assert (touches, slips) == (bool(one.contact), one.families == 0)
