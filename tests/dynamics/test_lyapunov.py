"""All Lyapunov exponents: closed forms, known maps, and the variational equation by DOP853."""

import math
from dataclasses import replace

import numpy as np
import pytest
from maps import delayed_logistic, henon, logistic
from scipy.integrate import solve_ivp
from scipy.special import expit
from together import together
from tools import DESCRIBED

import hpcsweep
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.lyapunov import (
    kaplan_yorke_dimension,
    spectrum_of_motion,
    spectrum_of_orbit,
)
from hpcsweep.job import JobError, parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns

CHAOTIC = Structure(3, 1000.0, 1e4, damping_ratio=DESCRIBED)
CHAOS = 0.09877, 0.445


@together(
    "exponents, dimension",
    [
        ((-1.0, -2.0), 0.0),
        ((0.0, -2.0), 1.0),
        ((0.5, -1.0, -2.0), 1.5),
        ((0.5, 0.0, -1.0), 2.5),
        ((0.5, -0.25, -1.0), 2.25),
        ((0.5, 0.25), 2.0),
        ((0.5, -1.0, math.nan), 1.5),
        ((0.5, math.nan), math.nan),
    ],
)
def test_the_dimension_of_known_exponents(exponents, dimension):
    assert kaplan_yorke_dimension(np.array(exponents)) == pytest.approx(dimension, nan_ok=True)


def test_the_henon_map():
    """Sprott, Chaos and Time-Series Analysis, 2003: 0.41922, -1.62319, dimension 1.25827."""
    found = spectrum_of_motion(henon(1.4), np.array([0.1, 0.1]), 1.0, 0.01, 100_000)
    assert np.abs(found.exponents - [0.41922, -1.62319]).max() < 2 * found.errors.max()
    assert 0.001 < found.errors.max() <= 0.01
    assert found.exponents.sum() == pytest.approx(math.log(0.3), abs=1e-12)
    assert found.dimension.low < 1.25827 < found.dimension.high
    limited = spectrum_of_motion(henon(1.4), np.array([0.1, 0.1]), 1.0, 1e-6, 500)
    assert limited.n_periods == 500
    assert limited.errors.max() > 1e-3


def test_a_torus_and_what_rounding_hides():
    torus = spectrum_of_motion(delayed_logistic(2.05), np.array([0.4, 0.4]), 1.0, 1e-3, 50_000)
    assert abs(torus.exponents[0]) < 2e-3
    assert torus.exponents[1] < -0.01
    # the superstable orbit of period 2 at r = 1 + sqrt 5 contracts to nothing, by 0.3 beside it
    points = np.array([[0.5, 0.0], [(1 + math.sqrt(5)) / 4, 0.0]])
    found = spectrum_of_orbit(logistic(1 + math.sqrt(5)), points, 1.0)
    assert found.exponents[0] == pytest.approx(math.log(0.3), abs=1e-12)
    assert math.isnan(found.exponents[1])


def test_the_intervals_hold_what_they_promise():
    """Of 40 averages over 300 periods some 38 have ln 2, the exponent of x -> 4 x (1 - x)."""
    held = 0
    for start in np.random.default_rng(1).uniform(0.1, 0.9, 40):
        found = spectrum_of_motion(logistic(4.0), np.array([start, 0.0]), 1.0, 1e-9, 300)
        held += abs(found.exponents[0] - math.log(2)) <= found.errors[0]
    assert 34 <= held <= 40


@pytest.mark.parametrize("coupled", [False, True])
def test_without_contact_exponents_are_the_rates_of_free_decay(coupled):
    structure = Structure(3, sharpness=math.inf, damping_ratio=DESCRIBED)
    rates = np.sort(np.repeat(-np.array(DESCRIBED) * structure.frequencies, 2))[::-1]
    if coupled:
        stiffness = np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
        damping = np.array([[0.4, -0.1, 0], [-0.1, 0.2, -0.05], [0, -0.05, 0.1]])
        structure = Structure.from_matrices(np.eye(3), stiffness, [], damping=damping)
        first = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]])
        rates = np.sort(np.linalg.eigvals(first).real)[::-1]
    found = hpcsweep.lyapunov_spectrum(structure, 0.001, 0.7, [0.1] * 6)
    np.testing.assert_allclose(found.exponents, rates, rtol=0, atol=1e-12)
    assert found.n_periods == found.dimension.mean == 0


