"""Sweeps along any parameter: each run is that from the same state, whatever else has changed."""

import math

import numpy as np
import pytest
from together import together
from tools import ALONG, BASINS, GAPS, SMALL, hpcsweep, made

import hpcsweep as api
from hpcsweep.checks.validate import validate
from hpcsweep.figures.attractors import identities, missed_attractors
from hpcsweep.figures.diagrams.attractors import attractors, shares
from hpcsweep.figures.diagrams.metrics import measures
from hpcsweep.figures.diagrams.orbit_diagram import orbit
from hpcsweep.figures.diagrams.sweep import frames
from hpcsweep.figures.explorer.page_data import gather
from hpcsweep.figures.style import PlotError, classes_of, frame_at
from hpcsweep.job import JobError, parse_job, part_of
from hpcsweep.model.structure import Structure
from hpcsweep.store import Frames, StoreError
from hpcsweep.studies.attractors.runs import AttractorRuns
from hpcsweep.studies.sweep.runs import frame_runs

ONE = """
[structure]
n_floors = 1
sharpness = inf
stiffness_ratio = 50.0
damping_ratio = 0.02
[sweep]
along = "omega"
omega = {from = 0.9, to = 1.4, count = 51}
amplitude = 0.1
"""
"""One mass and a stop: past its resonance motions with and without contact coexist."""
OF_ATTRACTORS = """
[study]
kind = "attractors"
starts = 8
max_attractors = 3
max_cycles = 600
match_distance = 0.3
"""
ATTRACTORS = {
    "omega": ONE.replace("count = 51", "count = 11").replace("= 0.1", '= "0.09 + 0.01 * omega"')
    + OF_ATTRACTORS,
    "gap": ONE.replace('"omega"', '"structure.gap"').replace(
        "{from = 0.9, to = 1.4, count = 51}", "[1.1, 1.2]"
    )
    + OF_ATTRACTORS
    + '[vary]\n"structure.gap" = {from = 0.9, to = 1.2, count = 6}\n',
}
KIND = "hits", "orbit_period", "motion", "contact"
POINTS = ONE.replace("omega = {", "# {").replace("amplitude = 0.1", "") + (
    f"{OF_ATTRACTORS}points = [[0.1, 1.1]]\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of sweeps along the frequency, a gap, and the frequency at one amplitude."""
    folder = tmp_path_factory.mktemp("paths")
    for name, text in (("omega", ALONG), ("gap", GAPS), ("one", ONE)):
        made(text, folder / f"{name}.h5")
    return folder


def walk(results, frame: int, initial: np.ndarray):
    """Yield the runs of a frame in the order of the sweeps, each with the state before it."""
    state = initial
    for direction, order in (("up", slice(None)), ("down", slice(None, None, -1))):
        runs = results.sel(direction=direction).isel({results["outcome"].dims[1]: frame})
        along = runs["outcome"].dims[0]
        for at in np.arange(runs.sizes[along])[order]:
            yield runs.isel({along: at}), state
            state = runs["final_state"].values[at]


@pytest.mark.slow
@pytest.mark.parametrize("text", [ALONG, GAPS], ids=["omega", "gap"])
def test_points_are_those_by_hand_from_the_state_before_to_the_last_bit(text, tmp_path):
    text = text.replace("[output]", '[solver]\nskip = "none"\n[output]')
    results = api.open_results(made(text, tmp_path / "path.h5"))
    base = {"n_floors": 2, "stiffness_ratio": 300.0, "sharpness": 4e3, "damping_ratio": 0.05}
    assert (results["outcome"] == 1).all()
    for run, state in walk(results, 2, np.zeros(4)):
        gap, omega = float(run.get("gap", 1.0)), float(run["omega"])
        amplitude = 0.2 if 'along = "omega"' in text else 0.4 * omega**2 * math.sqrt(gap)
        assert float(run["amplitude"]) == amplitude
        structure = Structure(**base, gap=gap)
        points = api.stroboscopic_points(structure, amplitude, omega, state, 50)
        count = int(run["n_points"])
        stored = run["poincare"].values[:count]
        if int(run["classification_cycles"]) == 0:
            assert stored.tobytes() == points[-count:].tobytes()
        assert run["final_state"].values.tobytes() == points[-1].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omega", "gap"])
def test_runs_with_skip_rules_are_those_of_the_numerical_core_to_the_last_bit(folder, name):
    results = api.open_results(folder / f"{name}.h5")
    study = parse_job({"omega": ALONG, "gap": GAPS}[name], "", "job").study
    state = study.initial_state
    spared = 0
    for run, _ in walk(results, 2, state):
        at = int(np.searchsorted(study.along_of(2), float(run[study.run_dims[-1]])))
        runs = frame_runs(study.structure_at(at), float(run["omega"]), study.settings)
        rows = runs.follow([float(run["amplitude"])], state)
        for variable, values in rows.items():
            assert np.asarray(run[variable].values, values.dtype).tobytes() == values.tobytes()
        state = study.end_state(rows, 0)
        spared += int(rows["skip_rule"][0] > 0)
    assert spared > 11


def test_up_and_down_differ_where_motions_with_and_without_contact_coexist(folder):
    results = api.open_results(folder / "one.h5").isel(amplitude=0)
    structure = Structure(1, 50.0, math.inf, 0.02)
    omega = results["omega"].values
    grazes = np.array([structure.grazing_amplitude(w) for w in omega.tolist()]) < 0.1
    up, down = results["contact"].values > 0
    # from high frequencies the free motion is followed to where it grazes, in closed form
    assert np.array_equal(down[omega > 1.0], grazes[omega > 1.0])
    both = (omega > 1.0) & up & ~down
    assert both.sum() > 5
    assert np.array_equal(up[~both], down[~both])


def test_the_file_has_the_dimensions_of_the_path(folder):
    along = api.open_results(folder / "omega.h5")
    assert along["outcome"].dims == ("direction", "amplitude", "omega")
    assert along["amplitude"].values.tolist() == [0.05, 0.1, 0.2, 0.3]
    assert along["poincare"].dims == ("direction", "amplitude", "omega", "point", "state")
    gaps = api.open_results(folder / "gap.h5")
    assert gaps["outcome"].dims == ("direction", "omega", "gap")
    assert gaps["amplitude"].dims == ("omega", "gap")
    omega, gap = gaps["omega"].values[:, None], gaps["gap"].values
    assert gaps["amplitude"].values == pytest.approx(0.4 * omega**2 * np.sqrt(gap), rel=1e-15)
    assert gaps["gap"].attrs == {"units": "length", "long_name": "structure.gap"}
    text = ONE.replace("= 0.1", '= "0.1 * omega"').replace("count = 51", "count = 3")
    tied = parse_job(text, "", "job").study
    assert tied.run_dims == ("direction", "frame", "omega")
    text = text.replace('"omega"', '"amplitude"').replace('"0.1 * omega"', "[0.1, 0.2]")
    text = text.replace("{from = 0.9, to = 1.4, count = 3}", '"1 + amplitude"')
    tied = parse_job(text, "", "job").study
    assert tied.run_dims == ("direction", "frame", "amplitude")
    assert tied.omegas_of(0).tolist() == [1.1, 1.2]
    assert tied.amplitudes_of(0).tolist() == [0.1, 0.2]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omega", "gap", "one"])
def test_it_is_validated_summarized_and_described(folder, name):
    report = validate(folder / f"{name}.h5", samples=1)
    assert report.sound
    assert [again.whole_run for again in report.sample] == ["equal"]
    for command in ("summary", "status"):
        done = hpcsweep(0, command, folder / f"{name}.h5")
        assert done.returncode == 0, done.stderr
    (folder / "job.toml").write_text({"omega": ALONG, "gap": GAPS, "one": ONE}[name])
    done = hpcsweep(0, "describe", folder / "job.toml")
    key = "structure.gap" if name == "gap" else "sweep.omega"
    assert f"along {key} from" in done.stdout
    assert "linear, converged, newton: all hold along any path" in done.stdout
    assert hpcsweep(0, "run", folder / "job.toml", "--dry-run").returncode == 0


@pytest.mark.slow
def test_it_is_drawn_over_its_parameter(folder, tmp_path):
    along, gaps = (api.open_results(folder / f"{name}.h5") for name in ("omega", "gap"))
    axes = orbit.draw(along.isel(amplitude=[-1])).axes
    assert axes[1].get_xlabel().startswith(r"forcing frequency $\Omega$")
    assert axes[1].get_xlim() == pytest.approx((0.485 + 0.009, 0.815 - 0.009), abs=2e-2)
    figure = orbit.draw(gaps)
    assert figure.axes[1].get_xlabel() == "gap $g$"
    assert "$g$" not in figure.get_suptitle()
    assert r"$A=0.4\,\Omega^{2}\,\sqrt{\mathrm{gap}}$" in figure.get_suptitle()
    stop = figure.axes[1].lines[0]  # it moves with the gap
    assert np.array_equal(stop.get_xdata(), stop.get_ydata())
    titles = [axis.get_title() for axis in frames.draw(along).axes]
    assert (titles[0], titles[along.sizes["amplitude"] - 1]) == ("$A$ = 0.05", "$A$ = 0.3")
    assert classes_of(gaps).shape == (2, 4, 11)
    with pytest.raises(PlotError, match=r"--omega 0.5: the sweep is along omega"):
        frame_at(parse_job(ALONG, "", "job").study, omega=0.5)
    with pytest.raises(PlotError, match="the file holds none of them"):
        measures.draw(along)
    for kind in (["map"], ["phase", "--along", "0.7"], ["metrics", "--amplitude", "0.2"]):
        done = hpcsweep(0, "plot", folder / "omega.h5", "--kind", *kind, "-o", tmp_path / "it.png")
        assert done.returncode == 0, done.stderr
    done = hpcsweep(0, "plot", folder / "gap.h5", "--kind", "map", "-o", tmp_path / "no.png")
    said = "no map over amplitude and frequency: the sweep is along gap"
    assert done.stderr == f"hpcsweep: error: {folder / 'gap.h5'}: {said}\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", ATTRACTORS)
