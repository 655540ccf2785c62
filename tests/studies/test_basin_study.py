"""The study of basins: known answers, resumed, all commands."""

import json
import shutil

import h5py
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from together import together
from tools import BASINS as JOB
from tools import assert_same_datasets, hpcsweep

from hpcsweep import basin_boundary, open_results
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import StateBasins
from hpcsweep.figures.diagrams.basins import attractors_of
from hpcsweep.figures.palette import MOTION_COLOURS, MOTION_NAMES
from hpcsweep.job import JobError, parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    path = tmp_path_factory.mktemp("basins") / "job.toml"
    path.write_text(JOB)
    return path


@pytest.fixture(scope="module")
def whole(job):
    path = job.with_name("whole.h5")
    done = hpcsweep(0, "run", job, "-o", path)
    assert done.returncode == 0, done.stderr
    return path


def test_each_row_is_computed_again_as_it_was(tmp_path, job, whole):
    path = tmp_path / "again.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["commit"][0, 1::2] = 0
    assert json.loads(hpcsweep(0, "status", path, "--json").stdout)["runs_done"] == 4
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    assert_same_datasets(whole, path)


@pytest.mark.slow
def test_the_file_is_sound_and_tells_damage(tmp_path, whole):
    report = validate(whole, samples=2)
    assert report.problems == []
    assert report.committed == report.blocks == 7
    assert all(run.whole_run == "equal" for run in report.sample)
    assert any(run.difference is not None for run in report.sample)
    path = tmp_path / "damaged.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["label"][0, 3, 0, 2] = 3 - file["label"][0, 3, 0, 2]
    report = validate(path, samples=0)
    assert not report.sound
    assert "damaged byte(s) in label" in report.problems[0]


def test_rows_that_contradict_themselves_are_told(whole):
    study = parse_job(JOB, "job", "job").study
    results = open_results(whole)
    rows = {v.name: results[v.name].values[0, 2] for v in study.variables}
    assert study.check(study.block((0, 2, 0)), rows) == []
    for name, value, word in (
        ("hits", 100, "hits are those"),
        ("orbit_period", 0, "have a period"),
        ("multiplier", 1.5, "orbits attract"),
        ("attractor_id", 2, "numbered from 1"),
    ):
        broken = {**rows, name: rows[name].copy()}
        broken[name][0, 0] = value
        assert any(word in reported for _, reported in study.check(study.block((0, 2, 0)), broken))
    broken = {**rows, "label": rows["label"].copy()}
    broken["label"][0, 0] = 7
    assert any(
        "is labelled" in reported for _, reported in study.check(study.block((0, 2, 0)), broken)
    )


def test_each_start_goes_where_it_goes_when_it_is_decided_alone(whole):
    study, results = parse_job(JOB, "job", "job").study, open_results(whole)
    search = AttractorSearch(
        make_solver("flow", study.structure, 1.0, 1e-9), 0.7, study.settings, 600, 0.95, None
    )
    labels, points = results["label"].values[0, :, 0], results["point"].values[0, 0, 0]
    assert set(np.unique(labels)) == {1, 2}
    for row, v in enumerate(study.vertical):
        for column, u in enumerate(study.horizontal):
            own = search.attractors[search.classify(np.array([u, v]))]
            listed = points[labels[row, column] - 1]
            assert np.abs(own.points - listed).max(axis=1).min() < 1e-6


def test_the_mirror_image_of_a_slice_has_the_mirrored_basins(tmp_path, whole):
    """u -> -u and the opposite forcing: labels are those of the mirrored grid."""
    text = JOB.replace("from = -0.9, to = 1.0", "from = -1.0, to = 0.9")
    text += "[forcing]\nharmonics = [{order = 1, amplitude = -1.0}]\n"
    job, path = tmp_path / "mirror.toml", tmp_path / "mirror.h5"
    job.write_text(text)
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    one, other = open_results(whole), open_results(path)
    mirrored = other["label"].values[0, ::-1, 0, ::-1]
    points, images = (each["point"].values[0, 0, 0, :2] for each in (one, other))
    partner = [1 + int(np.abs(images + point).max(axis=1).argmin()) for point in points]
    assert sorted(partner) == [1, 2]
    assert np.abs(images[np.array(partner) - 1] + points).max() < 1e-6
    assert np.array_equal(np.array(partner)[one["label"].values[0, :, 0] - 1], mirrored)


