"""Published numbers of other programs: NLvib's third example, and the bilinear resonance."""

import math

import numpy as np
import pytest
import two_masses

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap


def settled(omega: float, start) -> two_masses.Orbit:
    """Return the orbit of period 1 that the motion from a state tends to, by Newton's method."""
    solver = FlowMap(two_masses.STRUCTURE, omega)
    state = solver.points(np.array(start), two_masses.AMPLITUDE, 300)[0][-1]
    along = np.eye(5)[-1]
    return two_masses.corrected(np.append(state, omega), along)


def test_the_motion_of_period_1_is_stable_where_it_is_said_to_be():
    orbit = settled(0.635, np.zeros(4))
    assert orbit.is_stable
    assert np.abs(orbit.multipliers).max() == pytest.approx(0.8857, abs=1e-3)


def test_its_multipliers_leave_the_unit_circle_as_a_pair_below_0_619():
    orbit = settled(0.625, np.zeros(4))
    before = None
    for omega in np.arange(0.624, 0.612, -0.001):
        point = np.append(orbit.state, omega)
        orbit, before = two_masses.corrected(point, np.eye(5)[-1]), orbit
        if not orbit.is_stable:
            break
    low, high = sorted((orbit.omega, before.omega))
    assert low - 0.005 < 0.619 < high + 0.005
    assert orbit.is_torus() or np.abs(orbit.multipliers.imag).max() > 0.9


@pytest.mark.slow
def test_the_whole_curve_is_the_one_of_the_table():
    orbits = two_masses.curve()
    found = two_masses.bifurcations(orbits)
    exact = [("torus", 0.618607), ("period doubling", 0.738783), ("period doubling", 0.755586)]
    for kind, omega in exact:
        assert min(abs(at - omega) for name, at, _ in found if name == kind) < 1e-5
    # the linear motion grazes, and the first and last contact is a torus, and a fold
    for kind, omega in (("torus", 0.581899639), ("fold", 0.653440140)):
        assert min(abs(at - omega) for name, at, _ in found if name == kind) < 1e-4
    size, omega = two_masses.greatest_rms(orbits)
    assert size == pytest.approx(1.01195, abs=1e-4)
    assert omega == pytest.approx(0.7537, abs=5e-4)


def test_a_bilinear_mass_resonates_between_its_two_frequencies():
    """At 2 w1 w2/(w1 + w2), where half a swing of each kind takes one forcing period."""
    structure = Structure(1, 3.0, math.inf, 0.01, gap=0.0)
    omegas = 4 / 3 + np.linspace(-0.02, 0.02, 21)
    sizes = []
    for omega in omegas:
        solver = FlowMap(structure, omega)
        state = solver.points(np.zeros(2), 1.0, 600)[0][-1]
        sizes.append(solver.observe(state, 1.0, 1).peak_drift)
    best = int(np.argmax(sizes))
    assert omegas[best] == pytest.approx(4 / 3, abs=0.0021)
    assert 0 < best < len(omegas) - 1
