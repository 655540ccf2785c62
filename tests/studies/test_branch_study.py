"""The study of branches: all motions of a file lie on them."""

import contextlib
import json
import re
import runpy
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest
from tools import SEEDS, TWO_STOPS, hpcsweep, spot

from hpcsweep import Structure, branch, meanings, open_results, orbit
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.figures.diagrams.branches import branches
from hpcsweep.figures.film.frames import Film, Request, joined
from hpcsweep.figures.film.picture import Picture
from hpcsweep.figures.overlay import MARKS, with_specials
from hpcsweep.figures.style import PlotError
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.solvers.flow.specialised import branch_kernels
from hpcsweep.store import Frames

BRANCHES = """
extends = "sweep.toml"
[study]
kind = "branches"
[branches]
seeds = "{seeds}"
steps = 300
max_points = 2000
max_seeds = 40
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("branches")
    (folder / "sweep.toml").write_text(SEEDS)
    done = hpcsweep(0, "run", folder / "sweep.toml", "-o", folder / "sweep.h5")
    assert done.returncode == 0, done.stderr
    (folder / "job.toml").write_text(BRANCHES.format(seeds=folder / "sweep.h5"))
    return folder


@pytest.fixture(scope="module")
def whole(folder):
    done = hpcsweep(0, "run", folder / "job.toml", "-o", folder / "whole.h5")
    assert done.returncode == 0, done.stderr
    return folder / "whole.h5"


def test_the_kernels_that_follow_branches_are_there_before_the_first_run(folder):
    study = load_job(folder / "job.toml").study
    names = {one.__name__ for one in branch_kernels(study.structure)}
    assert {"take_round", "advance_chain"} <= names
    study.warm_up()
    assert study.is_compiled()


@pytest.mark.slow
def test_every_periodic_motion_of_the_file_lies_on_a_branch(folder, whole):
    runs, results = open_results(folder / "sweep.h5"), open_results(whole)
    periodic = (runs["orbit_period"] > 0).sum(("direction", "amplitude")).values
    assert periodic.min() >= 18
    for line in range(3):
        own = results.isel(direction=0, line=line, amplitude=0)
        values = own["seed_value"].values[own["seed_period"].values > 0]
        there = (runs["orbit_period"].isel(omega=line) > 0).any("direction")
        assert set(values) == set(runs["amplitude"].values[there.values])
        assert own["n_covered"] == own["n_seeds"] == values.size
        assert own["seed_distance"].values[: values.size].max() < 1e-6
    (told,) = json.loads(hpcsweep(0, "summary", whole, "--json").stdout)
    assert told["seeds_covered"]["share"] == 1.0
    assert told["seeds_missed"] == []


def test_the_numbers_of_special_points_have_words(whole):
    results = open_results(whole)
    for name in ("special_kind", "criticality", "ends", "found_by", "seed_reason"):
        words, numbers = meanings(results[name]).values, results[name].values
        assert (words[numbers == 0] == ("on a branch" if name == "seed_reason" else "none")).all()
    kinds = meanings(results.special_kind).values
    assert (kinds[results.special_kind.values == 1] == "fold").all()
    assert (kinds == "fold").any()


def test_a_branch_in_python_has_the_form_and_the_values_of_the_file(folder, whole):
    study = load_job(folder / "job.toml").study
    run = open_results(whole).isel(direction=0, line=1, amplitude=0)
    first = branch(
        study.structure,
        *(float(run.seed_value[0]), float(run.omega), run.seed_point.values[0]),
        *(int(run.seed_period[0]), "amplitude", study.span, study.steps, study.largest_step),
    )
    held = {"branch": run.branch_id == 1, "step": run.step_branch == 1}
    held["special"] = run.special_branch == 1
    held = {dim: np.flatnonzero(is_held) for dim, is_held in held.items()}
    # it starts from an orbit, the file from a seed: steps that are alike, of one curve
    apart = np.abs(first["value"].values[:, None] - run["value"].values[held["step"]])
    alike, there = np.nonzero(apart < 1e-8)
    assert alike.size > first.sizes["step"] // 2
    shown = {"branch": [0], "step": alike, "special": np.arange(first.sizes["special"])}
    held["step"] = held["step"][there]
    more = {"orbit", "special_orbit", "multiplier", "special_multiplier", "contact_change"}
    assert set(first.data_vars) - set(run.data_vars) == more | {"leaving", "leaving_value"}
    shared = [name for name in first.data_vars if name in run]
    assert {"point", "stable", "special_kind", "ends", "change", "drift"} < set(shared)
    for name in shared:
        (dim,) = (dim for dim in run[name].dims if dim in held)
        assert first[name].dims == run[name].dims
        assert first[name].dtype == run[name].dtype
        notes = {key: value for key, value in first[name].attrs.items() if "value" not in key}
        if name != "value":  # whose long name is that of the parameter
            assert all(np.array_equal(run[name].attrs[key], notes[key]) for key in notes), name
        if name not in ("leads_to", "special_step"):  # which other branches leave is not followed
            values, expected = first[name].isel({dim: shown[dim]}), run[name].isel({dim: held[dim]})
            np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6, err_msg=name)
    assert meanings(first.ends).item() == first.attrs["ends"]
    np.testing.assert_array_equal(first.orbit.values[:, 0], first.point)


def test_points_of_branches_are_orbits_stable_or_not(whole):
    results = open_results(whole)
    structure = parse_job(results.attrs["job"], "job", "job").structure
    run = results.isel(direction=0, line=1, amplitude=0)
    period = dict(zip(run["branch_id"].values, run["branch_period"].values, strict=True))
    steps = np.flatnonzero(run["step_branch"].values)
    assert {0, 1} == set(run["stable"].values[steps].tolist())
    real = run["multiplier_real"].values
    apart = np.abs(real[steps] - 1.0).min(axis=1) > 0.01  # at a fold an orbit is not alone
    steps = steps[apart]
    for step in steps[:: max(steps.size // 12, 1)]:
        at, there = float(run["value"][step]), run["point"].values[step]
        p = int(period[int(run["step_branch"][step])])
        found = orbit(structure, at, float(results["omega"][1]), there, p)
        assert np.abs(found.points[0] - there).max() < 1e-9
        own = run["multiplier_real"].values[step] + 1j * run["multiplier_imag"].values[step]
        np.testing.assert_allclose(found.multipliers, own, rtol=0, atol=1e-5)


@pytest.mark.slow
def test_the_file_is_sound_and_lines_that_contradict_themselves_are_told(folder, whole):
    report = validate(whole, samples=1)
    assert report.problems == []
    assert all(run.whole_run == "equal" for run in report.sample)
    assert any(run.difference is not None for run in report.sample)
    results = open_results(whole)
    study = parse_job(results.attrs["job"], "job", "job").study
    rows = {v.name: results[v.name].values[0, 1] for v in study.variables}
    block = study.block((0, 1, 0))
    assert study.check(block, rows) == []
    for name, value, word in (
        ("stable", 7, "stable is that"),
        ("value", 9.0, "in the span"),
        ("seed_branch", 0, "told why not"),
        ("branch_id", 3, "numbered from 1"),
    ):
        broken = {**rows, name: rows[name].copy()}
        broken[name][0, 0] = value if name != "stable" else 1 - rows["stable"][0, 0]
        assert any(word in told for _, told in study.check(block, broken)), name


@pytest.mark.slow
def test_the_figure_draws_a_line_over_the_runs_of_a_sweep(folder, whole):
    picture = folder / "line.png"
    told = ("--line", 1, "--sweep", folder / "sweep.h5", "-o", picture)
    assert hpcsweep(0, "plot", whole, *told).returncode == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    with contextlib.closing(Frames(whole, "branches")) as frames:
        read = branches.load(frames, 1, folder / "sweep.h5")
    figure = branches.draw(read)
    (axis,) = figure.axes
    assert max(runs.zorder for runs in axis.collections) < min(line.zorder for line in axis.lines)
    value, kind = (read[0][f"special_{name}"].values.ravel() for name in ("value", "kind"))
    rows = [text.get_text().split() for text in figure.legends[1].get_texts()]
    listed = [float(row[-1]) for row in rows]
    assert listed == sorted(listed)
    assert [row[0] for row in rows] == [str(k + 1) for k in range(len(rows))]
    for row in rows:
        near = np.isclose(value, float(row[-1]), rtol=1e-5)
        assert " ".join(row[1:-2]) in {MARKS[k][0] for k in kind[near]}
    numbers = [int(part) for text in axis.texts for part in re.split("[,–]", text.get_text())]
    assert {1, len(rows)} <= set(numbers) <= set(range(1, len(rows) + 1))
    done = hpcsweep(0, "plot", whole, "--line", 3, "-o", folder / "none.png")
    assert done.returncode == 2
    assert "there are 3 lines" in done.stderr


@pytest.mark.slow
def test_branches_lie_under_the_points_of_a_film(folder, whole):
    """Where a branch passes and no run is, the frame has the branch's colour."""
    request = Request(folder / "sweep.h5", folder / "film.mp4", branches=whole)
    film = Film(request)
    picture = Picture(film, joined([film.survey(1)]))
    pixels = picture.paint(1)
    bare = picture.draw(1.0, film.read(1))
    panel = picture.panels[0]
    seen = {True: 0, False: 0}
    for one in film.overlay.at(1):
        for piece, steady in one.pieces():
            line = np.column_stack((one.value[piece], one.points[piece, 0, 0]))
            for at in (*line, *(0.5 * (line[1:] + line[:-1]))):
                if not panel.viewLim.contains(*at):
                    continue
                if spot(bare, panel, *at, 2).min() > 200:  # nothing else is there
                    dark = spot(pixels, panel, *at, 1).min()
                    assert dark < (70 if steady else 200)
                    seen[steady] += 1
    assert min(seen.values()) > 5
    assert hpcsweep(0, "animate", *_film(folder, whole)).returncode == 0
    done = hpcsweep(0, "animate", *_film(folder, folder / "sweep.h5"))
    assert done.returncode == 2
    assert "branches are needed" in done.stderr


