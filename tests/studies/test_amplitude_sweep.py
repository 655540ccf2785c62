"""Sweeps: the published regions, the skip rules against the window procedure, failures as data."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from reference import reference_points
from tools import PAPER, hpcsweep

from hpcsweep import open_results
from hpcsweep.dynamics.classify import MotionClass, contact_name
from hpcsweep.dynamics.orbit import orbit_period
from hpcsweep.job import load_job
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import stroboscopic_points
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import frame_runs

PLAIN = frozenset()

PRINTED = {
    "up": [
        ("P1 none", 0.0, 0.0158),
        ("P6 C3", 0.0168, 0.0168),
        ("P1 C3", 0.0178, 0.083),
        ("P2 C23", 0.084, 0.130),
        ("P1 C23", 0.131, 0.235),
        ("P1 C123", 0.236, 0.25),
    ],
    "down": [
        ("P1 C123", 0.25, 0.2156),
        ("P2 C123", 0.2146, 0.2127),
        ("P1 C23", 0.2117, 0.1177),
        ("P2 C23", 0.109, 0.084),
        ("P1 C3", 0.083, 0.0178),
    ],
}
DESCRIBED = {
    "up": [
        ("P1 none", 0.035, 0.0405),
        ("P1 C3", 0.042, 0.064),
        ("P9 C23", 0.066, 0.066),
        ("P8 C23", 0.068, 0.0715),
        ("P7 C23", 0.074, 0.082),
        ("P6 C23", 0.085, 0.0945),
        ("P4 C23", 0.1095, 0.131),
        ("P2 C123", 0.17, 0.2435),
        ("P1 C123", 0.2455, 0.25),
    ],
    "down": [
        ("P1 C123", 0.25, 0.2225),
        ("P1 C123", 0.155, 0.1305),
        ("P2 C13", 0.1295, 0.1265),
        ("P4 C23", 0.1205, 0.109),
        ("P1 C3", 0.064, 0.042),
    ],
}


def labels(results, direction: str, period: str) -> list[str]:
    runs = results.sel(direction=direction).isel(omega=0)
    n = results.sizes["mode"]
    return [
        f"P{p} {contact_name(int(c), n)}"
        for p, c in zip(runs[period].values, runs["contact"].values, strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("figure3", PRINTED),
        pytest.param("figure3-described", DESCRIBED, marks=pytest.mark.slow),
    ],
)
def test_figure_3_has_its_regions_from_the_command_line(tmp_path, name, expected):
    path = tmp_path / "f.h5"
    done = hpcsweep(0, "run", PAPER / f"{name}.toml", "-o", path)
    assert done.returncode == 0, done.stderr
    results = open_results(path)
    amplitude = results["amplitude"].values
    near = 2.01 * np.diff(amplitude).min()
    for direction, regions in expected.items():
        # by the paper's test: it claims P2 on the way down where an orbit of P1 is approached
        found = np.array(labels(results, direction, "window_period"))
        for label, first, last in regions:
            low, high = min(first, last), max(first, last)
            inside = (amplitude >= low + near) & (amplitude <= high - near)
            assert set(found[inside]) <= {label}, (direction, label)
            around = (amplitude >= low - near) & (amplitude <= high + near)
            assert label in found[around], (direction, label)
            # and it ends there: not one step more on both sides, unless chaos does, which ends
            # sooner or later by rounding
            outside = (amplitude < low - near) | (amplitude > high + near)
            runs = np.flatnonzero((found == label) & outside)
            beside = [i for i in runs if np.min(np.abs(amplitude[i] - [low, high])) < 2 * near]
            beyond = [found[i - 1 if amplitude[i] < low else i + 1] for i in beside]
            assert [b for b in beyond if not b.startswith("P0")] == [], (direction, label, beside)


def test_described_chaos_where_the_paper_says(tmp_path):
    job = load_job(PAPER / "figure3-described.toml")
    settings = replace(job.settings, metrics=frozenset({"lyapunov", "contact"}))
    path = job.study.amplitude[: int(np.searchsorted(job.study.amplitude, 0.0991))]
    swept = frame_runs(job.structure, 0.445, settings).follow(path, job.study.initial_state)
    at = int(np.argmin(np.abs(path - 0.09877)))
    assert swept["orbit_period"][at] == 0
    assert swept["lyapunov"][at] > 1e-3
    periodic = (swept["orbit_period"] > 0) & (swept["outcome"] == Outcome.COMPLETE)
    assert np.all(swept["lyapunov"][periodic] < 0)


@pytest.mark.parametrize("skip", [("linear", "converged"), ("linear", "converged", "newton")])
def test_skip_rules_give_the_results_of_the_plain_procedure(skip):
    """Wherever the window procedure itself has converged, by a strict tolerance."""
    amplitude = np.linspace(0.005, 0.25, 50)
    structure = Structure()
    settings = SweepSettings(period_tolerance=1e-8)
    start = np.zeros(6)
    for path in (amplitude, amplitude[::-1]):
        plain = frame_runs(structure, 0.445, replace(settings, skip=PLAIN)).follow(path, start)
        quick = frame_runs(structure, 0.445, replace(settings, skip=frozenset(skip))).follow(
            path, start
        )
        assert quick["cycles"].sum() < (0.25 if "newton" in skip else 0.6) * 200 * path.size
        assert np.all(plain["cycles"] == 200)
        assert np.array_equal(quick["contact"], plain["contact"])
        # an orbit of period 2 whose points nearly meet is one of period 1, still alternating
        apart = np.array(
            [
                np.ptp(p[:k], axis=0).max() > 1e-4
                for p, k in zip(plain["poincare"], plain["n_points"], strict=True)
            ]
        )
        settled = (plain["orbit_period"] > 0) & ((plain["orbit_period"] == 1) | apart)
        assert settled.sum() > 25
        assert np.array_equal(quick["orbit_period"][settled], plain["orbit_period"][settled])
        assert np.allclose(quick["drift"][settled], plain["drift"][settled], atol=0, rtol=1e-7)
        near = np.abs(quick["final_state"] - plain["final_state"])[settled]
        assert near.max() < 1e-7
        assert np.abs(quick["modal_norm"] - plain["modal_norm"])[settled].max() < 1e-4
        start = plain["final_state"][-1]


def test_newton_decides_what_the_plain_procedure_leaves_unsettled():
    # a period-1 orbit whose largest multiplier is -0.97: plain ends some 1e-5 away, alternating
    structure = Structure()
    settings = SweepSettings()
    state = frame_runs(structure, 0.445, settings).follow([0.25], np.zeros(6))["final_state"][0]
    path = np.linspace(0.25, 0.22, 13)
    plain = frame_runs(structure, 0.445, replace(settings, skip=PLAIN)).follow(path, state)
    quick = frame_runs(structure, 0.445, settings).follow(path, state)
    assert plain["orbit_period"][-1] != 1
    assert quick["orbit_period"][-1] == 1
    long = replace(settings, skip=PLAIN, transient_cycles=2000)
    truth = frame_runs(structure, 0.445, long).follow(path[-1:], plain["final_state"][-1])
    assert truth["orbit_period"][0] == 1
    assert np.abs(truth["final_state"][0] - quick["final_state"][-1]).max() < 1e-8


def test_linear_rule_is_the_closed_form_and_says_so():
    structure = Structure()
    swept = frame_runs(structure, 0.9, SweepSettings()).follow([0.01, 0.02], np.zeros(6))
    assert np.array_equal(swept["cycles"], [0, 0])
    response = structure.linear_steady_state(0.9)
    drift = np.abs(np.diff(response, prepend=0)).max() * 0.9**2
    assert swept["drift"] == pytest.approx([drift, drift], rel=1e-12)
    plain = frame_runs(structure, 0.9, SweepSettings(skip=PLAIN)).follow([0.01], np.zeros(6))
    assert plain["drift"][0] == pytest.approx(drift, rel=1e-6)
    assert plain["modal_norm"][0] == pytest.approx(swept["modal_norm"][0], abs=1e-4)
    assert np.abs(plain["final_state"][0] - swept["final_state"][0]).max() < 1e-12


@pytest.mark.parametrize("solver", ["flow", pytest.param("bdf", marks=pytest.mark.slow)])
def test_blocks_join_without_a_seam(solver):
    structure = Structure(n_floors=2, stiffness_ratio=300.0, sharpness=4e3)
    settings = SweepSettings(
        transient_cycles=4, sampling_cycles=4, max_orbit_period=2, solver=solver, rtol=1e-6
    )
    path = np.linspace(0.05, 0.2, 4)
    whole = frame_runs(structure, 0.7, settings).follow(path, np.zeros(4))
    first = frame_runs(structure, 0.7, settings).follow(path[:2], np.zeros(4))
    second = frame_runs(structure, 0.7, settings).follow(path[2:], first["final_state"][-1])
    for name, values in whole.items():
        joined = np.concatenate((first[name], second[name]))
        assert np.array_equal(values, joined, equal_nan=values.dtype.kind == "f"), name


def test_a_failed_run_is_data_and_the_sweep_goes_on():
    structure = Structure(n_floors=1, stiffness_ratio=0.0, damping_ratio=0.0)
    settings = SweepSettings(transient_cycles=5, sampling_cycles=5, max_orbit_period=2)
    swept = frame_runs(structure, 1.0, settings).follow([1e150, 0.1], np.array([0.0, 1e99]))
    assert swept["outcome"][0] == Outcome.NON_FINITE
    assert math.isnan(swept["drift"][0])
    assert np.isnan(swept["poincare"][0]).all()
    assert np.isfinite(swept["final_state"]).all()


def test_orbit_period_is_the_smallest_that_repeats():
    j = np.arange(40)
    for p in (1, 2, 3, 7):
        points = np.stack((np.cos(2 * np.pi * j / p), np.sin(2 * np.pi * j / p)), axis=1)
        assert orbit_period(points, 10, 1e-9) == p
    golden = 2 * np.pi * j * 0.6180339887
    assert orbit_period(np.stack((np.cos(golden), np.sin(golden)), axis=1), 10, 1e-3) == 0
    assert orbit_period(np.zeros((1, 2)), 10, 1e-9) == 0


LEFT_TO_COMPILE = """
import numpy as np
from hpcsweep.studies.sweep.runs import frame_runs
from hpcsweep.solvers.flow.march import march
from hpcsweep.solvers.flow.orbit import transient
from hpcsweep.studies.compilation import load, needed
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.model.structure import Structure

