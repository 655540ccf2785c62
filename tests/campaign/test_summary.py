"""`hpcsweep summary`, and figures of files that are read one frame at a time."""

import json
import shutil
import time

import numpy as np
import pytest
from tools import SMALL

from hpcsweep import store
from hpcsweep.campaign import provenance
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.summary import summarize, total_cost
from hpcsweep.commands import cli
from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, class_shares
from hpcsweep.figures import view
from hpcsweep.figures.diagrams import maps, mesh, metrics
from hpcsweep.figures.style import classes_of
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.store.journal import instant, spent


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("summary") / "study.h5"
    job = parse_job(SMALL + "lyapunov = true\nmax_points = 12\n", "study", "study")
    assert campaign.run(job, path, Serial()) == 0
    return path


def test_a_summary_counts_what_the_file_holds(file):
    reported, results = summarize(file), store.open_results(file)
    classes = classes_of(results)
    assert reported["runs_done"] == reported["runs_total"] == classes.size == 88
    for kind, share in class_shares(classes).items():
        entry = reported["classes"][CLASS_NAMES[kind]]
        assert entry["runs"] == (classes == kind).sum()
        assert entry["share"] == pytest.approx(share)
        for direction, kinds in zip(reported["directions"], classes, strict=True):
            shown = reported["by_direction"][direction][CLASS_NAMES[kind]]
            assert shown["runs"] == (kinds == kind).sum()
    assert sum(entry["share"] for entry in reported["classes"].values()) == pytest.approx(1)
    assert reported["classes"]["periodic"]["runs"] > 0
    period = results["orbit_period"].values[classes == MotionClass.PERIODIC]
    assert {p: e["runs"] for p, e in reported["periods"].items()} == {
        int(p): int((period == p).sum()) for p in np.unique(period)
    }
    contact = results["contact"].values
    sets = {0: "none", 1: "C1", 2: "C2", 3: "C12"}
    assert {name: e["runs"] for name, e in reported["contact_sets"].items()} == {
        sets[int(c)]: int((contact == c).sum()) for c in np.unique(contact)
    }
    assert reported["periods_per_run"] == pytest.approx(results["cycles"].values.mean())
    assert (
        reported["skip_rules"]["newton"]["runs"] == (results["skip_rule"] == SkipRule.NEWTON).sum()
    )
    assert sum(entry["runs"] for entry in reported["skip_rules"].values()) == 88
    assert reported["cost"]["runs_timed"] == 88
    assert reported["cost"]["wall_seconds"] >= 0.5 * reported["cost"]["core_seconds"] > 0
    assert reported["file_bytes"] == file.stat().st_size


def test_a_summary_tells_the_largest_of_each_measure(tmp_path, capsys):
    path = tmp_path / "measured.h5"
    job = parse_job(SMALL + "impacts = true\ncontact_force = true\n", "study", "study")
    assert campaign.run(job, path, Serial()) == 0
    reported, results = summarize(path)["largest"], store.open_results(path)
    assert list(reported) == ["contact_force", "impacts"]
    for name, most in reported.items():
        there = results[name].sel(omega=most["omega"], amplitude=most["amplitude"], stop=most["of"])
        assert float(there.max()) == most["value"] == float(results[name].max())
    assert cli.main(["summary", str(path)]) == 0
    assert f"{reported['contact_force']['value']:.4g} k gaps" in capsys.readouterr().out


def test_only_what_is_there_is_counted(tmp_path):
    job = parse_job(SMALL, "x", "x")
    path = tmp_path / "empty.h5"
    store.create(path, store.Layout(job), provenance.collect("none", ["here"]))
    reported = summarize(path)
    assert reported["runs_done"] == 0
    assert reported["cost"] is reported["periods_per_run"] is None
    assert reported["contact_sets"] == reported["periods"] == {}
    assert {entry["share"] for entry in reported["classes"].values()} == {None}
    assert reported["failures"] == {
        name: 0 for name in ("NON_FINITE", "STEP_LIMIT", "SOLVER_FAILED", "COLLAPSED")
    }


