"""What kernels specialised to a structure spare: a forcing period with them and with those for any.

bash benchmarks/run.sh specialised: a table in Markdown. Two periodic motions of the study, and
seven that are chaotic or of long period; microseconds a forcing period, the least of several turns,
in turn in one run. It compiles what is not compiled yet.
"""

import time

import numpy as np
from tools import PAPER

from hpcsweep.job import load_job
from hpcsweep.solvers.flow import FlowMap, specialised

CASES = [
    ("bluecrystal", 0.445, 0.06),
    ("bluecrystal", 0.445, 0.0987),
    ("bluecrystal", 0.7063, 0.32),
    ("bluecrystal", 0.5383, 0.15),
    ("bluecrystal", 0.2023, 0.2),
    ("bluecrystal-described", 0.2743, 0.2),
    ("bluecrystal-described", 0.3463, 0.25),
    ("bluecrystal-described", 0.445, 0.0987),
    ("bluecrystal-described", 0.2023, 0.2),
]
PERIODS, TURNS = 300, 9
COLUMNS = ("points", "and growth", "observed", "and growth", "tangent map")


def calls(solver, z, amplitude):
    """Return the calls to time, in the order of `COLUMNS`."""
    return (
        lambda: solver.points(z, amplitude, PERIODS),
        lambda: solver.grow(z, amplitude, PERIODS),
        lambda: solver.observe(z, amplitude, PERIODS, modal_norm=True),
        lambda: solver.observe(z, amplitude, PERIODS, modal_norm=True, growth=True),
        lambda: solver.monodromy(z, amplitude, PERIODS),
    )


def main() -> None:
    """Measure, and print the table."""
    print("| job | Omega | A |", " | ".join(COLUMNS), "|")
    print("|---|---|---|" + "---|" * len(COLUMNS))
    for name, omega, amplitude in CASES:
        study = load_job(PAPER / f"{name}.toml").study
        study.warm_up(n_ranks=0)
        solver = FlowMap(study.structure, omega)
        kernels = (specialised.FOR_ANY, solver._kernels)
        assert solver.is_specialised
        z = solver.advance(np.zeros(2 * study.structure.n_floors), amplitude, 300).state
        cells = []
        for call in calls(solver, z, amplitude):
            best = [np.inf, np.inf]
            for _ in range(TURNS):
                for which, solver._kernels in enumerate(kernels):
                    begun = time.perf_counter()
                    call()
                    best[which] = min(best[which], 1e6 * (time.perf_counter() - begun) / PERIODS)
            cells.append(f"{best[0]:.2f}, {best[1]:.2f}")
        print(f"| {name} | {omega} | {amplitude} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
