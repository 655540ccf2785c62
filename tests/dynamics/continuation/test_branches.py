"""Orbits and branches of structures: closed forms, published bifurcations, other integrators."""

import numpy as np
import pytest
from one_impact import OneImpact
from together import together

from hpcsweep import Structure, branch, load_job, meanings, orbit, stroboscopic_points
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.branches.variables import End

OMEGA, ZETA, BETA = 1.2, 0.05, 100.0
ONE = Structure(1, BETA, np.inf, ZETA)
CLOSED = OneImpact(ZETA, BETA, OMEGA)
GRAZING = np.hypot(1 - OMEGA**2, 2 * ZETA * OMEGA)
FIGURE_3 = Structure(3)


@pytest.fixture(scope="module")
def one_impact_branch():
    return branch(ONE, 0.5928912, OMEGA, settled(ONE, 0.5928912), 1, span=(1e-3, 0.9))


def kinds_of(found) -> np.ndarray:
    return meanings(found.special_kind).values


def settled(structure, amplitude):
    return stroboscopic_points(structure, amplitude, OMEGA, np.zeros(2), 800)[-1]


@pytest.mark.parametrize("duration", [0.302, 0.306])
def test_an_orbit_of_one_impact_is_that_of_the_closed_form(duration):
    amplitude, z, closing = CLOSED.orbit(duration, 4.1)
    found = orbit(ONE, amplitude, OMEGA, z + 1e-4, 1)
    np.testing.assert_allclose(found.points[0], z, rtol=0, atol=1e-10)
    assert found.residual < 1e-12
    closes, opens = found.signature
    assert (closes.contact, closes.closes, opens.closes) == (1, True, False)
    period = 2 * np.pi / OMEGA
    assert closes.phase == pytest.approx(float(closing) / period % 1.0, abs=1e-7)
    assert opens.phase - closes.phase == pytest.approx(duration / period, abs=1e-7)
    assert np.prod(found.multipliers) == pytest.approx(np.exp(-2 * ZETA * period), rel=1e-10)


def test_the_branch_of_one_impact_its_folds_and_its_grazing(one_impact_branch):
    found = one_impact_branch
    assert kinds_of(found).tolist() == ["grazing", "fold", "fold"]
    at = found.special_value.values
    assert at[0] == pytest.approx(GRAZING, abs=1e-10)
    assert at[2] == pytest.approx(CLOSED.fold(0.2864, 0.2874, 5.13), abs=1e-10)
    assert found.attrs["begins"] == found.attrs["ends"] == "end of the span"
    assert abs(found.contact_change.values[0]).tolist() == [1]
    # an orbit without contact is linear: A = GRAZING |u|
    free = found.isel(step=found.contact.values == 0)
    size = free.point.values / free.value.values[:, None]
    np.testing.assert_allclose(size, np.tile(size[0], (len(size), 1)), rtol=0, atol=1e-10)
    # stable, unstable past the fold beside the grazing, stable again
    folds = found.special_step.values[1:]
    turns = np.flatnonzero(np.diff(found.stable.values.astype(int)))
    assert len(turns) == 2
    assert np.abs(turns - folds).max() <= 1


def test_points_of_a_branch_are_orbits_of_the_closed_form(one_impact_branch):
    found = one_impact_branch
    for duration in (0.302, 0.308):
        amplitude, z, _ = CLOSED.orbit(duration, 4.1)
        again = branch(ONE, amplitude, OMEGA, z, 1, span=(1e-3, 0.9), steps=1)
        np.testing.assert_allclose(again.point.values[1], z, rtol=0, atol=1e-10)
        near = np.abs(found.value.values - amplitude) + np.abs(found.point.values - z).sum(1)
        assert near.min() < 0.1


@pytest.fixture(scope="module")
def two_masses():
    structure = load_job("jobs/structures/two-masses.toml").structure
    z = np.zeros(4)
    for amplitude in np.arange(0.4, 0.099, -0.02):
        z = stroboscopic_points(structure, amplitude, 0.7, z, 200)[-1]
    return structure, z


def test_a_published_doubling_of_two_masses(two_masses):
    found = branch(two_masses[0], 0.1, 0.7, two_masses[1], 1, "omega", (0.695, 0.742))
    assert kinds_of(found).tolist() == ["doubling"]
    assert found.special_value.values == pytest.approx([0.738783], abs=1e-6)


