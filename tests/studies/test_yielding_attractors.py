"""Attractors and basins of structures that yield: what the files tell, and how they go on."""

import shutil

import h5py
import numpy as np
import pytest
from tools import assert_same_datasets, hpcsweep, made

from hpcsweep import open_results
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.dynamics.classify import Shakedown

STRUCTURE = """
[structure]
matrices = {mass = [1.0], stiffness = [[0.2]], damping = [[0.2]]}
[[structure.slider]]
direction = [1.0]
stiffness = 0.8
strength = 0.8
name = "spring"
[[structure.contact]]
direction = [1.0]
gap = 0.267
stiffness = 100.0
"""
ATTRACTORS = f"""
[study]
kind = "attractors"
starts = 10
displacement = [-1.5, 0.26]
velocity = [-2.0, 2.0]
{STRUCTURE}
[sweep]
omega = 1.218
amplitude = [0.355, 0.36]
[output]
block = 1
"""
BASINS = f"""
[study]
kind = "basins"
components = ["u_1", "p_spring"]
horizontal = [-1.4, -0.6, 0.0]
vertical = [-0.6, -0.3]
starts = 8
{STRUCTURE}
[sweep]
omega = 1.218
amplitude = 0.36
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return made(ATTRACTORS, tmp_path_factory.mktemp("attractors") / "found.h5")


@pytest.fixture(scope="module")
def basins(tmp_path_factory):
    return made(BASINS, tmp_path_factory.mktemp("basins") / "basins.h5")


def test_a_file_tells_families_and_shakedown_of_each_attractor(found):
    with open_results(found) as results:
        held = results["attractor_id"].values > 0
        told = {
            name: results[name].values[held] for name in ("families", "shakedown", "multiplier")
        }
        assert results["state"].values.tolist() == ["u_1", "v_1", "p_spring"]
        assert (results["hits"].values.sum(axis=-1) == 10).all()
        np.testing.assert_array_equal(told["families"] == 1, told["shakedown"] == Shakedown.ELASTIC)
        assert {Shakedown.ELASTIC, Shakedown.PLASTIC} == set(told["shakedown"].tolist())
        energy = results["slider_energy"].values[held][:, 0]
        np.testing.assert_array_equal(energy > 0.0, told["shakedown"] == Shakedown.PLASTIC)
        assert (told["multiplier"] < 1.0).all()
        # each keeps its identity along the amplitudes
        first, last = (set(ids[ids > 0].tolist()) for ids in results["attractor_id"].values[0, 0])
        assert first & last
    counted = summarize(found)["shakedown"]
    assert counted["elastic"]["runs"] + counted["plastic"]["runs"] == held.sum()


@pytest.mark.slow
def test_the_file_is_sound_and_goes_on_where_it_was_cut(tmp_path, found):
    assert not validate(found).problems
    path, job = tmp_path / "cut.h5", tmp_path / "job.toml"
    job.write_text(ATTRACTORS)
    shutil.copy(found, path)
    with h5py.File(path, "r+") as file:
        file["commit"][..., 1:] = 0
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    assert_same_datasets(found, path)


@pytest.mark.slow
def test_starts_with_another_p_go_to_members_of_the_same_families(tmp_path, basins):
    assert not validate(basins).problems
    with open_results(basins) as results:
        assert (results["label"].values > 0).all()
        assert results["families"].values.max() == 1
    done = hpcsweep(0, "plot", basins, "--kind", "basins", "-o", "x.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names = [one["name"] for one in summarize(basins)["basins"].values()]
    assert any(name.endswith("elastic") for name in names)


@pytest.mark.slow
def test_figures_of_attractors_name_what_yields(tmp_path, found):
    for kind in ("shares", "attractors"):
        done = hpcsweep(0, "plot", found, "--kind", kind, "-o", "x.png", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