def test_attractors_along_a_path_are_those_of_each_place_to_the_last_bit(name, tmp_path):
    study = parse_job(ATTRACTORS[name], "", "job").study
    path = made(ATTRACTORS[name], tmp_path / "path.h5")
    results = api.open_results(path)
    assert results["outcome"].dims == ("direction", *study.run_dims[1:])
    frame, several = study.n_frames - 1, 0
    state = alone = study.initial_state
    for at in range(study.n_along):
        run = results.isel({"direction": 0, study.run_dims[1]: frame, study.run_dims[2]: at})
        omega, amplitude = float(run["omega"]), float(run["amplitude"])
        structure = study.structure_at(at)
        assert structure.gap == float(run.get("gap", 1.0))
        runs = AttractorRuns(structure, omega, study.settings, study)
        rows = runs.follow([amplitude], state)  # what a place has of the one before: seeds
        for variable, values in rows.items():
            assert np.asarray(run[variable].values, values.dtype).tobytes() == values.tobytes()
        state = study.end_state(rows, 0)
        found, of_point = (
            sorted(map(tuple, np.transpose([own[name][0] for name in KIND])[own["hits"][0] > 0]))
            for own in (rows, runs.follow([amplitude], alone))
        )
        assert found == of_point  # the starts of a point on its own find the same
        several += int(rows["n_attractors"][0] > 1)
    assert several > 2
    ids = results["attractor_id"].values[0, frame]
    assert ids.max() <= 3  # they keep their identity along the path
    assert validate(path, samples=2).sound


