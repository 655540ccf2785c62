"""What can be checked of the recipes in slurm/ without Apptainer and conda."""

import re
import runpy
import subprocess
import tomllib

import pytest
from tools import ROOT

from hpcsweep.figures.options import figures

SECTIONS = {
    "setup", "files", "arguments", "environment", "post", "runscript", "startscript", "test",
    "labels", "help",
}  # fmt: skip
"""Of an Apptainer definition."""
SHELL = ("environment", "post", "runscript", "test")
CONDA_NAMES = {"matplotlib-base": "matplotlib"}
"""Packages that have another name on conda-forge: without a toolkit of windows."""


@pytest.fixture(scope="module")
def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def definition() -> dict[str, str]:
    """The sections of the Apptainer definition; its header under ''."""
    text = (ROOT / "slurm" / "apptainer.def").read_text()
    header, *rest = re.split(r"^%(\w+)\n", text, flags=re.MULTILINE)
    return {"": header, **dict(zip(rest[::2], rest[1::2], strict=True))}


def test_conda_environment_states_what_the_package_needs(project):
    text = (ROOT / "slurm" / "environment.yml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    wanted = "".join(f"{line}\n" for line in lines)
    # of YAML only this: two keys with a list of plain words each
    form = r"name: hpcsweep\nchannels:\n(  - [\w-]+\n)+dependencies:\n(  - [\w.<>=,-]+\n)+"
    assert re.fullmatch(form, wanted)
    listed = set()
    for line in lines[lines.index("dependencies:") + 1 :]:
        name, bounds = re.fullmatch(r"  - ([\w-]+)(.*)", line).groups()
        listed.add(CONDA_NAMES.get(name, name) + bounds)
    extras = project["optional-dependencies"]
    needed = {*project["dependencies"], *extras["mpich"], *extras["video"]}
    assert listed == needed | {"pip", f"python{project['requires-python']}"}


def test_apptainer_definition_has_the_sections_of_the_format(definition):
    assert set(definition) - {""} <= SECTIONS
    keys = [line for line in definition[""].splitlines() if line and not line.startswith("#")]
    assert [line.split(": ")[0] for line in keys] == ["Bootstrap", "From"]
    assert "NOT checked" in definition[""]
    for name, body in definition.items():
        assert not name or all(line.startswith("    ") for line in body.splitlines() if line)


def test_apptainer_image_is_made_of_what_is_there(definition, project):
    python = re.search(r"^From: python:(3\.\d+)-slim$", definition[""], re.MULTILINE)[1]
    assert f"Programming Language :: Python :: {python}" in project["classifiers"]
    copied = [line.split()[0] for line in definition["files"].splitlines() if line.strip()]
    assert [name for name in copied if not (ROOT / name).exists()] == []
    # what the package is built from
    assert {"pyproject.toml", "hpcsweep", project["readme"], *project["license-files"][:2]} <= set(
        copied
    )
    extras = re.search(r"/opt/source\[([\w,]+)\]", definition["post"])[1].split(",")
    assert set(extras) <= set(project["optional-dependencies"])


@pytest.mark.parametrize("section", SHELL)
def test_shell_of_apptainer_sections_parses(definition, section):
    done = subprocess.run(
        ["sh", "-n"], input=definition[section], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_image_tests_itself_by_commands_that_the_installed_package_is_tested_by(definition):
    smoke = (ROOT / "tests" / "packaging" / "smoke.py").read_text()
    commands = re.findall(r"hpcsweep (--\w+|\w+)", definition["test"])
    assert len(commands) >= 4
    assert [name for name in commands if f'hpcsweep("{name}"' not in smoke] == []


def test_installed_package_draws_every_figure():
    smoke = runpy.run_path(str(ROOT / "tests" / "packaging" / "smoke.py"), run_name="smoke")
    drawn = [kind for name, kinds in smoke.items() if name.endswith("PLOTS") for kind in kinds]
    assert sorted(drawn) == sorted(figures())
