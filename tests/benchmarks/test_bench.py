"""`bench`: what is called a difference, what is measured, and the bounded comparison."""

import importlib.util
import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import bench
import numpy as np
import pytest
from matplotlib import pyplot
from speed import figure, passages, peers, profile, ratios, scaling, skips, startup, work_precision
from together import together
from tools import JOBS, datasets, kernels_but

from hpcsweep.job import load_job, parse_job
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import frame_runs

P1 = work_precision.Stretch("P1 C3", Structure(), 0.445, 0.06, 100, 3)
UNDECIDED = (0.593820358198865, 0.18524934160705717)
"""Omega and A at which the plain run from rest still sees P2 in what settles to P1."""


def one_run(skip=frozenset()):
    settings = SweepSettings(transient_cycles=60, sampling_cycles=32, skip=skip)
    block = frame_runs(Structure(), 0.445, settings).follow([0.0987], np.zeros(6))
    return {name: values[0] for name, values in block.items()}


def reported(plain, skipped):
    return skips.differences(plain, skipped, skips.distances(plain, skipped))


def test_a_run_agrees_with_itself_and_with_its_orbit_alone():
    assert reported(one_run(), one_run()) == []
    assert reported(one_run(), one_run(SweepSettings().skip)) == []


@together(
    "name, change",
    [
        ("orbit_period", 2), ("contact", 1), ("drift", 3e-5), ("modal_norm", 2e-3),
        ("poincare", 2e-5), ("final_state", 2e-5), ("outcome", 1),
    ],
)  # fmt: skip
def test_every_kind_of_difference_is_named(name, change):
    plain, other = one_run(), one_run()
    other[name] = other[name] + np.asarray(change, np.asarray(other[name]).dtype)
    assert reported(plain, other) == [name]


def test_distance_of_sets_by_hand():
    left = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert skips.set_distance(left, left[::-1]) == 0.0
    assert skips.set_distance(left, np.array([[0.0, 0.25]])) == 1.0
    assert skips.set_distance(left[:0], left) == math.inf


def test_profile_counts_what_the_runs_ask_of_the_solver(monkeypatch):
    monkeypatch.setattr(profile, "STRETCHES", 2)
    monkeypatch.setattr(profile, "LENGTH", 3)
    job = parse_job(
        "[sweep]\nomega = 0.445\namplitude = {from = 0.05, to = 0.1, count = 9}\n",
        "profile",
        "profile",
    )
    (row,) = profile.profile(job, turns=1)
    assert row.n_runs == 6
    assert set(row.spent) == set(row.periods) <= set(profile.CALLS)
    assert 0 < sum(row.spent.values()) < row.microseconds
    # a building that touches the stop: at least one linear step and one passage a period
    periods = sum(row.periods.values())
    assert row.counts["linear steps"] > row.counts["passages"] > periods > 0
    assert "0.445" in profile.as_text([row])
    assert profile.as_json([row])[0]["counts"] == row.counts


def test_paths_are_drawn_alike_and_stay_on_the_map():
    for index in range(50):
        omega, amplitudes = skips.random_path(index, 7)
        again = skips.random_path(index, 7)
        assert omega == again[0]
        assert np.array_equal(amplitudes, again[1])
        assert 0.2 <= omega <= 0.8
        assert 0 < amplitudes.min() < amplitudes.max() <= 0.35
        assert np.abs(np.diff(amplitudes)) == pytest.approx(skips.STEP)
    assert skips.random_path(0, 7)[0] != skips.random_path(0, 8)[0]


def test_comparison_counts_every_point():
    result = skips.compare(25, seed=1)
    assert sum(result["skip_rules"].values()) == result["points"] == 25
    assert 0 < result["periods_per_point"] < result["periods_plain"] == 200
    assert result["unexplained"] == 0
    assert "unexplained: 0" in skips.as_text(result)


def test_a_plain_run_that_had_not_settled_is_called_undecided():
    omega, amplitude = UNDECIDED
    comparison = skips.Comparison(Structure(), omega, SweepSettings())
    plain, skipped, difference = comparison.compare(amplitude, np.zeros(6))
    assert (plain["orbit_period"], skipped["orbit_period"]) == (2, 1)
    assert difference.agrees_after == 2000
    assert difference.closer > 1e3


def test_a_wrong_jump_is_found_and_not_explained(monkeypatch):
    follow = FlowMap.follow_orbits

    def wrong(*given, **named):
        found = follow(*given, **named)
        orbits = found.orbits._replace(points=found.orbits.points + 1e-3)
        return replace(found, orbits=orbits)

    monkeypatch.setattr(FlowMap, "follow_orbits", wrong)
    comparison = skips.Comparison(Structure(), 0.445, SweepSettings())
    _, _, difference = comparison.compare(0.06, np.zeros(6))
    assert "poincare" in difference.what
    assert difference.agrees_after == 0