@pytest.mark.slow
def test_published_bifurcations_of_two_masses(two_masses):
    # third example of NLvib; torus and doublings by harmonic balance, grazings in closed form
    structure, z = two_masses
    found = branch(structure, 0.1, 0.7, z, 1, "omega", span=(0.58, 0.76), largest_step=0.1)
    kinds, values = kinds_of(found), found.special_value.values
    expected = {"torus": [0.618607], "doubling": [0.738783, 0.755586]}
    for kind, at in expected.items():
        nearest = [np.abs(values[kinds == kind] - one).min() for one in at]
        assert max(nearest) < 1e-6
    grazings = np.sort(values[kinds == "grazing"])
    expected = [0.581899639039312, 0.653440140416260]
    np.testing.assert_allclose(grazings, expected, rtol=0, atol=1e-10)


def test_a_subcritical_doubling_of_figure_3_is_seen_by_integration():
    z = np.zeros(6)
    for amplitude in np.arange(0.25, 0.119, -0.01):
        z = stroboscopic_points(FIGURE_3, amplitude, 0.445, z, 200)[-1]
    found = branch(FIGURE_3, 0.12, 0.445, z, 1, span=(0.105, 0.121))
    assert kinds_of(found).tolist() == ["doubling"]
    at, there = found.special_value.item(), found.special_point.values[0]
    assert at == pytest.approx(0.1114496582, abs=1e-9)
    assert found.criticality.values.tolist() == [-1]

    def end(amplitude, start):
        return stroboscopic_points(FIGURE_3, amplitude, 0.445, start, 3000)[-1]

    # stable above, unstable below; above it an orbit of twice the period, unstable, is near
    assert np.abs(end(at + 1e-4, there) - there).max() < 1e-3
    assert np.abs(end(at - 1e-4, there) - there).max() > 0.01
    leaving = orbit(FIGURE_3, found.leaving_value.item(), 0.445, found.leaving.values[0], 2)
    assert found.leaving_value.item() > at
    assert not leaving.stable
    assert np.abs(leaving.points[0] - leaving.points[1]).max() > 1e-4


@pytest.mark.parametrize("sharpness", [np.inf, 1e6])
def test_a_branch_passes_the_grazings_of_sharp_stops_from_either_side(sharpness):
    structure = Structure(3, sharpness=sharpness)
    found = []
    for amplitude in (0.01, 0.05):  # below and above the first contact
        z = stroboscopic_points(structure, amplitude, 0.445, np.zeros(6), 1000)[-1]
        found.append(branch(structure, amplitude, 0.445, z, 1, span=(0.005, 0.25)))
    below, above = found
    for one in found:
        assert one.attrs["begins"] == one.attrs["ends"] == "end of the span"
    grazing = below.special_value.values[0]
    assert kinds_of(below)[0] == "grazing"
    if sharpness == np.inf:
        exact = structure.grazing_amplitude(0.445)
        assert grazing == pytest.approx(exact, abs=1e-12)
    assert kinds_of(below).tolist() == kinds_of(above).tolist()
    np.testing.assert_allclose(below.special_value, above.special_value, rtol=0, atol=1e-10)
    assert np.count_nonzero(kinds_of(below) == "fold") == 4


@pytest.mark.parametrize("stiffness", [29.0, 1e5])
def test_a_branch_that_ends_at_a_grazing_says_so(stiffness):
    structure, omega = Structure(1, stiffness, np.inf, 0.01, gap=1.26), 0.801
    grazing = structure.grazing_amplitude(omega)
    z = stroboscopic_points(structure, 0.5 * grazing, omega, np.zeros(2), 3000)[-1]
    found = branch(structure, 0.5 * grazing, omega, z, 1, span=(0.1 * grazing, 1.2 * grazing))
    assert found.attrs["begins"] == "end of the span"
    if stiffness < 1e3:  # it goes on past the grazing
        assert found.attrs["ends"] == "end of the span"
        assert found.special_value.values[0] == pytest.approx(grazing, abs=1e-10)
    else:
        assert found.attrs["ends"] == End.GRAZING.name.lower()  # which files of studies hold, too
        assert found.value.values[-1] == pytest.approx(grazing, abs=1e-7)
    again = branch(structure, 0.5 * grazing, omega, z, 5, span=(0.1 * grazing, 0.9 * grazing))
    assert (again.attrs["period"], again.sizes["turn"]) == (1, 1)  # its minimal period


