"""Five storeys between stops: a map, attractors and basins at a point, the drift of chaotic runs.

python docs/examples/five_storeys.py computes jobs/structures/five-storeys.toml where its results
are not there yet, then all attractors and their basins at one of its points, and a histogram.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

import hpcsweep

JOB = Path(__file__).resolve().parents[2] / "jobs" / "structures" / "five-storeys.toml"
POINT = ("--set", "sweep.omega=0.29", "--set", "sweep.amplitude=0.1")


def run(*arguments: object) -> None:
    """Run a command of hpcsweep."""
    subprocess.run(["hpcsweep", *map(str, arguments)], check=True)


def main() -> None:
    """Compute, print and draw."""
    run("describe", JOB)
    run("run", JOB, "-o", "five-storeys.h5")
    run("plot", "five-storeys.h5", "--kind", "map", "-o", "five-storeys.png")
    few = ("--set", "study.starts=100", "--set", "output.max_points=40")
    run("run", JOB, *POINT, *few, "--set", 'study.kind="attractors"', "-o", "five-each.h5")
    run("summary", "five-each.h5")
    grid = "{from = -1.0, to = 1.0, count = 40}"
    slices = ("--set", f"study.horizontal={grid}", "--set", f"study.vertical={grid}")
    run("run", JOB, *POINT, *few, *slices, "--set", 'study.kind="basins"', "-o", "five-basins.h5")
    run("plot", "five-basins.h5", "-o", "five-basins.png")
    results = hpcsweep.open_results("five-storeys.h5")
    table = results[["drift"]].assign(motion=hpcsweep.meanings(results.motion)).to_dataframe()
    chaotic = table[table.motion == "chaotic"]
    unit = results.drift.attrs["units"]
    print(f"{len(chaotic)} of {len(table)} runs are chaotic; their drift in {unit}:")
    print(chaotic.drift.describe().to_string())
    figure, axis = plt.subplots()
    axis.hist(chaotic.drift, bins=40)
    axis.set_xlabel(f"largest storey drift  [{unit}]")
    axis.set_ylabel("chaotic runs")
    figure.savefig("five-storeys-drift.png", dpi=150)


if __name__ == "__main__":
    main()
