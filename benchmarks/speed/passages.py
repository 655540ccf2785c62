"""What the passages in closed form earn: run time without each of them, in copies of the package.

A contact may pass its layer slowly along both linear motions (`passage.slow_passage`), and alone by
an integral equation (`layer.solitary`); without them the motion there is integrated by collocation.
Each copy is compiled once, then every case runs in all copies by turns: processor time, least of
some, over that of the package as it is.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
PAPER = ROOT / "jobs" / "paper"
WITHOUT = {
    "slow": (
        "solvers/flow/passage/passage.py",
        "    elif rho == math.inf:\n        return INTEGRATED",
        "    elif True:\n        return INTEGRATED",
    ),
    "solitary": (
        "solvers/flow/layer/solitary/step.py",
        "    if contact < 0 or not (",
        "    if True or contact < 0 or not (",
    ),
}
"""File of the package, its text, and the text without the passage."""
COPIES = {"all": (), "no slow": ("slow",), "no solitary": ("solitary",), "neither": tuple(WITHOUT)}
CASES = {
    "figure 3": ("figure3.toml",),
    "map, 12 frames": ("bluecrystal.toml", "--set", "sweep.omega={from=0.25,to=0.75,count=12}"),
    "described frame": ("figure3-described.toml",),
    "sharpness 100": ("figure3.toml", "--set", "structure.sharpness=100.0"),
    "sharpness 10": ("figure3.toml", "--set", "structure.sharpness=10.0"),
}


def copy_package(folder: Path, names: tuple[str, ...]) -> None:
    """Copy the package into a folder, without the passages of these names."""
    shutil.copytree(ROOT / "hpcsweep", folder / "hpcsweep")
    for name in names:
        path, text, other = WITHOUT[name]
        source = (folder / "hpcsweep" / path).read_text()
        if source.count(text) != 1:
            raise SystemExit(f"passages: {path} has no single {text!r}")
        (folder / "hpcsweep" / path).write_text(source.replace(text, other))


def processor_time(package: Path, job: tuple[str, ...]) -> float:
    """Run a job by a copy of the package; return the seconds of processor time."""
    variables = {**os.environ, "PYTHONPATH": str(package)}
    variables["NUMBA_CACHE_DIR"] = str(package / "cache")
    begun = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "hpcsweep", "run", str(PAPER / job[0]), *job[1:]]
        done = subprocess.run(
            [*command, "-o", f"{folder}/out.h5"], env=variables, cwd=folder, capture_output=True,
            text=True, check=False,
        )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"passages: {done.stderr}")
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begun


def main() -> None:
    """Print processor times and ratios as a table."""
    parser = argparse.ArgumentParser(prog="passages", description=__doc__.split("\n")[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of each, of which the least")
    parser.add_argument("--case", choices=CASES, action="append", help="default: all of them")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, gone in COPIES.items():
            copy_package(Path(folder) / name, gone)
            processor_time(Path(folder) / name, CASES["figure 3"])
        print(f"{'processor time, s':20s}" + "".join(f"{name:>18s}" for name in COPIES))
        for case in asked.case or CASES:
            least = dict.fromkeys(COPIES, float("inf"))
            for _ in range(asked.repeat):
                for name in COPIES:
                    seconds = processor_time(Path(folder) / name, CASES[case])
                    least[name] = min(least[name], seconds)
            cells = (f"{value:9.2f}  {value / least['all']:6.3f}" for value in least.values())
            print(f"{case:20s}" + "".join(f"{cell:>18s}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