@pytest.mark.slow
def test_a_branch_does_not_jump_where_a_multiplier_has_a_pole():
    # a soft stop pulls before it pushes: motions that dwell there repel by 1e6 a period
    structure = Structure(3, sharpness=1e3)
    z = stroboscopic_points(structure, 0.01, 0.445, np.zeros(6), 1000)[-1]
    found = branch(structure, 0.01, 0.445, z, 1, span=(0.005, 0.25), steps=2000)
    largest = found.multiplier.values[:, 0]
    assert np.abs(largest).max() > 1e5
    assert largest.real[np.abs(largest) > 100].max() < 0
    assert found.attrs["ends"] == "not followed on"


def test_a_branch_does_not_jump_to_its_own_other_side():
    # with the damping as described both sides of a fold at 0.16763 come near each other before it
    structure = load_job("jobs/paper/figure3-described.toml").structure
    z = stroboscopic_points(structure, 0.035, 0.445, np.zeros(6), 2000)[-1]
    z = stroboscopic_points(structure, 0.0355, 0.445, z, 500)[-1]
    found = branch(structure, 0.0355, 0.445, z, 1, span=(0.035, 0.25), steps=2000)
    assert found.value.values[[0, -1]].tolist() == [0.035, 0.25]
    kinds = kinds_of(found).tolist()
    assert kinds.count("branch point") == 0
    assert len(kinds) == 42
    assert kinds.count("doubling") == 12
    # one step from a doubling and from a fold, as they are with steps of a tenth
    tori = found.special_value.values[kinds_of(found) == "torus"]
    for at in (0.135924374776, 0.170242128620):
        assert np.abs(tori - at).min() < 1e-10


def test_derivatives_by_parameters():
    z = np.array([0.207, 0.236, 0.482, -0.562, -0.234, -0.139])
    forced = ForcedMap(FIGURE_3, 0.06, 0.445)
    # differences of the period map of another solver, over a wider step
    solver, h = make_solver("bdf", FIGURE_3, 0.445, 1e-10), 2e-5
    high, low = (solver.advance(z, 0.06 + side, 1).state for side in (h, -h))
    _, _, slopes = forced.tangents(z[None], 0.06, by=1)
    np.testing.assert_allclose(slopes[0, :, 0], (high - low) / (2 * h), rtol=0, atol=1e-3)


def test_a_branch_goes_along_any_number_of_a_structure(one_impact_branch):
    del one_impact_branch
    z = settled(ONE, 0.6)
    for parameter, value in (("gap", 1.0), ("damping_ratio", ZETA)):
        found = branch(ONE, 0.6, OMEGA, z, 1, parameter, (0.98 * value, 1.02 * value), steps=3)
        assert found.attrs["parameter"] == parameter
        end = found.isel(step=0)
        changed = {"gap": 1.0, "stiffness_ratio": BETA, "damping_ratio": ZETA}
        changed[parameter] = float(end.value)
        moved = Structure(1, sharpness=np.inf, **changed)
        there = orbit(moved, 0.6, OMEGA, end.point.values, 1)
        np.testing.assert_allclose(there.points[0], end.point.values, rtol=0, atol=1e-10)


BAD = {
    "period": ({"period": 0}, "period"),
    "state": ({"state": [0.0]}, "state"),
    "elsewhere": ({"state": [0.9, 2.0]}, "no orbit of period 1"),
    "parameter": ({"parameter": "mass"}, "parameter must be one of amplitude"),
    "span": ({"span": (0.7, 0.9)}, "span must hold amplitude = 0.6"),
}


@together("name", BAD)
def test_a_bad_start_is_told_in_one_line(name):
    changes, expected = BAD[name]
    given = {"state": settled(ONE, 0.6), "period": 1, **changes}
    with pytest.raises((ValueError, ArithmeticError), match=expected) as raised:
        branch(ONE, 0.6, OMEGA, **given)
    assert "\n" not in str(raised.value)


def test_the_closings_of_an_unstable_orbit_are_counted_on_it():
    # a P8 that errors leave by a factor of 2e12: one motion of 8 periods closes (8, 7, 13) times
    structure = load_job("jobs/paper/figure3-described.toml").structure
    z = np.array([-0.4381586532696103, -0.12981894730389607, 1.000539807472604] + [0.0] * 3)
    z[3:] = -0.4948446245200967, -0.3079619444343885, 0.16597709445722805
    found = orbit(structure, 0.1442077035710309, 0.445, z, 8)
    assert abs(found.multipliers[0]) > 1e11
    closings = [one.contact for one in found.signature if one.closes]  # by another integrator
    forced = ForcedMap(structure, 0.1442077035710309, 0.445)
    seen = forced.signature(found.points / forced.units, forced.amplitude)
    assert seen == tuple(closings.count(k) for k in (1, 2, 3))
