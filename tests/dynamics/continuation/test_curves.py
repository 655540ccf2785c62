"""Curves of special points of structures in the plane, against closed forms."""

import numpy as np
import pytest
from one_impact import OneImpact
from together import together

from hpcsweep import Structure, branch, curve, meanings, stroboscopic_points
from hpcsweep.solvers.trajectory import crossings, trajectory

OMEGA, ZETA, BETA = 1.2, 0.05, 100.0
ONE = Structure(1, BETA, np.inf, ZETA)
SPAN = (0.25, 0.8), (1.18, 1.22)


@pytest.fixture(scope="module")
def one_impact_branch():
    z = stroboscopic_points(ONE, 0.5928912, OMEGA, np.zeros(2), 800)[-1]
    return branch(ONE, 0.5928912, OMEGA, z, 1, span=(1e-3, 0.9))


def test_the_curve_of_a_grazing_is_that_of_the_linear_motion(one_impact_branch):
    special = one_impact_branch.isel(special=0)
    assert meanings(special.special_kind).item() == "grazing"
    found = curve(ONE, special, span=SPAN, steps=20)
    amplitude, omega = found.value.values.T
    expected = np.hypot(1 - omega**2, 2 * ZETA * omega)
    np.testing.assert_allclose(amplitude, expected, rtol=0, atol=1e-10)
    assert omega.min() == 1.18
    assert omega.max() == 1.22
    assert found.attrs["kind"] == "grazing"
    assert found.attrs["begins"] == found.attrs["ends"] == "end of the span"
    assert found.special_kind.size == meanings(found.special_kind).size == 0


@pytest.mark.slow
def test_the_curve_of_a_fold_is_that_of_the_closed_form(one_impact_branch):
    special = one_impact_branch.isel(special=2)
    assert meanings(special.special_kind).item() == "fold"
    found = curve(ONE, special, span=((0.1, 0.3), (1.18, 1.21)), steps=20)
    for end in (0, -1):
        amplitude, omega = found.value.values[end].tolist()
        assert omega in (1.18, 1.21)
        seen = crossings(ONE, amplitude, omega, found.point.values[end])
        closes, opens = sorted(seen, key=lambda one: not one.closes)
        period = 2 * np.pi / omega
        duration, closing = (opens.phase - closes.phase) % 1.0 * period, closes.phase * period
        pair = duration - 5e-4, duration + 5e-4
        closed = OneImpact(ZETA, BETA, omega).fold(*pair, closing)
        assert amplitude == pytest.approx(closed, abs=1e-9)
    assert np.abs(np.abs(found.multiplier.values) - 1).min(axis=1).max() < 1e-6


def test_a_curve_follows_another_number_of_the_structure(one_impact_branch):
    special = one_impact_branch.isel(special=0)
    found = curve(ONE, special, ("amplitude", "gap"), span=((0.4, 0.6), (0.9, 1.1)), steps=3)
    amplitude, gap = found.value.values.T
    size = np.hypot(1 - OMEGA**2, 2 * ZETA * OMEGA)
    np.testing.assert_allclose(amplitude, size * gap, rtol=0, atol=1e-10)
    assert found.parameter.values.tolist() == ["amplitude", "gap"]


def test_the_curve_of_a_limit_of_linear_motion_is_in_closed_form(one_impact_branch):
    # |u| = A / hypot(1 - Omega^2, 2 zeta Omega), and |u'' + G| = |2 zeta u' + u|
    for measure, of_omega in (
        ("storey_drift", lambda omega: 1.0),
        ("floor_acceleration", lambda omega: np.hypot(1.0, 2 * ZETA * omega)),
    ):
        limit = 0.7
        found = curve(*(ONE, one_impact_branch), span=SPAN, steps=20, measure=measure, limit=limit)
        amplitude, omega = found.value.values.T
        expected = limit * np.hypot(1 - omega**2, 2 * ZETA * omega) / of_omega(omega)
        np.testing.assert_allclose(amplitude, expected, rtol=0, atol=1e-9)
        assert (omega.min(), omega.max()) == (1.18, 1.22)
        assert (found.attrs["kind"], found.attrs["limit"]) == (measure, limit)


def test_the_curve_of_a_contact_force_is_where_a_sweep_has_it(one_impact_branch):
    found = curve(
        ONE,
        one_impact_branch,
        span=((0.05, 0.9), (1.19, 1.21)),
        steps=3,
        measure="contact_force",
        limit=8.0,
    )
    for k in (0, -1):
        amplitude, omega = found.value.values[k].tolist()
        path = trajectory(ONE, amplitude, omega, found.point.values[k], 20_001)
        assert BETA * (path[:, 0].max() - 1.0) == pytest.approx(8.0, abs=1e-5)


BAD = {
    "measure": ({"special": None, "measure": "height", "limit": 1}, "measure must be one of drift"),
    "limit": ({"special": None, "measure": "drift"}, "limit must be"),
    "never": (
        {"special": None, "measure": "drift", "limit": 1e3},
        "limit must be between .* and .*, is 1000",
    ),
    "no special point": ({"special": 3}, "special must be one special point of a branch"),
    "parameters": ({"parameters": ("gap", "gap")}, "parameters must be two different ones"),
    "one parameter": ({"parameters": "gap"}, "parameters must be two different ones"),
    "parameter": ({"parameters": ("gap", "mass")}, "parameter must be one of amplitude"),
    "span": ({"span": (0.4, 0.8)}, "span must be two pairs"),
    "elsewhere": ({"span": ((0.1, 0.2), (1.1, 1.3))}, "span must hold amplitude = 0.45"),
}


@together("name", BAD)
def test_bad_arguments_are_told_in_one_line(name, one_impact_branch):
    changes, expected = BAD[name]
    given = {"special": one_impact_branch.isel(special=0), "span": SPAN, **changes}
    if given["special"] is None:
        given["special"] = one_impact_branch
    with pytest.raises(ValueError, match=expected) as raised:
        curve(ONE, **given)
    assert "\n" not in str(raised.value)
