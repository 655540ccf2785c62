"""Buildings on bearings: closed forms, the independent reference, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from together import together
from yielding import Yielding

import hpcsweep
from hpcsweep.model.isolation import isolated_period

SHAKING = hpcsweep.Record(np.random.default_rng(3).standard_normal(40) * 4.0, dt=0.1)
GIVEN = {"slab_mass": 2.0, "stiffness": 1.5, "strength": 0.8, "initial_stiffness": 20.0}


def test_a_rigid_building_is_one_bilinear_oscillator_of_the_whole_mass():
    """Under a constant acceleration q it turns where m q u = k u^2 / 2 + Q (u - u_y / 2).

    u_y = Q / (k_0 - k), m the mass of slab and floors: u is the larger root.
    """
    q, m, k, initial, strength = 1.1, 5.0, 1.5, 20.0, 0.8
    isolation = hpcsweep.Isolation(**GIVEN)
    rigid = hpcsweep.Building([1.0, 2.0], 1e6, damping_ratio=0.0, isolation=isolation)
    found = hpcsweep.response(rigid.structure, hpcsweep.Record([-q, -q], dt=12.0))
    u_y, over = strength / (initial - k), m * q - strength
    turn = (over + math.sqrt(over * over + k * strength * u_y)) / k
    assert found.displacement == pytest.approx([turn] * 3, rel=2e-6)
    assert found.ductility[0] == pytest.approx(turn / u_y, rel=2e-6)
    assert found.slider_force[0] == strength
    assert found.excursions[0] >= 1


def test_it_moves_as_the_reference_with_storeys_that_yield_and_walls():
    isolation = hpcsweep.Isolation(**GIVEN, damping_ratio=0.02, gap=1.2, wall_stiffness=300.0)
    yields = {"yield_drift": [0.3, math.inf], "hardening": 0.1}
    tower = hpcsweep.Building([1.0, 2.0], [30.0, 25.0], isolation=isolation, **yields)
    structure = tower.structure
    fixed = hpcsweep.Building([1.0, 2.0], [30.0, 25.0]).structure
    # u_0 is the slab, storeys are between it and the floors above
    stretch = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    stiffness = stretch.T @ np.diag([3.0, 25.0]) @ stretch
    stiffness[0, 0] += 1.5
    relative = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    damping = relative.T @ fixed.damping_matrix @ relative
    damping[0, 0] += 2.0 * 0.02 * math.sqrt(1.5 * 5.0)
    sliders = [
        hpcsweep.Slider((1.0, 0.0, 0.0), 18.5, 0.8),
        hpcsweep.Slider(stretch[0], 27.0, 27.0 * 0.3),
    ]
    walls = [hpcsweep.Contact((side, 0.0, 0.0), 1.2, 300.0) for side in (1.0, -1.0)]
    reference = Yielding(np.diag([2.0, 1.0, 2.0]), stiffness, damping, walls, sliders)
    end = reference.run(SHAKING.acceleration, SHAKING.dt)
    found = hpcsweep.response(structure, SHAKING)
    np.testing.assert_allclose(found.final_state, end, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.plastic, reference.plastic, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(found.excursions, reference.excursions)
    assert found.excursions.min() > 0
    assert found.impacts.min() > 0
    assert structure.floor_names == ("isolation", "1", "2")
    assert structure.building_names == ("building",)
    assert structure.storey_names == ("1", "2")
    assert structure.slider_names == ("isolation", "1")
    assert tuple(structure.contact_names.values()) == ("wall right", "wall left")
    # beside another building that is never reached it moves alike
    other = hpcsweep.Building([1.0, 1.0, 1.0], 9.0, name="B")
    pair = hpcsweep.adjacent([tower, other], gap=1e6, stiffness=1.0)
    assert pair.floor_names == ("A isolation", "A1", "A2", "B1", "B2", "B3")
    assert pair.storey_names == ("A1", "A2", "B1", "B2", "B3")
    names = ("A1-B1", "A2-B2", "A wall right", "A wall left")
    assert tuple(pair.contact_names.values()) == names
    facing = [np.flatnonzero(contact.direction).tolist() for contact in pair.contacts[:2]]
    assert facing == [[1, 3], [2, 4]]
    beside = hpcsweep.response(pair, SHAKING)
    np.testing.assert_allclose(beside.final_state[:3], end[:3], rtol=0, atol=1e-11)
    np.testing.assert_allclose(beside.drift[:2], found.drift, rtol=1e-11)


def test_bearings_are_given_in_engineers_terms():
    mass, g = 4e5, 9.80665
    lead = hpcsweep.Isolation(slab_mass=1.0, period=2.5, yield_drift=0.02)
    after = mass * (2 * math.pi / 2.5) ** 2
    assert lead.bearings(mass) == pytest.approx((after, 10 * after, 0.02 * 9 * after))
    pendulum = hpcsweep.Isolation(slab_mass=1.0, radius=2.0, friction=0.06)
    by_radius = (mass * g / 2.0, 100 * mass * g / 2.0, 0.06 * mass * g)
    assert pendulum.bearings(mass) == pytest.approx(by_radius)
    # the period of a pendulum does not depend on the mass
    by_period = hpcsweep.Isolation(
        slab_mass=1.0, period=2 * math.pi * math.sqrt(2.0 / g), friction=0.06
    )
    assert by_period.bearings(mass) == pytest.approx(by_radius)


def test_the_period_and_damping_of_the_building_are_those_on_a_fixed_base():
    isolation = hpcsweep.Isolation(**GIVEN)
    free = hpcsweep.Building([1.0, 2.0], [3.0, 2.0], period=0.7)
    on_slab = hpcsweep.Building([1.0, 2.0], [3.0, 2.0], period=0.7, isolation=isolation)
    assert on_slab.storey_stiffness == free.storey_stiffness
    # no damping where slab and floors move as one
    damping = on_slab.structure.damping_matrix
    np.testing.assert_allclose(damping.sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(damping[1:, 1:], free.structure.damping_matrix, rtol=1e-12)


def test_the_isolated_period_is_that_of_bearings_that_slide():
    """Of a rigid building 2 pi sqrt(m / k), whether or not it may yield, and beside another one."""
    rigid = hpcsweep.Building([1.0, 2.0], 1e6, isolation=hpcsweep.Isolation(**GIVEN), name="A")
    yields = replace(rigid, yield_drift=0.1)
    slow = hpcsweep.Building([1.0, 2.0], 1e-3, name="B")
    pair = hpcsweep.adjacent([yields, slow], gap=0.1, stiffness=1.0)
    for one in (rigid.structure, yields.structure, pair):
        assert isolated_period(one) == pytest.approx(2 * math.pi * math.sqrt(5.0 / 1.5), rel=1e-5)
    assert isolated_period(slow.structure) is None


WRONG = [
    ({"slab_mass": 0.0}, r"isolation\.slab_mass must be finite and positive, from 1e-12 to"),
    ({"stiffness": None}, r"isolation\.period, stiffness or radius must be given"),
    ({"radius": 2.0}, r"isolation\.stiffness and radius must not be given both"),
    ({"strength": None}, r"isolation\.strength, yield_drift or friction must be given"),
    ({"friction": 0.1}, r"isolation\.strength and friction must not be given both"),
    ({"strength": None, "friction": 5.0}, r"friction must be above 0, and at most 1, is 5\.0"),
    ({"strength": -1.0}, r"isolation\.strength must be finite and positive, from"),
    ({"damping_ratio": -0.1}, r"isolation\.damping_ratio must be from 0 to 100, is -0\.1"),
    ({"gap": -0.1}, r"isolation\.gap must be at least 0 \(inf: no walls\), is -0\.1"),
    ({"gap": 0.1}, r"isolation\.wall_stiffness must be given with gap, and above 0"),
    ({"initial_stiffness": 1.0}, r"initial_stiffness must be above that after yielding, 1\.5, is"),
]


@together("wrong, message", WRONG)
def test_wrong_bearings_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        _ = hpcsweep.Building(1.0, 1.0, isolation=GIVEN | wrong).structure


def test_what_is_no_isolation_is_refused():
    for wrong in (3, "soft"):
        with pytest.raises(ValueError, match=r"building\.isolation must be a Isolation"):
            hpcsweep.Building(1.0, 1.0, isolation=wrong)
