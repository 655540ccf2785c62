"""The walls between the rooms stand, and fall over when somebody breaks through one."""

import ast
import functools
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tools import ROOT

LINTER = Path(sys.executable).parent / "lint-imports"
BREACHES = {
    "The floors of the house": ("model/structure.py", "from hpcsweep.store import Layout"),
    "Only parallel.mpi imports mpi4py": ("campaign/status.py", "from mpi4py import MPI"),
    "Only store imports h5py": ("figures/style.py", "import h5py"),
    "Only figures imports matplotlib": ("campaign/summary.py", "import matplotlib.pyplot"),
    "Only kernels imports numba": ("solvers/bdf.py", "import numba"),
    "The numerical core sees no path": ("studies/sweep/runs.py", "import pathlib"),
    "A campaign does not ask": ("campaign/queue.py", "from hpcsweep.studies import refine"),
    "The rooms of the studies": ("studies/grid.py", "from hpcsweep.studies import sweep"),
    "The rooms of the flow map": (
        "solvers/flow/state/state.py",
        "from hpcsweep.solvers.flow.step import forcing",
    ),
    "The rooms of the solvers": ("solvers/free.py", "from hpcsweep.solvers import bdf"),
    "The rooms of the kernels": ("kernels/simd/vectors.py", "import hpcsweep.kernels.compile"),
}
"""For each contract, by the beginning of its name, a line that it forbids, and where."""


def lint(folder: Path) -> tuple[int, dict[str, bool], str]:
    """Exit code of import-linter, whether each contract is kept, and all that it says."""
    done = subprocess.run(
        [LINTER, "--no-cache"], cwd=folder, capture_output=True, text=True, check=False
    )
    verdicts = re.findall(r"^(.+?) (KEPT|BROKEN)\b", done.stdout, re.MULTILINE)
    return done.returncode, {name: word == "KEPT" for name, word in verdicts}, done.stdout


@pytest.fixture
def house(tmp_path):
    """A copy of the package and its contracts."""
    shutil.copytree(
        ROOT / "hpcsweep", tmp_path / "hpcsweep", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_every_contract_breaks_when_its_wall_is_broken(house):
    code, kept, said = lint(house)
    assert code == 0, said
    assert len(kept) == len(BREACHES)
    for name, line in BREACHES.values():
        path = house / "hpcsweep" / name
        path.write_text(path.read_text() + f"\n{line}\n")
    code, kept, said = lint(house)
    assert code == 1
    for beginning in BREACHES:
        (name,) = (name for name in kept if name.startswith(beginning))
        assert not kept[name], f"{name} holds although it was broken:\n{said}"


def test_a_room_without_a_floor_is_refused(house):
    shed = house / "hpcsweep" / "shed"
    shed.mkdir()
    (shed / "__init__.py").write_text('"""A room nobody has placed."""\n')
    code, _, said = lint(house)
    assert code == 1
    assert "shed" in said


@functools.cache
def modules() -> dict[str, tuple[str, list[ast.FunctionDef]]]:
    """Return all modules of the package without references and examples: texts and functions."""
    examples = re.compile(r"\n\n *(References|Examples)\n *-+\n.*?(?=\n *\"{3})", re.DOTALL)
    texts = {
        str(path.relative_to(ROOT / "hpcsweep")): examples.sub("", path.read_text())
        for path in (ROOT / "hpcsweep").rglob("*.py")
    }
    return {
        name: (
            text,
            [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)],
        )
        for name, text in texts.items()
    }


def test_files_and_functions_stay_small():
    """Without a module's derivation, references and examples. Longer ones have a reason."""
    long_files, long_functions = set(), set()
    for name, (text, functions) in modules().items():
        if re.sub(r'^r?"{3}.*?"{3}', "", text, count=1, flags=re.DOTALL).count("\n") > 400:
            long_files.add(name)
        long_functions |= {
            f"{name}:{node.name}" for node in functions if node.end_lineno - node.lineno >= 85
        }
    assert long_files == set(REASONS_FOR_FILES)
    assert long_functions == set(REASONS_FOR_FUNCTIONS)


def test_kernels_stay_small():
    """Ten arguments, and fifteen branches and loops, at most.

    A kernel takes what it touches: a tuple that is only unpacked again is as many arguments.
    """
    forks = ast.If | ast.IfExp | ast.For | ast.While
    n_kernels, large = 0, []
    for name, (_, functions) in modules().items():
        for node in functions:
            makers = {ast.unparse(one).split("(")[0] for one in node.decorator_list}
            if makers & {"kernel", "inlined", "entry_point"}:
                n_kernels += 1
                branches = sum(isinstance(one, forks) for one in ast.walk(node))
                if len(node.args.args) > 10 or branches > 15:
                    large.append(f"{name}:{node.name}")
    assert n_kernels > 200
    assert large == []


REASONS_FOR_FILES: dict[str, str] = {}
REASONS_FOR_FUNCTIONS: dict[str, str] = {}
