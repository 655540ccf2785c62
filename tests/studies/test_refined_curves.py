"""Refined maps whose cells are cut where known curves cross them."""

import re
import shutil

import h5py
import numpy as np
import pytest
from together import together
from tools import JOBS, assert_same_datasets, hpcsweep, made

from hpcsweep import open_results
from hpcsweep.campaign.run import STOPPED
from hpcsweep.campaign.status import status
from hpcsweep.checks.validate import validate
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.studies.refinement import Source

ONE = """
[structure]
n_floors = 1
stiffness_ratio = 100.0
sharpness = inf
damping_ratio = 0.05
"""
SWEEP = f"""{ONE}
[sweep]
omega = [1.1, 1.2, 1.3]
amplitude = {{from = 0.1, to = 0.9, count = 9}}
transient_cycles = 100
sampling_cycles = 32
max_orbit_period = 1
"""
BRANCHES = (
    SWEEP
    + """
[study]
kind = "branches"
[branches]
seeds = "one.h5"
steps = 300
max_points = 2000
max_seeds = 40
max_curve_points = 600
"""
)
CURVES = BRANCHES + 'curves = ["fold", "grazing"]\n'
MAP = f"""{ONE}
[study]
kind = "points"
refine = {{levels = 3, wrong = 0.2, curves = "curves.h5"}}
[sweep]
omega = {{from = 1.08, to = 1.31, count = 41}}
amplitude = {{from = 0.06, to = 0.94, count = 34}}
transient_cycles = 100
sampling_cycles = 32
[output]
poincare = false
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("curves")
    jobs = {"one": SWEEP, "curves": CURVES, "none": BRANCHES, "map": MAP}
    for name, text in jobs.items():
        (folder / f"{name}.toml").write_text(text)
        done = hpcsweep(0, "run", f"{name}.toml", cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def beside(crossed: np.ndarray) -> np.ndarray:
    """Return the corners of boxes that begin where `crossed` is set."""
    corners = crossed.copy()
    corners[1:] |= crossed[:-1]
    corners[:, 1:] |= corners[:, :-1]
    return corners


@pytest.mark.slow
def test_all_points_beside_a_curve_are_computed(folder):
    results = open_results(folder / "map.h5")
    source, crossed = results["source"].values[0], results["crossed"].values[0] != 0
    assert (source == Source.INFERRED).mean() > 0.05
    assert not (source[beside(crossed)] == Source.INFERRED).any()
    # without contact one floor touches the stop where its motion has the size of the gap
    omega, amplitude = results["omega"].values, results["amplitude"].values
    inside = (omega >= 1.1) & (omega <= 1.3)
    touches = np.hypot(1 - omega**2, 2 * 0.05 * omega)[inside]
    number = np.searchsorted(amplitude, touches) - 1
    assert crossed[np.flatnonzero(inside), number].all()
    # the control: without the curves some of these are inferred
    plain = made(MAP.replace(', curves = "curves.h5"', ""), folder / "plain.h5")
    known = open_results(plain)
    assert "crossed" not in known
    assert (known["source"].values[0][beside(crossed)] == Source.INFERRED).any()
    both = (known["source"].values[0] != Source.INFERRED) & (source != Source.INFERRED)
    for name in ("drift", "motion", "contact"):
        first, second = known[name].values[0][both], results[name].values[0][both]
        assert np.array_equal(first, second, equal_nan=True), name


@pytest.mark.slow
def test_a_complete_map_needs_the_curves_no_more(folder, tmp_path):
    shutil.copy(folder / "map.h5", tmp_path)
    assert validate(tmp_path / "map.h5", samples=0).problems == []
    for words in (("status",), ("summary",), ("plot", "--cells")):
        assert hpcsweep(0, words[0], "map.h5", *words[1:], cwd=tmp_path).returncode == 0
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        file["crossed"][0, 5, 5] ^= 1
    (problem,) = validate(tmp_path / "map.h5", samples=0).problems
    assert "its checksum does not hold" in problem


@pytest.mark.slow
def test_it_goes_on_with_the_same_curves_only(folder, tmp_path):
    shutil.copy(folder / "curves.h5", tmp_path)
    (tmp_path / "map.toml").write_text(MAP)
    command = ("run", "map.toml")
    assert hpcsweep(0, *command, "--max-hours", 0.0008, cwd=tmp_path).returncode == STOPPED
    before = (tmp_path / "map.h5").read_bytes()
    (tmp_path / "curves.h5").unlink()
    for text, said in (
        (None, "curves.h5: cannot be read: No such file or directory"),
        (
            CURVES.replace('"fold", ', ""),
            "curves.h5: holds other curves than when .*map.h5 was begun; give another",
        ),
    ):
        if text:
            (tmp_path / "curves.toml").write_text(text)
            shutil.copy(folder / "one.h5", tmp_path)
            assert hpcsweep(0, "run", "curves.toml", cwd=tmp_path).returncode == 0
        done = hpcsweep(0, *command, cwd=tmp_path)
        assert done.returncode == 2
        assert re.search(said, done.stderr)
        assert len(done.stderr.splitlines()) == 1
        assert (tmp_path / "map.h5").read_bytes() == before
    shutil.copy(folder / "curves.h5", tmp_path)
    assert hpcsweep(0, *command, cwd=tmp_path).returncode == 0
    assert_same_datasets(folder / "map.h5", tmp_path / "map.h5")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"curves.h5"', '"gone.h5"'), "gone.h5: cannot be read: No such file"),
        (('"curves.h5"', '["curves.h5", "one.h5"]'), "one.h5: holds motions"),
        (('"curves.h5"', '"none.h5"'), "none.h5: holds no curves; branches.curves names those"),
        (("damping_ratio = 0.05", "damping_ratio = 0.06"), "is of another structure than the map"),
        (("from = 1.08, to = 1.31", "from = 2.0, to = 2.1"), "no curve crosses the map"),
    ],
)
def test_curves_that_do_not_fit_get_one_line_and_nothing_is_written(folder, change, said):
    text = MAP.replace(*change)
    assert text != MAP
    (folder / "bad.toml").write_text(text)
    dry = ("--dry-run",) if "gone" in said else ()
    done = hpcsweep(0, "run", "bad.toml", *dry, cwd=folder)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (folder / "bad.h5").exists()


@pytest.mark.slow
def test_a_file_that_is_not_complete_is_refused(folder, tmp_path):
    for path in folder.glob("*.h5"):
        shutil.copy(path, tmp_path)
    with h5py.File(tmp_path / "curves.h5", "r+") as file:
        file["commit"][0, 1] = 0
    (tmp_path / "map.toml").write_text(MAP)
    done = hpcsweep(0, "run", "map.toml", "-o", "new.h5", cwd=tmp_path)
    assert done.returncode == 2
    assert "curves.h5: is not complete; run its job again to resume it" in done.stderr


@together("given", ["3", "[]", '["a.h5", 4]', '""'])
def test_names_that_are_none_get_one_line(given):
    with pytest.raises(JobError, match=r"study\.refine\.curves = .*must be a results file of"):
        parse_job(MAP.replace('"curves.h5"', given), "job", "job")


def test_basins_have_no_curves():
    text = (JOBS / "refined" / "basins.toml").read_text()
    given = text.replace("refine = {", 'refine = {curves = "a.h5", ')
    (setting,) = (line for line in given.splitlines() if line.startswith("refine"))
    with pytest.raises(JobError, match=r"study\.refine\.curves = .*does not go with basins"):
        load_job(JOBS / "refined" / "basins.toml", [f"study.{setting}"])


@pytest.mark.slow
def test_curves_of_one_part_cut_the_cells_on_both_sides_of_it(folder):
    text = (
        MAP.replace("41", "21")
        .replace("count = 34", "count = 18")
        .replace("levels = 3", "levels = 1")
    )
    (folder / "three.toml").write_text(text + "[vary]\nstructure.gap = [0.8, 0.9, 1.0, 1.1]\n")
    done = hpcsweep(0, "run", "three.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    results = open_results(folder / "three.h5")
    crossed = results["crossed"].values[:, 0] != 0
    assert crossed.any(axis=(1, 2)).tolist() == [False, True, True, False]
    corners = beside(crossed[1])
    computed = results["source"].values[:, 0] != Source.INFERRED
    assert computed[1:][:, corners].all()
    assert validate(folder / "three.h5", samples=0).problems == []


@pytest.mark.slow
def test_a_dry_run_counts_the_cells_that_curves_cross(folder):
    said = hpcsweep(0, "run", "map.toml", "--dry-run", cwd=folder).stdout
    (line,) = (line for line in said.splitlines() if line.startswith("  refined "))
    assert "cells, those that curves cross and the first draw" in line
    crossed = open_results(folder / "map.h5")["crossed"].values[0] != 0
    least = int(re.search(r"(\d+) points", line)[1])
    assert beside(crossed).sum() < least <= status(folder / "map.h5")["runs_done"]
