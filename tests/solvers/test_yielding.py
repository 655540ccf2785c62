"""Structures whose sliders slip, under records: closed forms and an independent reference."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from together import together
from yielding import SmoothYielding, Yielding

import hpcsweep
from hpcsweep.model.kernel_model import record_model
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.state.shared import new_shared
from hpcsweep.solvers.instants import InstantMap
from hpcsweep.solvers.sliders import Sliders


def bilinear_storeys(n, rng, hardening, contacts=()):
    """Return storeys in parallel with sliders that slip at a drift of 0.3, and their reference."""
    steps = np.eye(n) - np.eye(n, k=-1)
    k0 = rng.uniform(2.0, 8.0, n)
    mass, initial = np.diag(rng.uniform(0.5, 2.0, n)), (steps.T * k0) @ steps
    spring = (1.0 - hardening) * k0
    sliders = [
        hpcsweep.Slider(row, k, 0.3 * k) for row, k in zip(steps.tolist(), spring, strict=True)
    ]
    damping = 0.05 * initial
    structure = hpcsweep.Structure.from_matrices(
        mass, hardening * initial, contacts, damping=damping, sliders=sliders
    )
    return structure, Yielding(mass, hardening * initial, damping, contacts, sliders)


def same(response, reference, end, tolerance=1e-12):
    """Assert that a response is that of the reference."""
    size = max(1.0, np.abs(end).max())
    np.testing.assert_allclose(response.final_state, end, rtol=0, atol=tolerance * size)
    np.testing.assert_allclose(response.plastic, reference.plastic, rtol=0, atol=tolerance * size)
    np.testing.assert_allclose(
        response.plastic_path, reference.path, rtol=tolerance, atol=tolerance
    )
    np.testing.assert_array_equal(response.excursions, reference.excursions)
    yielded = reference.strength / reference.spring
    np.testing.assert_allclose(response.ductility, reference.elongation / yielded, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_storeys_move_as_the_reference(seed):
    rng = np.random.default_rng(seed)
    n, hardening = int(rng.integers(1, 5)), float(rng.choice([0.0, 0.02, 0.3]))
    stop = hpcsweep.Contact([0.0] * (n - 1) + [1.0], 0.8, 50.0)
    structure, reference = bilinear_storeys(n, rng, hardening, contacts=[stop] * (seed % 2))
    record = hpcsweep.Record(rng.standard_normal(30) * rng.uniform(2.0, 8.0), dt=0.1)
    end = reference.run(record.acceleration, record.dt)
    found = hpcsweep.response(structure, record)
    same(found, reference, end)
    np.testing.assert_allclose(found.slider_energy, reference.strength * found.plastic_path)


@pytest.mark.parametrize(
    ("seed", "sharpness"),
    [
        (3, 3.0),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((0, 20.0), (1, 400.0), (2, 1e4))),
    ],
)
def test_storeys_that_yield_beside_smooth_stops_move_as_the_reference(seed, sharpness):
    """Three storeys between soft and hard stops, one slider in a layer at a time or several."""
    rng = np.random.default_rng(seed)
    contacts = [
        hpcsweep.Contact((0.0, 0.0, 1.0), 0.3, 60.0),
        hpcsweep.Contact((0.0, -1.0, 0.0), 0.2, 15.0),
        hpcsweep.Contact((1.0, 0.0, -1.0), 0.4, 30.0),
    ]
    sharp, reference = bilinear_storeys(3, rng, 0.05, contacts=contacts)
    structure = replace(sharp, sharpness=sharpness)
    given = *(np.linalg.inv(reference.matrices[0]), *reference.matrices[1:]), contacts
    reference = SmoothYielding(sharpness, *given, sharp.sliders)
    record = hpcsweep.Record(rng.standard_normal(30) * 8.0, dt=0.2)
    end = reference.run(record.acceleration, record.dt)
    found = hpcsweep.response(structure, record, energy=True)
    same(found, reference, end, 1e-10)
    assert found.excursions.min() > 0
    assert found.excursions.sum() > 6
    assert found.impacts.sum() > 3
    assert abs(found.energy.balance) < 1e-12
    assert min(found.energy.input, found.energy.sliders, found.energy.viscous) > 0.0
    # within layers, where the peaks are, and at the samples
    for name in ("drift", "floor_acceleration", "force"):
        sampled = getattr(hpcsweep.response(structure, record, at_samples=True), name)
        assert (sampled <= getattr(found, name) * (1 + 1e-12)).all()
        assert (sampled > 0.2 * getattr(found, name)).all()


def test_a_slider_that_slips_in_a_layer_of_any_width_has_its_closed_form():
    """Behind a stop without sharpness, half a spring, all is within the layer, and linear.

    So the mass is that of the oscillator on a slider k beside a spring kappa / 2 that is at rest at
    the gap, from which it is pulled.
    """
    slider = hpcsweep.Slider((1.0,), 3.0, 0.2)
    stop = hpcsweep.Contact((1.0,), 0.0, 2.0)
    record = hpcsweep.Record([-1.0, 0.5, -0.3, 2.0, 0.0, 0.0], dt=0.7)
    given = {"damping": [[0.1]], "sliders": [slider]}
    smooth = hpcsweep.Structure.from_matrices([1.0], [[0.5]], [stop], sharpness=0.0, **given)
    linear = hpcsweep.Structure.from_matrices([1.0], [[1.5]], [], **given)
    one, two = (hpcsweep.response(of, record, 0.9, energy=True) for of in (smooth, linear))
    assert two.excursions[0] > 1
    for name in ("final_state", "plastic", "plastic_path", "excursions", "displacement"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=1e-13)
    np.testing.assert_allclose(one.energy, two.energy, rtol=0, atol=1e-13)


@pytest.mark.parametrize("sharpness", [0.0, 4.0, 1e3, math.inf])
def test_the_energy_of_a_contact_is_the_integral_of_its_force(sharpness):
    stop = hpcsweep.Contact((1.0,), 0.1, 7.0)
    structure = hpcsweep.Structure.from_matrices([1.0], [[1.0]], [stop], sharpness=sharpness)
    ends = np.array([-0.3, 0.102, 0.4])
    held = [structure.contact_energy(np.array([u])) for u in ends]
    for a, b, first, last in zip(ends[:-1], ends[1:], held[:-1], held[1:], strict=True):
        nodes, weights = np.polynomial.legendre.leggauss(600)
        u = a + 0.5 * (b - a) * (nodes + 1.0)
        force = structure.contact_forces(np.stack((u, 0.0 * u), 1))[:, 0]
        assert last - first == pytest.approx(0.5 * (b - a) * weights @ force, rel=1e-5, abs=5e-9)


@pytest.mark.parametrize("dt", [0.1, 2.5])
def test_sets_without_a_table_move_as_the_reference(dt):
    """More sliders than all of whose sets have tables; in long intervals the series are halved."""
    rng = np.random.default_rng(7)
    stop = hpcsweep.Contact([0.0] * 7 + [1.0], 0.8, 50.0)
    structure, reference = bilinear_storeys(8, rng, 0.05, contacts=[stop])
    record = hpcsweep.Record(rng.standard_normal(30) * 4.0, dt=dt)
    end = reference.run(record.acceleration, dt)
    found = hpcsweep.response(structure, record)
    same(found, reference, end)
    assert (found.excursions > 0).sum() > 4
    sampled = hpcsweep.response(structure, record, at_samples=True)
    np.testing.assert_array_equal(sampled.final_state, found.final_state)
    assert (sampled.floor_acceleration <= found.floor_acceleration * (1 + 1e-12)).all()
    assert (sampled.floor_acceleration > 0.3 * found.floor_acceleration).all()


@pytest.mark.parametrize("n", [1, 8, 11])
def test_peaks_of_storeys_that_all_yield_are_those_beside_one_that_does_not(n):
    """Where all yield their drifts are proved to stay below their peaks at once."""
    rng = np.random.default_rng(n)
    record = hpcsweep.Record(rng.standard_normal(200) * 4.0, dt=0.1)
    given = {"storey_stiffness": rng.uniform(10.0, 40.0, n).tolist(), "hardening": 0.05}
    building = hpcsweep.Building(mass=[1.0] * n, yield_drift=0.2, collapse_drift=1e3, **given)
    far = hpcsweep.adjacent([building, hpcsweep.Building(mass=1.0)], gap=1e6, stiffness=1.0)
    structures = (building.structure, far)
    drifts = [record_model(one, record.dt).elements.drifts for one in structures]
    assert drifts == [n, -1]
    one, two = (hpcsweep.response(structure, record) for structure in structures)
    assert one.excursions.max() > 5
    for name in ("drift", "floor_acceleration", "ductility"):
        np.testing.assert_allclose(getattr(two, name)[:n], getattr(one, name), rtol=1e-11)


def test_springs_and_sliders_between_any_coordinates_move_as_the_reference():
    """Two of unlike directions, one row with two sliders, and a damper without a spring beside."""
    rng = np.random.default_rng(5)
    mass = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.5]])
    stiffness = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.5]])
    sliders = [
        hpcsweep.Slider((0.0, 0.0, -1.0), 4.0, 0.5),
        hpcsweep.Slider((0.0, 0.0, 1.0), 2.0, 1.0),
        hpcsweep.Slider((0.5, 1.0, -2.0), 3.0, 0.7, name="brace"),
    ]
    contacts = [hpcsweep.Contact((1.0, -1.0, 0.0), 0.05, 40.0)]
    damping = 0.02 * stiffness
    structure = hpcsweep.Structure.from_matrices(
        mass, stiffness, contacts, damping=damping, sliders=sliders
    )
    reference = Yielding(mass, stiffness, damping, contacts, sliders)
    samples = rng.standard_normal(40) * 3.0
    # a ground motion acts along M 1
    reference.matrices = (np.linalg.inv(mass), stiffness, damping)
    end = reference.run(samples, 0.15)
    found = hpcsweep.response(structure, hpcsweep.Record(samples, dt=0.15))
    same(found, reference, end)
    assert found.excursions.min() > 0
    assert found.impacts[0] > 0


def oscillator(strength, hardening=0.0, damping=0.0):
    """Return a mass 1 on a spring of initial stiffness 1 that yields."""
    slider = hpcsweep.Slider((1.0,), 1.0 - hardening, (1.0 - hardening) * strength)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[hardening]], [], damping=[[damping]], sliders=[slider]
    )


def test_an_elastoplastic_oscillator_under_a_sudden_force_has_its_closed_form():
    """u = q (1 - cos t) up to u = f, then u'' = q - f until u' = 0, for f < 2 q.

    It slips from t1, cos t1 = 1 - f / q, with the speed v = q sin t1, for v / (f - q) by v^2 / 2 (f
    - q), f > q.
    """
    q, f = 1.0, 1.2
    t1 = math.acos(1.0 - f / q)
    v = q * math.sin(t1)
    duration, way = v / (f - q), 0.5 * v * v / (f - q)
    record = hpcsweep.Record([-q, -q], dt=t1 + duration + 1.0)
    found = hpcsweep.response(oscillator(f), record)
    assert found.plastic[0] == pytest.approx(way, rel=1e-14)
    assert found.ductility[0] == pytest.approx((f + way) / f, rel=1e-14)
    assert found.displacement_time[0] == pytest.approx(t1 + duration, rel=1e-12)
    assert found.slider_force[0] == f
    assert found.excursions[0] == 1
    assert found.slider_energy[0] == pytest.approx(f * way, rel=1e-14)
    assert found.residual_displacement[0] == pytest.approx(way, rel=1e-14)
    # then it swings about p + q, from p + f at rest
    at_end = way + q + (f - q) * math.cos(1.0)
    assert found.final_state[0] == pytest.approx(at_end, rel=1e-13)


def test_energy_of_an_undamped_oscillator_balances():
    """Under a constant force q the work q u is kinetic, strain and slider energy."""
    q, f, hardening = 1.0, 0.9, 0.2
    structure = oscillator(f, hardening)
    found = hpcsweep.response(structure, hpcsweep.Record([-q, -q], dt=20.0))
    u, v = found.final_state
    k = 1.0 - hardening
    spring = k * (u - found.plastic[0])
    stored = 0.5 * v * v + 0.5 * hardening * u * u + 0.5 * spring**2 / k
    assert stored + found.slider_energy[0] == pytest.approx(q * u, rel=1e-13)
    assert found.excursions[0] == 1


def test_a_stiff_slider_is_a_block_on_friction():
    """Newmark's block: under a pulse a it slides by v^2 (1 / g - 1 / a) / 2, v = a t, g = F / m."""
    a, t, g = 3.0, 0.5, 1.0
    slider = hpcsweep.Slider((1.0,), 1e8, g)
    structure = hpcsweep.Structure.from_matrices([1.0], [[0.0]], [], sliders=[slider])
    samples = np.r_[np.full(501, -a), np.zeros(2000)]
    found = hpcsweep.response(structure, hpcsweep.Record(samples, dt=t / 500))
    # the ground stops within one sample: a pulse of t and half a sample more
    v = a * (t + 0.5 * t / 500)
    exact = 0.5 * v * v * (1.0 / g - 1.0 / a)
    assert found.plastic[0] == pytest.approx(exact, rel=2e-3)
    assert found.excursions[0] == 1


