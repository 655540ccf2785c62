"""A share of the jumps along paths; `bash benchmarks/run.sh jumps JOB.toml` follows more."""

import jumps
import numpy as np
import pytest
from together import together
from tools import PAPER

from hpcsweep.job import load_job

STUDIES = ["bluecrystal", "bluecrystal-described"]


def study_of(name):
    return load_job(PAPER / f"{name}.toml").study


@pytest.mark.slow
@pytest.mark.parametrize("name", [STUDIES[0], pytest.param(STUDIES[1], marks=pytest.mark.slow)])
def test_motions_go_to_the_orbits_they_are_jumped_to(name):
    found = jumps.jumps_of(study_of(name), 700, 20)
    assert len(found) > 50
    assert len({jump.period for jump in found}) > 1
    assert not [jump for jump in found if jump.is_elsewhere]


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_motions_of_the_whole_study_go_to_the_orbits_they_are_jumped_to(name):
    study = study_of(name)
    found = [jump for frame in range(17, 2000, 540) for jump in jumps.jumps_of(study, frame, 9)]
    assert len(found) > 250
    assert not [jump for jump in found if jump.is_elsewhere]


@pytest.mark.slow
def test_a_motion_that_is_elsewhere_is_seen(monkeypatch):
    true = jumps.distances

    def displaced(runs, start, amplitude, period, last):
        return true(runs, start, amplitude, period, last + 1e-6)

    monkeypatch.setattr(jumps, "distances", displaced)
    found = jumps.jumps_of(study_of(STUDIES[0]), 700, 100)
    fast = [jump for jump in found if jump.multiplier < 0.9]
    assert len(fast) > 5
    assert all(jump.is_elsewhere for jump in fast)


@together(
    "multiplier, late, elsewhere",
    [
        (0.5, 1e-9, False),
        (0.5, 1e-7, True),
        (0.999, 1e-4 * 0.999**600, False),
        (0.999, 1e-4, False),
        (0.999, 2e-4, True),
        (0.99, 1e-4, True),
        (0.5, np.nan, True),
    ],
)
def test_a_slow_approach_is_none_to_another_motion(multiplier, late, elsewhere):
    jump = jumps.Jump(0.5, 0.1, 1, multiplier, early=1e-4, late=late)
    assert jump.is_elsewhere is elsewhere
