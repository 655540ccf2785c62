"""Campaigns of refined maps: equal bytes on any ranks and after any kill; reports of commands."""

import json
import re

import faults
import h5py
import numpy as np
import pytest
import xarray
from together import together
from tools import REFINE, REFINED, SMALL, TWO_STOPS, assert_same_datasets, hpcsweep, made

from hpcsweep import open_results
from hpcsweep.campaign.run import STOPPED, run_all
from hpcsweep.campaign.status import overview, status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures.diagrams.mesh import open_map
from hpcsweep.figures.diagrams.vary_map import vary
from hpcsweep.figures.inferred import filled_classes, share_note
from hpcsweep.figures.style import percent
from hpcsweep.job import JobError, parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store import Frames, pack
from hpcsweep.studies.refine.audit import last_look, n_drawn
from hpcsweep.studies.refinement import Source

RUNS = 520
COARSE = REFINE.replace("levels = 3", "levels = 2")
THREE = REFINED.replace(REFINE, COARSE) + "[vary]\nstructure.gap = [0.99, 1.0, 1.01]\n"
NUMBER = f"""
[study]
kind = "attractors"
starts = 8
refine = {{levels = 2, wrong = 0.6}}
{TWO_STOPS}
[sweep]
omega = {{from = 0.5, to = 1.1, count = 13}}
amplitude = {{from = 0.02, to = 0.5, count = 14}}
[output]
max_points = 32
"""


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    return made(REFINED, tmp_path_factory.mktemp("refined") / "map.h5")


@pytest.mark.slow
def test_what_is_computed_equals_all_points_and_the_audit_bounds_what_is_inferred(
    refined, tmp_path
):
    whole = open_results(made(REFINED.replace(REFINE, 'kind = "points"'), tmp_path / "whole.h5"))
    results = open_results(refined)
    source = results["source"].values
    inferred = source == Source.INFERRED
    assert np.array_equal(inferred, results["outcome"].values == 0)
    assert 0.1 < inferred.mean() < 0.9
    assert (source == Source.AUDIT).any()
    assert np.array_equal(inferred, results["cell"].values != 0)
    for name in ("drift", "motion", "contact", "orbit_period", "final_state"):
        mine, all_of_it = results[name].values[~inferred], whole[name].values[~inferred]
        assert np.array_equal(mine, all_of_it, equal_nan=True), name
    assert np.isnan(results["drift"].values[inferred]).all()
    wrong = np.zeros(inferred.shape, bool)
    for name in ("motion", "orbit_period", "contact"):
        told = results[f"inferred_{name}"].values
        assert not told[~inferred].any()
        wrong |= told != whole[name].values
    look = last_look(results["audit"].values)
    assert look.left == inferred.sum()
    assert look.low <= wrong[inferred].mean() <= look.high < 0.2


@pytest.mark.slow
def test_readers_tell_computed_from_inferred(refined, tmp_path):
    results = open_results(refined)
    inferred = int((results["source"].values == Source.INFERRED).sum())
    for told in (status(refined), summarize(refined)):
        assert told["runs_inferred"] == inferred
        assert told["runs_done"] == RUNS - inferred
        assert told["audit"]["left"] == inferred
    assert status(refined)["complete"]
    assert sum(entry["runs"] for entry in summarize(refined)["classes"].values()) == RUNS - inferred
    assert overview(refined)["state"] == "complete"
    frames = Frames(refined)
    frame = frames.dataset(7)
    frames.close()
    for name in ("source", "cell", "inferred_motion", "inferred_contact", "drift"):
        assert np.array_equal(frame[name], results[name].isel(omega=[7]), equal_nan=True), name
    packed = tmp_path / "packed.h5"
    pack(refined, packed)
    assert open_results(packed).drop_attrs().equals(results.drop_attrs())
    assert validate(refined, samples=0).problems == validate(packed, samples=0).problems == []
    for words in (("status",), ("summary",)):
        done = hpcsweep(0, *words, refined)
        assert f"{inferred} points; of" in done.stdout
    for kind in ("motion", "contact"):
        value = () if kind == "motion" else ("--value", kind)
        picture = tmp_path / f"{kind}.png"
        done = hpcsweep(0, "plot", refined, "--kind", "map", *value, "--cells", "-o", picture)
        assert done.returncode == 0, done.stderr
        assert picture.stat().st_size > 10_000
    done = hpcsweep(0, "explore", refined, "-o", tmp_path / "page.html")
    assert done.returncode == 0, done.stderr
    assert "inferred from its cell" in (tmp_path / "page.html").read_text()


