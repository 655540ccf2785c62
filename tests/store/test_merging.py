"""A job is cut in jobs of its parts, whose files make that of the whole, to the last bit."""

import json
from pathlib import Path

import numpy as np
import pytest
from together import together
from tools import (
    ATTRACTORS,
    BASINS,
    GRID,
    RECORDS,
    REFINED,
    SEEDS,
    SMALL,
    VARY,
    assert_same_datasets,
    hpcsweep,
)

from hpcsweep import open_results
from hpcsweep.campaign.run import COMPLETE, run_all
from hpcsweep.checks.validate import validate
from hpcsweep.job import JobError, load_job, parse_job
from hpcsweep.job.split import split
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import StoreError, merge

LISTED = GRID.replace("[structure]", "points = [[0.2, 0.6], [0.1, 0.5], [0.3, 0.7]]\n[structure]")
LISTED = "\n".join(line for line in LISTED.splitlines() if not line.startswith(("omega", "ampl")))
FEW = ATTRACTORS.replace("starts = 24", "starts = 8").replace("count = 6", "count = 2")
BRANCHES = SEEDS.replace(
    "[structure]",
    '[study]\nkind = "branches"\n[branches]\nseeds = "seeds.h5"\nmax_points = 400\n[structure]',
)


def computed(path: Path) -> Path:
    """Run a job beside its file."""
    job, output = load_job(path), path.with_suffix(".h5")
    (ended,) = run_all([(job, output)], Serial())
    assert ended.code == COMPLETE
    return output


def parts_of(text: str, n: int, folder: Path, name: str = "job") -> tuple[Path, list[Path]]:
    """Write a job, and compute its parts; return its path and their files."""
    path = folder / f"{name}.toml"
    path.write_text(text)
    made = []
    for part, own in split(load_job(path), n, path).items():
        part.write_text(own)
        made.append(computed(part))
    return path, made


@pytest.mark.parametrize(
    ("text", "n"),
    [
        pytest.param(SMALL, 3, marks=pytest.mark.slow),
        pytest.param(GRID, 4, marks=pytest.mark.slow),
        (SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 3") + VARY, 2),
        pytest.param(LISTED, 3, marks=pytest.mark.slow),
        (RECORDS.replace("count = 5", "count = 2"), 3),
        pytest.param(FEW, 2, marks=pytest.mark.slow),
    ],
    ids=["sweeps", "points", "vary", "list", "records", "attractors"],
)
def test_merged_parts_are_the_whole_to_the_last_bit(text, n, tmp_path):
    path, parts = parts_of(f"# mine\n{text}", n, tmp_path)
    assert sum(parse_job(open_results(p).attrs["job"], "", "x").study.n_runs for p in parts) == (
        load_job(path).study.n_runs
    )
    merged = tmp_path / "merged.h5"
    done = hpcsweep(0, "merge", *parts[::-1], "-o", merged)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"runs of {n} parts\n")
    whole = computed(path)
    assert_same_datasets(whole, merged)
    assert validate(merged, samples=0).sound
    told, right = open_results(merged).attrs, open_results(whole).attrs
    for name in ("job", "name", "resolved_job", "fingerprint", "structure", "libraries"):
        assert told[name] == right[name], name
    assert told["history"].endswith(f": merged of {n} parts")
    state = json.loads(hpcsweep(0, "status", merged, "--json").stdout)
    assert state["runs_done"] == state["runs_total"] == load_job(path).study.n_runs