def test_below_its_strength_a_slider_is_a_spring():
    rng = np.random.default_rng(2)
    record = hpcsweep.Record(rng.standard_normal(200), dt=0.1)
    yielding, _ = bilinear_storeys(3, np.random.default_rng(3), 0.1)
    elastic = hpcsweep.Structure.from_matrices(
        yielding.mass_matrix,
        yielding.stiffness_matrix,
        [],
        damping=yielding.damping_matrix,
        drift=yielding.drift_rows,
    )
    scale = hpcsweep.first_contact_scale(yielding, record)
    below = hpcsweep.response(yielding, record, 0.999 * scale)
    linear = hpcsweep.response(elastic, record, 0.999 * scale)
    # by series and by tables: to rounding, 200 steps long
    np.testing.assert_allclose(below.final_state, linear.final_state, rtol=0, atol=1e-13)
    np.testing.assert_allclose(below.floor_acceleration, linear.floor_acceleration, rtol=1e-12)
    assert not below.excursions.any()
    assert below.ductility.max() == pytest.approx(0.999, rel=1e-9)
    assert hpcsweep.response(yielding, record, 1.001 * scale).excursions.sum() == 1


def test_a_response_scales_with_its_strengths():
    """From rest all lengths and forces grow with the scale of record and strengths."""
    rng = np.random.default_rng(4)
    record = hpcsweep.Record(rng.standard_normal(100) * 3.0, dt=0.1)
    one = hpcsweep.response(oscillator(1.0, 0.1, 0.05), record)
    two = hpcsweep.response(oscillator(2.0, 0.1, 0.05), record, 2.0)
    assert one.excursions[0] == two.excursions[0] > 0
    np.testing.assert_allclose(two.plastic, 2.0 * one.plastic, rtol=1e-13)
    np.testing.assert_allclose(two.final_state, 2.0 * one.final_state, rtol=1e-12)