@pytest.mark.slow
def test_no_difference_is_left_unexplained():
    result = skips.compare(600, seed=2)
    wrong = [row for row in result["differences"] if not row["agrees_after"]]
    assert wrong == []
    # and the comparison was one of motions with contact, most of them shortened
    assert result["skip_rules"]["NEWTON"] > 200
    assert result["periods_per_point"] < 40


@pytest.mark.slow
def test_every_peer_solves_the_equations():
    rows = work_precision.work_precision([P1], repeats=1)
    asked = {(name, rtol) for name, rtol, _ in peers.methods()}
    assert {(row.method, row.rtol) for row in rows} == asked
    assert all(row.microseconds > 0 for row in rows)
    # the error of a step, of which a period has hundreds; where the error estimate of an explicit
    # method misses how a layer begins, more: of 16 starts 1e-15 apart DOP853 at 1e-9 was off by
    # 3e-9 to 2e-8 in 13, by 1e-7 in two and by 1e-6 in one
    assert [row for row in rows if not row.error < 1e4 * row.rtol] == []
    assert all(row.error < 1e-10 for row in rows if row.method == "flow")


def test_methods_that_fail_or_are_absent_are_said(monkeypatch):
    def fails(_regime):
        def points(_state):
            raise ArithmeticError("gave up")

        return points

    ours = next(peers.methods())
    monkeypatch.setattr(work_precision, "methods", lambda: iter([ours, ("peer", 1e-6, fails)]))
    nowhere = peers.Package("no_such_module", "no-such-package", "ask its authors")
    monkeypatch.setattr(peers, "PACKAGES", (*peers.PACKAGES, nowhere))
    said = []
    rows = work_precision.work_precision([P1], repeats=1, say=said.append)
    assert [row.method for row in rows] == ["flow"]
    assert "P1 C3: peer at 1e-06 failed: gave up" in said
    reported = work_precision.as_text(rows)
    assert "not measured: no-such-package is not installed (ask its authors)" in reported
    absent = work_precision.as_json(rows)["not_installed"]
    assert absent[-1] == "no-such-package"
    for package in peers.PACKAGES[:-1]:
        installed = importlib.util.find_spec(package.module) is not None
        assert (package.name in absent, f"{package.name} is not" in reported) == (
            not installed,
        ) * 2


@pytest.mark.slow
def test_ratio_on_an_attractor():
    compared = [ratios.motions()[0], ratios.motions()[2]]
    rows = ratios.motion_ratios(compared, against=(("bdf", 1e-6),), turns=1)
    assert [row.motion for row in rows] == ["building", "pounding"]
    for row in rows:
        assert (row.method, row.rtol) == ("bdf", 1e-6)
        assert row.ratio == pytest.approx(row.microseconds / row.flow_microseconds)
        assert row.ratio > 100
        assert row.flow_error < 1e-10 < row.error < 1e-3


def test_the_motions_of_the_ratios_are_those_they_say():
    assert ratios.pounding() == load_job(JOBS / "structures/pounding.toml").structure
    touched = []
    for regime in ratios.motions():
        flow = FlowMap(regime.structure, regime.omega)
        rest = np.zeros(2 * regime.structure.n_floors)
        state = flow.advance(rest, regime.amplitude, 300).state
        touched.append(flow.observe(state, regime.amplitude, 20).contact)
    assert touched == [0b100, 0b110, 0b110, 0b111]


def test_numbers_of_ranks():
    assert [scaling.rank_numbers(n) for n in (1, 2, 6, 8)] == [
        [1], [1, 2], [1, 2, 4, 6], [1, 2, 4, 8],
    ]  # fmt: skip


def test_without_a_launcher_ranks_are_left_out_by_name(monkeypatch):
    monkeypatch.setattr(scaling, "mpirun", lambda: None)
    assert "not measured: no mpirun found" in scaling.ranks_as_text(scaling.ranks())


@pytest.mark.slow
@pytest.mark.mpi
def test_scaling_over_ranks(monkeypatch):
    monkeypatch.setenv("OMPI_MCA_rmaps_base_oversubscribe", "1")
    result = scaling.ranks([1, 2], turns=1, n_frames=2)
    assert [row["ranks"] for row in result["rows"]] == [1, 2]
    assert result["rows"][0]["efficiency"] == 1.0
    for row in result["rows"]:
        assert 0 < row["seconds"] < row["command_seconds"]
        assert row["efficiency"] == pytest.approx(row["speedup"] / row["ranks"])
    assert "efficiency" in scaling.ranks_as_text(result)
    assert "other programs" in scaling.ranks_as_text({**result, "load": 2.0 * result["cores"]})
    assert "other programs" not in scaling.ranks_as_text({**result, "load": 0.0})