def test_a_row_looks_at_its_messages_as_often_as_it_has_starts():
    study, polls = parse_job(JOB, "x", "x").study, []
    one = np.array([0])
    study.runs_at(3, one, study.initial_state)
    study.runs_at(2, one, study.initial_state, lambda: polls.append(1))
    assert len(polls) >= study.polls_per_run == 9


def test_a_linear_structure_has_one_basin():
    study = parse_job(
        JOB.replace("stiffness_ratio = 50.0", "stiffness_ratio = 0.0"), "x", "x"
    ).study
    for frame in (0, 6):
        row = study.runs_at(frame, np.array([0]), study.initial_state)
        assert np.all(row["label"] == 1)
        assert row["hits"][0].tolist() == [9, 0, 0, 0, 0, 0, 0, 0]
        assert row["orbit_period"][0, 0] == 1


def test_a_group_is_told_alike_in_any_order_and_what_is_not_listed_is_elsewhere():
    structure = Structure(1, 50.0, np.inf, gap=0.5, gap_left=0.5)
    solver = make_solver("flow", structure, 1.0, 1e-9)
    rng = np.random.default_rng(4)
    states = rng.uniform(-1, 1, (60, 2))

    def basins(starts, most):
        search = AttractorSearch(solver, 0.7, SweepSettings(), 600, 0.95, None)
        return StateBasins(search, starts, most)

    both = basins(states[:20], 8)
    assert [one.hits for one in both.attractors] == sorted(
        (one.hits for one in both.attractors), reverse=True
    )
    first, _ = both.labels(states[20:40])
    second, _ = both.labels(states[40:])
    again, _ = both.labels(states[20:40])
    assert np.array_equal(first, again)
    one = basins(states[:20], 1)
    (kept,) = one.attractors
    assert kept.hits == both.attractors[0].hits
    assert np.array_equal(one.labels(states[40:])[0], np.where(second == 0, 0, ELSEWHERE))
    none = basins(states[:0], 8)
    assert none.attractors == []
    assert set(none.labels(states[:4])[0].tolist()) == {ELSEWHERE}
    assert ELSEWHERE not in (UNDECIDED, FAILED)


def test_attractors_of_one_motion_have_shades_of_its_colour(whole):
    listed = attractors_of(open_results(whole), 0)
    colours = [colour for _, colour, _ in listed.values()]
    assert colours[0] == MOTION_COLOURS[MOTION_NAMES.index("P1")]
    assert len(set(colours)) == 2
    assert [name for name, _, _ in listed.values()] == ["P1 C1,1L", "P1 C1,1L"]


@pytest.mark.slow
def test_every_command_tells_it(tmp_path, whole):
    state = json.loads(hpcsweep(0, "status", whole, "--json").stdout)
    assert state["complete"]
    assert state["study"] == "basins"
    assert state["starts"] == 63
    assert "periods; undecided 0" in hpcsweep(0, "status", whole).stdout
    (reported,) = json.loads(hpcsweep(0, "summary", whole, "--json").stdout)
    assert sum(entry["runs"] for entry in reported["basins"].values()) == 63
    boundary = basin_boundary(open_results(whole).label.values[0, :, 0])
    told = {**boundary._asdict(), "exponent": None}
    assert reported["boundaries"] == {"of the slice": told}
    listed = hpcsweep(0, "summary", whole).stdout
    assert "starts to 1, P1" in listed
    assert f"{boundary.entropy:.4g}, on the boundary {boundary.boundary_entropy:.4g}" in listed
    picture = tmp_path / "picture.png"
    done = hpcsweep(0, "plot", whole, "-o", picture)
    assert done.returncode == 0, done.stderr
    with Image.open(picture) as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(maxcolors=1 << 24)}
    shades = [shade for _, shade, _ in attractors_of(open_results(whole), 0).values()]
    assert {tuple(round(255 * part) for part in to_rgb(shade)) for shade in shades} <= colours
    for arguments in (
        ("plot", whole, "--kind", "map"),
        ("plot", whole, "--kind", "shares"),
        ("explore", whole, "-o", tmp_path / "page.html"),
    ):
        done = hpcsweep(0, *arguments)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "holds basins" in done.stderr
    assert not (tmp_path / "page.html").exists()


