"""Mutants: change one operator, constant or name of a room at random; its tests must notice.

    python benchmarks/mutants.py job                    # 20 mutants of hpcsweep/job
    python benchmarks/mutants.py studies/refine -n 50 --seed 1
    python benchmarks/mutants.py earthquakes/stripes.py --tests earthquakes campaign

Each mutant is made in a copy of the tree, and the quick tests of the folder of `tests/` that has
the room's name are run there until one fails. What lived is printed, with the exit code 1: a test
is missing there, or the change makes no difference (a tolerance, a limit of effort). Kernels are
compiled anew for each of their mutants: run their rooms with NUMBA_DISABLE_JIT=1.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 600
"""Seconds after which the tests of a mutant hang, which they notice."""
QUICK = "not slow and not mpio and not browser and not slurm and not mpi"
SWAPS: dict[type, type] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


class Mutant(NamedTuple):
    """One change of a file."""

    path: Path
    node: ast.expr
    text: str
    """In place of the node's."""

    def source(self) -> str:
        """Return the file with the change."""
        lines = self.path.read_bytes().splitlines(keepends=True)
        first, last = self.node.lineno - 1, self.node.end_lineno - 1
        head, tail = lines[first][: self.node.col_offset], lines[last][self.node.end_col_offset :]
        lines[first : last + 1] = [head + f"({self.text})".encode() + tail]
        return b"".join(lines).decode()

    def __str__(self) -> str:
        where = f"{self.path.relative_to(ROOT)}:{self.node.lineno}"
        return f"{where}: {ast.unparse(self.node)} -> {self.text}"


def changes(node: ast.AST, rivals: dict[str, str]) -> Iterator[str]:
    """Make the texts that replace an expression, each wrong in one place.

    Parameters
    ----------
    node : ast.AST
    rivals : dict of str to str
        Names that stand beside others in an assignment, with one of these.
    """
    match node:
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in SWAPS:
            yield ast.unparse(ast.Compare(left, [SWAPS[type(op)]()], [right]))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in SWAPS:
            yield ast.unparse(ast.BinOp(left, SWAPS[type(op)](), right))
        case ast.BoolOp(op=op, values=values):
            yield ast.unparse(ast.BoolOp(SWAPS[type(op)](), values))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield ast.unparse(operand)
        case ast.Constant(value=bool(value)):
            yield repr(not value)
        case ast.Constant(value=int(value)):
            yield repr(value + 1)
        case ast.Constant(value=float(value)):
            yield repr(1.5 * value + 0.1)
        case ast.Name(id=name, ctx=ast.Load()) if name in rivals:
            yield rivals[name]


def _expressions(node: ast.AST) -> Iterator[ast.AST]:
    """Walk through what is computed: no annotation, no text."""
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list") or isinstance(node, ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _expressions(child)


def mutants(path: Path) -> Iterator[Mutant]:
    """Make all mutants of a file."""
    made = set()
    for function in ast.walk(ast.parse(path.read_text())):
        if not isinstance(function, ast.FunctionDef):
            continue
        rivals: dict[str, str] = {}
        for node in ast.walk(function):
            if isinstance(node, ast.Tuple) and isinstance(node.ctx, ast.Store):
                names = [item.id for item in node.elts if isinstance(item, ast.Name)]
                rivals |= dict(zip(names, names[1:] + names[:1], strict=True))
        for node in _expressions(function):
            for text in changes(node, rivals):
                if (node.lineno, node.col_offset, node.end_col_offset, text) not in made:
                    made.add((node.lineno, node.col_offset, node.end_col_offset, text))
                    yield Mutant(path, node, text)


def lives(mutant: Mutant, tree: Path, tests: list[str], processes: int = 2) -> bool:
    """Return whether all tests pass in a copy of the tree with this change."""
    there = tree / mutant.path.relative_to(ROOT)
    there.write_text(mutant.source())
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", str(processes), "-m", QUICK]
    try:
        done = subprocess.run(
            [*command, "-p", "no:cacheprovider", *(f"tests/{name}" for name in tests)],
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            capture_output=True,
            timeout=LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    finally:
        shutil.copy(mutant.path, there)
    return done.returncode == 0


def main() -> int:
    """Make mutants of a room, and print which lived."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("room", help="folder or file of hpcsweep/")
    parser.add_argument("-n", type=int, default=20, help="number of mutants (default: 20)")
    parser.add_argument("--seed", type=int, default=0, help="of their choice (default: 0)")
    parser.add_argument("--tests", nargs="+", help="folders of tests/ (default: the room's name)")
    options = parser.parse_args()
    room = ROOT / "hpcsweep" / options.room
    files = [room] if room.is_file() else sorted(room.rglob("*.py"))
    found = [mutant for path in files for mutant in mutants(path)]
    if not found:
        parser.error(f"{options.room}: has no code that could be changed")
    tests = options.tests or [options.room.split("/")[0]]
    chosen = random.Random(options.seed).sample(found, min(options.n, len(found)))
    n_lived = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, check=True)
        for name in listed.stdout.decode().splitlines():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
        for number, mutant in enumerate(chosen, 1):
            lived = lives(mutant, tree, tests)
            n_lived += lived
            print(f"{number}/{len(chosen)} {'LIVED ' if lived else 'killed'} {mutant}", flush=True)
    print(f"{len(chosen) - n_lived} of {len(chosen)} killed; {len(found)} could be made")
    return 1 if n_lived else 0


if __name__ == "__main__":
    sys.exit(main())