def _film(folder, branches) -> tuple:
    given = "--width", "480", "-o", folder / "film.mp4", "--branches", branches
    return folder / "sweep.h5", *given


@pytest.mark.slow
def test_special_points_are_where_long_integrations_say(whole):
    compare = runpy.run_path("jobs/attractors/special_points.py")["compare"]
    agreed, others = compare(str(whole))
    assert others == []
    assert sum(agreed.values()) >= 5


@pytest.mark.slow
def test_special_points_lie_over_the_map_of_a_sweep(folder, whole):
    sweep, picture = folder / "sweep.h5", folder / "map.png"
    plot = ("plot", sweep, "--kind", "map", "-o", picture, "--branches")
    assert hpcsweep(0, *plot, whole).returncode == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    done = hpcsweep(0, *plot, sweep)
    assert done.returncode == 2
    assert "branches are needed" in done.stderr
    # what is drawn is what the file holds
    runs, results = open_results(sweep), open_results(whole)
    study = parse_job(runs.attrs["job"], "job", "job").study
    shown = with_specials(runs, whole, study)
    kinds = results["special_kind"].values
    assert shown.sizes["special"] == np.count_nonzero(kinds)
    np.testing.assert_array_equal(np.sort(shown["special_kind"]), np.sort(kinds[kinds > 0]))
    omega = np.unique(shown["special_omega"].values)
    assert set(omega) <= set(results["omega"].values.tolist())
    with pytest.raises(PlotError, match="another structure"):
        with_specials(runs, whole, replace(study, structure=Structure(3)))


