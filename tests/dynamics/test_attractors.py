"""All attractors at a point: shares, intervals, neighbourhoods, and cases whose answer is known."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binom
from together import together
from tools import DESCRIBED

import hpcsweep
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import portrait
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.known import Signature, distance, matched, same_orbit
from hpcsweep.dynamics.neighbourhood import inside, lyapunov_forms, neighbourhood
from hpcsweep.dynamics.shares import share_interval, starts_needed
from hpcsweep.dynamics.starts import box_of, starting_states, usual_reach
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.linear import LinearOrbit
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

PAPER, AS_DESCRIBED = Structure(), Structure(damping_ratio=DESCRIBED)
MACHINE = Structure(1, 50.0, math.inf, gap=0.5, gap_left=0.5)
"""Of jobs/structures/clearance.toml: its own mirror image."""


def test_so_many_starts_find_a_share():
    assert starts_needed(0.01, 0.01) == 459
    for share, risk in ((0.01, 0.01), (0.3, 1e-6), (1e-4, 0.5)):
        count = starts_needed(share, risk)
        assert (1 - share) ** count <= risk < (1 - share) ** (count - 1)


@pytest.mark.parametrize("starts", [7, 60, 459])
def test_the_interval_holds_the_share_at_least_as_often_as_it_promises(starts):
    ends = np.array([share_interval(hits, starts, 0.95) for hits in range(starts + 1)])
    for share in (0.001, 0.01, 0.2, 0.5, 0.77, 0.999):
        held = (ends[:, 0] <= share) & (share <= ends[:, 1])
        assert binom.pmf(np.flatnonzero(held), starts, share).sum() >= 0.95
    low, high = ends[starts // 3]
    assert binom.sf(starts // 3 - 1, starts, low) == pytest.approx(0.025)
    assert binom.cdf(starts // 3, starts, high) == pytest.approx(0.025)
    assert ends[0, 0] == 0
    assert ends[-1, 1] == 1


def test_starts_fill_their_box_and_belong_to_their_point():
    box = box_of([[-1, 3], [0, 1], [2, 2.5], [-9, -8]], np.ones(4))
    states = starting_states(box, 300, 5, 0.445, 0.1)
    assert states.shape == (300, 4)
    assert np.all((box[:, 0] <= states) & (states <= box[:, 1]))
    share = ((states - box[:, 0]) / (box[:, 1] - box[:, 0])).mean(axis=0)
    # independent ones would scatter by 1 / sqrt(12 N) = 0.017
    assert np.abs(share - 0.5).max() < 0.01
    assert np.array_equal(starting_states(box, 40, 5, 0.445, 0.1), states[:40])
    for other in ((5, 0.445, 0.2), (5, 0.446, 0.1), (6, 0.445, 0.1)):
        assert not np.isclose(starting_states(box, 300, *other), states).any(axis=1).all()
    with pytest.raises(ValueError, match=r"box must have shape \(4, 2\), has shape \(1, 2\)"):
        box_of([[0, 1]], np.ones(4))
    with pytest.raises(ValueError, match="box must be finite, each low below its high"):
        box_of([[0, 1], [1, 0], [0, 1], [0, 1]], np.ones(4))


def test_a_linear_structure_has_one_attractor_with_share_1():
    structure = Structure(2, damping_ratio=(0.1, 0.04)).without_contacts()
    (found,) = hpcsweep.attractors(structure, 0.3, 0.7, starts=64)
    orbit = LinearOrbit(structure, 0.7)
    assert found.kind is MotionClass.PERIODIC
    assert found.orbit_period == 1
    assert found.contact == 0
    assert found.share == found.share_high == 1
    assert found.share_low == pytest.approx(0.025 ** (1 / 64))
    assert found.points[0] == pytest.approx(orbit.state(0.3), abs=1e-9)
    assert found.lyapunov == pytest.approx(orbit.lyapunov_exponent, rel=1e-6)
    assert found.multiplier == pytest.approx(math.exp(found.lyapunov * 2 * math.pi / 0.7))
    assert found.drift == pytest.approx(structure.steady_drift(0.7) * 0.7**2, rel=1e-6)


def test_a_mirror_symmetric_structure_has_mirrored_pairs():
    """The image of a motion is -z half a period later.

    A box of starts at tau = 0 is no image of itself, but of the box half a period later, that is of
    the box -z under the forcing of opposite sign: it is there that the image has the same share.
    """
    found = hpcsweep.attractors(MACHINE, 0.7, 1.0, starts=459)
    assert [one.orbit_period for one in found] == [1, 1]
    first, second = found
    assert second.points[0] == pytest.approx(-_half_a_period(first.points[0]), abs=1e-6)
    assert first.multiplier == pytest.approx(second.multiplier, rel=1e-4)
    assert first.drift == pytest.approx(second.drift, rel=1e-6)
    assert first.hits + second.hits == 459
    later = dataclasses.replace(MACHINE, harmonics=[(1, 1.0, math.pi)])
    images = hpcsweep.attractors(later, 0.7, 1.0, starts=459, seed=1)
    for one, image in zip(found, images, strict=True):
        assert image.points[0] == pytest.approx(-one.points[0], abs=1e-6)
        assert one.share_low < image.share < one.share_high


def _half_a_period(state):
    """Carry a state of the machine half a forcing period on, at A = 0.7 and Omega = 1."""

    def motion(tau, z):
        u, v = z
        stops = max(u - 0.5, 0.0) - max(-u - 0.5, 0.0)
        return v, -0.1 * v - u - 50 * stops - 0.7 * math.sin(tau)

    return solve_ivp(motion, (0, math.pi), state, rtol=1e-10, atol=1e-12).y[:, -1]


@pytest.mark.slow
def test_the_coexisting_motions_of_figure_3_are_found():
    """As printed P1 beside P2 at 0.12, three at 0.2188; as described P2 C13 beside P4 C23."""
    found = hpcsweep.attractors(PAPER, 0.12, 0.445, starts=50)
    assert {(one.orbit_period, one.contact) for one in found} == {(1, 6), (2, 6)}
    found = hpcsweep.attractors(PAPER, 0.2188, 0.445, starts=50)
    assert {(one.orbit_period, one.contact) for one in found} == {(1, 6), (1, 7), (2, 7)}
    found = hpcsweep.attractors(AS_DESCRIBED, 0.128, 0.445, starts=50)
    orbits = {(one.orbit_period, one.contact) for one in found if one.orbit_period}
    assert orbits == {(2, 5), (4, 6)}
    assert sum(one.share for one in found) == pytest.approx(1)
    (chaos,) = (one for one in found if one.kind is MotionClass.CHAOTIC)
    assert chaos.lyapunov_low > 0
    assert math.isnan(chaos.multiplier)


def test_what_neighbourhoods_and_windows_tell_is_what_each_start_decides():
    solver = make_solver("flow", AS_DESCRIBED, 0.445, 1e-9)
    settings, units = SweepSettings(), AS_DESCRIBED.state_units
    for amplitude in (0.115, 0.15):
        starts = starting_states(box_of(None, units), 60, 3, 0.445, amplitude)
        searched = AttractorSearch(solver, amplitude, settings, 2000, 0.95, None)
        found = portrait(searched, starts[:0], starts)
        search = AttractorSearch(solver, amplitude, settings, 2000, 0.95, None)
        alone = np.array([search.classify(start) for start in starts])
        assert found.cycles < search.cycles
        for label, own in zip(found.labels, alone, strict=True):
            one, other = found.attractors[label], search.attractors[own]
            assert (one.orbit_period, one.contact) == (other.orbit_period, other.contact)
            assert one.drift == pytest.approx(other.drift, rel=1e-6)


def test_a_neighbourhood_goes_to_its_orbit():
    amplitude = 0.0987
    solver = make_solver("flow", PAPER, 0.445, 1e-9)
    (orbit,) = hpcsweep.attractors(PAPER, amplitude, 0.445, starts=4)
    rng = np.random.default_rng(2)
    near = neighbourhood(solver, amplitude, orbit.points, rng)
    tangents = [solver.monodromy(z, amplitude, 1)[1] for z in orbit.points]
    forms = lyapunov_forms(tangents, np.eye(6))
    for k, tangent in enumerate(tangents):
        after = forms[(k + 1) % len(forms)]
        assert forms[k] == pytest.approx(tangent.T @ after @ tangent + np.eye(6), rel=1e-6)
    for k, point in enumerate(orbit.points):
        steps = rng.standard_normal((20, 6))
        steps /= np.sqrt(np.einsum("ki,ij,kj->k", steps, near.forms[k], steps))[:, None]
        states = point + 0.999 * steps
        assert np.all(inside(states, [None, near]) == 1)
        assert np.all(inside(point + 1.001 * steps, [near]) <= 0)
        for state in states:
            end = solver.advance(state, amplitude, 400).state
            assert np.abs(end - orbit.points).max(axis=1).min() < 1e-9


def test_an_orbit_is_known_by_any_of_its_points():
    points = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])
    assert same_orbit(points, np.roll(points, 2, axis=0) + 1e-8, 1e-6)
    assert not same_orbit(points, points[::-1], 1e-6)
    assert not same_orbit(points, points[:2], 1e-6)


def test_motions_that_are_no_orbit_are_known_by_where_and_how_often():
    turns = 2 * np.pi * 0.6180339887 * np.arange(2500)
    circle = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    known = Signature(circle[:2000])
    assert known.holds(circle[2200:2264])
    assert not known.holds(1.2 * circle[2200:2264])
    assert not known.holds(circle[2200:2264] * [1, 0.5])
    # on the same curve, but on one part of it only
    assert not known.holds(circle[circle[:, 0] > 0.8][:64])


def test_identities_go_to_the_nearest_first():
    orbit = np.array([[0.0, 0.0]])
    doubled = np.array([[0.1, 0.0], [-0.1, 0.0]])
    far = np.array([[3.0, 0.0]])
    assert distance(orbit, doubled) == pytest.approx(0.1)
    assert matched([orbit, far], [far + 0.01, doubled], 0.2) == [(1, 0), (0, 1)]
    assert matched([orbit, far], [far + 0.3], 0.2) == []
    assert matched([orbit, doubled], [orbit + 0.05], 0.2) == [(0, 0)]


def test_arguments_are_refused_in_one_line():
    for arguments, words in (
        ({"starts": 0}, "starts must be a whole number from 1"),
        ({"box": [[0, 1]]}, "box must have shape"),
        ({"confidence": 1.0}, "confidence must be between 0 and 1"),
        ({"max_cycles": 0}, "max_cycles"),
        ({"solver": "euler"}, "solver must be one of flow, bdf"),
    ):
        with pytest.raises(ValueError, match=words):
            hpcsweep.attractors(PAPER, 0.1, 0.445, **arguments)


@pytest.mark.slow
def test_a_torus_that_is_nearly_locked_is_one_attractor():
    """Its motions meet in clusters of points, each somewhere else along it."""
    found = hpcsweep.attractors(AS_DESCRIBED, 0.1586087589903809, 0.5193235789385496, starts=150)
    kinds = [(one.kind, one.orbit_period) for one in found]
    assert kinds == [(MotionClass.PERIODIC, 6), (MotionClass.QUASI_PERIODIC, 0)]
    assert sum(one.hits for one in found) == 150


FOLD = 0.22123998868537
"""Of a P2 of Figure 3, at Omega = 0.445."""
GRAZING = Structure(1, 29.0, math.inf, damping_ratio=0.01, gap=1.26)
"""A published soft impact oscillator; just below grazing a chaotic saddle lies beside P1 and P5."""


@pytest.mark.parametrize("seed", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_transient_chaos_has_no_share(seed):
    """300 of 300 starts on the saddle end on P1, by an explicit integrator, too."""
    found = hpcsweep.attractors(GRAZING, 0.44912, 0.801, seed=seed)
    assert sorted(one.orbit_period for one in found) == [1, 5]
    assert sum(one.hits for one in found) == 459
    # 1,000 starts followed for 200,000 periods: P1 has 0.487 +- 0.03 of the box
    assert all(one.share_low < 0.5 < one.share_high for one in found)
    assert found.n_transient > 10
    assert 500 < found.lifetime.low < found.lifetime.mean < found.lifetime.high < 10000


@pytest.mark.slow
def test_a_torus_that_ends_in_an_orbit_is_that_orbit():
    """Slow approaches to a P102 of multiplier 0.925 have been two tori."""
    structure = Structure(damping_ratio=(0.1262, 0.0161, 0.0077))
    found = hpcsweep.attractors(structure, 0.15828173505911847, 0.514371538944225, starts=60)
    assert [one.orbit_period for one in found] == [102, 19]
    assert found[0].multiplier == pytest.approx(0.925075, abs=1e-6)
    assert all_apart(structure, found) > 1e-3


def all_apart(structure, found):
    """Return the least distance of two of the attractors, in units of the state."""
    points = [one.points / structure.state_units for one in found]
    return min(distance(a, b) for k, a in enumerate(points) for b in points[k + 1 :])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("structure", "omega", "amplitude", "periods"),
    [
        (GRAZING, 0.801, 0.4491, [1, 5]),
        (GRAZING, 0.801, 0.4495, [1, 5]),
        (GRAZING, 0.801, 0.4545, [2, 5, 6]),
        (PAPER, 0.445, FOLD - 1e-9, [1, 1, 2]),
    ],
)
def test_no_orbit_is_listed_twice(structure, omega, amplitude, periods):
    # the P2 has 1 % of the starts
    found = hpcsweep.attractors(structure, amplitude, omega, starts=400 if 2 in periods else 100)
    assert sorted(one.orbit_period for one in found) == periods
    assert all_apart(structure, found) > 1e-3


def test_near_its_fold_an_orbit_is_one_whatever_the_tolerance():
    """1e-13 before the fold its points are known to 1e-9: it has been 21 attractors."""
    solver, amplitude = make_solver("flow", PAPER, 0.445, 1e-9), FOLD - 1e-13
    starts = starting_states(box_of(None, PAPER.state_units), 100, 3, 0.445, amplitude)
    settings = SweepSettings(period_tolerance=1e-11)
    searched = AttractorSearch(solver, amplitude, settings, 2000, 0.95, None)
    found = portrait(searched, starts[:0], starts)
    assert sorted(one.orbit_period for one in found.attractors) == [1, 1, 2]


def test_the_ghost_of_a_fold_is_no_orbit():
    """1.3e-9 past the fold a P2 closes to 1.4e-8, and is left after 2,550 periods."""
    found = hpcsweep.attractors(PAPER, 0.22123999, 0.445, starts=16)
    assert [one.orbit_period for one in found] == [1, 1]
    assert sum(one.hits for one in found) == 16


@together("states", [None, 3, "rest"])
def test_states_that_are_none_are_refused(states):
    with pytest.raises(ValueError, match="states must be an array of shape"):
        hpcsweep.attractors(Structure(1), 0.1, 0.7, states=states)


def test_starts_reach_to_the_widest_gap_with_the_speed_of_a_mode_through_it():
    paper = Structure(3, 300.0)
    np.testing.assert_array_equal(usual_reach(paper), np.ones(6))
    own = Structure(2, 20.0, mass=(2e5, 1e5), storey_stiffness=(3e7, 2e7), gap=0.02, gap_left=0.05)
    slowest = own.frequencies[0]
    assert usual_reach(own).tolist() == [0.05, 0.05, 0.05 * slowest, 0.05 * slowest]
    for gaps, reach in (([-0.2, 0.1], 0.1), ([-0.2, -0.3], 0.3), ([0.0, -0.2], 0.2), ([0.0], 1.0)):
        contacts = [hpcsweep.Contact((1.0,), gap, 1.0) for gap in gaps]
        pressed = Structure.from_matrices([1.0], [[1.0]], contacts)
        assert usual_reach(pressed)[0] == reach


def test_chaos_that_only_a_seed_reaches_has_no_share():
    calm = np.array([-0.1385, 0.2201, 0.3147, -1.0683, -0.0547, 0.2825])  # near the P2
    box = np.stack((calm - 1e-9, calm + 1e-9), axis=1)
    chaotic = [[0.1409, 0.3006, 0.2898, -1.1085, 0.1114, -0.0344]]
    given = {"starts": 1, "box": box, "states": chaotic, "max_cycles": 1000}
    found = hpcsweep.attractors(AS_DESCRIBED, 0.128, 0.445, **given)
    assert [(one.kind.name, one.hits) for one in found] == [("PERIODIC", 1), ("CHAOTIC", 0)]


def test_the_exponent_of_chaos_is_that_of_its_spectrum():
    """It was that of the window that is taken for chaos, of some hundred periods."""
    structure = Structure(1, 163.0, math.inf, 0.049, gap=0.5, gap_left=0.5)
    (chaos,) = hpcsweep.attractors(structure, 3.96, 1.03, starts=4, max_cycles=1000)
    assert chaos.kind is MotionClass.CHAOTIC
    point = 3.96, 1.03, chaos.points[-1]
    exact = hpcsweep.lyapunov_spectrum(structure, *point, error=1e-9, max_cycles=4000)
    off, half = abs(exact.exponents[0] - chaos.lyapunov), chaos.lyapunov_high - chaos.lyapunov
    assert off < half + exact.errors[0]
    assert half < 0.015 * chaos.lyapunov
