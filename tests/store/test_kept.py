"""Files that an earlier version wrote are read for good; tests/data/keep.py writes them anew."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from together import together
from tools import ROOT, hpcsweep

from hpcsweep import open_results
from hpcsweep.job import job as meaning
from hpcsweep.job import parse_job
from hpcsweep.store import DamagedError, layout, opening
from hpcsweep.studies import variables
from hpcsweep.studies.variable import count

DATA = ROOT / "tests" / "data"
FILES = sorted(path.stem for path in DATA.glob("*.h5"))
JOBS = json.loads((DATA / "jobs.json").read_text())
READING = (
    ("status", "--json"),
    ("summary", "--json"),
    ("validate", "--samples", "0"),
    ("table", "-o", "made.csv"),
    ("plot", "-o", "made.png"),
    ("explore", "-o", "made.html"),
)
"""What is done with every file, by which another version reads it."""
NOT_FOR = {("explore", name) for name in ("basins", "refined-basins", "branches", "yielding")}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder of the kept files, which name one another."""
    for path in DATA.glob("*.h5"):
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def later(monkeypatch):
    """Make this a later version: its layout, its runs and what it means by a job are others."""

    def change() -> None:
        monkeypatch.setattr(layout, "LAYOUT_VERSION", layout.LAYOUT_VERSION + 1)
        monkeypatch.setattr(meaning, "MEANING_VERSION", meaning.MEANING_VERSION + 1)
        more = (count("more", (), "what is new"), *variables.RUN_VARIABLES[::-1])
        renamed = [v for v in more if v.name not in ("window_class", "classification_cycles")]
        monkeypatch.setattr(variables, "RUN_VARIABLES", tuple(renamed))
        monkeypatch.setattr(variables, "ALWAYS", (*variables.ALWAYS, "more"))

    return change


def test_a_file_of_each_kind_of_study_is_kept():
    from hpcsweep.studies.kinds import KINDS

    studies = [opening.job_of(DATA / f"{name}.h5").study for name in FILES]
    assert {study.kind for study in studies} == set(KINDS)
    assert sum(path.stat().st_size for path in DATA.iterdir()) < 1e6


def read(name: str) -> dict[str, bytes]:
    """Do with a file all that reads it; return what is made of it."""
    made = {}
    for command, *options in READING:
        if (command, name) not in NOT_FOR:
            beside = (
                ("--branches", "branches.h5") if (command, name) == ("explore", "seeds") else ()
            )
            done = hpcsweep(0, command, f"{name}.h5", *options, *beside)
            assert done.returncode == 0, f"{name}: {command}: {done.stdout}{done.stderr}"
            made[command] = done.stdout.encode()
            for path in Path().glob("made.*"):
                made[command] += path.read_bytes()
                path.unlink()
    return made


def same(first, second) -> bool:
    """Return whether two datasets have the same numbers, dimensions, coordinates and notes."""
    return first.identical(second) and all(
        np.asarray(first[name].attrs[note] == second[name].attrs[note]).all()
        for name in first.variables
        for note in first[name].attrs
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_a_later_version_makes_the_same_of_a_file(name, folder, monkeypatch):
    made = read(name)
    with monkeypatch.context() as changed:
        changed.setattr(layout, "LAYOUT_VERSION", layout.LAYOUT_VERSION + 1)
        again = read(name)
    assert made.keys() == again.keys()
    assert [command for command in made if made[command] != again[command]] == []


@together("name", ["vary", "records"])
def test_a_later_version_has_the_same_numbers(name, folder, monkeypatch):
    before = open_results(f"{name}.h5")
    with monkeypatch.context() as changed:
        changed.setattr(layout, "LAYOUT_VERSION", layout.OLDEST + 1)
        assert same(before, open_results(f"{name}.h5"))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FILES if "records" not in name])
def test_a_version_with_other_variables_and_meanings_reads_a_file(name, folder, later):
    before = open_results(f"{name}.h5")
    later()
    assert same(before, open_results(f"{name}.h5"))
    assert "means other runs" in read(name)["validate"].decode()


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_runs_of_a_kept_file_are_computed_again(name, folder):
    done = hpcsweep(0, "validate", f"{name}.h5", "--samples", "2")
    assert done.returncode == 0, done.stdout
    assert "means other runs" not in done.stdout


def test_only_the_version_that_wrote_a_file_goes_on_with_it(folder, monkeypatch):
    name, job = "seeds.h5", folder / "seeds.toml"
    job.write_text(opening.job_of(folder / name).text)
    more = ("run", job, "-o", "more.h5", "--reuse", name)
    lines = {"resumes": ("run", job, "-o", name), "reuses": more}
    lines["merges"] = ("merge", name, name, "-o", "whole.h5")
    monkeypatch.setattr(layout, "LAYOUT_VERSION", layout.OLDEST + 1)
    for does, line in lines.items():
        done = hpcsweep(0, *line)
        said = f"error: {name}: has layout version {layout.OLDEST}, which hpcsweep 0.2.0 {does}; "
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert said in done.stderr
        assert f"but {does} version {layout.OLDEST + 1} only" in done.stderr


def test_a_file_of_an_earlier_version_is_packed_as_it_is(folder, monkeypatch):
    before = open_results("seeds.h5")
    with monkeypatch.context() as changed:
        changed.setattr(layout, "LAYOUT_VERSION", layout.OLDEST + 1)
        assert hpcsweep(0, "pack", "seeds.h5").returncode == 0
        assert same(before, open_results("seeds.h5"))
    assert same(before, open_results("seeds.h5"))


def test_a_damaged_file_of_an_earlier_version_is_refused(folder, monkeypatch):
    path = folder / "seeds.h5"
    whole = path.read_bytes()
    monkeypatch.setattr(layout, "LAYOUT_VERSION", layout.OLDEST + 1)
    for word in (b"orbit_period,", b"forcing periods", b"lyapunov"):
        at = whole.find(word)
        if at > 0:
            path.write_bytes(whole[:at] + b"X" + whole[at + 1 :])
            with pytest.raises(DamagedError):
                open_results(path)


@pytest.mark.slow
@together("name", JOBS)
def test_a_kept_job_means_the_same(name):
    assert parse_job(JOBS[name]["text"], name, "job").fingerprint == JOBS[name]["fingerprint"]
