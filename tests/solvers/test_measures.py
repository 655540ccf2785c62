"""Measures of storeys, floors and contacts: both solvers, the closed form, the reference."""

import math

import numpy as np
import pytest
from general import random_general_cases
from measures import compare
from reference import reference_points
from scipy.special import expit
from tools import SMALL

from hpcsweep import Contact, open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.summary import summarize
from hpcsweep.job import parse_job
from hpcsweep.model.observed import ACCELERATION, ANY_PEAK, IMPACT, PEAKS
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.guard.extremum import SAME_PEAK
from hpcsweep.solvers.linear import LinearOrbit
from hpcsweep.studies.quantities import CONTACT_MEASURES, MEASURES

ALL = ANY_PEAK + IMPACT
OF_SPRINGS = [name for name in CONTACT_MEASURES if name != "simultaneous"]
OUTPUT = "".join(f"{name} = true\n" for name in MEASURES)
SI = {"mass": (2e5, 1e5), "storey_stiffness": (3e7, 2e7), "gap": 0.02}
CASES = [
    (Structure(3, 300.0, 1e4), 0.2, 0.445),
    (Structure(2, 50.0, 40.0), 0.4, 0.7),
    (Structure(2, 300.0, math.inf, gap=0.4, gap_left=0.6), 0.3, 0.6),
    (
        Structure(2, 20.0, 2e3, 0.03, mass=(2e5, 1e5), storey_stiffness=(3e7, 2e7), gap=0.02),
        3.0,
        7.0,
    ),
]


def start_of(structure) -> np.ndarray:
    n = structure.n_floors
    return np.concatenate((np.full(n, 0.6), np.full(n, 0.4))) * structure.state_units


def sampled(structure, amplitude, omega, z, n_periods) -> np.ndarray:
    """Peaks of the independent reference, at many times: a little too low."""
    rows = np.concatenate((structure.drift_rows, np.eye(structure.n_floors)))
    gaps = [contact.gap for contact in structure.contacts]
    n, parts = structure.n_floors, 8000
    highest = np.zeros(len(rows) + n + len(gaps))
    period = 2 * math.pi / omega
    for _ in range(n_periods):
        states = reference_at(structure, amplitude, omega, z, period, parts)
        u, pushed = states[:, :n], absolute_accelerations(structure, states)
        past = u @ structure.directions.T - gaps
        own = np.concatenate((np.abs(u @ rows.T), np.abs(pushed), past), axis=1)
        highest = np.maximum(highest, own.max(axis=0))
        z = reference_points(structure, amplitude, omega, z, 1)[-1]
    return highest


def absolute_accelerations(structure, states) -> np.ndarray:
    """What springs, dampers and contacts do to the floors, per mass."""
    n = structure.n_floors
    u, v = states[:, :n], states[:, n:]
    force = -u @ structure.stiffness_matrix - v @ structure.damping_matrix
    for contact, d in zip(structure.contacts, structure.directions, strict=True):
        x = u @ d - contact.gap
        share = (x > 0) if structure.sharpness == math.inf else expit(structure.sharpness * x)
        force -= np.outer(contact.stiffness * share * x, d)
    return np.linalg.solve(structure.mass_matrix, force.T).T


def reference_at(structure, amplitude, omega, z, period, parts) -> np.ndarray:
    """States within a period, by an explicit method of high order with small steps."""
    from scipy.integrate import solve_ivp

    from hpcsweep.model.equations import MODEL, derivative
    from hpcsweep.model.kernel_model import kernel_model
    from hpcsweep.model.units import Units

    model = kernel_model(structure, omega)
    packed, units = MODEL.pack(model), Units(structure, model)
    size = amplitude / units.amplitude_unit
    times = np.linspace(0.0, model.period, parts + 1)
    done = solve_ivp(
        lambda t, y: derivative(t, y, size, packed),
        (0.0, model.period),
        units.into(z),
        "DOP853",
        times,
        rtol=1e-10,
        atol=1e-12,
        max_step=model.period / 2000,
    )
    assert period == pytest.approx(model.period / structure.frequency_unit)
    return units.out_of(done.y.T)