def test_continuing_at_samples_and_peaks_at_samples_are_those_of_the_motion():
    rng = np.random.default_rng(6)
    structure, _ = bilinear_storeys(2, rng, 0.1)
    record = hpcsweep.Record(rng.standard_normal(60) * 6.0, dt=0.1)
    whole = hpcsweep.response(structure, record)
    sampled = hpcsweep.response(structure, record, at_samples=True)
    assert whole.excursions.sum() > 0
    np.testing.assert_array_equal(sampled.final_state, whole.final_state)
    np.testing.assert_array_equal(sampled.plastic, whole.plastic)
    assert (sampled.floor_acceleration <= whole.floor_acceleration * (1 + 1e-12)).all()
    assert (sampled.ductility <= whole.ductility * (1 + 1e-12)).all()


def test_storeys_that_yield_are_springs_and_sliders():
    """The same building by its storeys, by its matrices, and beside another one."""
    record = hpcsweep.Record(np.random.default_rng(8).standard_normal(80) * 4.0, dt=0.1)
    given = {"yield_drift": [0.4, math.inf, 0.2], "hardening": 0.05}
    storeys = hpcsweep.Structure(
        3, sharpness=math.inf, storey_stiffness=[4.0, 3.0, 2.0], gap=math.inf, **given
    )
    assert storeys.slider_names == ("1", "3")
    steps = np.eye(3) - np.eye(3, k=-1)
    sliders = [
        hpcsweep.Slider(steps[0], 0.95 * 4.0, 0.95 * 1.6),
        hpcsweep.Slider(steps[2], 0.95 * 2.0, 0.95 * 0.4),
    ]
    matrices = hpcsweep.Structure.from_matrices(
        np.eye(3), storeys.elastic_stiffness, [], damping=storeys.damping_matrix, sliders=sliders
    )
    np.testing.assert_allclose(
        storeys.elastic_stiffness, steps.T @ np.diag([0.2, 3.0, 0.1]) @ steps, atol=1e-15
    )
    one, two = hpcsweep.response(storeys, record), hpcsweep.response(matrices, record)
    assert one.excursions.min() > 0
    np.testing.assert_allclose(one.final_state, two.final_state, rtol=0, atol=1e-13)
    np.testing.assert_allclose(one.plastic, two.plastic, rtol=0, atol=1e-13)
    building = hpcsweep.Building(mass=[1.0] * 3, storey_stiffness=[4.0, 3.0, 2.0], **given)
    far = hpcsweep.adjacent([building, hpcsweep.Building(mass=1.0)], gap=1e6, stiffness=1.0)
    assert far.slider_names == ("A1", "A3")
    np.testing.assert_allclose(
        hpcsweep.response(far, record).plastic, one.plastic, rtol=0, atol=1e-12
    )


