"""Refined maps of basins: equal to all starts, on any ranks and after kills; told by commands."""

import json

import h5py
import numpy as np
import pytest
from together import together
from tools import BASINS, assert_same_datasets, hpcsweep, made

from hpcsweep import basin_boundary, open_results
from hpcsweep.campaign.status import status
from hpcsweep.checks.validate import validate
from hpcsweep.job import JobError, parse_job
from hpcsweep.store import Frames, pack
from hpcsweep.studies.refine.audit import last_look
from hpcsweep.studies.refinement import Source

WHOLE = BASINS.replace("count = 9", "count = 41").replace("count = 7", "count = 34")
REFINED = WHOLE.replace("starts = 16", "starts = 16\nrefine = {levels = 3, wrong = 0.2}")
STARTS = 41 * 34


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    return made(REFINED, tmp_path_factory.mktemp("refined") / "map.h5")


def test_starts_equal_those_of_all_rows_and_the_audit_bounds_the_inferred_ones(refined, tmp_path):
    whole = open_results(made(WHOLE, tmp_path / "whole.h5"))
    results = open_results(refined)
    assert results["label"].dims == ("direction", "row", "column")
    inferred = results["source"].values == Source.INFERRED
    assert np.array_equal(inferred, results["outcome"].values == 0)
    assert 0.1 < inferred.mean() < 0.9
    every = whole["label"].values[:, :, 0]
    assert np.array_equal(results["label"].values[~inferred], every[~inferred])
    look = last_look(results["audit"].values)
    wrong = (results["inferred_label"].values != every)[inferred]
    assert look.left == inferred.sum()
    assert look.low <= wrong.mean() <= look.high < 0.2
    for name in ("attractor_id", "orbit_period", "motion", "contact", "point", "drift"):
        listed, own = results[name].values, whole[name].values[:, :, 0]
        assert np.array_equal(listed, own, equal_nan=True), name
    assert "hits" not in results


def test_a_start_does_not_depend_on_those_beside_it(refined):
    study = parse_job(REFINED, "job", "job").study
    stored = open_results(refined)
    at = np.flatnonzero(stored["outcome"].values[0, 5])
    together = study.runs_at(5, at, study.initial_state)
    for k in (0, at.size // 2, at.size - 1):
        alone = study.runs_at(5, at[k : k + 1], study.initial_state)
        for name, values in alone.items():
            assert values[0] == together[name][k] == stored[name].values[0, 5, at[k]], name


@pytest.mark.slow
def test_readers_and_commands_tell_it(refined, tmp_path):
    results = open_results(refined)
    inferred = int((results["source"].values == Source.INFERRED).sum())
    state = status(refined)
    assert state["complete"]
    assert state["runs_inferred"] == inferred
    assert state["starts"] == state["runs_done"] == STARTS - inferred
    (reported,) = json.loads(hpcsweep(0, "summary", refined, "--json").stdout)
    assert sum(entry["runs"] for entry in reported["basins"].values()) == STARTS
    names = ("inferred_label", "label")
    every, own = (results[name].values[0].reshape(len(results.row), -1) for name in names)
    boundary = basin_boundary(np.where(own != 0, own, every))
    assert reported["boundaries"]["of the slice"]["entropy"] == boundary.entropy > 0
    assert f"{STARTS - inferred} of {STARTS}" in hpcsweep(0, "summary", refined).stdout
    frames = Frames(refined, None)
    for name in ("label", "inferred_label", "point", "cell"):
        own = frames.dataset(7)[name]
        assert np.array_equal(own, results[name].isel(row=[7]), equal_nan=True), name
    frames.close()
    picture = tmp_path / "map.png"
    done = hpcsweep(0, "plot", refined, "--cells", "-o", picture)
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000
    pack(refined, tmp_path / "packed.h5")
    assert open_results(tmp_path / "packed.h5").drop_attrs().equals(results.drop_attrs())


@pytest.mark.slow
def test_it_is_sound_and_damage_is_seen(refined, tmp_path):
    report = validate(refined, samples=1)
    assert report.problems == []
    assert all(run.whole_run == "equal" for run in report.sample)
    assert all(run.difference is not None for run in report.sample)
    path = tmp_path / "map.h5"
    path.write_bytes(refined.read_bytes())
    with h5py.File(path, "r+") as file:
        file["point"][0, 3, 1, 0] += 1e-9
    (problem,) = validate(path, samples=0).problems
    assert "frame 3 " in problem
    assert "its checksum does not hold" in problem
    made(REFINED, path)
    assert_same_datasets(refined, path)


def test_starts_that_contradict_themselves_are_told(refined):
    study, results = parse_job(REFINED, "job", "job").study, open_results(refined)
    rows = {v.name: results[v.name].values[0, 0, :1] for v in study.variables}
    block = study.block((0, 0, 0))
    assert study.check(block, rows) == []
    for label, word in ((9, "of the list"), (-2, "failed")):
        broken = {**rows, "label": np.array([label], np.int8)}
        assert any(word in reported for _, reported in study.check(block, broken))


def test_until_it_is_complete_there_is_no_list_and_no_picture(refined, tmp_path):
    path = tmp_path / "map.h5"
    path.write_bytes(refined.read_bytes())
    with h5py.File(path, "r+") as file:
        file["inferred"][...] = 0
    results = open_results(path)
    assert not results["source"].values.any()
    assert not results["attractor_id"].values.any()
    assert np.isnan(results["point"].values).all()
    assert not status(path)["complete"]
    done = hpcsweep(0, "plot", path, "-o", tmp_path / "map.png")
    assert done.returncode == 2
    assert "known when it is complete" in done.stderr
    assert done.stderr.count("\n") == 1


@together(
    "old, new, said",
    [
        ("wrong = 0.2", 'on = ["class"]', "study.refine.on = ['class']: must be a list of"),
        ("levels = 3", "levels = 13", "study.refine.levels = 13: must be a whole number"),
        ("[sweep]", "[output]\nblock = 2\n[sweep]", "output.block = 2: must be 1"),
        ("[sweep]", "[vary]\nstructure.gap = [0.4, 0.5]\n[sweep]", "go with vary.structure.gap"),
    ],
)
def test_a_mistake_is_one_line_and_nothing_is_written(tmp_path, old, new, said):
    assert old in REFINED
    text = REFINED.replace(old, new, 1)
    with pytest.raises(JobError) as caught:
        parse_job(text, "x.toml", "x")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    job = tmp_path / "x.toml"
    job.write_text(text)
    done = hpcsweep(0, "run", job, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert [*tmp_path.iterdir()] == [job]