def test_a_campaign_that_fails_is_told(monkeypatch):
    monkeypatch.setattr(startup, "JOB", "[sweep]\nomega = -1\namplitude = 0.1\n")
    result = startup.startup(repeats=1)
    assert "sweep.omega" in result["failed"]
    assert "not measured" in startup.as_text(result)
    monkeypatch.setattr(scaling, "mpirun", lambda: "false")
    result = scaling.ranks([1], turns=1)
    assert "on 1 ranks failed" in result["failed"]
    assert "not measured" in scaling.ranks_as_text(result)


@pytest.mark.slow
def test_a_warm_start_is_shorter_than_a_cold_one(monkeypatch):
    """Cold are two kernels here: to compile all takes a minute."""
    run_command = startup.run_command

    def with_most_kernels(command, **variables):
        cache = Path(variables.get("NUMBA_CACHE_DIR", "."))
        if not cache.exists():
            lost = ("solvers/flow/layer/passage/passage", "solvers/flow/orbit/transient")
            assert kernels_but(cache, *lost) == 2
        return run_command(command, **variables)

    monkeypatch.setattr(startup, "run_command", with_most_kernels)
    result = startup.startup(repeats=1)
    assert result["libraries"] < result["warm"] < result["cold"] / 2


def test_work_precision_figure(tmp_path):
    rows = [
        work_precision.Row(regime, method, rtol, time / rtol**0.2, 1.0, rtol)
        for regime in ("beta = 100", "P1")
        for method, time in (("one", 1.0), ("other", 30.0))
        for rtol in (1e-3, 1e-6)
    ]
    figure.draw(rows, tmp_path / "figure.png")
    image = pyplot.imread(tmp_path / "figure.png")
    assert image.shape[1] > image.shape[0] > 300
    coloured = np.ptp(image[:, :, :3], axis=2) > 0.3
    assert coloured[: image.shape[0] * 4 // 5].sum() > 500


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--only", "speed"), "'speed' is none of work-precision"),
        (("--skips", "0"), "must be at least 1"),
        (("--seed", "-1"), "--seed -1"),
        (("--only", "floors", "--plot", "x.png"), "--plot"),
    ],
)
def test_mistakes_tell_what_is_wrong(capsys, arguments, word):
    with pytest.raises(SystemExit) as end:
        bench.main([*arguments])
    assert end.value.code == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert word in told.err.splitlines()[-1]


@pytest.mark.slow
def test_parts_by_name_as_json(monkeypatch, capsys):
    monkeypatch.setattr(scaling, "floors", partial(scaling.floors, scaling.FLOORS[:4], 1, 3))
    code = bench.main(["--skips", "10", "--processes", "1", "--only", "floors", "--json"])
    told = capsys.readouterr()
    assert code == 0, told.err
    found = json.loads(told.out)
    assert list(found) == ["floors", "skips"]
    assert found["skips"]["points"] == 10
    assert [row["n_floors"] for row in found["floors"]] == [3, 10, 20, 20]


@pytest.mark.slow
def test_passages_take_strategies_in_and_out(monkeypatch, capsys, tmp_path):
    """By plain Python, which shows as well as compiled kernels do which ones are used."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    changes = ("structure.n_floors=1", "structure.sharpness=300.0", "output.lyapunov=false")
    changes += ("structure.stiffness_ratio=30.0", "sweep.omega=0.9")
    changes += ("sweep.amplitude={from=0.6,to=0.7,count=2}",)  # periodic
    changes += ("sweep.transient_cycles=1", "sweep.sampling_cycles=1", "sweep.max_orbit_period=1")
    job = ("figure3.toml", *(word for one in changes for word in ("--set", one)))
    monkeypatch.setitem(passages.CASES, "figure 3", job)
    points, measured = {}, passages.processor_time

    def keep(gone, cache, job, out):
        seconds = measured(gone, cache, job, out)
        points[gone] = datasets(out)["poincare"].view(float)
        return seconds

    monkeypatch.setattr(passages, "processor_time", keep)
    passages.main(["--case", "figure 3", "--repeat", "0", "--without", "volterra"])
    table = capsys.readouterr().out.splitlines()
    assert table[0].split()[-3:] == ["all", "without", "volterra"]
    assert len(table[1].split()) == 2 + 4
    # the same motion, by other arithmetic
    np.testing.assert_allclose(points[()], points["volterra",], rtol=1e-12, atol=1e-12)
    assert (points[()] != points["volterra",]).any()