@pytest.fixture(scope="module")
def curves(folder):
    """Branches of one floor beside a stop, and the curves of their folds and grazings."""
    sweep = """
[structure]
n_floors = 1
stiffness_ratio = 100.0
sharpness = inf
damping_ratio = 0.05
[sweep]
omega = [1.1, 1.2, 1.3]
amplitude = {from = 0.1, to = 0.9, count = 9}
transient_cycles = 100
sampling_cycles = 32
max_orbit_period = 1
"""
    (folder / "one.toml").write_text(sweep)
    job = BRANCHES.format(seeds=folder / "one.h5").replace("sweep.toml", "one.toml")
    room = "max_curves = 16\nmax_curve_points = 600\n"
    (folder / "curves.toml").write_text(f'{job}curves = ["fold", "grazing"]\n{room}')
    for name in ("one", "curves"):
        done = hpcsweep(0, "run", folder / f"{name}.toml", "-o", folder / f"{name}.h5")
        assert done.returncode == 0, done.stderr
    return folder / "curves.h5"


@pytest.mark.slow
def test_special_points_lie_on_curves_that_meet_where_strips_do(curves):
    results = open_results(curves)
    kinds, numbers = results["special_kind"].values[0, :, 0], results["special_curve"].values
    assert (kinds > 0).sum() == 9
    np.testing.assert_array_equal(numbers[0, :, 0] > 0, kinds > 0)
    strips = ((1.1, 1.15), (1.15, 1.25), (1.25, 1.3))
    ends: dict[float, list] = {border: [] for pair in strips for border in pair}
    for line, strip in enumerate(strips):
        run = results.isel(direction=0, line=line, amplitude=0)
        number = run["curve_of_step"].values
        omega, at = run["curve_omega"].values, run["curve_amplitude"].values
        grazing = run["curve_kind"].values[number - 1] == Kind.GRAZING
        # one floor without contact touches the stop where its motion has the size of the gap
        w = omega[(number > 0) & grazing]
        known = np.hypot(1 - w**2, 2 * 0.05 * w)
        np.testing.assert_allclose(at[(number > 0) & grazing], known, rtol=0, atol=1e-9)
        for border in strip:
            ends[border].append(np.sort(at[(number > 0) & (np.abs(omega - border) < 1e-12)]))
    for border in (1.15, 1.25):
        below, above = ends[border]
        assert below.size == 3
        np.testing.assert_allclose(below, above, rtol=0, atol=1e-9)
    (told,) = json.loads(hpcsweep(0, "summary", curves, "--json").stdout)
    assert told["curves"]["followed"]["share"] == 1.0
    assert told["curves"]["curves"] == 9
    assert "special points on a curve  9 (100 %)" in hpcsweep(0, "summary", curves).stdout


