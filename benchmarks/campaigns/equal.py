"""Compute the same jobs with two versions and compare what both files hold, bit for bit.

    bash benchmarks/run.sh equal OLD NEW [--folder DIR] [--only NAME ...] [--ranks N]

OLD and NEW are clones with a `.venv` each. What a version has computed before into DIR/<version> is
not computed again. Data are compared by name, as bytes in the order of the axes, so that files
whose dimensions have other names compare as well; what only one file holds is reported.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
from tools import JOBS, PAPER, datasets, environment

FRAMES = "[sweep]\nomega = {from = 0.2002, to = 0.785197, count = 40}\n"
"""Every 50th of the 2,000 frames of a whole study."""
SLICE = "{from = -1.0, to = 1.0, count = 100}"
CASES = {
    "ci": (JOBS / "ci.toml", ""),
    "demo": (JOBS / "demo.toml", ""),
    "two-buildings": (JOBS / "structures/two-buildings.toml", ""),
    "pounding": (JOBS / "structures/pounding.toml", ""),
    "clearance": (JOBS / "structures/clearance.toml", ""),
    "bdf": (
        JOBS / "ci.toml",
        "[solver]\nmethod = 'bdf'\n[sweep]\nomega = [0.6, 0.8]\n"
        "amplitude = {from = 0.01, to = 0.3, count = 6}\n",
    ),
    "records": (
        JOBS / "earthquakes/two-buildings.toml",
        "[records]\nscale = {by = 'sa', period = 0.78, from = 0.25, to = 15.0, count = 8}\n",
    ),
    "points": (PAPER / "points.toml", ""),
    "classified": (PAPER / "figure3-classified.toml", ""),
    "window": (PAPER / "figure3.toml", "[solver]\nskip = 'none'\n"),
    "attractors": (JOBS / "attractors/attractors-figure3.toml", ""),
    "basins": (
        JOBS / "attractors/basins.toml",
        f"[study]\nhorizontal = {SLICE}\nvertical = {SLICE}\nstarts = 459\n",
    ),
    "bluecrystal": (PAPER / "bluecrystal.toml", FRAMES),
    "bluecrystal-described": (PAPER / "bluecrystal-described.toml", FRAMES),
}


def compute(clone: Path, folder: Path, name: str, ranks: int) -> Path:
    """Compute a job with the version in a clone, unless it has been."""
    job, changes = CASES[name]
    folder.mkdir(parents=True, exist_ok=True)
    text = folder / f"{name}.toml"
    text.write_text(f'extends = "{job}"\n{changes}')
    out = folder / f"{name}.h5"
    line = [clone / ".venv/bin/hpcsweep", "run", text, "-o", out]
    if ranks > 1:
        line = [clone / ".venv/bin/mpirun", "-n", str(ranks), *line]
    subprocess.run([*map(str, line)], env=environment(), check=True, capture_output=True, cwd=clone)
    return out


def compare(left: Path, right: Path) -> tuple[list[str], list[str], int]:
    """Return the data that differ, those that one file alone holds, and how many are equal."""
    a, b = datasets(left), datasets(right)
    both = sorted(a.keys() & b.keys())
    differ = [name for name in both if not np.array_equal(a[name], b[name])]
    return differ, sorted(a.keys() ^ b.keys()), len(both) - len(differ)


def main() -> int:
    """Compare two versions; return how many jobs differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("/tmp/equal"))
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--ranks", type=int, default=1)
    asked = parser.parse_args()
    different = 0
    for name in asked.only:
        files = [
            compute(clone.resolve(), asked.folder.resolve() / _version(clone), name, asked.ranks)
            for clone in (asked.old, asked.new)
        ]
        differ, alone, equal = compare(*files)
        different += bool(differ)
        told = f"{equal} datasets equal to the last bit"
        if differ:
            told += f", DIFFERENT: {', '.join(differ)}"
        if alone:
            told += f", in one file alone: {', '.join(alone)}"
        print(f"{name}: {told}", flush=True)
    return different


def _version(clone: Path) -> str:
    line = ["git", "-C", str(clone), "describe", "--always", "--dirty"]
    return subprocess.run(line, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