@pytest.mark.slow
def test_attractors_along_a_path_are_drawn_and_compared_with_its_sweep(folder, tmp_path):
    for name, label in (("omega", r"forcing frequency $\Omega$"), ("gap", "gap")):
        results = api.open_results(made(ATTRACTORS[name], tmp_path / f"{name}.h5"))
        figure = attractors.draw(results)
        assert figure.axes[0].get_xlabel().startswith(label)
        assert shares.draw(results).axes[1].get_xlabel().startswith(label)
        page = gather(Frames(tmp_path / f"{name}.h5", "attractors"))
        assert page.dims == parse_job(ATTRACTORS[name], "", "job").study.run_dims[1:]
        assert (page.runs["motion"] > 0).any(axis=1).all()
    text = ATTRACTORS["omega"].replace('"0.09 + 0.01 * omega"', "[0.1, 0.11]")
    found = Frames(made(text, tmp_path / "map.h5"), "attractors")
    sweep = text.replace(OF_ATTRACTORS, "")
    missed = missed_attractors(found, made(sweep, tmp_path / "sweep.h5"))
    assert missed.shape == (2, 11)
    assert (missed >= 0).all()
    assert identities(found).shape == (2, 11, 3)
    for kind in ("map", "number"):
        assert hpcsweep(0, "plot", tmp_path / "map.h5", "--kind", kind).returncode == 0
    for file, words in (
        ("one", "does not hold, along omega, all points of"),
        ("gap", "is of another structure"),
    ):
        with pytest.raises(StoreError, match=words):
            missed_attractors(found, folder / f"{file}.h5")


