"""The study of attractors: resumed, all commands."""

import contextlib
import itertools
import json
import shutil

import h5py
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from together import together
from tools import ATTRACTORS as JOB
from tools import TWO_STOPS, assert_same_datasets, hpcsweep

import hpcsweep as package
from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.checks.validate import validate
from hpcsweep.commands.cli import main
from hpcsweep.commands.plot import _default
from hpcsweep.figures.attractors import continued, identities
from hpcsweep.figures.diagrams import maps
from hpcsweep.figures.diagrams.attractors import shares
from hpcsweep.figures.explorer.page_data import gather, slots
from hpcsweep.figures.options import figures
from hpcsweep.figures.palette import MOTION_COLOURS, motion_index
from hpcsweep.job import JobError, parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    path = tmp_path_factory.mktemp("attractors") / "job.toml"
    path.write_text(JOB)
    return path


@pytest.fixture(scope="module")
def whole(job):
    path = job.with_name("whole.h5")
    done = hpcsweep(0, "run", job, "-o", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.mark.slow
def test_larger_blocks_give_the_same_results(tmp_path, whole):
    job, path = tmp_path / "blocks.toml", tmp_path / "blocks.h5"
    job.write_text(JOB.replace("block = 2", "block = 4"))
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    two, four = open_results(whole), open_results(path)
    kept = [name for name in two if name != "commit"]
    assert two[kept].equals(four[kept])


@pytest.mark.slow
def test_each_block_restarts_from_what_the_file_holds(tmp_path, job, whole):
    path = tmp_path / "again.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["commit"][0, :, 1:] = 0
        file["commit"][0, 2, 2] = 0
    assert json.loads(hpcsweep(0, "status", path, "--json").stdout)["runs_done"] == 6
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    assert_same_datasets(whole, path)


@pytest.mark.slow
def test_the_file_is_sound_and_tells_damage(tmp_path, whole):
    report = validate(whole, samples=1)
    assert report.problems == []
    assert report.committed == report.blocks == 9
    assert all(run.whole_run == "equal" for run in report.sample)
    assert any(run.difference is not None for run in report.sample)
    path = tmp_path / "damaged.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["share"][0, 1, 3, 0] += 1e-3
    report = validate(path, samples=0)
    assert not report.sound
    assert "damaged byte(s) in share, first in A = 0.66" in report.problems[0]


def test_the_file_holds_what_the_function_finds(whole):
    results = open_results(whole).isel(direction=0)
    study = parse_job(JOB, "job", "job").study
    assert dict(results.sizes)["attractor"] == 4
    structure = Structure(1, 50.0, np.inf, gap=0.5, gap_left=0.5)
    for frame, k in ((0, 0), (1, 5), (2, 3)):
        point = results.isel(omega=frame, amplitude=k)
        found = package.attractors(
            structure,
            float(point["amplitude"]),
            float(point["omega"]),
            starts=24,
            seed=3,
            box=study.box,
            max_cycles=600,
        )
        number = int((point["hits"] > 0).sum())
        assert [one.hits for one in found if one.hits] == point["hits"].values[:number].tolist()
        for slot, one in enumerate(found[:number]):
            same = [s for s in range(number) if point["hits"].values[s] == one.hits]
            near = [np.abs(point["point"].values[s] - one.points).max(axis=1).min() for s in same]
            assert min(near) < 1e-6 or not one.orbit_period
            assert point["share_low"].values[slot] == one.share_low
            assert point["share_high"].values[slot] == one.share_high
        counted = ("n_undecided", "n_failed", "n_elsewhere")
        rest = sum(int(point[name]) for name in counted)
        assert int(point["hits"].sum()) + rest == 24


LIST = (
    """
[study]
kind = "attractors"
starts = 24
max_cycles = 600
points = [[0.7, 1.0], [0.6, 1.1], [0.3, 0.9]]
"""
    + TWO_STOPS
)


@pytest.mark.slow
def test_a_list_of_points_has_the_attractors_of_each_on_its_own(tmp_path):
    job, path = parse_job(LIST, "list", "list"), tmp_path / "list.h5"
    assert campaign.run(job, path, Serial()) == 0
    results = open_results(path).isel(direction=0, amplitude=0)
    assert results["forcing_amplitude"].values.tolist() == [0.7, 0.6, 0.3]
    for place in range(3):
        one = results.isel(omega=place)
        point = float(one["forcing_amplitude"]), float(one["omega"])
        found = package.attractors(job.structure, *point, starts=24, max_cycles=600)
        assert one["hits"].values[: len(found)].tolist() == [each.hits for each in found]
        assert one["attractor_id"].values[: len(found)].tolist() == [*range(1, len(found) + 1)]
    assert results["n_attractors"].values[0] == 2
    cells, _, _ = drawn_cells(path, value="share")
    order = np.argsort(results["omega"].values)
    np.testing.assert_array_equal(cells, results["share"].values[order, 0])
    for extra, words in (
        (("--value", "identity"), "have no identity along a path"),
        (("--kind", "shares"), "draw it with --kind map"),
    ):
        done = hpcsweep(0, "plot", path, *extra, "-o", tmp_path / "none.png")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert words in done.stderr


def test_an_identity_is_carried_along_and_mirrored_motions_are_born_from_one(whole):
    """At Omega = 1 the symmetric motion splits into two at A = 0.63 (clearance.toml)."""
    frame = open_results(whole).isel(direction=0, omega=1)
    assert frame["n_attractors"].values.tolist() == [1, 1, 2, 2, 2, 2]
    ids = [sorted(row[row > 0].tolist()) for row in frame["attractor_id"].values]
    assert ids == [[1], [1], *[[1, 2]] * 4]
    assert frame["last_id"].values.tolist() == [1, 1, 2, 2, 2, 2]
    low, high = frame["share_low"].values[5, :2], frame["share_high"].values[5, :2]
    assert low.max() < high.min()


@pytest.mark.slow
def test_every_command_tells_it(tmp_path, whole):
    state = json.loads(hpcsweep(0, "status", whole, "--json").stdout)
    assert state["complete"]
    assert state["study"] == "attractors"
    assert state["starts"] == 18 * 24
    assert state["most_attractors"] == int(open_results(whole)["n_attractors"].max())
    assert "attractors a point" in hpcsweep(0, "status", whole).stdout
    (reported,) = json.loads(hpcsweep(0, "summary", whole, "--json").stdout)
    assert reported["runs_done"] == 18
    assert reported["attractors"] == int((open_results(whole)["attractor_id"] > 0).sum())
    assert sum(entry["runs"] for entry in reported["numbers"].values()) == 18
    assert "points with 2 attractors" in hpcsweep(0, "summary", whole).stdout
    sweep = tmp_path / "sweep.toml"
    settings = JOB.split("[structure]")[1].replace("max_points = 32\n", "")
    sweep.write_text("[structure]" + settings)
    assert hpcsweep(0, "run", sweep, "-o", tmp_path / "sweep.h5").returncode == 0
    for given in (
        (),
        ("--kind", "shares", "--omega", "1.0"),
        ("--kind", "number"),
        ("--kind", "number", "--sweep", tmp_path / "sweep.h5"),
    ):
        picture = tmp_path / "picture.png"
        done = hpcsweep(0, "plot", whole, *given, "-o", picture)
        assert done.returncode == 0, done.stderr
        assert picture.stat().st_size > 10_000
        picture.unlink()
    for arguments in (
        ("plot", whole, "--kind", "orbit"),
        ("plot", tmp_path / "sweep.h5", "--kind", "shares"),
        ("plot", whole, "--kind", "number", "--sweep", whole),
        ("animate", whole, "-o", tmp_path / "film.mp4"),
    ):
        done = hpcsweep(0, *arguments)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "holds" in done.stderr


def drawn_cells(path, **options):
    """Return the numbers of the cells of a map, frame by frame, and its colours and keys."""
    with contextlib.closing(Frames(path, "attractors")) as frames:
        results = maps.motion_map.load(frames, **options)
    figure = maps.motion_map.draw(results, **options)
    mesh = figure.axes[0].collections[0]
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return np.ma.masked_array(mesh.get_array()), mesh.get_cmap(), words


def test_the_map_shows_what_the_file_holds_of_the_attractor_of_the_largest_share(whole):
    results = open_results(whole).isel(direction=0)
    first = results.isel(attractor=0)
    assert (first["hits"] == results["hits"].max("attractor")).all()
    cells, colours, words = drawn_cells(whole)
    assert all(colours(int(k))[:3] == to_rgb(MOTION_COLOURS[k]) for k in np.unique(cells))
    motion = motion_index(first["motion"].values, first["orbit_period"].values)
    motion[first["contact"].values == 0] = 0
    np.testing.assert_array_equal(cells, motion)
    assert any(word.startswith("P1  ") for word in words)
    for name, values in (
        ("share", first["hits"].values / 24),
        ("drift", first["drift"].values),
        ("number", np.minimum(results["n_attractors"].values, 5) - 1),
    ):
        np.testing.assert_array_equal(drawn_cells(whole, value=name)[0], values, name)


def test_identities_over_both_parameters(whole):
    """Each keeps its own along the amplitudes, and continues the one it is near to."""
    results = open_results(whole).isel(direction=0)
    with contextlib.closing(Frames(whole, "attractors")) as frames:
        found = identities(frames)
    stored = results["attractor_id"].values
    assert ((found > 0) == (stored > 0)).all()
    for frame in range(3):
        pairs = {*zip(stored[frame].ravel().tolist(), found[frame].ravel().tolist(), strict=True)}
        assert len(pairs) == len(dict(pairs)) == len({new for _, new in pairs})
    # the symmetric motion of Omega = 1 and 1.1 is one sheet, on which it hardly moves
    point = results["point"].values
    assert np.abs(point[2, :2, 0] - point[1, :2, 0]).max() < 0.06
    assert (found[2, :, 0] == found[1, 0, 0]).all()
    # at Omega = 0.9 it has lost its stability: of the two it meets there it continues the nearer
    near = np.abs(point[0, 0, :2] - point[1, 0, 0]).max(axis=1)
    assert found[1, 0, 0] == found[0, 0, np.argmin(near)]
    cells, _, words = drawn_cells(whole, value="identity")
    numbers = [int(word.split(",")[0]) for word in words[: len(np.unique(found[:, :, 0]))]]
    np.testing.assert_array_equal(np.array(numbers)[cells.astype(int)], found[:, :, 0])


def test_an_identity_continues_that_with_most_amplitudes_in_common():
    votes = {(7, 1): 3, (7, 2): 5, (4, 2): 4, (4, 3): 1, (9, 1): 3}
    assert continued(votes) == {2: 7, 1: 9, 3: 4}


@pytest.mark.slow
def test_a_grid_of_attractors_is_a_map_by_default(tmp_path, whole):
    pictures = [tmp_path / f"{k}.png" for k in range(3)]
    options = [], ["--kind", "map"], ["--kind", "attractors"]
    for picture, extra in zip(pictures, options, strict=True):
        assert main(["plot", str(whole), "-o", str(picture), "--dpi", "50", *extra]) == 0
    assert pictures[0].read_bytes() == pictures[1].read_bytes() != pictures[2].read_bytes()
    known = figures()
    for given, kind in (
        ("omega = [0.9, 1.0, 1.1]", "map"),
        ("omega = 0.9", "attractors"),
    ):
        text = JOB.replace("omega = [0.9, 1.0, 1.1]", given)
        assert _default(parse_job(text, "job", "job"), known) == kind
    refined = 'kind = "attractors"\nrefine = {levels = 2}'
    text = JOB.replace('kind = "attractors"', refined).replace("block = 2", "")
    assert _default(parse_job(text, "job", "job"), known) == "number"


def test_stacked_shares_fill_the_panel_over_the_amplitudes(whole):
    """No start of this job is undecided, so that nothing but attractors is to be seen."""
    results = open_results(whole)
    assert not results["n_undecided"].values.any()
    figure = shares.draw(results.sel(omega=[1.0]))
    stacked = figure.axes[0]
    assert stacked.get_xlim() == (0.6, 0.7)
    assert stacked.get_ylim() == (0.0, 1.0)
    cells = np.array([path.get_extents().extents for path in stacked.collections[0].get_paths()])
    assert cells[:, :2].min(axis=0) == pytest.approx((0.6, 0.0))
    assert cells[:, 2:].max(axis=0) == pytest.approx((0.7, 1.0))
    area = np.prod(cells[:, 2:] - cells[:, :2], axis=1).sum()
    assert area == pytest.approx(0.1)


def test_the_explorer_shows_attractors_by_share(whole):
    study, results = (
        gather(Frames(whole, "attractors"), by_share=True),
        open_results(whole).isel(direction=0),
    )
    assert study.words[0] == "attractor 1 by share"
    shares = results["share"].values.transpose(0, 2, 1)[:, : len(study.directions)]
    np.testing.assert_array_equal(study.runs["share"], shares.astype(np.float32))


def test_the_explorer_keeps_each_attractor_in_a_place_of_its_own(tmp_path, whole):
    study, results = gather(Frames(whole, "attractors")), open_results(whole).isel(direction=0)
    assert study.each == "attractor"
    n = len(study.directions)
    assert int(results["n_attractors"].max()) <= n <= results.sizes["attractor"]
    assert study.directions == ("1", "2", "3", "4")[:n]
    assert study.words == tuple(f"attractor {name}" for name in study.directions)
    identity, share, period = (
        results[name].transpose("omega", "amplitude", "attractor").values
        for name in ("attractor_id", "share", "orbit_period")
    )
    number = np.broadcast_to(results["n_attractors"].values[:, None], study.runs["motion"].shape)
    for frame, row in np.ndindex(identity.shape[:2]):
        held = identity[frame, row] > 0
        shown = study.runs["motion"][frame, :, row] > 0
        assert shown.sum() == held.sum()
        places = np.flatnonzero(shown)
        assert np.isnan(study.runs["number"][frame, ~shown, row]).all()
        assert np.array_equal(study.runs["number"][frame, shown, row], number[frame, shown, row])
        stored = np.stack((share[frame, row, held].astype(np.float32), period[frame, row, held]))
        codes, values = study.runs["period"], study.runs["share"]
        drawn = np.stack((values[frame, places, row], codes[frame, places, row]))
        assert sorted(stored.T.tolist()) == sorted(drawn.T.tolist())


def test_places_of_attractors_are_kept_along_the_amplitudes():
    identity = np.array([[1, 0, 0], [2, 1, 0], [3, 1, 2], [3, 0, 0], [4, 3, 0]])
    order = slots(identity)
    assert np.sort(order).tolist() == [[0, 1, 2]] * 5
    shown = np.take_along_axis(identity, order, axis=1)
    assert shown[0].tolist() == [1, 0, 0]
    assert shown[1].tolist()[0] == 1
    for before, after in itertools.pairwise(shown):
        for place, one in enumerate(before):
            assert not one or one not in after or after[place] == one
    assert [sorted(row) for row in shown.tolist()] == [sorted(row) for row in identity.tolist()]


@together(
    "old, new, words",
    [
        ("starts = 24", "starts = 0", ("study.starts", "0", "1 to")),
        ("seed = 3", "seed = -1", ("study.seed", "-1")),
        ("[-1.0, 0.9]", "[0.9, -1.0]", ("study.displacement", "low below high")),
        ("[-1.0, 0.9]", "[[0, 1], [0, 1]]", ("study.displacement", "n = 1")),
        ("[-1.0, 0.9]", "0.5", ("study.displacement", "[low, high]")),
        ("max_attractors = 4", "max_attractors = 65", ("study.max_attractors", "1 to 64")),
        ("max_cycles = 600", "max_cycles = 0", ("study.max_cycles", "0")),
        ("seed = 3", "confidence = 1.0", ("study.confidence", "from 0.5 to 1")),
        ("match_distance = 0.3", "match_distance = 0", ("study.match_distance", "from 1e-09 to")),
        ("seed = 3", "sead = 3", ("study.sead", "'seed'")),
        ("[output]", '[solver]\nskip = "none"\n[output]', ("solver.skip", '"all"')),
        ("[output]", "[output]\npoincare = false", ("output.poincare", "true")),
        ('kind = "attractors"\n', "", ("study.starts", "attractors")),
        ("omega = [", 'directions = ["up"]\nomega = [', ("sweep.directions", "amplitude_sweep")),
    ],
)
def test_a_mistake_in_a_job_is_one_line(old, new, words):
    assert old in JOB
    with pytest.raises(JobError) as caught:
        parse_job(JOB.replace(old, new), "x.toml", "x")
    text = str(caught.value)
    assert "\n" not in text
    for word in ("x.toml", *words):
        assert word in text
