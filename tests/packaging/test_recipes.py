"""What can be checked of the recipes in slurm/ without Apptainer, conda, EasyBuild and Spack."""

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


def bounds_of(requirement: str) -> tuple[str, list[int], list[int]]:
    """Return the name, the least version and what lies beyond the last one, if anything does."""
    name, least, beyond = re.fullmatch(r"([\w-]+)>=([\d.]+)(?:,<([\d.]+))?", requirement).groups(
        default=""
    )
    return name, as_numbers(least), as_numbers(beyond)


def as_numbers(version: str) -> list[int]:
    return [int(part) for part in version.split(".") if part]


def test_easyconfig_lists_what_the_package_needs_within_its_bounds(project):
    (path,) = (ROOT / "slurm").glob("*.eb")
    told: dict = {}
    exec(path.read_text(), told)
    chain = told["toolchain"]
    assert path.name == f"hpcsweep-{project['version']}-{chain['name']}-{chain['version']}.eb"
    assert (told["version"], told["description"]) == (project["version"], project["description"])
    listed = dict(told["dependencies"])
    assert as_numbers(listed.pop("Python")) >= as_numbers(project["requires-python"][2:])
    bundled = listed.pop("SciPy-bundle")
    assert int(bundled[:4]) >= 2025  # has numpy 2.3 and scipy 1.16
    needed = {name: rest for name, *rest in map(bounds_of, project["dependencies"])}
    assert needed.keys() - {"numpy", "scipy"} == listed.keys()
    for name, version in listed.items():
        least, beyond = needed[name]
        assert as_numbers(version) >= least, name
        assert not beyond or as_numbers(version) < beyond, name


def test_spack_package_states_what_the_package_needs(project):
    text = (ROOT / "slurm" / "spack" / "package.py").read_text()
    assert f'"""{project["description"]}."""' in text
    listed = dict(re.findall(r'depends_on\("(?:py-)?([\w-]+)@([\d.:]+)"', text))
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    needed = [*project["dependencies"], *build, f"python{project['requires-python']}"]
    assert len(listed) == len(needed)
    for name, least, beyond in map(bounds_of, needed):
        first, _, last = listed[name].partition(":")
        assert as_numbers(first) == least, name
        # a last version of Spack is the whole series
        assert as_numbers(last) == (beyond and [*beyond[:-1], beyond[-1] - 1]), name


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