@together(
    "old, new, words",
    [
        ("omega = 1.0", "omega = [1.0, 1.1]", ("sweep.omega", "one number")),
        ("amplitude = 0.7", "amplitude = [0.6, 0.7]", ("sweep.amplitude", "one number")),
        ("seed = 2", 'components = ["u_1", "u_1"]', ("study.components", "two of u_1")),
        ("seed = 2", 'components = ["u_1", "v_2"]', ("study.components", "v_2")),
        ("seed = 2", 'components = "u_1"', ("study.components", "two of")),
        ("seed = 2", "horisontal = 3", ("study.horisontal", "'horizontal'")),
        ("vertical = {from = -1.0, to = 1.0, count = 7}", "vertical = 1.0", ("two values",)),
        ("vertical = {from = -1.0, to = 1.0", "vertical = {from = 2.0, to = 1.0", ("less than",)),
        ("count = 9", "count = 100001", ("study.horizontal", "100000")),
        ("starts = 16", "starts = 0", ("study.starts", "1 to")),
        ("max_cycles = 600", "max_attractors = 65", ("study.max_attractors", "1 to 64")),
        ("[sweep]", '[solver]\nskip = "none"\n[sweep]', ("solver.skip", '"all"')),
        ("[sweep]", "[output]\nblock = 2\n[sweep]", ("output.block", "each row")),
        ("[sweep]", "[sweep]\nclassify_cycles = 5", ("sweep.classify_cycles", "max_cycles")),
        ("seed = 2", "confidence = 0.9", ("study.confidence", "attractors")),
        ('kind = "basins"\n', "", ("study.horizontal", "basins")),
    ],
)
def test_a_mistake_in_a_job_is_one_line(old, new, words):
    assert old in JOB
    with pytest.raises(JobError) as caught:
        parse_job(JOB.replace(old, new, 1), "x.toml", "x")
    text = str(caught.value)
    assert "\n" not in text
    for word in ("x.toml", *words):
        assert word in text


def test_components_of_buildings_have_the_names_of_their_floors():
    buildings = """
        [[building]]
        mass = [1.0, 1.0]
        storey_stiffness = 100.0
        [[building]]
        name = "old"
        mass = 1.0
        storey_stiffness = 80.0
        [pounding]
        gap = 0.1
        stiffness = 1e4
        [study]
        kind = "basins"
        components = ["u_A2", "v_old1"]
        [sweep]
        omega = 5.0
        amplitude = 0.5
        """
    study = parse_job(buildings, "x.toml", "x").study
    assert study.components == (1, 5)
    assert study.names() == ("u_A2", "v_old1")
    assert list(study.coordinates["state"].values) == [
        *("u_A1", "u_A2", "u_old1", "v_A1", "v_A2", "v_old1")
    ]
    with pytest.raises(JobError, match="must be two of u_A1, u_A2, u_old1, v_A1, v_A2"):
        parse_job(buildings.replace("u_A2", "u_2"), "x.toml", "x")
    yields = buildings.replace("mass = 1.0", "mass = 1.0\nyield_drift = 0.1")
    with pytest.raises(JobError, match=r"v_old1, p_old1$"):
        parse_job(yields.replace("u_A2", "p_1"), "x.toml", "x")


def test_a_slice_along_rows_has_the_nearest_starts_with_these_values():
    text = JOB_OF_ROWS
    study = parse_job(text, "rows.toml", "rows").study
    assert study.names() == ("u_1-2", "v_2")
    starts = study.at(np.array([-0.5, 0.5]), 0.25)
    assert np.allclose(starts[:, 0] - starts[:, 1], [-0.5, 0.5])
    assert np.allclose(starts[:, 0] + starts[:, 1], 0.3 + 0.1)  # as at the initial state
    assert np.array_equal(starts[:, 2:], [[0.0, 0.25], [0.0, 0.25]])
    assert np.allclose(study.starting_states, [[0.7, 0.7, 0.0, 1.0]])
    wrong = text.replace("u_1-2", "u_1-3")
    with pytest.raises(JobError, match=r"study.components = .*must be two of u_1, u_2"):
        parse_job(wrong, "rows.toml", "rows")


JOB_OF_ROWS = """
[study]
kind = "basins"
components = ["u_1-2", "v_2"]
horizontal = [-1.0, 1.0]
vertical = [-1.0, 0.5]
[structure]
n_floors = 2
[sweep]
omega = 0.7
amplitude = 0.3
initial_state = [0.3, 0.1, 0.0, 0.0]
"""