@pytest.mark.slow
def test_a_part_of_a_varied_path_is_a_job_of_its_own(tmp_path):
    text = GAPS + "structure.stiffness_ratio = [100.0, 300.0]\n"
    job = parse_job(text, "job", "job")
    results = api.open_results(made(text, tmp_path / "varied.h5"))
    assert results["outcome"].dims == ("stiffness_ratio", "direction", "omega", "gap")
    own = part_of(job, (1,))
    alone = api.open_results(made(own.text, tmp_path / "part.h5"))
    for name in own.study.variables:
        part = results.sel(stiffness_ratio=300.0)[name.name]
        np.testing.assert_array_equal(part.values, alone[name.name].values)
    assert parse_job(own.text, "", "job").fingerprint == parse_job(GAPS, "", "job").fingerprint
    assert validate(tmp_path / "varied.h5", samples=0).sound


def test_a_formula_counts_by_its_values():
    formulas = "0.1 * omega**2", " 0.1*(omega ** 2)", "0.1 * omega**2.0000001"
    jobs = [parse_job(ONE.replace("= 0.1", f'= "{one}"'), "", "job") for one in formulas]
    first, same, other = (job.fingerprint for job in jobs)
    assert first == same != other
    assert "+0.1*omega" in repr(parse_job(ONE.replace("= 0.1", '= "+0.1*omega"'), "", "job").study)


@together(
    "old, new, words",
    [
        ('"omega"', '"Omega"', "sweep.along = 'Omega': must be omega, amplitude or a key of"),
        ('"omega"', '"solver.rtol"', "sweep.along = 'solver.rtol': must be omega, amplitude or"),
        ('"omega"', '"structure.gap"', "sweep.along = 'structure.gap': needs its values: [vary]"),
        ("{from = 0.9, to = 1.4, count = 51}", "[1.0, 0.9]", "sweep.omega = [1.0, 0.9]: must asc"),
        ("= 0.1", '= "0.1 * gap"', "sweep.amplitude = '0.1 * gap': knows no 'gap', only omega;"),
        ("= 0.1", '= "1 - omega"', "must be 0, or from 1e-250 to 1e+250, is -0.01 at omega = 1.01"),
        ("= 0.1", '= "sqrt(1 - omega)"', "is nan at omega = 1.01"),
        ("= 0.1", '= "1 / (omega - 0.9)"', "is nan at omega = 0.9"),
        ("= 0.1", '= "9.0**omega**999"', "overflows at omega = 1.01"),
        ("= 0.1", '= "omega^2"', "must be of numbers, names, + - * / **, brackets, pi and sqrt"),
        ("= 0.1", "= \"__import__('os')\"", "must be of numbers"),
        ("= 0.1", '= "omega.real"', "must be of numbers"),
        ("= 0.1", f'= "{"(" * 150}omega"', "must be of numbers"),
        ("= 0.1", f'= "{"1+" * 150}omega"', "must have 200 letters at most"),
        ("= 0.1", '= "sin"', "is nan at omega = 0.9"),
        ("{from = 0.9, to = 1.4, count = 51}", '"1"', "sweep.omega = '1': must be numbers: the"),
        ("[sweep]", '[study]\nkind = "points"\n[sweep]', "unknown key 'sweep.along'; it goes with"),
    ],
)
def test_bad_paths_are_refused_in_one_line(old, new, words):
    assert ONE.count(old) == 1
    with pytest.raises(JobError) as refused:
        parse_job(ONE.replace(old, new), "job.toml", "job")
    said = str(refused.value)
    assert said.startswith("job.toml: ")
    assert words in said
    assert "\n" not in said