@pytest.mark.parametrize(
    ("structure", "amplitude", "omega"),
    [CASES[0], *(pytest.param(*case, marks=pytest.mark.slow) for case in CASES[1:])],
)
def test_peaks_are_those_of_the_motion(structure, amplitude, omega):
    z = start_of(structure)
    flow = FlowMap(structure, omega)
    seen = flow.observe(z, amplitude, 2, measures=ALL)
    assert seen.contact
    n_drifts = len(structure.drift_rows)
    assert seen.measures.storey_drift.max() == pytest.approx(seen.peak_drift, rel=1e-11)
    low = sampled(structure, amplitude, omega, z, 2)
    n = structure.n_floors
    parts = [getattr(seen.measures, quantity.name) for quantity in PEAKS]
    low = np.split(low, np.cumsum([n_drifts, n, n]))
    low[-1] = structure.switched(structure.force_per_length * low[-1], low[-1])
    # a sample misses the top by (spacing)^2 / 8 of the curvature at most
    for one, other in zip(parts, low, strict=True):
        scale = np.abs(other).max()
        assert np.all(one >= other - 1e-9 * scale)
        assert np.all(one <= other + 2e-3 * scale)
    plain = flow.observe(z, amplitude, 2)
    assert plain.measures is None
    for quantity, values in zip(PEAKS, parts, strict=True):
        some = flow.observe(z, amplitude, 2, measures=quantity.flag).measures
        np.testing.assert_array_equal(getattr(some, quantity.name), values)
    np.testing.assert_array_equal(plain.points, seen.points)
    assert plain.peak_drift == pytest.approx(seen.peak_drift, rel=SAME_PEAK)
    bdf = BdfMap(structure, omega, 1e-9).observe(z, amplitude, 2, measures=ALL)
    for name, values in vars(seen.measures).items():
        scale = 1e-5 * np.abs(values).max()
        np.testing.assert_allclose(getattr(bdf.measures, name), values, rtol=3e-4, atol=scale)


LONG_STEPS = (71, 102, 144, 166, 316, 438, 620, 729, 733, 775, 818, 844, 850, 962, 998)
"""Cases whose layer steps, planned for the motion alone, are too long for its measures."""


@pytest.mark.slow
def test_measures_of_random_structures():
    """Closings are equal, all else is right over the conditioning; the whole: docs/reliability."""
    chosen = [case for case in random_general_cases(1000, seed=0) if case.number in LONG_STEPS]
    found = [compare(case) for case in (*chosen, *random_general_cases(30, seed=1))]
    assert None not in found
    assert not any(counts is False for _, _, counts in found)
    scaled = np.array([one for _, one, _ in found])
    assert len(scaled) == len(LONG_STEPS) + 30
    assert np.quantile(scaled, 0.9, axis=0).max() < 1e-11
    assert scaled.max() < 1e-9


def test_a_window_does_not_depend_on_those_before():
    structure, amplitude, omega = CASES[0]
    z = np.array([0.2, 0.5, 0.9, 1.0, -2.0, 3.0])
    flow = FlowMap(structure, omega)
    first = flow.observe(z, amplitude, 1, measures=ALL).measures
    own = absolute_accelerations(structure, z[None])[0]
    assert np.all(first.floor_acceleration >= np.abs(own))
    flow.observe(start_of(structure), amplitude, 2, measures=ALL)
    again = flow.observe(z, amplitude, 1, measures=ALL).measures
    for name, values in vars(first).items():
        np.testing.assert_array_equal(getattr(again, name), values)