def test_sessions_add_up_and_a_block_done_twice_counts_once(tmp_path):
    def reported(records):
        journal = tmp_path / "x.h5.journal"
        journal.write_text("".join(json.dumps(record) + "\n" for record in records))
        return total_cost(store.journal.read_history(tmp_path / "x.h5"))

    def block(time, place, seconds, **processor):
        return {
            "kind": "block", "time": time, "place": [0, place, 0],
            "runs": 50, "seconds": seconds,
        } | processor  # fmt: skip

    records = [
        {"kind": "start", "time": 100.0, "ranks": 2, "hosts": ["a"]},
        block(110.0, 0, 10.0),
        block(112.0, 1, 11.0),  # killed: no end, and the last block was lost
        {"kind": "start", "time": 500.0, "ranks": 4, "hosts": ["a"]},
        block(512.0, 1, 12.0, processor=2.5),  # among busy neighbours
        {"kind": "end", "time": 513.0, "reason": "complete"},
    ]
    assert reported(records) == {
        "sessions": 2,
        "ranks": [2, 4],
        "wall_seconds": 25.0,
        "core_seconds": 12.5,
        "clock_seconds": 22.0,
        "runs_timed": 100,
        "runs_per_second": 4.0,
        "runs_per_core_second": 100 / 12.5,
    }
    assert reported([]) is reported(records[:1]) is None


def test_core_seconds_are_processor_time_and_both_are_told_where_they_differ(
    file, tmp_path, capsys
):
    begun = instant()
    time.sleep(0.3)
    cost = spent((0, 0, 0), 1, begun)
    assert cost.processor < 0.2 < 0.3 <= cost.seconds
    copy = shutil.copy(file, tmp_path / "a.h5")
    block = {"kind": "block", "time": 110.0, "place": [0, 0, 0], "runs": 8, "seconds": 20.8}
    start = {"kind": "start", "time": 100.0, "ranks": 2, "hosts": ["a"]}
    for processor, told in ((4.4, True), (20.0, False)):
        lines = json.dumps(start), json.dumps(block | {"processor": processor})
        copy.with_suffix(".h5.journal").write_text("\n".join(lines) + "\n")
        for command in ("summary", "status"):
            assert cli.main([command, str(copy)]) == 0
            text = capsys.readouterr().out
            assert f"{processor:g}" in text
            assert ("20.8 s by the clock" in text) == told
        assert f"{8 / processor:.3g}" in text


def test_the_command_writes_text_tables_and_json(file, tmp_path, capsys):
    assert cli.main(["summary", str(file)]) == 0
    text = capsys.readouterr().out
    for words in ("88 of 88", "runs per second", "of 50", "undecided", "contact none", " P1 "):
        assert words in text
    assert cli.main(["summary", "--markdown", str(file), str(file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.count("|") for line in lines} == {4}
    for line in lines[2:]:
        name, left, right = (cell.strip() for cell in line.strip("|").split("|"))
        assert name
        assert left == right != ""
    assert cli.main(["summary", "--json", str(file)]) == 0
    assert json.loads(capsys.readouterr().out)[0]["runs_done"] == 88
    other = tmp_path / "other.h5"
    other.write_text("nothing")
    assert cli.main(["summary", str(file), str(other)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"hpcsweep: error: {other}: ")


@pytest.mark.slow
def test_maps_read_frame_by_frame_are_the_same_pictures(file, tmp_path):
    whole = store.open_results(file)
    for k, direction in enumerate(("up", "down")):
        frames = store.Frames(file)
        few = mesh.open_map(frames, direction=direction)
        frames.close()
        assert "poincare" not in few
        np.testing.assert_array_equal(
            classes_of(few)[0], classes_of(whole)[whole.direction.values.tolist().index(direction)]
        )
        for draw in (maps.motion_map.draw, metrics.benefit.draw):
            left, right = tmp_path / "left.png", tmp_path / "right.png"
            with view.viewing(100):
                view.save(draw(few), left)
                view.save(draw(whole.isel(direction=[k])), right)
            assert left.read_bytes() == right.read_bytes()


def test_frames_are_gathered_in_the_order_asked_for(file):
    whole, frames = store.open_results(file), store.Frames(file)
    twice = {"twice": lambda one: 2 * one["drift"].values}
    few = frames.gather(("drift", "poincare", "no_such"), [3, 1], "down", derive=twice)
    frames.close()
    np.testing.assert_array_equal(few["twice"].values, 2 * few["drift"].values)
    few = few.drop_vars("twice")
    assert set(few.data_vars) == {"drift", "poincare"}
    np.testing.assert_array_equal(few["omega"].values, whole["omega"].values[[3, 1]])
    chosen = whole.isel(direction=[1], omega=[3, 1])
    for name in few.data_vars:
        assert few[name].dims == chosen[name].dims
        np.testing.assert_array_equal(few[name].values, chosen[name].values)