@pytest.mark.slow
def test_a_damaged_byte_of_what_is_inferred_is_seen_and_mended(refined, tmp_path):
    path = tmp_path / "map.h5"
    path.write_bytes(refined.read_bytes())
    with h5py.File(path, "r") as file:
        place = file["source"].id.get_offset() + 20 * 5 + 3
    with path.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 2]))
    results = open_results(path)
    assert not results["source"].values[0, 5].any()
    assert results["source"].values[0, 6].all()
    assert not status(path)["complete"]
    (problem,) = validate(path, samples=0).problems
    assert "frame 5 " in problem
    assert "its checksum does not hold" in problem
    made(REFINED, path)
    assert_same_datasets(refined, path)


def test_inferred_values_that_do_not_follow_are_seen(refined, tmp_path):
    """All checksums hold, but a label is not that of the computed points around it."""
    from hpcsweep.store import Layout
    from hpcsweep.store.commit import open_campaign
    from hpcsweep.store.inferred import write_inferred

    path = tmp_path / "map.h5"
    path.write_bytes(refined.read_bytes())
    results = open_results(path)
    names = ("source", "cell", "inferred_motion", "inferred_orbit_period", "inferred_contact")
    values = {name: results[name].values.ravel().copy() for name in names}
    first = np.flatnonzero(values["source"] == Source.INFERRED)[0]
    values["inferred_orbit_period"][first] += 1
    campaign = open_campaign(path, Layout(parse_job(REFINED, "job", "job")), Serial())
    write_inferred(campaign, {**values, "audit": results["audit"].values})
    campaign.close()
    (problem,) = validate(path, samples=0).problems
    assert "inferred_orbit_period does not follow from the computed points" in problem


@pytest.mark.slow
def test_stopped_between_rounds_and_resumed(refined, tmp_path):
    from hpcsweep.campaign.progress import Silent

    flag, path = StopFlag(), tmp_path / "map.h5"

    class Stopping(Silent):
        def advance(self, runs):
            flag.reason = flag.reason or "SIGTERM"

    job = [(parse_job(REFINED, "job", "job"), path)]
    (ending,) = run_all(job, Serial(), flag=flag, progress=lambda *_: Stopping())
    assert ending.code == STOPPED
    part = open_results(path)
    assert not part["source"].values.any()
    assert np.isnan(part["audit"].values).all()
    assert status(path)["audit"] is None
    assert overview(path)["state"] == "stopped"
    made(REFINED, path)
    assert_same_datasets(refined, path)


@pytest.mark.slow
def test_refined_by_the_period(refined, tmp_path):
    """The cells of this map are those of the class: no motions without a period lie beside it."""
    text = REFINED.replace("wrong = 0.2", 'on = ["period", "contact"], wrong = 0.2')
    path = made(text, tmp_path / "map.h5")
    results, by_class = open_results(path), open_results(refined)
    assert "inferred_motion" not in results
    for name in ("source", "cell", "inferred_orbit_period", "inferred_contact"):
        assert np.array_equal(results[name], by_class[name]), name
    assert validate(path, samples=0).problems == []
    frames = Frames(path)
    classes, periods = filled_classes(open_map(frames))
    frames.close()
    assert np.array_equal(periods, by_class["orbit_period"] + by_class["inferred_orbit_period"])
    kinds = by_class["motion"].values + by_class["inferred_motion"].values
    unknown = (by_class["source"] == Source.INFERRED) & (kinds > MotionClass.PERIODIC)
    assert np.array_equal(classes, np.where(unknown, MotionClass.UNDECIDED, kinds))
    assert hpcsweep(0, "plot", path, "-o", tmp_path / "map.png").returncode == 0
    assert hpcsweep(0, "explore", path, "-o", tmp_path / "page.html").returncode == 0
    window = text.replace("transient_cycles", "classify_cycles = 0\ntransient_cycles")
    assert parse_job(window, "job", "job").study.refine.variables == ["orbit_period", "contact"]