@together(
    "old, new, words",
    [
        ("{from = 0.5, to = 1.5, count = 11}", "[1.5, 0.5]", "vary.structure.gap = [1.5, 0.5]: mu"),
        ("{from = 0.5, to = 1.5, count = 11}", "[0.5, inf]", "vary.structure.gap = [0.5, inf]: mu"),
        ('"0.4 * omega**2 * sqrt(gap)"', "[0.1, 0.2]", "sweep.amplitude = [0.1, 0.2]: must be one"),
        ("structure.gap", "structure.n_floors", "must be a whole number from 1 to"),
        ("structure.gap", "structure.colour", "unknown key"),
    ],
)
def test_bad_structures_along_a_path_are_refused_in_one_line(old, new, words):
    with pytest.raises(JobError) as refused:
        parse_job(GAPS.replace(old, new), "job.toml", "job")
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@together(
    "text, old, new, words",
    [
        (BASINS, "amplitude = 0.7", 'amplitude = "0.7 * omega"', "must be numbers: form"),
        (BASINS, "[sweep]", '[sweep]\nalong = "omega"', "unknown key 'sweep.along'"),
        (
            SMALL,
            "[sweep]",
            '[sweep]\nalong = "gap"',
            "sweep.along = 'gap': must be omega,",
        ),
        (POINTS, "[sweep]", "[sweep]", "goes with neither study.points nor"),
        (
            POINTS,
            "points = [[0.1, 1.1]]",
            "refine = {levels = 2}",
            "goes with neither study.points",
        ),
    ],
)
def test_points_on_their_own_refuse_a_path_and_formulas(text, old, new, words):
    assert text.count(old) == 1
    with pytest.raises(JobError, match=f"^job: .*{words}"):
        parse_job(text.replace(old, new), "job", "job")


def test_the_explorer_has_the_forcing_and_the_structure_of_each_run(folder, tmp_path):
    from hpcsweep.figures.explorer.page import build_page

    page = gather(Frames(folder / "gap.h5"))
    study = parse_job(GAPS, "", "job").study
    assert page.dims == ("omega", "gap")
    assert page.steps["amplitude"][2] == study.amplitudes_of(2).tolist()
    assert [one.gap for one in page.steps["structures"]] == study.along_of(0).tolist()
    assert '"key": "gap"' in build_page(page)
    page = gather(Frames(folder / "omega.h5"), amplitude_step=2)
    assert page.steps["omega"][0] == page.amplitude.tolist()
    assert page.steps["structures"] == []
    with pytest.raises(PlotError, match="along omega or amplitude, not gap"):
        gather(Frames(folder / "gap.h5"), branches=tmp_path / "none.h5")


@pytest.mark.slow
def test_branches_along_the_frequency_start_from_its_sweeps_and_are_drawn_beneath(folder, tmp_path):
    from hpcsweep.campaign.summary import summarize

    text = ONE.replace('along = "omega"\n', "").replace("count = 51", "count = 2")
    text += '[study]\nkind = "branches"\n[branches]\nparameter = "omega"\nsteps = 200\n'
    text += f'seeds = "{folder / "one.h5"}"\nspan = [0.9, 1.4]\nmax_points = 1000\n'
    path = made(text, tmp_path / "branches.h5")
    assert summarize(path)["seeds"] > 50
    assert summarize(path)["seeds_covered"]["share"] == 1.0
    command = ("plot", path, "-o", tmp_path / "b.png", "--sweep")
    assert hpcsweep(0, *command, folder / "one.h5").returncode == 0
    done = hpcsweep(0, *command, folder / "gap.h5")
    assert done.stderr.endswith("holds branches along omega, not gap\n")


