"""Single points: a grid or a list."""

import json

import numpy as np
import pytest
from tools import GRID, hpcsweep

from hpcsweep import open_results
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.store import Frames, Grid
from hpcsweep.studies.quantities import CONTACT_MEASURES, MEASURES
from hpcsweep.studies.sweep.runs import frame_runs

LIST = """
[study]
kind = "points"
points = [[0.05, 0.6], [0.2, 0.5], [0.2, 0.6], [0.0, 0.7]]
[structure]
n_floors = 2
stiffness_ratio = 300.0
[sweep]
transient_cycles = 30
sampling_cycles = 20
max_orbit_period = 6
initial_state = [0.1, 0.2, 0.0, 0.3]
"""


@pytest.fixture
def grid_job(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(GRID)
    return path


@pytest.mark.slow
def test_a_point_is_the_run_from_the_initial_state(tmp_path, grid_job):
    path = tmp_path / "grid.h5"
    assert hpcsweep(0, "run", grid_job, "-o", path).returncode == 0
    results = open_results(path)
    study = parse_job(GRID, "grid", "grid").study
    assert results["direction"].values.tolist() == ["initial"]
    assert dict(results.sizes)["omega"] == 4
    for frame, at in ((0, 0), (2, 7), (3, 10)):
        alone = frame_runs(study.structure, float(study.omega[frame]), study.settings).follow(
            study.amplitude[at : at + 1], study.initial_state
        )
        for name, values in alone.items():
            stored = results[name].values[0, frame, at]
            assert np.array_equal(stored, values[0], equal_nan=True), name
    report = validate(path, samples=1)
    assert report.problems == []
    assert report.committed == report.blocks == 44
    assert all(run.whole_run == "equal" for run in report.sample)


def test_larger_blocks_give_the_same_results_in_fewer_tasks(tmp_path, grid_job):
    assert hpcsweep(0, "run", grid_job, "-o", tmp_path / "1.h5").returncode == 0
    grid_job.write_text(GRID + "block = 4\n")
    assert hpcsweep(0, "run", grid_job, "-o", tmp_path / "4.h5").returncode == 0
    one, four = open_results(tmp_path / "1.h5"), open_results(tmp_path / "4.h5")
    assert four.sizes["block"] == 3
    kept = [name for name in one if name != "commit"]
    assert one[kept].equals(four[kept])
    assert parse_job(grid_job.read_text(), "", "x").study.n_tasks == 12


@pytest.mark.slow
def test_a_list_of_points_has_a_frame_a_point(tmp_path):
    job, path = tmp_path / "list.toml", tmp_path / "list.h5"
    job.write_text(LIST)
    done = hpcsweep(0, "run", job, "-o", path)
    assert done.returncode == 0, done.stderr
    results = open_results(path)
    assert results["forcing_amplitude"].values.tolist() == [0.05, 0.2, 0.2, 0.0]
    assert results["omega"].values.tolist() == [0.6, 0.5, 0.6, 0.7]
    assert dict(results.sizes)["amplitude"] == 1
    study = parse_job(LIST, "", "list").study
    alone = frame_runs(study.structure, 0.6, study.settings).follow([0.2], study.initial_state)
    assert np.array_equal(results["final_state"].values[0, 2, 0], alone["final_state"][0])
    assert validate(path, samples=1).problems == []
    state = json.loads(hpcsweep(0, "status", path, "--json").stdout)
    assert state["complete"]
    assert state["study"] == "points"
    assert state["runs_total"] == 4
    html = tmp_path / "page.html"
    for command in (
        ("summary", path),
        ("plot", path, "--kind", "map", "--value", "drift"),
        ("explore", path, "-o", html),
        ("pack", path),
        ("summary", path),
    ):
        done = hpcsweep(0, *command, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert hpcsweep(0, "run", job, "-o", path).returncode == 2


def test_a_list_lies_on_the_grid_of_its_frequencies_and_amplitudes(tmp_path):
    job, path = tmp_path / "list.toml", tmp_path / "list.h5"
    job.write_text(LIST)
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    frames = Frames(path)
    try:
        grid = Grid(frames)
        assert grid.rows.tolist() == [0.5, 0.6, 0.7]
        assert grid.along.tolist() == [0.0, 0.05, 0.2]
        middle = grid.dataset(1)
        assert middle["outcome"].values[0, 0].tolist() == [0, 1, 1]
        own = frames.dataset(2)["final_state"].values[0, 0, 0]
        assert np.array_equal(middle["final_state"].values[0, 0, 2], own)
        assert np.isnan(middle["drift"].values[0, 0, 0])
        assert middle.coords.keys() == frames.dataset(2).coords.keys()
    finally:
        frames.close()


def test_the_grid_of_a_grid_is_its_frames(tmp_path, grid_job):
    path = tmp_path / "grid.h5"
    assert hpcsweep(0, "run", grid_job, "-o", path).returncode == 0
    frames = Frames(path)
    try:
        assert Grid(frames).dataset(2).identical(frames.dataset(2))
    finally:
        frames.close()


@pytest.mark.slow
def test_points_without_their_stroboscopic_points_are_drawn_as_a_map(tmp_path):
    job, path = tmp_path / "grid.toml", tmp_path / "grid.h5"
    job.write_text(GRID + "poincare = false\n")
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    for place, kind in enumerate(([], ["--kind", "map"])):
        done = hpcsweep(0, "plot", path, *kind, "-o", tmp_path / f"{place}.png")
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "0.png").read_bytes() == (tmp_path / "1.png").read_bytes()


def test_contacts_that_a_structure_lacks_have_no_variable(tmp_path):
    text = "[structure]\nn_floors = 1\ngap = inf\n[sweep]\nomega = 0.6\namplitude = 0.1\n"
    text += "\n".join(["[output]", *(f"{name} = true" for name in MEASURES)])
    for kind in ("amplitude_sweep", "points", "attractors", "basins"):
        study = parse_job(f"{text}\n[study]\nkind = '{kind}'\n", "job", "job").study
        assert min(study.dimensions.values()) > 0, kind
        assert not {v.name for v in study.variables} & {*CONTACT_MEASURES}, kind
    (tmp_path / "job.toml").write_text(text)
    assert hpcsweep(0, "run", tmp_path / "job.toml", "-o", tmp_path / "a.h5").returncode == 0
    assert open_results(tmp_path / "a.h5")["displacement"].notnull().all()
