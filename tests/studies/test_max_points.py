"""`output.max_points`: fewer stroboscopic points stored, everything else the same."""

import json

import numpy as np
import pytest
from together import together
from tools import SMALL, hpcsweep

from hpcsweep.figures.style import classes_of
from hpcsweep.job import JobError, parse_job
from hpcsweep.store import Frames, open_results
from hpcsweep.studies.sweep.runs import frame_runs

OPEN = SMALL.replace("[sweep]\n", "[sweep]\nclassify_cycles = 0\n")
"""Some of its runs have no orbit within their windows."""


def job(extra: str = "", text: str = SMALL):
    return parse_job(text + extra, "x.toml", "x")


def test_all_points_are_no_other_job():
    for all_of_them in ("max_points = 20", "max_points = 1000"):
        assert job(all_of_them).fingerprint == job().fingerprint
    fewer = {job().fingerprint, *(job(f"max_points = {m}").fingerprint for m in (12, 13, 19))}
    assert len(fewer) == 4


@together("value", ["11", "0", "-1", "true", "12.0", "'all'"])
def test_fewer_points_than_tell_an_orbit_are_refused(value):
    with pytest.raises(JobError, match=r"^x\.toml: output\.max_points = .*2 max_orbit_period = 12"):
        job(f"max_points = {value}")


def test_only_the_stored_points_change():
    whole, few = job(text=OPEN), job("max_points = 12", OPEN)
    rows = [
        frame_runs(j.structure, 0.8, j.settings).follow(j.study.amplitude, j.study.initial_state)
        for j in (whole, few)
    ]
    count = rows[0]["n_points"]
    assert (count > 12).any()
    assert rows[1]["poincare"].shape == (whole.study.amplitude.size, 12, 4)
    np.testing.assert_array_equal(rows[1]["n_points"], np.minimum(count, 12))
    for run in range(whole.study.amplitude.size):
        last = rows[0]["poincare"][run, : count[run]][-12:]
        np.testing.assert_array_equal(rows[1]["poincare"][run, : len(last)], last)
        assert np.isnan(rows[1]["poincare"][run, len(last) :]).all()
    for name in rows[0].keys() - {"poincare", "n_points"}:
        np.testing.assert_array_equal(rows[0][name], rows[1][name], err_msg=name)


@pytest.mark.slow
def test_such_a_file_is_valid_and_read_by_all(tmp_path):
    path = tmp_path / "few.toml"
    path.write_text(OPEN + "max_points = 12\nlyapunov = true\n")
    assert hpcsweep(0, "run", path, cwd=tmp_path).returncode == 0
    reported = hpcsweep(0, "validate", tmp_path / "few.h5", "--json", "--samples", 6)
    assert reported.returncode == 0, reported.stdout + reported.stderr
    assert json.loads(reported.stdout)["sound"] is True
    results = open_results(tmp_path / "few.h5")
    assert results.sizes["point"] == 12
    aperiodic = (results["orbit_period"] == 0).values
    assert aperiodic.any()
    assert (results["n_points"].values[aperiodic] == 12).all()
    frames = Frames(tmp_path / "few.h5")
    frame = np.concatenate([classes_of(frames.dataset(k)) for k in range(4)], axis=1)
    frames.close()
    np.testing.assert_array_equal(frame, classes_of(results))