def test_the_force_of_a_storey_is_that_at_which_it_yields():
    by_force = hpcsweep.Structure(2, yield_force=0.3, hardening=0.1)
    by_drift = hpcsweep.Structure(2, yield_drift=0.3, hardening=0.1)
    assert by_force.sliders == by_drift.sliders  # of storeys of stiffness 1
    assert by_force.sliders[0].strength == pytest.approx(0.27)
    with pytest.raises(ValueError, match="yield_drift must be a number, is 'soft'"):
        hpcsweep.Structure(2, yield_drift="soft")


WRONG = [
    ({"direction": (0.0, 0.0)}, "slider.direction must not be 0"),
    ({"stiffness": 0.0}, "slider.stiffness must be"),
    ({"strength": -1.0}, "slider.strength must be"),
    ({"strength": math.inf}, "slider.strength must be"),
    ({"name": 3}, "slider.name must be a text"),
    ({"name": "two\nlines"}, "characters that can be printed, is 'two"),
]


@together("wrong, message", WRONG)
def test_wrong_sliders_are_refused(wrong, message):
    given = {"direction": (1.0, 0.0), "stiffness": 1.0, "strength": 1.0}
    with pytest.raises(ValueError, match=message):
        hpcsweep.Slider(**given | wrong)


def test_structures_refuse_what_sliders_cannot_do():
    slider, given = hpcsweep.Slider((1.0,), 1.0, 1.0), ([1.0], [[1.0]])
    with pytest.raises(ValueError, match="slider 1 must have 1 entries, has 2"):
        hpcsweep.Structure.from_matrices(
            *given, [], sliders=[hpcsweep.Slider((1.0, 0.0), 1.0, 1.0)]
        )
    with pytest.raises(ValueError, match="sliders must be at most 64, are 65"):
        hpcsweep.Structure.from_matrices(*given, [], sliders=[slider] * 65)
    with pytest.raises(ValueError, match="must not be negative"):
        hpcsweep.Structure.from_matrices([1.0], [[-2.0]], [], sliders=[slider])
    structure = hpcsweep.Structure.from_matrices(*given, [], sliders=[slider])
    with pytest.raises(ValueError, match="moves under ground-motion records, and under a harmonic"):
        FlowMap(structure, 1.0)


