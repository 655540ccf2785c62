"""Studies with varied keys: each part as a job of its own."""

import math
import time

import numpy as np
import pytest
from tools import ATTRACTORS, BASINS, GRID, SMALL, VARY

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.figures.style import classes_of
from hpcsweep.job import parse_job, part_of
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames, StoreError
from hpcsweep.studies.run_names import count

SHARP = SMALL.replace("sharpness = 4e3", "sharpness = inf\nrestitution = 0.7")
STOPS = VARY.replace("{from = 0.5, to = 1.5, count = 3}", "[0.5, 0.6]")


def compute(text: str, path):
    job = parse_job(text, "job", "job")
    assert campaign.run(job, path, Serial()) == 0
    return job, open_results(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        GRID + STOPS,
        *(pytest.param(one + STOPS, marks=pytest.mark.slow) for one in (SMALL, ATTRACTORS, BASINS)),
    ],
    ids="gsab",
)
def test_each_part_is_that_of_a_job_of_its_own_to_the_last_bit(text, tmp_path):
    job, results = compute(text, tmp_path / "varied.h5")
    assert results.sizes["stiffness_ratio"] == 2
    assert (results["outcome"] == 1).all()
    frames = Frames(tmp_path / "varied.h5", None)
    for place in frames.places:
        own = part_of(job, place)
        alone = compute(own.text, tmp_path / f"{'-'.join(map(str, place))}.h5")[1]
        part = results.sel(job.study.values_at(place))
        frames.choose(place)
        read = frames.gather([*frames])
        for name in own.study.variables:
            np.testing.assert_array_equal(part[name.name].values, alone[name.name].values)
            np.testing.assert_array_equal(read[name.name].values, alone[name.name].values)
    frames.close()
    assert len({results["drift"].values[k, 0].tobytes() for k in range(2)}) == 2
    reported = summarize(tmp_path / "varied.h5")
    assert reported["runs_done"] == reported["runs_total"] == job.study.n_runs
    assert reported["vary"] == {axis.key: list(axis.values) for axis in job.study.axes}
    report = validate(tmp_path / "varied.h5", samples=1)
    assert report.sound
    assert len(report.sample) == 1


def test_a_part_is_chosen_by_the_values_of_its_keys(tmp_path):
    path = tmp_path / "varied.h5"
    compute(SMALL + VARY, path)
    frames = Frames(path, at={"gap": 1.0, "stiffness_ratio": 300})
    assert frames.study.structure.gap == 1.0
    assert frames.study.structure.stiffness_ratio == 300.0
    assert frames.part == "stiffness_ratio = 300, gap = 1"
    frames.close()
    for at, words in (
        ({"gap": 0.7}, "gap = 0.7: must be one of 0.5, 1, 1.5"),
        ({"gap": "wide"}, "gap = wide: must be one of 0.5, 1, 1.5"),
        ({"mass": 1.0}, "mass = 1.0: it varies stiffness_ratio, gap"),
    ):
        with pytest.raises(StoreError, match=words):
            Frames(path, at=at)


def test_keys_are_counted_in_english():
    assert [count(2, noun) for noun in ("gap", "building_0_radius", "building_1_mass")] == [
        "2 gaps",
        "2 building_0_radiuses",
        "2 building_1_masses",
    ]
    assert count(1, "mass") == "1 mass"


def test_words_are_an_axis_too(tmp_path):
    path = tmp_path / "varied.h5"
    text = SMALL + '[vary]\nsolver.skip = ["all", "none"]\n'
    results = compute(text, path)[1]
    assert results["skip"].values.tolist() == ["all", "none"]
    spared = results["skip_rule"].sel(skip="none")
    assert (spared == 0).all()
    assert (results["skip_rule"].sel(skip="all") > 0).any()
    frames = Frames(path, at={"skip": "none"})
    assert frames.at == {"skip": "none"}
    frames.close()


@pytest.mark.parametrize(
    ("key", "given", "job", "values", "other"),
    [
        pytest.param(
            *("sharpness", "[inf, 1e4]", SMALL, [math.inf, 1e4], 7), marks=pytest.mark.slow
        ),
        ("tension", "[true, false]", SHARP, ["true", "false"], 1.0),
        pytest.param(
            *("damping_ratio", "[[0.02, 0.03], 0.05]", SMALL, ["[0.02, 0.03]", "0.05"], 0.02),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_values_that_are_no_finite_numbers_are_an_axis_too(
    key, given, job, values, other, tmp_path
):
    path = tmp_path / "varied.h5"
    job, results = compute(f"{job}[vary]\nstructure.{key} = {given}\n", path)
    assert results[key].values.tolist() == values
    assert validate(path, samples=2).sound
    assert summarize(path)["vary"] == {f"structure.{key}": values}
    for place, value in enumerate(values):
        asked = value == "true" if value in ("true", "false") else value
        frames = Frames(path, at={key: asked})
        assert frames.place == (place,)
        assert frames.at == {key: value}
        assert classes_of(results.sel({key: value})).shape == (2, 4, 11)
        frames.close()
    with pytest.raises(StoreError, match=f"{key} = {other}: must be one of"):
        Frames(path, at={key: other})


@pytest.mark.slow
def test_a_thousand_structures_cost_what_their_runs_cost():
    """Each is made, validated and thrown away; a millisecond each is a hundredth of a sweep."""
    text = SMALL + "[vary]\nstructure.gap = {from = 0.5, to = 1.5, count = 1000}\n"
    begun = time.process_time()
    study = parse_job(text, "job", "job").study
    seconds = time.process_time() - begun
    assert study.n_parts == 1000
    assert seconds < 5.0
    own = part_of(parse_job(text, "job", "job"), (17,)).study
    begun = time.process_time()
    own.compute(own.path(0)[0], own.initial_state)
    assert seconds / 1000 < 40 * (time.process_time() - begun)
