"""Sweeps and points of structures that yield: what the file tells, and what is refused."""

import numpy as np
import pytest
from together import together
from tools import hpcsweep, made, refuse

from hpcsweep import open_results
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics.classify import MotionClass, Shakedown
from hpcsweep.job import JobError, parse_job
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule

STRUCTURE = """
[structure]
matrices = {mass = [1.0], stiffness = [[0.05]], damping = [[0.2]]}
[[structure.slider]]
direction = [1.0]
stiffness = 0.95
strength = 0.95
name = "spring"
"""
SWEEP = """
[sweep]
omega = [0.7, 0.9]
amplitude = [0.1, 0.2, 0.6, 0.9]
transient_cycles = 60
sampling_cycles = 16
[output]
storey_drift = true
block = 1
"""
JOB = STRUCTURE + SWEEP
RATCHET = (
    JOB.replace("[0.05]]", "[0.0]]")
    .replace("strength = 0.95", "strength = 0.3")
    .replace(
        "[sweep]",
        "[forcing]\nharmonics = [{order = 1}, {order = 2, amplitude = 0.7, phase = 0.9}]\n[sweep]",
    )
)
COLLAPSE = RATCHET.replace("[[0.2]]}", "[[0.2]]}\ncollapse_drift = 1.0")


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return made(JOB, tmp_path_factory.mktemp("sweep") / "sweep.h5")


def test_a_sweep_shakes_down_and_tells_how(swept):
    with open_results(swept) as results:
        up, down = (results.sel(direction=way) for way in ("up", "down"))
        assert results["state"].values.tolist() == ["u_1", "v_1", "p_spring"]
        assert (results["outcome"] == Outcome.COMPLETE).all()
        assert (results["orbit_period"] == 1).all()
        elastic, plastic = Shakedown.ELASTIC, Shakedown.PLASTIC
        assert up["shakedown"].values.tolist() == 2 * [[elastic, elastic, plastic, plastic]]
        assert down["shakedown"].values.tolist() == 2 * [[elastic, elastic, plastic, plastic]]
        free = [MotionClass.NO_CONTACT] * 2 + [MotionClass.PERIODIC] * 2
        assert up["motion"].values.tolist() == 2 * [free]
        # on the way down what has yielded stays: only what has not is the free motion
        rule = results["skip_rule"].values
        assert (rule[0, :, 0] == SkipRule.LINEAR).all()
        assert (rule[1, :, :2] == SkipRule.NEWTON).all()
        last = down["final_state"].values[:, :2, 2]
        assert (abs(last) > 1e-3).all()
        np.testing.assert_array_equal(last[:, 0], last[:, 1])
        assert (results["plastic"] == 0.0).all()
        slips = results["shakedown"] == plastic
        np.testing.assert_array_equal(results["slider_energy"].values[..., 0] > 0, slips)
        assert (results["ductility"].values[slips.values] > 1.0).all()
        drift, ductility = results["storey_drift"].values, results["ductility"].values
        np.testing.assert_allclose(drift, ductility, rtol=1e-12)


def test_the_free_motion_is_that_which_is_integrated(tmp_path, swept):
    text = JOB.replace("[sweep]", '[solver]\nskip = "none"\n[sweep]')
    with open_results(made(text, tmp_path / "whole.h5")) as whole, open_results(swept) as short:
        for name in ("final_state", "ductility", "slider_energy", "storey_drift"):
            np.testing.assert_allclose(whole[name], short[name], rtol=0, atol=2e-6)
        np.testing.assert_array_equal(whole["shakedown"], short["shakedown"])
        np.testing.assert_array_equal(whole["orbit_period"], short["orbit_period"])


def test_blocks_and_ranks_change_no_bit(tmp_path, swept):
    together = made(JOB.replace("block = 1", "block = 50"), tmp_path / "together.h5")
    with open_results(together) as a, open_results(swept) as b:
        for name in set(b.data_vars) - {"commit"}:
            assert a[name].values.tobytes() == b[name].values.tobytes(), name


def test_the_file_is_sound_and_its_summary_counts(swept):
    assert not validate(swept).problems
    counted = summarize(swept)
    assert counted["shakedown"]["elastic"]["runs"] == 8
    assert counted["shakedown"]["plastic"]["runs"] == 8
    assert counted["largest"]["ductility"]["value"] > 1.0


def test_a_drift_a_period_is_told(tmp_path):
    path = made(RATCHET, tmp_path / "ratchet.h5")
    with open_results(path) as results:
        told = results["shakedown"].values == Shakedown.RATCHETING
        drift = results["plastic"].values[..., 0]
        assert told[..., 2:].all()
        np.testing.assert_array_equal(told, drift != 0.0)
        assert (results["orbit_period"].values[told] == 1).all()
        # u goes along with p, and no force changes
        ends = results["final_state"].values[told]
        np.testing.assert_array_less(abs(ends[:, 0] - ends[:, 2]), 0.32)
    assert not validate(path).problems


def test_a_collapse_is_an_outcome_and_the_path_goes_on_from_rest(tmp_path):
    path = made(COLLAPSE, tmp_path / "collapse.h5")
    with open_results(path) as results:
        collapsed = results["outcome"].values == Outcome.COLLAPSED
        assert collapsed[..., 2:].all()
        assert not collapsed[..., 0].any()
        assert np.isnan(results["ductility"].values[collapsed]).all()
        assert (results["final_state"].values[collapsed] == 0.0).all()
    assert not validate(path).problems


def test_the_solver_that_does_not_know_sliders_is_refused():
    job = JOB.partition("[output]")[0]
    with pytest.raises(JobError, match=r"solver.method = 'bdf': must be 'flow' where"):
        parse_job('[solver]\nmethod = "bdf"\n' + job, "job.toml", "job")


@together(
    "value, said",
    [
        ("[0.0, 0.0]", r"list of 2 n \+ L = 3 numbers, u, v and p"),
        ("[3.0, 0.0, 0.0]", r"\|b . u - p\| of slider spring at most 1, is 3"),
    ],
)
def test_a_start_beyond_the_strength_is_refused(value, said):
    text = JOB.replace("[output]", f"initial_state = {value}\n[output]")
    with pytest.raises(JobError, match=said):
        parse_job(text, "job.toml", "job")


def test_exponents_are_those_transverse_to_the_family_of_an_orbit(tmp_path):
    path = made(JOB + "lyapunov = true\n", tmp_path / "exponents.h5")
    with open_results(path) as results:
        found, elastic = results["lyapunov"].values, results["shakedown"] == Shakedown.ELASTIC
        # c / 2 m of the structure that has not yielded, after it has yielded, too
        np.testing.assert_allclose(found[elastic.values], -0.1, rtol=1e-7)
        assert (found[~elastic.values] > -0.1).all()
        assert (found < 0.0).all()
    assert not validate(path).problems


def test_a_map_shows_the_ductility(tmp_path, swept):
    done = hpcsweep(0, "plot", swept, "--kind", "map", "--value", "ductility", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_phase_portrait_is_drawn_and_a_page_refused(tmp_path, swept):
    arguments = ("--kind", "phase", "--amplitude", "0.9", "-o", "x.png")
    done = hpcsweep(0, "plot", swept, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "x.png").stat().st_size > 10_000
    refuse(hpcsweep(0, "explore", swept, "-o", "x.html", cwd=tmp_path), "springs that yield")
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]