@pytest.mark.parametrize("sharpness", [pytest.param(2e3, marks=pytest.mark.slow), math.inf])
def test_forces_on_a_structure_at_rest_leave_its_own_accelerations(sharpness):
    stiffness, forcing = np.array([[3.0, -1.0], [-1.0, 2.0]]), [0.0, 1.0]
    contacts = [Contact((1.0, -1.0), 0.3, 200.0)]
    given = {"damping_ratio": 0.02, "sharpness": sharpness}
    forced = Structure.from_matrices([1, 2], stiffness, contacts, forcing=forcing, **given)
    shaken = Structure.from_matrices([1, 2], stiffness, contacts, **given)
    assert shaken.shakes
    assert not forced.shakes
    again = Structure.from_matrices([1, 2], stiffness, contacts, forcing=[-1, -2], **given)
    start, found = np.array([0.3, -0.1, 0.2, 0.5]), {}
    for name, structure in (("forced", forced), ("shaken", shaken), ("again", again)):
        flow = FlowMap(structure, 0.8)
        seen = flow.observe(start, 0.4, 1, measures=ACCELERATION)
        found[name] = seen.measures.floor_acceleration
        states = reference_at(structure, 0.4, 0.8, start, 2 * math.pi / 0.8, 4000)
        own = absolute_accelerations(structure, states)
        if name == "forced":
            times = np.linspace(0.0, 2 * math.pi, len(states))
            own += 0.4 * np.outer(np.sin(times), [0.0, 0.5])
        # samples miss the top, as above
        np.testing.assert_allclose(found[name], np.abs(own).max(axis=0), rtol=3e-4)
    np.testing.assert_array_equal(found["again"], found["shaken"])
    free = forced.without_contacts()
    orbit = LinearOrbit(free, 0.8)
    seen = FlowMap(free, 0.8).observe(orbit.state(0.4), 0.4, 1, measures=ALL)
    same(orbit.measures(0.4), seen.measures)


def same(one, other):
    """Check that measures are equal."""
    for name, values in vars(one).items():
        np.testing.assert_allclose(values, getattr(other, name), rtol=1e-9)


def test_free_motions_have_theirs_in_closed_form():
    structure = Structure(3, 300.0)
    orbit = LinearOrbit(structure, 0.7)
    amplitude = 0.9 * structure.grazing_amplitude(0.7)
    seen = FlowMap(structure, 0.7).observe(orbit.state(amplitude), amplitude, 1, measures=ALL)
    same(orbit.measures(amplitude), seen.measures)
    two = orbit.measures([amplitude, 2 * amplitude])
    assert {values.shape for values in vars(two).values()} == {(2, 3)}


@pytest.mark.parametrize("method", ["flow", pytest.param("bdf", marks=pytest.mark.slow)])
def test_a_sweep_holds_them_where_they_are_asked_for(tmp_path, method):
    small = SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 5")
    if method == "bdf":
        small = small.replace("transient_cycles = 30", "transient_cycles = 4")
        small = small.replace("sampling_cycles = 20", "sampling_cycles = 12")
        small = small.replace("count = 5", "count = 2")
        small = small.replace("{from = 0.5, to = 0.8, count = 2}", "[0.6]")
    text = f'{small}{OUTPUT}[solver]\nmethod = "{method}"\n'
    job = parse_job(text, "job", "job")
    assert campaign.run(job, tmp_path / "peaks.h5", Serial()) == 0
    results = open_results(tmp_path / "peaks.h5")
    assert results.storey_drift.dims == ("direction", "omega", "amplitude", "storey")
    assert results.stop.values.tolist() == ["1", "2"]
    assert results.contact_force.attrs["units"] == "k gaps"
    scale = results.amplitude / results.omega**2
    drift = results.storey_drift.max("storey") / scale
    np.testing.assert_allclose(drift.transpose(*results.drift.dims), results.drift, rtol=1e-9)
    touched = results.contact.values > 0
    force = results.contact_force.values.max(axis=-1)
    assert (force[touched] > 0).all()
    assert (force[~touched] == 0).all()
    for name in OF_SPRINGS:
        own = results[name].values.max(axis=-1)
        assert (own[touched] > 0).all(), name
        assert (own[~touched] == 0).all(), name
    assert results.contact_share.max() < 1
    assert touched.any()
    assert not touched.all()
    other = parse_job(text.replace(OUTPUT, ""), "job", "job")
    assert campaign.run(other, tmp_path / "plain.h5", Serial()) == 0
    plain = open_results(tmp_path / "plain.h5")
    assert "storey_drift" not in plain
    for name in plain.data_vars:
        if name == "drift":
            np.testing.assert_allclose(plain.drift, results.drift, rtol=SAME_PEAK)
        elif name != "commit":
            np.testing.assert_array_equal(plain[name].values, results[name].values)