def frame(**given):
    """Return a building of two storeys, of stiffnesses 100 and 80 less P / h of 10 and 4."""
    usual = {"storey_height": [3.0, 2.5], "weight": [20.0, 10.0], "p_delta": True}
    stiffness = {"storey_stiffness": [100.0, 80.0]}
    return hpcsweep.Building([2.0, 1.0], **stiffness, **(usual | given)).structure


def test_weights_take_their_part_of_the_stiffness():
    loads = [10.0, 4.0]
    np.testing.assert_allclose(
        frame().stiffness_matrix, [[166.0, -76.0], [-76.0, 76.0]], rtol=1e-15
    )
    yielding = frame(yield_drift=0.02, hardening=0.05, collapse_drift=0.3)
    steps = np.array([[1.0, 0.0], [-1.0, 1.0]])
    own = np.array([5.0, 4.0]) - loads
    np.testing.assert_allclose(
        yielding.elastic_stiffness, steps.T @ np.diag(own) @ steps, atol=1e-13
    )
    assert [one.limit for one in yielding.sliders] == [0.02, 0.02]
    assert frame(p_delta=False, period=2.0).frequencies[0] == pytest.approx(math.pi)
    assert frame(period=2.0).frequencies[0] < 0.97 * math.pi


def test_a_limit_is_needed_of_storeys_that_soften_alone():
    given = {"yield_drift": 0.1, "hardening": [0.0, 0.5]}  # 0 - 10, and 40 - 4
    assert frame(**given, collapse_drift=[0.3, math.inf]).drift_limits[1] == math.inf
    with pytest.raises(ValueError, match="must be finite for each that softens"):
        frame(**given, collapse_drift=[math.inf, 0.3])


@together(
    "given, message",
    [
        ({"weight": None}, "weight is missing: p_delta needs it"),
        ({"storey_height": None}, "storey_height is missing: p_delta needs it"),
        ({"weight": [20.0, 200.0]}, "p_delta: storey 2 does not stand: .* 80, must be below .* 80"),
        ({"yield_drift": 0.1}, "collapse_drift is missing: the structure softens"),
        ({"collapse_drift": 0.1}, "collapse_drift goes with yield_drift"),
        ({"yield_drift": 0.1, "collapse_drift": 0.0}, r"collapse_drift must be above 0 .* 0\.0"),
        (
            {"yield_drift": 0.1, "collapse_drift": 0.05},
            "collapse_drift must be above the drift at which the storey yields, 0.1, is 0.05",
        ),
        *(
            ({"yield_drift": 0.1, "collapse_drift": limits}, "must be finite for each that softens")
            for limits in ([0.3, math.inf], [math.inf, 0.3], math.inf)
        ),
        ({"yield_drift": 0.1, "hardening": -0.2}, r"hardening must be from -0\.1 to below 1"),
        ({"p_delta": 1}, "p_delta must be true or false, is 1"),
    ],
)
def test_wrong_weights_and_limits_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        frame(**given)


