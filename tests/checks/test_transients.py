"""What share of chaotic runs outlives more periods, against repetition of the plain motion."""

import json

import numpy as np
import pytest
from tools import hpcsweep

from hpcsweep import load_job, open_results, stroboscopic_points
from hpcsweep.checks.transients import outliving

CHAOTIC = 5
PERIODS = 2000


@pytest.fixture(scope="module")
def chaos(tmp_path_factory):
    # beside windows of periods 6 and 4, where some chaos ends
    file = tmp_path_factory.mktemp("chaos") / "chaos.h5"
    amplitude = "sweep.amplitude={from = 0.095, to = 0.11, step = 0.0003}"
    hpcsweep(0, "run", "jobs/paper/figure3-described.toml", "--set", amplitude, "-o", file)
    return file


def repeats(points: np.ndarray) -> bool:
    """Return whether the last point is met again: weak chaos may end in a P1400."""
    return bool((np.abs(points[-1501:-1] - points[-1]).max(axis=1) < 1e-6).any())


@pytest.mark.slow
def test_what_ends_repeats_and_what_outlives_does_not(chaos):
    results = open_results(chaos).isel(omega=0)
    structure = load_job("jobs/paper/figure3-described.toml").structure
    runs = np.argwhere(results["motion"].values == CHAOTIC)
    assert len(runs) > 10
    early = late = 0
    for direction, at in runs:
        state = results["final_state"].values[direction, at]
        amplitude = float(results["amplitude"][at])
        points = stroboscopic_points(structure, amplitude, 0.445, state, PERIODS + 20_000)
        early, late = early + repeats(points[:PERIODS]), late + repeats(points)
    found = outliving(chaos, 1000, PERIODS)
    assert found["chaotic"] == found["samples"] == len(runs)
    # one that ends while it is classified may count as either
    assert 0 < early <= found["ended"] <= late
    assert found["outlive"] == len(runs) - found["ended"] > 0
    assert found["undecided"] == 0
    assert found["low"] < found["share"] < found["high"]


@pytest.mark.slow
def test_summary_says_it_of_as_many_as_asked(chaos):
    told = json.loads(hpcsweep(0, "summary", chaos, "--transients", 2, "--json").stdout)
    assert told[0]["transients"]["samples"] == 2
    text = hpcsweep(0, "summary", chaos, "--transients", 1).stdout
    assert "chaotic runs outlive 10000 more periods" in text
    assert "outlive" not in hpcsweep(0, "summary", chaos).stdout


@pytest.mark.slow
def test_chaotic_attractors_are_followed_too(tmp_path):
    file = tmp_path / "attractors.h5"
    hpcsweep(
        *(0, "run", "jobs/attractors/attractors-figure3-described.toml", "-o", file),
        *("--set", "sweep.amplitude=[0.128]", "--set", "study.starts=40"),
    )
    found = outliving(file, 3, 500)
    assert found["chaotic"] == found["outlive"] == 1
    # none ended: only mean lifetimes below 500 / ln 20 are refused
    assert found["lifetime"] == [None, pytest.approx(500 / np.log(20)), None]
    assert "outlive" in hpcsweep(0, "summary", file, "--transients", 1).stdout