@pytest.mark.slow
def test_curves_lie_over_the_map_of_a_sweep(folder, curves):
    picture = folder / "curves.png"
    plot = ("plot", folder / "one.h5", "--kind", "map", "-o", picture, "--branches")
    assert hpcsweep(0, *plot, curves).returncode == 0
    results = open_results(curves)
    runs = open_results(folder / "one.h5")
    shown = with_specials(runs, curves, parse_job(runs.attrs["job"], "job", "job").study)
    held = results["curve_of_step"].values > 0
    np.testing.assert_array_equal(shown["curve_omega"], results["curve_omega"].values[held])
    assert np.unique(shown["curve_number"]).size == results["n_curves"].values.sum()


def test_a_damaged_line_is_told(folder, whole):
    path = folder / "damaged.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["value"][0, 1, 0, 2] += 1e-3
    report = validate(path, samples=0)
    assert not report.sound
    assert "damaged byte(s) in value" in report.problems[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameter", "span"),
    [("omega", [0.9, 1.1]), ("gap", None)],
)
def test_other_parameters(folder, tmp_path, parameter, span):
    text = TWO_STOPS + f'[study]\nkind = "branches"\n[branches]\nparameter = "{parameter}"\n'
    text = text.replace("gap = 0.5\ngap_left = 0.5", "gap = 0.5")
    sweep = text.split("[study]")[0] + "[sweep]\nomega = [0.9, 1.0, 1.1]\namplitude = [0.5, 0.6]\n"
    (tmp_path / "s.toml").write_text(sweep)
    assert hpcsweep(0, "run", tmp_path / "s.toml", "-o", tmp_path / "s.h5").returncode == 0
    own = f'seeds = "{tmp_path / "s.h5"}"\nspan = {span or [0.45, 0.55]}\n'
    (tmp_path / "b.toml").write_text(text + own + sweep.split("inf\n")[1])
    done = hpcsweep(0, "run", tmp_path / "b.toml", "-o", tmp_path / "b.h5")
    assert done.returncode == 0, done.stderr
    results = open_results(tmp_path / "b.h5")
    assert results.sizes["line"] == (2 if parameter == "omega" else 6)
    assert (results["n_covered"] == results["n_seeds"]).all()
    assert (results["n_seeds"] >= 1).all()
    assert np.isnan(results["omega"].values).all() == (parameter == "omega")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sweep.h5", "none.h5", ("none.h5", "cannot be read")),
        ("sweep.h5", "sweep.toml", ("sweep.toml", "not an HDF5 file")),
        ("steps = 300", "span = [0.71, 0.9]", ("no periodic motion", "0.71 to 0.9")),
        ("[branches]", "[structure]\nstiffness_ratio = 51.0\n[branches]", ("another structure",)),
        ("steps = 300", "span = [0.3, 0.2]", ("branches.span", "low below high")),
        ("steps = 300", "span = [-0.3, 0.2]", ("branches.span", "A must be 0, or from 1e-250")),
        ("steps = 300", 'parameter = "gap"', ("branches.span", "missing")),
        ("steps = 300", 'curves = ["flip"]', ("branches.curves", "fold, doubling")),
        ("steps = 300", 'curves = ["fold"]\ncurve_span = [1, 2]', ("curve_span", "sweep.omega")),
        (
            "steps = 300",
            'curves = ["fold"]\nparameter = "omega"',
            ("branches.parameter", '"amplitude"'),
        ),
        ("[branches]", '[solver]\nmethod = "bdf"\n[branches]', ("solver.method", "flow")),
        ('kind = "branches"', "", ("branches.seeds", '"branches"')),
    ],
)
def test_what_cannot_be_followed_is_told_in_one_line(folder, tmp_path, old, new, words):
    text = (folder / "job.toml").read_text()
    assert old in text
    job, path = folder / "bad.toml", tmp_path / "bad.h5"
    job.write_text(text.replace(old, new))
    done = hpcsweep(0, "run", job, "-o", path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr
    assert not path.exists()


@pytest.mark.slow
def test_lines_of_a_number_of_the_structure_may_be_a_list_of_points():
    head, sweep = SEEDS.split("[sweep]")
    text = BRANCHES.format(seeds="none.h5").replace('extends = "sweep.toml"', "")
    listed = text.replace('"branches"', '"branches"\npoints = [[0.3, 0.9], [0.5, 1.1]]', 1)
    along = "parameter = 'gap'\nspan = [0.4, 0.6]\n"
    study = parse_job(head + listed + along, "job", "job").study
    assert study.describe_task(0) == "Omega = 0.9, A = 0.3"
    assert study.describe_task(1) == "Omega = 1.1, A = 0.5"
    assert study.n_frames == 2
    for job, words in (
        (listed + "span = [0.4, 0.6]\n", "must not be given along amplitude"),
        (listed + along + "[sweep]" + sweep, "must not be given beside study.points"),
    ):
        with pytest.raises(JobError, match=words):
            parse_job(head + job, "job", "job")


@pytest.mark.slow
def test_a_search_finds_orbits_that_no_motion_tells(folder, whole):
    job, path = folder / "search.toml", folder / "search.h5"
    text = (folder / "job.toml").read_text().replace("steps = 300", "steps = 300\nstarts = 32")
    job.write_text(text + "[sweep]\nomega = 1.0\n")
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    seeded, searched = open_results(whole), open_results(path)
    assert (searched["found_by"] == 3).any()
    assert searched["n_branches"].item() > seeded["n_branches"].values[0, 1, 0]
    assert validate(path, samples=1).problems == []


def test_a_part_of_a_structure_that_is_no_one_number_is_refused():
    text = "[structure]\nn_floors = 2\ngap = [1.0, 2.0]\n[sweep]\nomega = 1.0\namplitude = 0.1\n"
    text += '[study]\nkind = "branches"\n[branches]\nseeds = "x.h5"\nparameter = "gap"\n'
    with pytest.raises(JobError, match="one finite number"):
        parse_job(text + "span = [0.5, 1.5]\n", "job", "job")
