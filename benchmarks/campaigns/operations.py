"""Floating-point operations of a forcing period, counted, and their share of what a core can do.

bash benchmarks/run.sh operations: a table in Markdown. The kernels run as plain Python
(NUMBA_DISABLE_JIT=1), each sum, difference, product and quotient of real numbers replaced by a
function that counts it, eight for one of lanes; a fused product is two, a root or a function of
`math` or numpy one a number. Comparisons, moduli and what indexes arrays do not count. Compiled,
the same periods are timed, and so is the machine's limit: fused products of eight lanes in twelve
independent chains.
"""

import argparse
import ast
import builtins
import importlib.machinery
import json
import math
import operator
import os
import subprocess
import sys
import time

import numpy as np

CASES = (
    ("as printed", None, 0.445, 0.01),
    ("as printed", None, 0.445, 0.06),
    ("as printed", None, 0.445, 0.0987),
    ("as printed", None, 0.5, 0.2),
    ("as printed", None, 0.3, 0.2),
    ("as printed", None, 0.21, 0.3),
    ("as described", [0.1262, 0.0161, 0.0077], 0.445, 0.0987),
)
TRANSIENT, PERIODS, TIMED, TURNS = 300, 4, 400, 25
COUNTED = ("hpcsweep.solvers.flow.", "hpcsweep.kernels.simd.fallback", "hpcsweep.model.contact")
NOT_COUNTED = ("hpcsweep.solvers.flow.flow_map",)
"""It takes states from one unit to another, once a call."""
NAMES = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
OPERATIONS = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
}
CHAINS, LINKS = 12, 2_000_000

done = {"numbers": 0, "lanes": 0}


def counted(symbol: str, a, b):
    """Do an operation and count it, if its result is real."""
    result = OPERATIONS[symbol](a, b)
    power = symbol == "**" and isinstance(b, (int, float)) and float(b).is_integer()
    return add(result, max(abs(int(b)) - 1, 1) if power else 1)


def add(result, each: int = 1):
    """Count the real numbers of a result, `each` of them so many times."""
    if isinstance(result, np.ndarray) and result.dtype.kind == "f":
        done["lanes"] += each * result.size
    elif isinstance(result, (float, np.floating)):
        done["numbers"] += each
    return result


class Counting(ast.NodeTransformer):
    """Replaces arithmetic by calls of `counted`, and counts what functions give."""

    def visit_BinOp(self, node):
        """Replace an operation."""
        self.generic_visit(node)
        return self._call(node.op, node.left, node.right) or node

    def visit_AugAssign(self, node):
        """Replace ``a += b`` by ``a = a + b``."""
        self.generic_visit(node)
        left = ast.parse(ast.unparse(node.target), mode="eval").body
        call = self._call(node.op, left, node.value)
        return ast.Assign([node.target], call) if call else node

    def visit_Call(self, node):
        """Count roots, and functions of `math` and numpy."""
        self.generic_visit(node)
        named = node.func
        if isinstance(named, ast.Attribute) and named.attr in ("sqrt", "exp", "log", "sin", "cos"):
            return ast.Call(ast.Name("_added", ast.Load()), [node], [])
        return node

    def _call(self, operation, left, right):
        if type(operation) not in NAMES:
            return None
        symbol = ast.Constant(NAMES[type(operation)])
        return ast.Call(ast.Name("_counted", ast.Load()), [symbol, left, right], [])


class Loader(importlib.machinery.SourceFileLoader):
    """Loads a module with its arithmetic counted."""

    def get_code(self, fullname):
        """Compile the module anew: what lies beside it is not counted."""
        path = self.get_filename(fullname)
        tree = Counting().visit(ast.parse(self.get_data(path)))
        return compile(ast.fix_missing_locations(tree), path, "exec")


class Finder(importlib.machinery.PathFinder):
    """Finds the modules of kernels."""

    @classmethod
    def find_spec(cls, fullname, path=None, target=None):
        """Return those that are counted a loader that counts."""
        spec = super().find_spec(fullname, path, target)
        if spec and fullname.startswith(COUNTED) and fullname not in NOT_COUNTED:
            spec.loader = Loader(fullname, spec.origin)
        return spec