settings = SweepSettings(metrics=frozenset({metrics!r}))
load(needed(settings))
kernels = march.march, transient.end_of_transient
before = [len(kernel.dispatcher.signatures) for kernel in kernels]
amplitude = np.linspace(0.01, 0.25, 40)
found = frame_runs(Structure(), 0.21, settings).follow(amplitude, np.zeros(6))
assert set(found["skip_rule"].tolist()) >= {{0, 1, 3}}
print(sum(before), sum(len(kernel.dispatcher.signatures) for kernel in kernels))
"""


@pytest.mark.slow
@pytest.mark.parametrize("metrics", [("contact",), ("poincare", "drift", "modal_norm", "lyapunov")])
def test_the_warm_up_leaves_nothing_to_compile(metrics):
    script = LEFT_TO_COMPILE.format(metrics=metrics)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    before, after = done.stdout.split()
    assert before == after


def test_what_the_paper_calls_p2_on_the_way_down_of_figure_3_is_p1():
    study = load_job(PAPER / "figure3.toml").study
    start = stroboscopic_points(study.structure, 0.2488, 0.445, np.zeros(6), 300)[-1]
    amplitudes = study.amplitude[(study.amplitude > 0.212) & (study.amplitude < 0.249)][::-1]
    found = frame_runs(study.structure, 0.445, study.settings).follow(amplitudes, start)
    claimed = found["window_period"] == 2
    assert claimed.sum() == 3
    assert (found["orbit_period"] == 1).all()
    # the orbit at the middle of the three, by the independent reference
    at = int(np.flatnonzero(claimed)[1])
    orbit = found["poincare"][at, 0]
    again = reference_points(study.structure, float(amplitudes[at]), 0.445, orbit, 1)[0]
    assert np.abs(again - orbit).max() < 1e-10


def test_the_path_is_that_of_the_plain_procedure_whatever_is_decided():
    study = load_job(PAPER / "figure3-described.toml").study
    amplitudes = study.amplitude[::12]
    rows = [
        frame_runs(study.structure, 0.445, replace(study.settings, classify_cycles=cycles)).follow(
            amplitudes, study.initial_state
        )
        for cycles in (None, 0, 50_000)
    ]
    for name in ("final_state", "outcome", "skip_rule", "cycles"):
        np.testing.assert_array_equal(rows[0][name], rows[1][name])
        np.testing.assert_array_equal(rows[0][name], rows[2][name])
    np.testing.assert_array_equal(rows[0]["orbit_period"], rows[2]["window_period"])
    motion, period = rows[2]["motion"], rows[2]["orbit_period"]
    assert not (motion == MotionClass.UNDECIDED).any()
    assert ((period > 0) == np.isin(motion, (MotionClass.PERIODIC, MotionClass.NO_CONTACT))).all()
    assert (rows[0]["orbit_period"] != period).sum() > 3
    low, mean, high = (rows[2][name] for name in ("lyapunov_low", "lyapunov", "lyapunov_high"))
    assert (low <= mean).all()
    assert (mean <= high).all()
    assert (low[motion == MotionClass.CHAOTIC] > 0).all()


def test_metrics_are_those_of_the_decided_motion():
    # Figure 3 as described, up: P8 with a multiplier of modulus 0.52, not settled in the window
    study = load_job(PAPER / "figure3-described.toml").study
    amplitudes = study.amplitude[study.amplitude < 0.0681]
    found = frame_runs(study.structure, 0.445, study.settings).follow(
        amplitudes, study.initial_state
    )
    assert amplitudes[-1] == pytest.approx(0.068)
    assert found["orbit_period"][-1] == 8
    assert found["drift"][-1] == pytest.approx(2.391483, abs=1e-6)
