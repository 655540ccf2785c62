"""Orbits along the amplitude by moves that are compiled, against moves in Python as for any map."""

from itertools import pairwise

import numpy as np
import pytest

from hpcsweep import Structure, load_job, stroboscopic_points
from hpcsweep.dynamics.continuation import cycle
from hpcsweep.dynamics.continuation.branch import Limits, follow
from hpcsweep.dynamics.continuation.catalogue import orbits_on
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, solve_at
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.forced import ForcedMap

TWO_MASSES = load_job("jobs/structures/two-masses.toml").structure
ORBITS = {
    "one mass": (Structure(1, 100.0, np.inf, 0.05), 0.6, 1.2, 1),
    "two masses, one contact, P3": (TWO_MASSES, 0.472, 0.5, 3),
    "two floors": (Structure(2), 0.06, 0.445, 1),
    "two floors, P3": (Structure(2), 0.056, 0.6, 3),
    "three floors": (Structure(3), 0.06, 0.445, 1),
    "three floors, P2": (Structure(3), 0.088, 0.445, 2),
    "dashpots": (Structure(2, 100.0, np.inf, 0.05, restitution=0.6), 0.4, 0.5, 1),
}


class InPython(ForcedMap):
    """The map without compiled moves."""

    def take_round(self, scale, rows, inverse, matrices, rules):
        del scale, rows, inverse, matrices, rules


def curves(name):
    """Return the curves of an orbit, compiled and not, and its points."""
    structure, amplitude, omega, period = ORBITS[name]
    z = np.zeros(2 * structure.n_floors)
    for at in np.linspace(0.5 * amplitude, amplitude, 5):
        z = stroboscopic_points(structure, at, omega, z, 300)[-1]
    own = structure, amplitude, omega
    compiled, plain = (Curve(kind(*own), period, 0.1) for kind in (ForcedMap, InPython))
    points = cycle.continued(plain.map, (z / plain.map.units)[None], amplitude, period)
    return compiled, plain, points


@pytest.mark.parametrize("name", ORBITS)
def test_orbits_are_those_found_in_python(name):
    compiled, plain, points = curves(name)
    amplitude, period = compiled.map.amplitude, compiled.period
    start = solve_at(compiled, points + 1e-4, amplitude)
    for border in (start.tangent, np.eye(start.y.size)[-1]):
        guess = start.y + 1e-3 * start.tangent
        for near in (None, start):
            own, other = (curve.solve(guess, border, near) for curve in (compiled, plain))
            np.testing.assert_allclose(own.y, other.y, rtol=0, atol=1e-12)
            np.testing.assert_allclose(own.tangent, other.tangent, rtol=0, atol=1e-7)
            np.testing.assert_allclose(own.inverse, other.inverse, rtol=1e-6, atol=1e-6)
            assert own.residual == pytest.approx(other.residual, abs=1e-10)
        kept, again = (curve.solve(guess, border, start, keeps=True) for curve in (compiled, plain))
        np.testing.assert_allclose(kept.y, again.y, rtol=0, atol=1e-12)
    assert own.y[-1] == guess[-1]  # at one amplitude, to the last bit
    assert len(own.maps.matrices) == period


@pytest.mark.parametrize("name", ["two floors, P3", "three floors", "two masses, one contact, P3"])
def test_a_walk_is_that_in_python(name):
    compiled, plain, points = curves(name)
    at = compiled.map.amplitude
    limits = Limits(0.7 * at, 1.4 * at, 12)
    arcs = [follow(curve, solve_at(curve, points, at), limits) for curve in (compiled, plain)]
    own, other = arcs
    assert len(own.points) == len(other.points) > 12
    for one, same in zip(own.points, other.points, strict=True):
        np.testing.assert_allclose(one.y, same.y, rtol=0, atol=1e-6)
        assert one.tests == pytest.approx(same.tests, abs=1e-4)
        # the point of the branch in Python that is next to it
        again = plain.solve(one.y, one.tangent)
        np.testing.assert_allclose(one.y, again.y, rtol=0, atol=1e-11)
        assert compiled.signature(again) == plain.signature(again)
    kinds = [[special.kind for _, special in arc.specials] for arc in arcs]
    assert kinds[0] == kinds[1]
    values = [[special.at.y[-1] for _, special in arc.specials] for arc in arcs]
    np.testing.assert_allclose(*values, rtol=0, atol=1e-10)


def test_no_point_is_an_error_of_one_line():
    compiled, _, points = curves("one mass")
    with pytest.raises(NotConvergedError, match="not converged"):
        compiled.solve(compiled.join(points, 1e300), np.array([0.0, 0.0, 1.0]))


def test_steps_of_a_walk_lead_along_the_branch():
    compiled, _, points = curves("one mass")
    start = solve_at(compiled, points, 0.6)
    arc = follow(compiled, start, Limits(0.5, 0.7, 3))
    assert any(compiled.signature(point) == (1,) for point in arc.points)
    for first, last in pairwise(arc.points):
        step = last.y - first.y
        assert step @ first.tangent > 0.9 * np.linalg.norm(step)
        np.testing.assert_allclose(compiled.residual(last.y), 0.0, atol=1e-10)


@pytest.mark.parametrize("omega", [0.9, 1.0])
def test_branches_cross_where_a_pair_of_mirrored_orbits_leaves(omega):
    # the Jacobian is singular there; rounding breaks the symmetry of a map in Python
    stops = Structure(1, 50.0, np.inf, gap=0.5, gap_left=0.5)
    at = []
    for kind in (ForcedMap, InPython):
        curve = Curve(kind(stops, 0.4, omega), 1, 0.5)
        z = stroboscopic_points(stops, 0.4, omega, np.zeros(2), 300)[-1]
        start = solve_at(curve, z[None] / curve.map.units, 0.4)
        arc = follow(curve, start, Limits(0.2, 0.7, 300))
        assert arc.ends == ("end of the span", "end of the span")
        ((_, special),) = arc.specials
        assert special.kind is Kind.BRANCH_POINT
        at.append(curve.split(special.at.y)[1])
    assert at[0] == pytest.approx(at[1], abs=1e-7)
    # motions go to the orbits of the branch below, above to one of the pair
    away = []
    for amplitude in (0.98 * at[0], 1.02 * at[0]):
        z = stroboscopic_points(stops, amplitude, omega, np.array([0.1, 0.0]), 1500)[-1]
        (orbit,) = orbits_on(arc, amplitude)
        away.append(np.abs(orbit * curve.map.units - z).max())
    assert away[0] < 1e-9
    assert away[1] > 1e-2
