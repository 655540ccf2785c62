"""Contacts with a dashpot: the coefficient of restitution, and what is refused."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf
from together import together

import hpcsweep
from hpcsweep.model.adjacent import adjacent
from hpcsweep.model.buildings import Building
from hpcsweep.model.dashpot import ratio_of_restitution, restitution_of
from hpcsweep.model.description import describe, in_words

GIVEN = (1.0, 0.999, 0.9, 0.65, 0.3, 0.14, 0.13, 0.01, 1e-6)


def collision(ratio, tension):
    """Speed after a collision at speed 1, in 30 digits, from exp(A t) by its eigenvalues."""
    with mp.workdps(30):
        xi = mpf(ratio)
        root = mp.sqrt(mp.mpc(xi * xi - 1))
        fast, slow = -xi - root, -xi + root

        def motion(t, order):
            return (
                (slow**order * mp.exp(slow * t) - fast**order * mp.exp(fast * t)) / (slow - fast)
            ).real

        if tension:
            end = mp.pi / mp.sqrt(1 - xi * xi)
        else:
            # the first root of x'' after 0, between that of x' and of x
            turn = mp.findroot(lambda t: motion(t, 1), 1 / (1 + xi))
            end = mp.findroot(lambda t: motion(t, 2), (turn, 3 * turn), solver="anderson")
        return float(-motion(end, 1))


@together("tension", [False, True])
@together("e", GIVEN)
def test_the_damping_ratio_gives_the_restitution_that_is_asked(e, tension):
    ratio = ratio_of_restitution(e, tension)
    pulls = math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio * ratio)) if tension else 0.0
    assert (pulls if tension else restitution_of(ratio)) == pytest.approx(e, rel=1e-13)
    if 0.13 < e < 1:
        assert collision(ratio, tension) == pytest.approx(e, rel=1e-12)


def test_the_formula_with_tension_gives_a_higher_restitution_without():
    ratio = ratio_of_restitution(0.65, tension=True)
    assert restitution_of(ratio) == pytest.approx(0.674751, abs=1e-6)
    assert restitution_of(1.0) == pytest.approx(math.exp(-2), rel=1e-14)


def test_a_contact_feels_the_reduced_mass_of_two_bodies():
    contact = hpcsweep.Contact.from_restitution([1, -1], 0.1, 50.0, 0.65, [2.0, 3.0], True)
    expected = 2 * ratio_of_restitution(0.65, True) * math.sqrt(50.0 * 2 * 3 / 5)
    assert contact.damping == pytest.approx(expected, rel=1e-14)
    coupled = hpcsweep.Contact.from_restitution([0, 1], 0.1, 50.0, 0.65, [[2.0, 1.0], [1.0, 3.0]])
    expected = 2 * ratio_of_restitution(0.65) * math.sqrt(50.0 * 2.5)
    assert coupled.damping == pytest.approx(expected, rel=1e-14)


def test_stops_of_floors_and_of_buildings_have_their_dashpots():
    building = hpcsweep.Structure(
        2, 100.0, math.inf, mass=[1.0, 4.0], storey_stiffness=2.0, restitution=[0.5, 1.0]
    )
    expected = 2 * ratio_of_restitution(0.5) * math.sqrt(200.0)
    assert building.contact_damping.tolist() == [pytest.approx(expected), 0.0]
    assert ("e", "(0.5, 1)") in in_words(building)
    assert describe(building)["contacts"][0]["damping"] == pytest.approx(expected)
    assert "damping" not in describe(building)["contacts"][1]
    both = [Building([2.0, 2.0], 5.0), Building([3.0, 3.0], 5.0)]
    made = adjacent(both, 0.1, 50.0, restitution=[0.65, 1.0], tension=True)
    expected = 2 * ratio_of_restitution(0.65, True) * math.sqrt(50.0 * 6 / 5)
    assert made.contact_damping.tolist() == [pytest.approx(expected), 0.0]
    damped = adjacent(both, 0.1, 50.0, damping=7.0)
    assert np.array_equal(damped.contact_damping, [7.0, 7.0])
    assert not damped.contacts[0].tension


def of_matrices(**more):
    contact = hpcsweep.Contact([1.0], 0.1, 5.0, 0.5)
    return hpcsweep.Structure.from_matrices([1.0], [[1.0]], [contact], **more)


@together(
    "make, said",
    [
        (lambda: hpcsweep.Contact([1.0], 0.1, 5.0, -1.0), "contact.damping must be at least 0"),
        (lambda: hpcsweep.Contact([1.0], 0.1, 5.0, math.nan), "contact.damping must be"),
        (lambda: hpcsweep.Contact([1.0], 0.1, 5.0, 1.0, "no"), "contact.tension must be true or"),
        (lambda: of_matrices(sharpness=1e4), "contact.damping = 0.5 needs sharpness = inf"),
        (lambda: hpcsweep.Structure(2, restitution=0.5), "restitution = 0.5 needs sharpness = inf"),
        (lambda: hpcsweep.Structure(2, restitution=0.0), "restitution must be from 1e-06 to 1"),
        (lambda: hpcsweep.Structure(2, restitution=1.5), "restitution must be from 1e-06 to 1"),
        (lambda: hpcsweep.Structure(2, restitution=[0.5]), "restitution must have 2 numbers"),
        (lambda: hpcsweep.Structure(2, tension=3), "tension must be true or false, is 3"),
    ],
)
def test_what_no_dashpot_can_be_is_refused_in_one_line(make, said):
    with pytest.raises(ValueError, match=said) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_without_a_dashpot_a_smooth_stop_may_have_a_restitution_of_1():
    assert hpcsweep.Structure(2, restitution=1.0).contacts == hpcsweep.Structure(2).contacts
