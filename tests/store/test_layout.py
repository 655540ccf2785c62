"""Files kept for ever: what version 1 of the layout means does not change."""

import shutil

import h5py
import numpy as np
import pytest
from tools import ROOT, SMALL, assert_same_datasets, hpcsweep

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.status import status
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import StoreError, is_packed, job_of
from hpcsweep.store.contents import Contents
from hpcsweep.store.metadata import metadata_checksum

DATA = ROOT / "tests" / "data"
PLAIN, PACKED = DATA / "layout1.h5", DATA / "layout1-packed.h5"


FINAL_STATE = [-0.36469735714333196, -0.12547426015361998, -0.866230818410719, -0.1225914390867043]
DRIFT = 1.4241772826887955
LYAPUNOV = -0.020526493055381793
NORM = [0.9981817814757795, 0.017575097442390764]


@pytest.mark.parametrize("path", [PLAIN, PACKED])
def test_a_file_of_version_1_opens_with_its_values(path):
    results = open_results(path)
    assert results.attrs["layout_version"] == 1
    assert dict(results.sizes) == {
        "direction": 2,
        "frame": 2,
        "amplitude": 7,
        "point": 8,
        "state": 4,
        "mode": 2,
        "block": 3,
    }
    assert results["state"].values.tolist() == ["u_1", "u_2", "v_1", "v_2"]
    assert results["omega"].values.tolist() == [0.55, 0.7]
    assert results["orbit_period"].values.tolist() == [
        [[1, 1, 0, 2, 3, 3, 3], [1, 1, 0, 0, 0, 3, 3]],
        [[1, 1, 0, 1, 3, 3, 3], [1, 1, 0, 0, 0, 3, 3]],
    ]
    assert results["shortcut"].values.tolist() == [
        [[1, 3, 0, 3, 3, 3, 3], [1, 3, 0, 0, 0, 3, 3]],
        [[3, 3, 0, 3, 3, 3, 2], [3, 3, 0, 0, 0, 3, 2]],
    ]
    assert results["contact"].values[1, 1].tolist() == [0, 2, 2, 3, 3, 3, 3]
    assert np.isnan(results["drift"].values[0, 0, 0])
    exact = {"final_state": FINAL_STATE, "drift": DRIFT, "lyapunov": LYAPUNOV, "modal_norm": NORM}
    places = {"final_state": (1, 1, 5), "modal_norm": (0, 0, 1)}
    for name, values in exact.items():
        stored = results[name].values[places.get(name, (0, 0, 5))]
        assert np.array_equal(stored, values), name
    assert status(path)["complete"]
    assert job_of(path).text.startswith("# Kept for ever")


def test_the_packed_file_of_version_1_holds_the_same():
    assert is_packed(PACKED)
    assert not is_packed(PLAIN)
    assert_same_datasets(PLAIN, PACKED)
    assert open_results(PLAIN).identical(open_results(PACKED))


@pytest.mark.parametrize(
    ("path", "samples"), [pytest.param(PLAIN, 2, marks=pytest.mark.slow), (PACKED, 1)]
)
def test_a_file_of_version_1_is_sound_and_the_other_solver_agrees(path, samples):
    report = validate(path, samples=samples, seed=2)
    assert report.problems == []
    assert report.committed == report.blocks == 12
    assert len(report.sample) == samples
    assert all(run.difference <= run.allowed for run in report.sample)


def test_a_campaign_of_version_1_can_be_resumed(tmp_path):
    path = tmp_path / "layout1.h5"
    shutil.copy(PLAIN, path)
    with h5py.File(path, "r+") as file:
        file["commit"][1, 1, 2] = 0
    job = tmp_path / "job.toml"
    job.write_text(job_of(path).text)
    assert status(path)["runs_done"] == 27
    done = hpcsweep(0, "run", job, "-o", path)
    assert done.returncode == 0, done.stderr
    assert status(path)["complete"]


def test_a_newer_layout_is_refused_with_both_numbers(tmp_path):
    path = tmp_path / "newer.h5"
    shutil.copy(PLAIN, path)
    with h5py.File(path, "r+") as file:
        file.attrs["layout_version"] = 2
    with pytest.raises(StoreError, match="layout version 2, this program reads version 1"):
        open_results(path)


def test_the_job_written_back_out_of_the_file_gives_equal_data(tmp_path, small_job):
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    assert hpcsweep(0, "run", small_job, "-o", first).returncode == 0
    shown = hpcsweep(0, "status", first, "--job")
    assert shown.returncode == 0
    assert shown.stdout == small_job.read_text()
    back = tmp_path / "back.toml"
    back.write_text(shown.stdout)
    assert hpcsweep(0, "run", back, "-o", second).returncode == 0
    assert_same_datasets(first, second)
    both = hpcsweep(0, "status", first, "--job", "--json")
    assert both.returncode == 2
    assert "not allowed with" in both.stderr


@pytest.mark.parametrize(
    ("name", "checksum"),
    [
        ("layout1.h5", "b0251586641fdc322b3a0e00685bbed9"),
        ("layout1-packed.h5", "58b209d693693b14da9e75adcd3a0356"),
    ],
)
def test_the_checksum_of_metadata_stays_what_files_were_written_with(name, checksum):
    with h5py.File(DATA / name, "r") as file:
        assert metadata_checksum(Contents(file)) == checksum


def test_a_campaign_begun_before_motions_were_decided_goes_on_as_it_began(tmp_path):
    path, whole = tmp_path / "begun.h5", tmp_path / "whole.h5"
    before = parse_job(SMALL, "small", "small", plain=True)
    for one in (path, whole):
        assert campaign.run(before, one, Serial()) == 0
    assert job_of(path).settings.decide_cycles is None
    with h5py.File(path, "r+") as file:
        file["commit"][1, 1] = 0  # what was not done yet
    assert campaign.run(parse_job(SMALL, "small", "small"), path, Serial()) == 0
    assert_same_datasets(path, whole)
    assert job_of(path).fingerprint == before.fingerprint
    named = SMALL.replace("[output]", "decide_cycles = 50000\n[output]")
    with pytest.raises(StoreError, match="results of another job"):
        campaign.run(parse_job(named, "small", "small"), path, Serial())