def test_chaos_of_three_floors():
    """Their sum is minus the trace of the damping, as no contact has a dashpot."""
    found = hpcsweep.lyapunov_spectrum(CHAOTIC, *CHAOS, [0.0] * 6, error=2e-3)
    sum_of_all = -2 * (np.array(DESCRIBED) * CHAOTIC.frequencies).sum()
    assert found.exponents.sum() == pytest.approx(sum_of_all, abs=1e-10)
    assert found.errors.max() <= 2e-3
    assert found.exponents[0] > found.errors[0]
    assert found.dimension.low > 1


@pytest.mark.slow
def test_the_variational_equation():
    """Over 20 periods, by DOP853: the same equations written down here."""
    beta, rho, zeta, amplitude, omega = 50.0, 100.0, 0.02, 1.0, 0.8
    stiffness = np.array([[2.0, -1.0], [-1.0, 1.0]])
    squares, modes = np.linalg.eigh(stiffness)
    damping = modes @ np.diag(2 * zeta * np.sqrt(squares)) @ modes.T

    def rates(tau, y):
        z = y.reshape(4, 5)
        u, v = z[:2], z[2:]
        closed = expit(rho * (u[:, 0] - 1))
        slope = beta * closed * (1 + rho * (1 - closed) * (u[:, 0] - 1))
        bent = -stiffness @ u - damping @ v
        bent[:, 0] -= beta * closed * (u[:, 0] - 1) + amplitude * math.sin(omega * tau)
        bent[:, 1:] -= slope[:, None] * u[:, 1:]
        return np.concatenate((v, bent)).ravel()

    start, frame, time = np.array([0.3, 0.2, 0.0, 0.1]), np.eye(4), 2 * math.pi / omega
    z, logarithms = start, []
    for _ in range(20):
        y = np.column_stack((z, frame)).ravel()
        y = solve_ivp(rates, (0.0, time), y, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        z, moved = y.reshape(4, 5)[:, 0], y.reshape(4, 5)[:, 1:]
        frame, upper = np.linalg.qr(moved)
        logarithms.append(np.log(np.abs(np.diag(upper))))
    # averages begin after the first tenth and are of ten batches: of the last ten periods
    expected = np.sort(np.mean(logarithms[10:], axis=0))[::-1] / time
    structure = Structure(2, beta, rho, damping_ratio=zeta)
    found = hpcsweep.lyapunov_spectrum(
        structure, amplitude, omega, start, max_cycles=20, classify_cycles=0, rtol=1e-11
    )
    assert found.n_periods == 20
    np.testing.assert_allclose(found.exponents, expected, rtol=0, atol=1e-6)


def test_sweeps_store_the_spectrum_of_each_run():
    settings = SweepSettings(classify_cycles=2_000)
    metrics = settings.metrics | {"lyapunov", "lyapunov_spectrum"}
    settings = replace(settings, metrics=metrics, spectrum_error=0.01)
    rows = FrameRuns(CHAOTIC, 0.445, settings).follow([0.02, 0.05, 0.09877, 0.3], np.zeros(6))
    assert rows["motion"].tolist() == [
        MotionClass.NO_CONTACT,
        MotionClass.PERIODIC,
        MotionClass.CHAOTIC,
        MotionClass.PERIODIC,
    ]
    total = -2 * (np.array(DESCRIBED) * CHAOTIC.frequencies).sum()
    np.testing.assert_allclose(rows["lyapunov_spectrum"].sum(axis=1), total, rtol=0, atol=1e-8)
    orbits = [0, 1, 3]
    largest = rows["lyapunov_spectrum"][:, 0]
    np.testing.assert_allclose(largest[orbits], rows["lyapunov"][orbits], rtol=0, atol=1e-9)
    assert rows["lyapunov_spectrum_error"][orbits].max() < 1e-9
    assert (rows["spectrum_cycles"] > 0).tolist() == [False, False, True, False]
    assert rows["lyapunov_spectrum_error"][2].max() <= 0.01
    assert rows["kaplan_yorke"][orbits].tolist() == [0, 0, 0]
    assert rows["kaplan_yorke_low"][2] > 1


def test_a_mass_that_comes_to_rest_on_its_stop_forgets_all_and_repeats():
    """Of Shaw and Holmes' oscillator, after 16 periods, and after hundreds that look like chaos."""
    stop = hpcsweep.Contact((1.0,), 0.0, math.inf, restitution=0.8)
    structure = Structure.from_matrices([1.0], [[1.0]], [stop])
    settings = SweepSettings(classify_cycles=4000, transient_cycles=300)
    metrics = settings.metrics | {"lyapunov", "lyapunov_spectrum"}
    for omega, longest in ((2.9125, 16), (2.925, 1000), (4.9, 1000)):
        runs = FrameRuns(structure, omega, replace(settings, metrics=metrics))
        rows = runs.follow([1.0], np.zeros(2))
        points, _ = runs.solver.points(rows["final_state"][0], 1.0, 3000)
        again = np.flatnonzero((points == points[-1]).all(axis=1))
        assert longest == 16 == again[-1] - again[-2] or 100 < again[-1] - again[-2] <= longest
        is_long = longest > 16
        assert rows["motion"] == (MotionClass.LONG_PERIOD if is_long else MotionClass.PERIODIC)
        assert rows["lyapunov"] == rows["lyapunov_low"] == -math.inf
        assert rows["lyapunov_spectrum"].tolist() == [[-math.inf] * 2]
        assert rows["lyapunov_spectrum_error"].tolist() == [[0.0] * 2]
        assert rows["kaplan_yorke"] == rows["kaplan_yorke_high"] == 0
    found = spectrum_of_motion(runs.solver, points[-1], 1.0, 0.01, 1000)
    assert found.exponents.tolist() == [-math.inf] * 2


def test_studies_of_attractors_store_the_spectrum_of_each():
    """A motion without contact, and one of period 5, of which the sum is the same."""
    text = """
[study]
kind = "attractors"
starts = 24
[structure]
n_floors = 1
stiffness_ratio = 29.0
sharpness = inf
gap = 1.26
damping_ratio = 0.01
[sweep]
omega = 0.801
amplitude = 0.44912
[output]
lyapunov_spectrum = true
"""
    study = parse_job(text, "job.toml", "job").study
    rows = study.runs_at(0, np.array([0]), study.initial_state)
    listed = rows["attractor_id"][0] > 0
    assert sorted(rows["orbit_period"][0, listed].tolist()) == [1, 5]
    exponents = rows["lyapunov_spectrum"][0, listed]
    np.testing.assert_allclose(exponents.sum(axis=1), -0.02, rtol=0, atol=1e-12)
    np.testing.assert_allclose(exponents[:, 0], rows["lyapunov"][0, listed], rtol=0, atol=1e-9)
    assert np.isnan(rows["kaplan_yorke"][0, ~listed]).all()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[study]\nkind = "basins"\n', "lyapunov_spectrum = True: must be false: spectra are of"),
        ("[structure]\nsharpness = inf\nyield_drift = 0.1\n", "must be false where springs yield"),
    ],
)
def test_studies_without_spectra_refuse_them(more, message):
    text = f"{more}[sweep]\nomega = 0.5\namplitude = 0.1\n[output]\nlyapunov_spectrum = true\n"
    with pytest.raises(JobError, match=message):
        parse_job(text, "job.toml", "job")