@pytest.mark.parametrize("direction", [(-1.0, 1.0), (1.0, -1.0), (0.5, -0.5)])
def test_a_drift_that_collapses_lies_beyond_that_at_which_it_yields_whatever_its_sign(direction):
    size = abs(direction[0])
    drift = [[1.0, 0.0], [-1.0, 1.0]]
    own = hpcsweep.Slider(direction, 1.0 / size**2, 0.1 / size)
    others = [[1.0, 0.0], [0.0, 1.0]], []

    def made(limit: float) -> hpcsweep.Structure:
        more = {"drift": drift, "sliders": [own], "collapse_drift": [math.inf, limit]}
        return hpcsweep.Structure.from_matrices([1.0, 1.0], *others, **more)

    assert made(0.101).drift_limits[1] == 0.101
    with pytest.raises(ValueError, match="above the drift at which the storey yields"):
        made(0.099)


def test_a_softening_oscillator_collapses_when_its_closed_form_does():
    """From u = f at t1, as above, u'' = w^2 u + e with w^2 = -alpha, e = q - (1 - alpha) f."""
    q, f, alpha, limit = 0.9, 0.8, -0.05, 6.0
    slider = hpcsweep.Slider((1.0,), 1.0 - alpha, (1.0 - alpha) * f)
    structure = hpcsweep.Structure.from_matrices(
        [1.0], [[alpha]], [], sliders=[slider], collapse_drift=limit
    )
    t1, w, e = math.acos(1.0 - f / q), math.sqrt(-alpha), q - (1.0 - alpha) * f
    a, b = f + e / w**2, q * math.sin(t1) / w
    after = brentq(
        lambda t: a * math.cosh(w * t) + b * math.sinh(w * t) - e / w**2 - limit, 0.0, 9.0,
        xtol=1e-15,
    )  # fmt: skip
    record = hpcsweep.Record([-q] * 201, dt=0.1)
    found = hpcsweep.response(structure, record, tail=5.0, base_shear=True)
    plain = hpcsweep.response(structure, record, tail=5.0, base_shear=False)
    assert plain.base_shear.size == 0
    assert plain.collapse_time == pytest.approx(found.collapse_time, rel=1e-14)
    assert found.collapsed
    assert found.collapse_time == found.duration == pytest.approx(t1 + after, rel=1e-14)
    assert found.final_state[0] == pytest.approx(limit, rel=1e-15)
    assert found.drift[0] == pytest.approx(limit, rel=1e-15)
    v2 = w**2 * (limit + e / w**2) ** 2 - w**2 * (a**2 - b**2)
    assert found.final_state[1] == pytest.approx(math.sqrt(v2), rel=1e-13)
    # the drift at yielding has the largest reaction, from then on it falls
    assert found.base_shear[0] == pytest.approx(f, rel=1e-14)
    standing = hpcsweep.response(structure, hpcsweep.Record([-0.3] * 201, dt=0.1))
    assert not standing.collapsed
    assert math.isnan(standing.collapse_time)
    assert standing.duration == 20.0


