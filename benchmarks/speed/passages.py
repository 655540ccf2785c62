"""What each strategy at contact layers earns: processor time of figure 3 with it and without it.

Kernels are compiled once with all `strategies`, without each of them, and without any, where all
layers are collocated; then every case runs by turns: processor time, least of some, over that with
all of them.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from hpcsweep.commands import cli
from hpcsweep.solvers.flow.rules import strategies

BENCHMARKS = Path(__file__).parent.parent
PAPER = BENCHMARKS.parent / "jobs" / "paper"
NAMES = strategies.Strategies._fields
WITHOUT = {**{name: (name,) for name in NAMES}, "any": NAMES}
CASES = {
    "figure 3": ("figure3.toml",),
    "as described": ("figure3-described.toml",),
    "sharpness 100": ("figure3.toml", "--set", "structure.sharpness=100.0"),
}
"""Jobs, and what is changed of them."""


def run(gone: tuple[str, ...], arguments: list[str]) -> int:
    """Be `hpcsweep`, compiled without the strategies of these names."""
    # kernels are compiled by this process: another one would have all of them
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    strategies.USED = strategies.USED._replace(**dict.fromkeys(gone, False))
    return cli.main(arguments)


def processor_time(gone: tuple[str, ...], cache: Path, job: tuple[str, ...], out: Path) -> float:
    """Run a job without some strategies; return the seconds of processor time."""
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    code = f"import sys; sys.path.insert(0, {str(BENCHMARKS)!r}); from speed.passages import run; "
    code += f"sys.exit(run({gone!r}, sys.argv[1:]))"
    arguments = ["run", str(PAPER / job[0]), *job[1:], "-o", str(out)]
    begun = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=variables, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"passages: {done.stderr}")
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begun


def main(arguments: list[str] | None = None) -> None:
    """Print processor times and ratios as a table."""
    parser = argparse.ArgumentParser(prog="passages", description=__doc__.split("\n")[0])
    parser.add_argument("--repeat", type=int, default=5, help="runs of each, of which the least")
    parser.add_argument("--case", choices=CASES, action="append", help="default: all of them")
    parser.add_argument(
        "--without", choices=WITHOUT, action="append", help="default: each of them, and any"
    )
    asked = parser.parse_args(arguments)
    without = asked.without or list(WITHOUT)
    columns = {"all": (), **{f"without {name}": WITHOUT[name] for name in without}}
    cases = asked.case or list(CASES)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        print(f"{'processor time, s':20s}" + "".join(f"{name:>18s}" for name in columns))
        for case in cases:
            turns: dict[str, list[float]] = {name: [] for name in columns}
            for turn in range(asked.repeat + 1):
                for name in columns:
                    out = place / f"{name}-{case}-{turn}.h5"
                    cache = place / name
                    turns[name].append(processor_time(columns[name], cache, CASES[case], out))
            # the first compiles
            least = {name: min(turns[name][1:] or turns[name]) for name in columns}
            cells = (f"{value:9.2f}  {value / least['all']:6.3f}" for value in least.values())
            print(f"{case:20s}" + "".join(f"{cell:>18s}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