def solver_of(case):
    """Make the solver of a case."""
    from hpcsweep.model.structure import Structure
    from hpcsweep.solvers.flow import FlowMap

    _, damping, omega, _ = case
    return FlowMap(Structure(damping_ratio=0.05 if damping is None else damping), omega)


def count(states: list) -> list:
    """Count the operations of a period of each case; the tables are built before."""
    builtins._counted, builtins._added = counted, add
    sys.meta_path.insert(0, Finder)
    found = []
    for case, state in zip(CASES, states, strict=True):
        solver = solver_of(case)
        state = solver.points(np.array(state), case[3], PERIODS)[0][-1]
        solver.points(state, case[3], PERIODS)
        done.update(numbers=0, lanes=0)
        before = solver.counts.copy()
        solver.points(state, case[3], PERIODS)
        steps = ((solver.counts - before) / PERIODS).tolist()
        found.append([done["numbers"] / PERIODS, done["lanes"] / PERIODS, *steps])
    return found


def measure() -> tuple[list, list, float]:
    """Return the states from which periods are counted, us a period, and the limit (GFlop/s)."""
    states, times = [], []
    for case in CASES:
        solver = solver_of(case)
        state = solver.advance(np.zeros(6), case[3], TRANSIENT).state
        states.append(state.tolist())
        least = math.inf
        for _ in range(TURNS):
            begun = time.process_time()
            solver.points(state, case[3], TIMED)
            least = min(least, time.process_time() - begun)
        times.append(1e6 * least / TIMED)
    return states, times, limit()


def limit() -> float:
    """Measure the fused products of lanes that a core does in independent chains (GFlop/s)."""
    from hpcsweep.kernels.compile import kernel
    from hpcsweep.kernels.simd.vectors import LANES, fma, load, store

    names = [f"v{k}" for k in range(CHAINS)]
    lines = ["def chains(x, n):", "    a = load(x, 0)", f"    b = load(x, {LANES})"]
    lines += [f"    {name} = load(x, {(2 + k) * LANES})" for k, name in enumerate(names)]
    lines += ["    for _ in range(n):"]
    lines += [f"        {name} = fma({name}, a, b)" for name in names]
    lines += [f"    store(x, {(2 + k) * LANES}, {name})" for k, name in enumerate(names)]
    space = {"load": load, "fma": fma, "store": store, "__name__": __name__}
    exec("\n".join(lines), space)
    chains = kernel(space["chains"])
    x = np.full((2 + CHAINS) * LANES, 0.5)
    chains(x, 1)
    least = math.inf
    for _ in range(10):
        begun = time.process_time()
        chains(x, LINKS)
        least = min(least, time.process_time() - begun)
    return 2e-9 * LANES * CHAINS * LINKS / least


def main() -> None:
    """Measure, count in another process, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", action="store_true", help="count, of states from stdin")
    if parser.parse_args().count:
        print(json.dumps(count(json.load(sys.stdin))))
        return
    states, times, most = measure()
    said = subprocess.run(
        [sys.executable, __file__, "--count"],
        input=json.dumps(states),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    print(f"limit: {most:.1f} GFlop/s a core, fused products of eight lanes\n")
    print(
        "| damping | Omega | A | steps | passages | layer steps | operations | of these in lanes",
        end="",
    )
    print(" | us a period | GFlop/s | of the limit |\n|---|" + "---:|" * 10)
    for case, us, (numbers, lanes, steps, passages, layer, *_) in zip(
        CASES, times, json.loads(said), strict=True
    ):
        rate = (numbers + lanes) / us / 1e3
        print(
            f"| {case[0]} | {case[2]} | {case[3]} | {steps:.0f} | {passages:.0f} | {layer:.0f} | "
            f"{numbers + lanes:,.0f} | {100 * lanes / (numbers + lanes):.0f} % | {us:.2f} | "
            f"{rate:.1f} | {100 * rate / most:.0f} % |"
        )


if __name__ == "__main__":
    main()