def test_inferred_motions_without_a_period_are_undecided():
    values = {"outcome": [1, 0, 0, 0], "source": [1, 2, 2, 2], "orbit_period": [0, 0, 0, 0]}
    values |= {"inferred_orbit_period": [0, 3, 0, 1], "inferred_contact": [0, 4, 4, 0]}
    results = xarray.Dataset({name: ("run", np.array(v)) for name, v in values.items()})
    classes, periods = filled_classes(results, np.array([MotionClass.CHAOTIC, 0, 0, 0]))
    known = MotionClass.PERIODIC, MotionClass.UNDECIDED, MotionClass.NO_CONTACT
    assert classes.tolist() == [MotionClass.CHAOTIC, *known]
    assert periods.tolist() == [0, 3, 0, 1]


@pytest.mark.slow
def test_in_three_parameters(tmp_path):
    whole = open_results(made(THREE.replace(COARSE, 'kind = "points"'), tmp_path / "whole.h5"))
    path = made(THREE, tmp_path / "three.h5")
    results = open_results(path)
    inferred = results["source"].values == Source.INFERRED
    assert results["source"].dims == ("gap", "direction", "omega", "amplitude")
    assert inferred.any()
    mine, every = results["motion"].values, whole["motion"].values
    assert np.array_equal(mine[~inferred], every[~inferred])
    wrong = (results["inferred_motion"].values != every)[inferred].mean()
    assert wrong <= last_look(results["audit"].values).high
    frames = Frames(path)
    frame = int(np.argmax(inferred.mean(axis=(0, 1, 3))))
    panels = vary.load(frames, omega=float(results["omega"][frame]))
    frames.close()
    shown = inferred[:, 0, frame]
    assert panels.inferred == pytest.approx(shown.mean())
    assert share_note(panels.inferred).startswith(percent(1 - float(shown.mean())))
    assert share_note(0.0) == ""
    frames = Frames(path, at={"gap": 1.01})
    assert np.array_equal(frames.dataset(3)["cell"], results["cell"].sel(gap=1.01).isel(omega=[3]))
    frames.close()
    assert validate(path, samples=0).problems == []


@pytest.mark.slow
def test_the_number_of_attractors_is_refined_point_by_point(tmp_path):
    path = made(NUMBER, tmp_path / "number.h5")
    results = open_results(path)
    inferred = results["source"].values == Source.INFERRED
    assert inferred.any()
    assert (results["n_attractors"].values[~inferred] > 1).any()
    number = np.where(inferred, results["inferred_n_attractors"], results["n_attractors"])
    assert number.min() >= 1
    row = NUMBER.replace("refine = {levels = 2, wrong = 0.6}", "")
    study = parse_job(row, "row", "row").study
    for frame, at in ((3, 0), (12, 13)):
        alone = study.runs_at(frame, np.array([at]), study.initial_state)
        stored = results["poincare"].values[0, frame, at]
        assert np.array_equal(stored, alone["poincare"][0], equal_nan=True)
    assert validate(path, samples=1).problems == []
    figures = [("plot", path, "--kind", kind) for kind in ("number", "shares", "attractors")]
    for words in (("status", path), ("summary", path), ("plot", path, "--cells"), *figures):
        assert hpcsweep(0, *words, cwd=tmp_path).returncode == 0
    with pytest.raises(JobError, match="must be a list of number"):
        parse_job(NUMBER.replace("wrong = 0.6", 'on = ["class"]'), "job", "job")


