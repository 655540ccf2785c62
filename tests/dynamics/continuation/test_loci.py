"""Loci of special points over two parameters, on maps where they are known in closed form."""

import numpy as np
import pytest
from maps_in_closed_form import Cubic, HenonPlane, SoftImpacts

from hpcsweep.dynamics.continuation.branch import Limits, follow
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.locus import Locus
from hpcsweep.dynamics.continuation.plane import Meeting, step_of_locus


def followed(map_, kind, points, values, spans, change=(), side=None, largest=0.05):
    """Values of both parameters along a locus, its meetings and its ends."""
    points = np.array(points, float)
    locus = Locus(map_, len(points), np.ones(2), spans, kind, change, side)
    limits = Limits(-np.inf, np.inf, largest=largest)
    arc = follow(locus, locus.start(points, values), limits, step=step_of_locus)
    met = [(one.kind, np.array(locus.split(one.at.y)[1])) for _, one in arc.specials]
    return np.array([locus.split(one.y)[1] for one in arc.points]), met, arc.ends


def fixed_point(a, b):
    """Of the Henon map, the one from which orbits of period 2 leave."""
    x = (b - 1 + np.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
    return [[x, b * x]]


def test_folds_and_doublings_of_the_henon_map_to_their_strong_resonances():
    spans = (-2.0, 5.0), (-1.2, 0.5)
    # folds at a = -(1 - b)^2 / 4, where x = (b - 1) / 2a
    a, x = -0.1225, 2.857
    at, met, ends = followed(HenonPlane(), Kind.FOLD, [[x, 0.3 * x]], (a, 0.3), spans)
    np.testing.assert_allclose(at[:, 0], -((1 - at[:, 1]) ** 2) / 4, rtol=0, atol=1e-10)
    assert ends == ("end of the span", "end of the span")
    ((kind, place),) = met
    assert kind is Meeting.RESONANCE_1
    np.testing.assert_allclose(place, [-1.0, -1.0], atol=1e-8)
    # doublings at a = 3 (1 - b)^2 / 4
    at, met, _ = followed(
        HenonPlane(), Kind.DOUBLING, fixed_point(0.3675, 0.3), (0.3675, 0.3), spans
    )
    np.testing.assert_allclose(at[:, 0], 3 * (1 - at[:, 1]) ** 2 / 4, rtol=0, atol=1e-10)
    ((kind, place),) = met
    assert kind is Meeting.RESONANCE_2
    np.testing.assert_allclose(place, [3.0, -1.0], atol=1e-8)


def test_a_torus_of_the_henon_map_between_its_resonances():
    # b = -1, where cos(angle) = 1 - (1 + a)^(1/2)
    at, met, ends = followed(
        HenonPlane(), Kind.TORUS, fixed_point(0.5, -1.0), (0.5, -1.0), ((-2.0, 5.0), (-1.2, 0.5))
    )
    np.testing.assert_allclose(at[:, 1], -1.0, rtol=0, atol=1e-10)
    assert set(ends) == {"resonance 1:1", "resonance 1:2"}
    places = {kind: place[0] for kind, place in met}
    expected = {
        Meeting.RESONANCE_1: -1.0,
        Meeting.RESONANCE_4: 0.0,
        Meeting.RESONANCE_3: 1.25,
        Meeting.RESONANCE_2: 3.0,
    }
    assert places == pytest.approx(expected, abs=1e-6)


def test_folds_pass_a_cusp():
    # x = 0.5, b = 1 + 3 x^2, a = -2 x^3
    at, met, _ = followed(Cubic(), Kind.FOLD, [[0.5]], (-0.25, 1.75), ((-1.0, 1.0), (0.5, 2.5)))
    np.testing.assert_allclose(at[:, 0] ** 2, 4 * ((at[:, 1] - 1) / 3) ** 3, atol=1e-9)
    assert at[:, 0].min() < -0.4
    assert at[:, 0].max() > 0.4
    ((kind, place),) = met
    assert kind is Meeting.CUSP
    np.testing.assert_allclose(place, [0.0, 1.0], atol=1e-8)


def test_grazings_of_soft_impacts_and_what_they_meet():
    spans = (-0.6, 0.6), (-1.4, 1.4)
    y = (0.2 - 0.3) / 3 / 0.9
    at, met, ends = followed(SoftImpacts(), Kind.GRAZING, [[0.0, y]], (0.0, 0.2), spans, (1, 0))
    np.testing.assert_allclose(at[:, 0], 0.0, atol=1e-10)
    assert ends == ("end of the span", "end of the span")
    places = {kind: place[1] for kind, place in met}
    expected = {
        Meeting.GRAZING_DOUBLING: -1.0,
        Meeting.DOUBLE_GRAZING: 0.3,
        Meeting.GRAZING_FOLD: 1.0,
    }
    assert places == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_folds_of_soft_impacts_touch_the_grazings_to_third_order():
    c = SoftImpacts.c

    def where(a):
        x = ((1 - a) / (1.5 * c)) ** 2
        return [[x, (a - 0.3 - x) / 3 / (1 - a / 2)]], (x * (1 - a) - c * x**1.5, a)

    at, met, ends = followed(SoftImpacts(), Kind.FOLD, *where(0.5), ((-0.6, 0.6), (-0.5, 1.4)))
    m, a = at.T
    np.testing.assert_allclose(m, 4 * (1 - a) ** 3 / (27 * c**2), rtol=0, atol=1e-10)
    assert a.max() == pytest.approx(1.0, abs=1e-3)
    assert ends == ("end of the span", "not followed on")
    # the second contact grazes where y is 0
    ((kind, place),) = met
    assert kind is Meeting.GRAZING_FOLD
    assert (place[1] - 0.3) == pytest.approx(where(place[1])[0][0][0], abs=1e-6)