def test_a_contact_out_of_reach_exerts_no_force(tmp_path):
    text = SMALL.replace("stiffness_ratio = 300.0", "stiffness_ratio = 300.0\ngap = [1.0, 1e6]")
    job = parse_job(text.replace("count = 4", "count = 2") + OUTPUT, "job", "job")
    assert campaign.run(job, tmp_path / "far.h5", Serial()) == 0
    results = open_results(tmp_path / "far.h5")
    for name in OF_SPRINGS:
        assert (results[name].values[..., 1] == 0).all()
        assert results[name].values[..., 0].max() > 0


@pytest.mark.slow
def test_attractors_and_basins_have_those_of_a_sweep_that_ends_on_them(tmp_path):
    structure = "[structure]\nn_floors = 2\nstiffness_ratio = 300.0\nsharpness = 4e3\n"
    sweep = "[sweep]\nomega = 0.6\namplitude = 0.3\ntransient_cycles = 300\n"
    found = {}
    for kind in ("amplitude_sweep", "attractors", "basins"):
        own = {"attractors": "starts = 8\n", "basins": "starts = 8\n"}.get(kind, "")
        if kind == "basins":
            own += "horizontal = [0.0, 0.5]\nvertical = [0.0, 0.5]\n"
        text = f'[study]\nkind = "{kind}"\n{own}{structure}{sweep}[output]\n{OUTPUT}'
        path = tmp_path / f"{kind}.h5"
        assert campaign.run(parse_job(text, "job", "job"), path, Serial()) == 0
        found[kind] = open_results(path)
    swept = found["amplitude_sweep"].isel(direction=0, omega=0, amplitude=0)
    assert int(swept.orbit_period) > 0
    assert float(swept.impacts.max()) > 0
    each = found["attractors"].isel(direction=0, omega=0, amplitude=0)
    basin = found["basins"].isel(direction=0, row=0, amplitude=0)
    for kind in found:
        most = summarize(tmp_path / f"{kind}.h5")["largest"]["contact_force"]
        assert most["value"] == float(found[kind].contact_force.max())
    for results in (each, basin):
        held = results.isel(attractor=np.flatnonzero(results.attractor_id))
        for name in MEASURES:
            assert held[name].dims == ("attractor", swept[name].dims[0])
            apart = np.abs(held[name] - swept[name]).max(swept[name].dims[0])
            assert apart.min() < 1e-9, name


def test_a_measure_that_cannot_be_is_found():
    text = SMALL.replace("count = 11", "count = 3") + OUTPUT
    study = parse_job(text, "job", "job").study
    block = study.block((0, 1, 0))
    rows = study.compute(block, np.zeros(4))

    def wrong(changed: dict) -> list[str]:
        return sorted({words for _, words in study.check(block, rows | changed)})

    assert wrong({}) == []
    for name, value, rule in (
        ("contact_share", 1.5, "lies between 0 and 1"),
        ("impacts", -1.0, "is finite and not negative"),
        ("impulse", np.inf, "is finite"),
    ):
        damaged = {name: np.full_like(rows[name], value)}
        assert wrong(damaged) == [f"not so: {name} {rule}"]
