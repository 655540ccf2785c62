"""What the pages say exists: links, paths, names, command lines, keys, variables."""

import ast
import functools
import importlib
import re
import shlex
import subprocess
from pathlib import Path

import draw_architecture
import from_code
import h5py
import pytest
from together import together
from tools import ATTRACTORS, BASINS, GRID, RECORDS, ROOT, SMALL, hpcsweep

import hpcsweep as hpcsweep_api
from hpcsweep.campaign.run import COMPLETE, FAILED, REFUSED, STOPPED
from hpcsweep.commands.cli import CLOSED_PIPE, build_parser
from hpcsweep.job import JobError, parse_job
from hpcsweep.job.keys import every_key
from hpcsweep.solvers.outcome import REMEDIES
from hpcsweep.studies.quantities import MEASURES

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md"]
PAGES += sorted([*DOCS.glob("*.md"), *DOCS.glob("theory/*.md")])
ROOMS = sorted(path.parent.name for path in (ROOT / "hpcsweep").glob("*/__init__.py"))
MEASURED = "".join(f"{name} = true\n" for name in MEASURES)
LIST = """
[study]
kind = "points"
points = [[0.05, 0.6], [0.2, 0.5]]
"""
TOP = ("hpcsweep", "jobs", "slurm", "tests", "docs", r"\.ci")
LAUNCHER = re.compile(r"^(?:(?:mpirun|srun)(?: -n \S+| --\S+)* )?hpcsweep (?=[a-z-])")


@functools.cache
def generated() -> dict[str, str]:
    """Pages that the site makes from the code, by their names in docs/generated."""
    return {f"{name}.md": text for name, text in from_code.pages().items()}


def blocks(text: str, *languages: str) -> list[str]:
    """Contents of the fenced blocks of some languages."""
    found = re.findall(r"^ *```(\w*)\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL)
    return [body for language, body in found if language in languages]


def spans(text: str) -> list[str]:
    """Everything between backticks outside fenced blocks, on one line."""
    text = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)
    return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)]


