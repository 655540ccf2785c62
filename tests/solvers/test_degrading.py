"""Sliders that degrade: paths and motions by hand, and an independent law and integration."""

import numpy as np
import pytest
from degrading import RULES
from random_degrading import differences, exact, random_case, random_paths, reference_of
from together import together

import hpcsweep

PLAIN = {"theta_p": 10.0, "theta_pc": 20.0}


def slider(stiffness=2.0, strength=2.0, direction=(1.0,), **backbone):
    return hpcsweep.Slider(direction, stiffness, strength, backbone=hpcsweep.Backbone(**backbone))


@together("side", [1.0, -1.0])
def test_first_loading_goes_along_the_backbone(side):
    """It yields at 1, is capped at 3 with 2.4, has 0.5 left from 37 / 6 on and none from 9 on."""
    shape = {"theta_p": 2.0, "theta_pc": 4.0, "theta_u": 9.0, "residual": 0.25, "hardening": 0.1}
    forces = slider(**shape).path(side * np.array([0.5, 1.0, 2.0, 3.0, 5.0, 6.5, 8.9, 9.1, 0.0]))
    right = np.array([1.0, 2.0, 2.2, 2.4, 1.2, 0.5, 0.5, 0.0, 0.0])
    np.testing.assert_allclose(side * forces, right, atol=1e-14)


@together(
    "rule, path, right",
    [
        # back from 3 to no force at 2, from where each has its own way to -2
        ("bilinear", [3, 2, 1, 0, 1, 3], [2, 0, -2, -2, 0, 2]),
        # 2 over 3 to (-1, -2), that over 4 to (3, 2); by the local peak (1, 1), nearer than 3
        ("peak-oriented", [3, 2, 0, -1, -2, 1, -0.5, 0.45, 1, 2, 3, 4],
         [2, 0, -4 / 3, -2, -2, 1, -0.8, 0.5, 1, 1.5, 2, 2]),
        # by (0, 0.4 * 4 / 3)
        ("pinching", [3, 2, 0, -0.5, -1, -2], [2, 0, -8 / 15, -19 / 15, -2, -2]),
    ],
)  # fmt: skip
def test_each_rule_loads_again_in_its_way(rule, path, right):
    kappas = {"kappa_f": 0.4, "kappa_d": 0.5} if rule == "pinching" else {}
    forces = slider(rule=rule, **PLAIN, **kappas).path(path)
    np.testing.assert_allclose(forces, right, atol=1e-14)


def test_energy_takes_strength_and_unloading_stiffness():
    """At 3 the work 5, of which 1 is kept: K_u = 2 (1 - 4 / 16), at no force 11 / 3 are left."""
    one = slider(rule="peak-oriented", Lambda=10.0, **PLAIN)
    forces = one.path([3.0, 5.0 / 3.0, -1.0, -3.0])
    left = 2.0 * (1.0 - 11.0 / 49.0)
    np.testing.assert_allclose(forces, [2.0, 0.0, -left, -left], atol=1e-14)


def test_all_energy_spent_is_all_force_lost():
    """At 9 the work is 17, of which 16 are spent, all but 4 of the 20: 16 > 4."""
    forces = slider(Lambda=10.0, **PLAIN).path([9.0, 8.9, 12.0])
    np.testing.assert_allclose(forces, [2.0, 0.0, 0.0])


def test_without_capping_and_deterioration_it_is_a_slider_beside_a_spring():
    rng = np.random.default_rng(3)
    rows, stiffness, part = np.eye(2) - np.eye(2, k=-1), np.array([3.0, 2.0]), 0.1
    shape = {"theta_p": 1e4, "theta_pc": 1e4, "hardening": part}
    whole = [slider(k, 0.3 * k, row, **shape) for k, row in zip(stiffness, rows, strict=True)]
    others = [
        hpcsweep.Slider(row, (1.0 - part) * k, 0.3 * k * (1.0 - part))
        for k, row in zip(stiffness, rows, strict=True)
    ]
    springs = (rows.T * part * stiffness) @ rows
    record = hpcsweep.Record(2.0 * rng.standard_normal(40), dt=0.3)
    one, other = (
        hpcsweep.response(
            hpcsweep.Structure.from_matrices(
                [1.0, 1.0], k, [], damping=0.1 * np.eye(2), sliders=sliders, collapse_drift=99.0
            ),
            record,
            energy=True,
        )
        for k, sliders in ((0.0 * springs, whole), (springs, others))
    )
    assert one.excursions.min() > 2
    np.testing.assert_array_equal(one.excursions, other.excursions)
    np.testing.assert_allclose(one.final_state, other.final_state, atol=1e-11)
    np.testing.assert_allclose(one.ductility, other.ductility, rtol=1e-11)
    work = [seen.energy.strain + seen.energy.sliders for seen in (one, other)]
    assert work[0] == pytest.approx(work[1], rel=1e-10)


def test_a_mass_is_lost_by_a_constant_push():
    """It yields at 1/4, is capped at 3/4 with 1.2 and lost at 7/4: work 1/8 + 0.55 + 0.6."""
    one = slider(4.0, 1.0, theta_p=0.5, theta_pc=1.0, hardening=0.1)
    structure = hpcsweep.Structure.from_matrices(
        [1.0], [[0.0]], [], sliders=[one], collapse_drift=99.0
    )
    seen = hpcsweep.response(structure, hpcsweep.Record([-2.0, -2.0], dt=3.0), energy=True)
    work, after = 1.275, 3.0 - seen.strength_lost[0]
    speed = np.sqrt(2.0 * (2.0 * 1.75 - work))
    right = [1.75 + speed * after + after**2, speed + 2.0 * after]
    np.testing.assert_allclose(seen.final_state, right, rtol=1e-12)
    np.testing.assert_allclose(seen.slider_energy, [work], rtol=1e-12)
    np.testing.assert_allclose(seen.slider_force, [1.2], rtol=1e-12)
    assert seen.final_slider_force[0] == 0.0
    assert abs(seen.energy.balance) < 1e-12


@pytest.mark.slow
@together("rule", RULES)
def test_paths_are_those_of_the_law(rule):
    assert max(random_paths(rule, seed) for seed in range(300)) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_random_storeys_move_as_the_reference(rule):
    """Among them what was wrong once: turns below the backbone, losses as an excursion begins."""
    cases = [(seed, seed < 40, seed % 4 == 0) for seed in range(60)]
    cases += {"bilinear": [(2626, True), (4078, True)], "peak-oriented": [(107,)],
              "pinching": [(7318, True)]}[rule]  # fmt: skip
    for seed, *given in cases:
        case = random_case(rule, seed, *given)
        seen, balance = exact(case)
        *away, other = differences(seen, reference_of(case, 300))
        assert max(away) < 1e-8, (seed, away)
        assert not other, seed
        assert abs(balance) < 1e-11, seed