@pytest.mark.slow
def test_branches_are_cut_by_their_lines(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("seeds.toml").write_text(SEEDS)
    computed(Path("seeds.toml"))
    path, parts = parts_of(BRANCHES, 3, Path(), "lines")
    merge(parts, Path("merged.h5"))
    assert_same_datasets(computed(path), Path("merged.h5"))


def test_a_name_that_a_job_gives_is_that_of_the_whole(tmp_path):
    text = f'name = "mine"\n{SMALL}'
    path = tmp_path / "job.toml"
    jobs = [parse_job(own, "x", "x") for own in split(parse_job(text, "x", "x"), 2, path).values()]
    assert [job.name for job in jobs] == ["mine-1of2", "mine-2of2"]
    assert np.array_equal(jobs[1].study.omega, [0.6, 0.8])


@together(
    "text, n, said",
    [
        (SMALL, 5, "-n 5: n must not exceed the 4 omegas"),
        (SMALL, 1, "-n 1: must be from 2 to 10000"),
        (f"part = [1, 2]\n{SMALL}", 2, "is a part already"),
        (REFINED, 2, "-n 2: is not allowed: this study cannot be split"),
        (BASINS, 2, "-n 2: is not allowed"),
    ],
)  # fmt: skip
def test_what_cannot_be_cut_is_refused(text, n, said, tmp_path):
    with pytest.raises(JobError) as error:
        split(parse_job(text, "x", "x"), n, tmp_path / "job.toml")
    assert said in str(error.value)


@together("given", ["[0, 2]", "[3, 2]", "[1.0, 2]", "2", "[1, 2, 3]", "[true, 2]"])
def test_a_part_is_one_of_several(given):
    with pytest.raises(JobError, match=r"x: part = .*: must be \[k, n\]"):
        parse_job(f"part = {given}\n{SMALL}", "x", "x")


@pytest.mark.slow
def test_what_is_no_whole_is_refused_in_one_line_and_nothing_is_written(tmp_path):
    short = SMALL.replace("transient_cycles = 30", "transient_cycles = 3")
    path, (first, second) = parts_of(SMALL, 2, tmp_path)
    _, (other, _) = parts_of(short, 2, tmp_path, "other")
    _, (third, *_) = parts_of(SMALL, 3, tmp_path, "third")
    whole, output = computed(path), tmp_path / "merged.h5"
    for files, said in (
        ([first], "part 2 of 2 is given 0 times, must be given once"),
        ([first, second, first], f"{first}: part 1 of 2 is given 2 times"),
        ([first, other], f"{other}: is of another job, or number of parts, than {first}"),
        ([first, third], f"{third}: is of another job, or number of parts, than {first}"),
        ([first, whole], f"{whole}: is of a whole job"),
        ([first, tmp_path / "none.h5"], "cannot be read"),
    ):
        done = hpcsweep(0, "merge", *files, "-o", output)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert said in done.stderr
        assert not output.exists()
    with pytest.raises(StoreError, match="exists already"):
        merge([first, second], whole)
    data = bytearray(first.read_bytes())
    with __import__("h5py").File(first) as file:
        data[file["drift"].id.get_offset() + 3] ^= 1
    first.write_bytes(data)
    with pytest.raises(StoreError, match=f"{first}: damaged"):
        merge([first, second], output)
    assert not output.exists()


@pytest.mark.slow
def test_commands_cut_and_merge(tmp_path):
    (tmp_path / "job.toml").write_text(SMALL)
    done = hpcsweep(0, "split", "job.toml", "-n", 2, "--set", "solver.rtol=1e-8", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "job-2of2.toml: written; run it with: hpcsweep run job-2of2.toml" in done.stdout
    assert hpcsweep(0, "split", "job.toml", "-n", 2, cwd=tmp_path).returncode == 2
    names = [f"job-{k}of2.h5" for k in (1, 2)]
    assert hpcsweep(0, "run", "job-1of2.toml", "job-2of2.toml", cwd=tmp_path).returncode == 0
    done = hpcsweep(0, "merge", *names, "-o", "job.h5", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "job.h5: 88 runs of 2 parts\n"), done.stderr
    # a complete file of the job, as run itself has it
    again = hpcsweep(0, "run", "job.toml", "--set", "solver.rtol=1e-8", cwd=tmp_path)
    assert again.returncode == 0
    assert "complete" in again.stdout + again.stderr