@pytest.mark.slow
def test_branches_along_a_formula_go_through_all_motions_and_lie_beneath_them(tmp_path):
    from hpcsweep.campaign.summary import summarize

    files = tmp_path / "sweep.h5", tmp_path / "attractors.h5"
    text = ATTRACTORS["omega"]
    for file, one in zip(files, (text.replace(OF_ATTRACTORS, ""), text), strict=True):
        made(one, file)
    job = text.replace('along = "omega"\n', "").replace(OF_ATTRACTORS, "")
    job += '[study]\nkind = "branches"\n[branches]\nparameter = "omega"\nsteps = 200\n'
    job += f'seeds = ["{files[0]}", "{files[1]}"]\nmax_points = 1000\n'
    path = made(job, tmp_path / "branches.h5")
    told = summarize(path)
    assert told["seeds"] > 25
    assert told["seeds_covered"]["share"] == 1.0
    assert validate(path).sound
    study = parse_job(job, "", "job").study
    omega, amplitude = (each[0] for each in study.forcing(np.array([1.0, 1.2])))
    assert (omega.tolist(), amplitude.tolist()) == ([1.0, 1.2], [0.09 + 0.01, 0.09 + 0.01 * 1.2])
    run = api.open_results(path).isel(direction=0, line=0, amplitude=0)
    steps = np.flatnonzero(run["step_branch"].values)[::20]
    for step in steps:  # a point of a branch is one of the motion at its place, by another solver
        value, orbit = float(run["value"][step]), run["point"].values[step]
        forcing = 0.09 + 0.01 * value, value
        end = api.stroboscopic_points(study.structure, *forcing, orbit, 1, solver="bdf", rtol=1e-9)
        np.testing.assert_allclose(end[-1], orbit, rtol=0, atol=1e-5)
    for file in files:
        command = ("plot", file, "--branches", path, "-o", tmp_path / "b.png")
        assert hpcsweep(0, *command).returncode == 0
        page = gather(Frames(file, None), branches=path)
        assert sum(one.value.size for one in page.branches[0]) == told["points"]
        command = ("plot", path, "--sweep", file, "-o", tmp_path / "b.png")
        assert hpcsweep(0, *command).returncode == 0
    formulas = ('"0.09 + omega * 0.01"', True), ('"0.09 + 0.01*(omega)"', False)
    for formula, differs in formulas:
        other = parse_job(job.replace('"0.09 + 0.01 * omega"', formula), "", "job")
        assert (other.fingerprint != parse_job(job, "", "job").fingerprint) == differs


@together(
    "old, new, words",
    [
        (
            '"omega"',
            '"amplitude"',
            "sweep.amplitude = '0.1 * omega': must be numbers: the",
        ),
        ("* omega", "* gap", "sweep.amplitude = '0.1 * gap': knows no 'gap', only omega"),
        ("* omega", "- omega", "must be 0, or from 1e-250 to 1e+250, is -0.8 at omega = 0.9"),
        ("0.1 * omega", "1e-3 / (omega - 0.91234)**2", "must have no pole, has one at 0.9123"),
        ('parameter = "omega"', 'parameter = "omega"\ncurves = ["fold"]', "without formulas"),
        ("[study]", "[output]\nlyapunov = true\n[study]", "unknown key 'output.lyapunov'"),
    ],
)
def test_bad_formulas_of_branches_are_refused_in_one_line(old, new, words):
    text = ONE.replace('along = "omega"\n', "").replace("= 0.1", '= "0.1 * omega"')
    text += '[study]\nkind = "branches"\n[branches]\nparameter = "omega"\n'
    text += 'seeds = "a.h5"\n'
    assert text.count(old) == 1
    with pytest.raises(JobError) as refused:
        parse_job(text.replace(old, new), "job.toml", "job")
    assert words in str(refused.value)