@pytest.mark.slow
def test_points_of_a_full_map_are_taken_over(refined, tmp_path):
    whole = made(REFINED.replace(REFINE, 'kind = "points"'), tmp_path / "whole.h5")
    taken = made(REFINED, tmp_path / "new.h5", reuse=[whole])
    assert_same_datasets(refined, taken)
    told = [r for r in faults.records(taken) if r["kind"] == "reuse"]
    assert told[0][f"from {whole}"] == status(refined)["runs_done"]
    finer = made(
        REFINED.replace("levels = 3", "levels = 2"), tmp_path / "finer.h5", reuse=[refined]
    )
    assert_same_datasets(
        made(REFINED.replace("levels = 3", "levels = 2"), tmp_path / "f.h5"), finer
    )


@pytest.mark.slow
@pytest.mark.mpi
def test_beside_other_jobs_in_one_queue(refined, tmp_path):
    for name, text in (("map", REFINED), ("small", SMALL)):
        (tmp_path / f"{name}.toml").write_text(text)
    done = hpcsweep(2, "run", "map.toml", "small.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_same_datasets(refined, tmp_path / "map.h5")
    assert status(tmp_path / "small.h5")["complete"]


@together(
    "change, said",
    [
        ((REFINE, REFINE + "\npoints = [[0.1, 0.5]]"), "a list of points has no cells"),
        (("levels = 3", "levels = 0"), "study.refine.levels = 0: must be a whole number from 1"),
        (("levels = 3", "levles = 3"), "unknown key 'study.refine.levles'; did you mean 'levels'?"),
        (("wrong = 0.2", "wrong = 0"), "study.refine.wrong = 0.0: must lie between 0 and 1"),
        (("wrong = 0.2", 'on = ["drift"]'), "study.refine.on = ['drift']: must be a list of class"),
        (("wrong = 0.2", "seed = -1"), "study.refine.seed = -1: must be a whole number"),
        (("{levels = 3, wrong = 0.2}", "3"), "study.refine = 3: must be a table"),
        (("poincare = false", "contact = false"), '"contact" needs output.contact = true'),
        (("poincare = false", "block = 5"), "output.block = 5: must be 1 with study.refine"),
        (("[output]", '[solver]\nmethod = "bdf"\n[output]'), '"class" needs sweep.classify_cycles'),
        (
            ("{from = 0.3, to = 0.9, count = 26}", "[0.5, 0.4]"),
            "omega must have two finite numbers",
        ),
        (("[output]", "[vary]\nstructure.gap = [1.0, 0.8]\n[output]"), "vary.structure.gap must"),
        (('"points"', '"amplitude_sweep"'), "it goes with study.kind"),
    ],
)
def test_what_cannot_be_refined_gets_one_line_and_nothing_is_written(tmp_path, change, said):
    text = REFINED.replace(*change)
    assert text != REFINED
    if "points =" in text:
        text = text.replace("omega = {from = 0.3, to = 0.9, count = 26}\n", "")
        text = text.replace("amplitude = {from = 0.02, to = 0.3, count = 20}\n", "")
    with pytest.raises(JobError) as caught:
        parse_job(text, "job", "job")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    job = tmp_path / "job.toml"
    job.write_text(text)
    if said.startswith("a list"):
        done = hpcsweep(0, "run", job, cwd=tmp_path)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
        assert [*tmp_path.iterdir()] == [job]


@pytest.mark.slow
def test_a_dry_run_says_what_is_computed_at_least(refined, tmp_path):
    job = tmp_path / "job.toml"
    job.write_text(REFINED)
    said = hpcsweep(0, "run", job, "--dry-run", cwd=tmp_path).stdout
    (line,) = (line for line in said.splitlines() if line.startswith("  refined "))
    least = int(re.search(r"(\d+) points", line)[1])
    assert least == 5 * 4 + 4 * 3 + n_drawn(0.2, 1, RUNS)
    assert least < status(refined)["runs_done"]


def test_status_as_json_is_json(refined):
    assert json.loads(hpcsweep(0, "status", refined, "--json").stdout)["runs_inferred"] > 0