@functools.cache
def anchors(text: str) -> frozenset[str]:
    """Return the anchors that GitHub gives a page's headings."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return frozenset(re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in headings)


def command_lines(text: str) -> list[str]:
    """Command lines of hpcsweep: of shell blocks, and between backticks."""
    shell = "\n".join(blocks(text, "sh")).replace("\\\n", " ").splitlines()
    lines = [" ".join(line.split()) for line in shell] + spans(text)
    return [LAUNCHER.sub("", line) for line in lines if LAUNCHER.match(line)]


def test_every_relative_link_leads_somewhere():
    lost = []
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            file = (page.parent / name).resolve() if name else page
            made = file.parent.name == "generated"  # by the site: not there in a checkout
            if made or not file.exists() or (anchor and anchor not in anchors(file.read_text())):
                lost.append((page.name, target))
    assert lost == []


def test_every_path_that_is_named_exists():
    lost: list[tuple[str, str]] = []
    for page in PAGES:
        text = page.read_text()
        said = "\n".join([*spans(text), *blocks(text, "sh", "python", "toml", "")])
        named = re.findall(rf"(?<![\w/.~-])(?:{'|'.join(TOP)})/[\w./*-]*\w", said)
        rooms = re.findall(rf"(?<![\w/.~-])(?:{'|'.join(ROOMS)})/[\w./]*\w", "\n".join(spans(text)))
        paths = [*named, *(f"hpcsweep/{room}" for room in rooms)]
        lost += [
            (page.name, path)
            for path in paths
            if not any([*ROOT.glob(path), *ROOT.glob(f"{path}.py"), *ROOT.glob(f"{path}.toml")])
        ]
    assert lost == []


def test_every_name_of_the_package_exists():
    texts = "\n".join("\n".join(spans(page.read_text())) for page in PAGES)
    for name in set(re.findall(r"(?<![\w/])hpcsweep(?:\.[a-zA-Z_]+)+", texts)):
        parts = name.split(".")
        for length in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:length]))
            except ModuleNotFoundError:
                continue
            break
        for part in parts[length:]:
            assert hasattr(found, part), name
            found = getattr(found, part)


def test_every_command_line_is_understood(capsys):
    parser = build_parser()
    refused = []
    for line in command_lines("\n".join(page.read_text() for page in PAGES)):
        words = shlex.split(line, comments=True)
        try:
            # a command by its name alone is meant, not given
            parser.parse_args(words if len(words) > 1 else [*words, "--help"])
        except SystemExit as end:
            if end.code:
                refused.append((line, capsys.readouterr().err))
    assert refused == []


def test_command_lines_are_found_and_mistakes_in_them_are_refused(capsys):
    lines = command_lines(
        "```sh\nmpirun -n 2 hpcsweep run a.toml \\\n --no # x\n```\n`hpcsweep plto`"
    )
    assert lines == ["run a.toml --no # x", "plto"]
    for line in lines:
        with pytest.raises(SystemExit) as end:
            build_parser().parse_args(shlex.split(line, comments=True))
        assert end.value.code == 2
    assert sum(len(command_lines(page.read_text())) for page in PAGES) > 40


def test_the_exercises_apply():
    exercises = sorted((DOCS / "exercises").glob("*.diff"))
    assert len(exercises) == 9
    for exercise in exercises:
        assert f"exercises/{exercise.name}" in (DOCS / "extending.md").read_text()
        done = subprocess.run(
            ["git", "apply", "--check", exercise], text=True, cwd=ROOT, capture_output=True
        )
        assert done.returncode == 0, done.stderr


def known_keys(start: str) -> list[str]:
    """Keys that the parser of jobs says it knows at one place."""
    with pytest.raises(JobError) as refused:
        parse_job(f"{start}0 = 1", "job.toml", "job")
    return str(refused.value).partition("known are ")[2].split(", ")


def test_every_key_of_a_job_is_described_and_no_other():
    rows = generated()["job-keys.md"]
    described = re.findall(r"^\| `([\w.]+)` \|", rows, re.MULTILINE)
    tables = {table: keys for table, keys in every_key().items() if table and keys}
    named = [f"{table}.{key}" for table, keys in tables.items() for key in keys]
    top = [key for key in known_keys("") if not tables.get(key) or key == "building"]
    assert len(named) > 60
    assert sorted({*named, *top, "extends"} - set(described)) == []
    own = {key for key in described if key.count(".") < 2}
    assert sorted(own - {*named, *top, "extends"}) == []
    assert len(set(described)) == len(described)


def test_every_variable_and_attribute_of_a_file_is_described(small_job, tmp_path):
    described = spans(generated()["variables.md"] + (DOCS / "file-format.md").read_text())
    small_job.write_text(f"{small_job.read_text()}lyapunov = true\n")
    assert hpcsweep(0, "run", small_job, "-o", tmp_path / "a.h5").returncode == 0
    with h5py.File(tmp_path / "a.h5", locking=False) as file:
        names = [*file, *file.attrs]
    assert len(names) > 30
    assert [name for name in names if name not in described] == []


def test_the_picture_of_the_rooms_is_that_of_the_contracts():
    drawn = draw_architecture.PICTURE.read_text()
    assert drawn == draw_architecture.picture(), "python docs/draw_architecture.py draws it anew"


def test_every_room_has_its_page_of_words():
    for room in ROOMS:
        source = Path(ROOT / "hpcsweep" / room / "__init__.py").read_text()
        assert ast.get_docstring(ast.parse(source))


@together("text", [SMALL + MEASURED + "lyapunov = true\n", GRID, ATTRACTORS, BASINS, LIST, RECORDS])
def test_every_name_in_a_file_is_in_the_glossary_or_among_the_variables(text):
    study = parse_job(text, "job.toml", "job").study
    named = spans((ROOT / "docs" / "glossary.md").read_text() + generated()["variables.md"])
    held = [study.commit, *study.variables, *(variable for variable, _ in study.given)]
    names = {*study.dimensions, *(variable.name for variable in held), study.kind}
    assert sorted(names - set(named)) == []


def test_every_exit_code_error_and_outcome_has_a_remedy():
    said = spans((DOCS / "troubleshooting.md").read_text())
    codes = set(map(str, (COMPLETE, STOPPED, REFUSED, FAILED, CLOSED_PIPE)))
    listed = re.findall(r"^\| (\d+) \|", (DOCS / "troubleshooting.md").read_text(), re.MULTILINE)
    assert set(listed) == codes
    paths = sorted((ROOT / "hpcsweep").rglob("*.py"))  # users of Python meet no command's errors
    source = "".join(path.read_text() for path in paths if path.parent.name != "commands")
    errors = re.findall(r"^class (\w+)\(\w*Error\)", source, re.MULTILINE)
    assert len(errors) > 8
    failed = [one.name.lower() for one in REMEDIES]
    assert sorted({*errors, *failed} - set(said)) == []


def test_every_public_name_is_on_the_page_of_python():
    page = (DOCS / "python.md").read_text()
    listed = re.findall(r"^\.\. auto(?:class|function):: (\w+)$", page, re.MULTILINE)
    assert sorted(set(hpcsweep_api.__all__) - {"__version__"}) == sorted(listed)
    assert dir(hpcsweep_api) == hpcsweep_api.__all__