def test_an_elastoplastic_oscillator_collapses_while_the_ground_pushes_on():
    """Beyond yielding u = f + v t + (q - f) t^2 / 2 runs away for f < q."""
    q, f, limit = 1.0, 0.6, 4.0
    t1 = math.acos(1.0 - f / q)
    v, a = q * math.sin(t1), q - f
    after = (math.sqrt(v * v + 2.0 * a * (limit - f)) - v) / a
    slider = hpcsweep.Slider((1.0,), 1.0, f)
    given = {"sliders": [slider], "collapse_drift": [limit]}
    structure = hpcsweep.Structure.from_matrices([1.0], [[0.0]], [], **given)
    # one sample interval, several, and one whose end is the collapse
    for dt in (50.0, (t1 + after) / 7.0, 0.37):
        record = hpcsweep.Record([-q] * (2 + int(50.0 / dt)), dt=dt)
        found = hpcsweep.response(structure, record)
        assert found.collapse_time == pytest.approx(t1 + after, rel=1e-13)
        assert found.plastic[0] == pytest.approx(limit - f, rel=1e-14)
    motion = hpcsweep.history(structure, record)
    assert len(motion.time) == len(motion.acceleration) == 1 + int((t1 + after) / 0.37)
    free = hpcsweep.response(structure, hpcsweep.Record([-q, -q], dt=0.9 * (t1 + after)))
    assert not free.collapsed


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_frames_with_weights_collapse_as_the_reference(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    stop = hpcsweep.Contact([0.0] * (n - 1) + [1.0], 0.5, 50.0)
    kept, _ = bilinear_storeys(n, rng, 0.02)
    steps = np.eye(n) - np.eye(n, k=-1)
    spent = 0.1 * np.array([one.stiffness for one in kept.sliders])
    stiffness = kept.elastic_stiffness - (steps.T * spent) @ steps
    given = kept.mass_matrix, stiffness
    contacts, damping = [stop] * (seed % 2), kept.damping_matrix
    structure = hpcsweep.Structure.from_matrices(
        *given, contacts, damping=damping, sliders=kept.sliders, drift=steps, collapse_drift=1.5
    )
    limits = [(row, 1.5) for row in steps]
    collapses = 0
    for size in (2.0, 6.0, 20.0):
        reference = Yielding(*given, damping, contacts, kept.sliders, limits)
        record = hpcsweep.Record(rng.standard_normal(25) * size, dt=0.1)
        end = reference.run(record.acceleration, record.dt)
        found = hpcsweep.response(structure, record, energy=True)
        same(found, reference, end)
        np.testing.assert_allclose(found.collapse_time, reference.collapse, rtol=1e-12)
        assert abs(found.energy.balance) < 1e-12
        collapses += found.collapsed
    assert collapses > 0


def test_energies_of_a_pounding_pair_balance():
    """Two buildings with Rayleigh damping that yield and touch, with dashpots and without."""
    rng = np.random.default_rng(9)
    pair = [
        hpcsweep.Building(
            mass=[2.0, 1.5], storey_stiffness=90.0, rayleigh=(0.2, 0.004), yield_drift=0.2
        ),
        hpcsweep.Building(mass=[1.0, 1.0, 1.0], storey_stiffness=50.0, damping_ratio=0.03),
    ]
    record = hpcsweep.Record(rng.standard_normal(80) * 6.0, dt=0.05)
    for restitution in (None, 0.6):
        given = {"gap": [0.05, 0.08], "stiffness": 400.0, "restitution": restitution}
        structure = hpcsweep.adjacent(pair, **given)
        found = hpcsweep.response(structure, record, tail=0.7, base_shear=True, energy=True)
        plain = hpcsweep.response(structure, record, tail=0.7, base_shear=True)
        np.testing.assert_allclose(found.final_state, plain.final_state, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.base_shear, plain.base_shear, rtol=1e-12)
        assert plain.energy is None
        energy = found.energy
        assert found.impacts.sum() > 2
        assert min(energy.kinetic, energy.strain, energy.viscous, energy.sliders) > 0
        assert (energy.contacts > 0) == (restitution is not None)
        assert abs(energy.balance) < 1e-12
        # a third of the work or more is not the same thing counted twice
        assert energy.input > 1.5 * energy.sliders


def test_the_energy_of_free_vibration_is_lost_to_the_dampers():
    structure = oscillator(5.0, damping=0.1)
    record = hpcsweep.Record([0.0, 0.0], dt=4.0)
    found = hpcsweep.response(structure, record, state=[0.5, -1.0], energy=True)
    assert found.energy.input == 0.0
    assert found.energy.viscous == pytest.approx(-found.energy.kinetic - found.energy.strain)
    assert 0.1 < found.energy.viscous < 0.625
    with pytest.raises(ValueError, match="energy and at_samples must not be asked for both"):
        hpcsweep.response(structure, record, energy=True, at_samples=True)


def test_the_base_of_a_rigid_building_feels_mass_times_ground_acceleration():
    mass = [3.0, 2.0, 1.0]
    rigid = hpcsweep.Building(mass, storey_stiffness=1e9, damping_ratio=0.5).structure
    samples = np.sin(0.05 * np.arange(60.0))
    found = hpcsweep.response(rigid, hpcsweep.Record(samples, dt=0.1), base_shear=True)
    assert found.base_shear == pytest.approx(6.0 * samples.max(), rel=1e-4)


def test_base_shears_are_the_largest_reactions_between_all_instants():
    """Of each of two buildings, contact or not, the forces of storey 1 and of the dampers."""
    rng = np.random.default_rng(11)
    pair = [
        hpcsweep.Building([2.0, 1.0], storey_stiffness=90.0, yield_drift=0.1, hardening=0.1),
        hpcsweep.Building([1.0, 1.0, 1.0], storey_stiffness=70.0, damping_ratio=0.02),
    ]
    structure = hpcsweep.adjacent(pair, gap=0.05, stiffness=800.0)
    assert structure.buildings.tolist() == [0, 0, 1, 1, 1]
    assert structure.building_names == ("A", "B")
    on_slab = replace(pair[0], isolation=hpcsweep.Isolation(1.0, period=3.0, strength=0.5))
    beside = hpcsweep.adjacent([on_slab, pair[1]], gap=0.05, stiffness=800.0)
    assert beside.building_names == ("A", "B")
    record = hpcsweep.Record(rng.standard_normal(40) * 6.0, dt=0.1)
    found = hpcsweep.response(structure, record, base_shear=True)
    assert found.impacts.sum() > 2
    assert found.excursions.sum() > 2
    seen = hpcsweep.history(structure, record, step=0.1 / 250)
    forces = seen.displacement @ structure.elastic_stiffness
    forces += seen.velocity @ structure.damping_matrix
    forces += seen.slider_force @ structure.slider_directions
    shear = np.stack([forces[:, :2].sum(axis=1), forces[:, 2:].sum(axis=1)])
    largest = np.abs(shear).max(axis=1)
    assert (largest <= found.base_shear * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(largest, found.base_shear, rtol=2e-5)
    sampled = hpcsweep.response(structure, record, at_samples=True, base_shear=True)
    np.testing.assert_allclose(
        sampled.base_shear, np.abs(shear[:, 250::250]).max(axis=1), rtol=1e-10
    )


def test_a_start_beyond_the_strength_of_a_slider_is_refused():
    slider = hpcsweep.Slider((1.0,), 1.0, 0.5, name="brace")
    structure = hpcsweep.Structure.from_matrices([1.0], [[0.2]], [], sliders=[slider])
    still = hpcsweep.Record([0.0, 0.0], dt=0.1)
    assert hpcsweep.response(structure, still, state=[0.5, 0.0]).excursions == [0]
    with pytest.raises(ValueError, match=r"state: slider brace would be extended by 0\.6, slips"):
        hpcsweep.response(structure, still, state=[0.6, 0.0])
    with pytest.raises(ValueError, match=r"slider\.name must differ, 'brace' is given twice"):
        hpcsweep.Structure.from_matrices([1.0], [[0.2]], [], sliders=[slider, slider])
    with pytest.raises(ValueError, match=r"building\.isolation must not have 'friktion'"):
        hpcsweep.Building(1.0, 1.0, isolation={"slab_mass": 1.0, "friktion": 0.1})


def test_energies_over_time_are_those_of_responses_that_end_there():
    """Their balance closes at each instant, with contacts, dashpots and sliders."""
    yields = hpcsweep.Building([2.5e5] * 2, 1e8, storey_height=3.2, name="A", yield_drift=5e-3)
    tall = hpcsweep.Building([2.5e5] * 3, 1e8, storey_height=3.2, name="B")
    structure = hpcsweep.adjacent([yields, tall], gap=0.01, stiffness=2e9, restitution=0.65)
    record = hpcsweep.synthetic_records(1, seed=1, dt=0.02, duration=8.0)[0]
    samples = record.acceleration.copy()
    found = InstantMap(structure, record.dt, energy=True).energies(samples, 3.0, 420)
    assert len(found) == 421  # with a tail
    assert max(abs(one.balance) for one in found) < 1e-12
    for j in (130, 300):
        cut = hpcsweep.Record(samples[: j + 1], record.dt)
        expected = hpcsweep.response(structure, cut, 3.0, energy=True).energy
        assert min(expected[3:]) > 0.0
        np.testing.assert_allclose(found[j], expected, rtol=0, atol=1e-12 * max(expected))


@pytest.mark.parametrize(("far", "counts"), [(0.0, True), (1e4, False)])
def test_a_slip_counts_that_is_more_than_the_rounding_of_the_displacements(far, counts):
    """An elongation of 1 + 1e-12 of one that slips at 1, its ends at 0 or far away."""
    slider = hpcsweep.Slider((-1.0, 1.0), 1.0, 1.0)
    structure = hpcsweep.Structure.from_matrices(
        [1.0, 1.0], [[1.0, 0.0], [0.0, 0.0]], [], sliders=[slider]
    )
    model = record_model(structure, 0.1)
    shared, sliders = new_shared(model, 1e-9, 1), Sliders(structure, model.elements)
    modes = shared.modes._replace(mode=np.array([1]), state=np.zeros(1))
    z = np.array([far, far + 1.0 + 1e-12, 0.0, 0.0]) / structure.length_unit
    assert sliders.slips(z, modes).tolist() == [counts]
    z[1] += 1e-6
    assert sliders.slips(z, modes).all()
    assert sliders.force(z, modes.mode, modes.state) == pytest.approx([1.0], rel=1e-14)
