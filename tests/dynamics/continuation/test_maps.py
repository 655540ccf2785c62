"""Continuation on maps whose orbits and bifurcations are known in closed form."""

import numpy as np
import pytest
from maps_in_closed_form import Delayed, Henon, Logistic

from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.catalogue import Catalogue, switch
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, solve_at
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.search import search
from hpcsweep.dynamics.stability import TangentMaps, floquet_multipliers


def found_on(arc):
    """Kinds and values of the special points of a piece of a branch."""
    return [(one.kind, arc.curve.split(one.at.y)[1]) for _, one in arc.specials]


def catalogue_of(map_, x, value, low, high, most_period, **limits):
    catalogue = Catalogue(map_, Limits(low, high, **limits), 1.0, most_period, 32)
    catalogue.add(np.array([x]), value)
    catalogue.grow()
    return catalogue


def test_doublings_of_the_logistic_map_give_feigenbaums_ratio():
    curve = Curve(Logistic(), 1, 1.0)
    start, at = solve_at(curve, np.array([[0.6]]), 2.5), []
    for _ in range(7):
        arc = follow(curve, start, Limits(1.5, 3.6), born=curve.period > 1)
        special = next(one for _, one in arc.specials if one.kind is Kind.DOUBLING)
        at.append(arc.curve.split(special.at.y)[1])
        curve, start = switch(curve, special)
    # Strogatz, Nonlinear Dynamics and Chaos, 10.2; the third is a root of a polynomial
    np.testing.assert_allclose(at[:2], [3.0, 1.0 + np.sqrt(6.0)], rtol=0, atol=1e-11)
    assert at[2] == pytest.approx(3.544090359551923, abs=1e-9)
    gaps = np.diff(at)
    assert gaps[-2] / gaps[-1] == pytest.approx(4.669201609, abs=1e-3)


def test_branches_of_the_logistic_map_are_found_once_and_are_supercritical():
    catalogue = catalogue_of(Logistic(), [0.6], 2.5, 1.5, 3.55, 8)
    assert [one.curve.period for one in catalogue.branches] == [1, 2, 4, 8]
    assert [one.parent for one in catalogue.branches] == [-1, 0, 1, 2]
    for one in catalogue.branches[:3]:
        assert [special.criticality for _, special in one.specials] == [1]
    # an orbit of each is recognised, at any phase
    x = np.array([0.5130445, 0.7994555])
    for points in (x, x[::-1]):
        assert catalogue.add(points[:, None], 3.2)[0] == 1
    assert catalogue.add(np.array([[0.5]]), 2.0)[0] == 0
    assert len(catalogue.branches) == 4


def test_a_branch_ends_where_a_step_has_led_onto_a_known_one():
    # of the logistic map's fixed points x = 0 and x = 1 - 1 / r, which cross at r = 1
    catalogue = catalogue_of(Logistic(), [0.6], 2.5, 1.5, 2.9, 1)
    known = catalogue.branches[0]
    first = follow(known.curve, solve_at(known.curve, np.array([[0.0]]), 2.0), Limits(1.5, 2.9))
    away = [one for one in first.points if one.y[-1] < 2.3]
    jumped = [one for one in known.points if one.y[-1] > 2.3]
    back = [one for one in first.points if one.y[-1] > 2.7]
    short = [one for one in jumped if one.y[-1] < 2.7]
    for points, ends, left in (
        (away + short + back, ("end of the span", "known"), away),
        (away + jumped, ("end of the span", "known"), away),
        (jumped[::-1] + away[::-1], ("known", "end of the span"), away[::-1]),
        (first.points, first.ends, first.points),
    ):
        arc, number = catalogue.own_part(Arc(known.curve, points, [], first.ends), away[-2])
        assert (arc.points, arc.ends) == (left, ends)
        assert number == (0 if "known" in ends else -1)


def test_folds_and_doublings_of_the_henon_map():
    b = Henon.b
    catalogue = catalogue_of(Henon(), [0.6, 0.18], 0.2, -0.2, 1.0, 2, most_steps=60)
    kinds = found_on(catalogue.branches[0])
    assert [kind for kind, _ in kinds] == [Kind.FOLD, Kind.DOUBLING]
    expected = [-0.25 * (1 - b) ** 2, 0.75 * (1 - b) ** 2]
    np.testing.assert_allclose([value for _, value in kinds], expected, rtol=0, atol=1e-11)
    (doubling,) = found_on(catalogue.branches[1])
    # x y = ((1 - b)^2 - a) / a^2 of the orbit of period 2, whose tangent map has the trace
    # 4 a^2 x y + 2 b and the determinant b^2
    assert doubling[0] is Kind.DOUBLING
    assert doubling[1] == pytest.approx((1 - b) ** 2 + 0.25 * (1 + b) ** 2, abs=1e-11)


def test_a_torus_of_the_delayed_logistic_map():
    (branch,) = catalogue_of(Delayed(), [0.3, 0.3], 1.6, 1.2, 2.2, 4).branches
    ((kind, value),) = found_on(branch)
    assert kind is Kind.TORUS
    assert value == pytest.approx(2.0, abs=1e-11)


@pytest.mark.slow
def test_a_search_finds_all_orbits_of_the_logistic_map_in_its_window_of_period_3():
    catalogue = Catalogue(Logistic(), Limits(3.835, 3.845), 0.01, 4, 64)
    starts = np.linspace(0.02, 0.98, 256)[:, None]
    search(catalogue, Logistic(), starts, (3.835, 3.845), 4)
    periods = [one.curve.period for one in catalogue.branches]
    # fixed points 0 and 1 - 1/r; those of 2 and 4 by doubling; the pair of 3, born at 1 + 8^(1/2);
    # the other pair of 4 is born at 3.9601
    assert sorted(periods) == [1, 1, 2, 3, 3, 4]
    stable = [abs(one.points[0].multipliers[0]) < 1 for one in catalogue.branches]
    assert [p for p, steady in zip(periods, stable, strict=True) if steady] == [3]


def test_multipliers_do_not_depend_on_how_a_product_is_cut():
    rng = np.random.default_rng(3)
    own = np.array([3e8, -2.0, 0.5, 1e-5])
    basis = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    # similar factors of one product: M_i = B_{i+1} D_i B_i^-1
    bases = [basis, *(np.linalg.qr(rng.normal(size=(4, 4)))[0] for _ in range(5)), basis]
    roots = np.abs(own) ** (1 / 6)
    signs = np.array([1.0, -1.0, 1.0, 1.0])
    matrices = [
        bases[i + 1] @ np.diag(roots * (signs if i == 0 else 1.0)) @ bases[i].T for i in range(6)
    ]
    found = TangentMaps(np.array(matrices)).multipliers
    np.testing.assert_allclose(found, own[np.argsort(-np.abs(own))], rtol=1e-9)
    product = np.linalg.multi_dot(matrices[::-1])
    # of the product the smallest has lost its digits
    assert abs(floquet_multipliers(product)[-1] / 1e-5 - 1) > 1e-5


def test_what_is_no_orbit_is_refused():
    with pytest.raises(NotConvergedError):
        solve_at(Curve(Henon(), 1, 1.0), np.array([[0.1, 0.1]]), -1.0)
