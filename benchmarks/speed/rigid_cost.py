"""Time of a forcing period with rigid stops, over that with sharp springs, on random structures.

`bash benchmarks/run.sh rigid_cost [--cases N]`: the structures of `random_rigid` whose gaps are
open, each with rigid stops of e = 1 and of its own e, with elastic stops of stiffness 1e4, and with
such stops whose dashpots have its own e. In turn; the least of nine turns counts.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from time import perf_counter

import numpy as np
from rigid import random_case

from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

STIFFNESS, LEAST_E, TURNS, PERIODS = 1e4, 0.05, 9, 100
PAIRS = {
    "rigid stops of e = 1, over elastic ones": (0, 1),
    "rigid stops of any e, over such dashpots": (2, 3),
    "rigid stops of any e, over elastic ones": (2, 1),
}


def solvers(case) -> list[FlowMap]:
    """Return those of e = 1, elastic, rigid, with dashpots."""
    mass, damping, stiffness, rows, gaps, restitutions, _, omega, _, harmonics = case
    made: list[list[Contact]] = [[], [], [], []]
    for row, gap, e in zip(rows, gaps, restitutions, strict=True):
        made[0].append(Contact(tuple(row), gap, math.inf, restitution=1.0))
        made[1].append(Contact(tuple(row), gap, STIFFNESS))
        made[2].append(Contact(tuple(row), gap, math.inf, restitution=e))
        e = max(e, LEAST_E)
        made[3].append(Contact.from_restitution(tuple(row), gap, STIFFNESS, e, mass))
    structures = [
        Structure.from_matrices(mass, stiffness, contacts, damping=damping, harmonics=harmonics)
        for contacts in made
    ]
    return [FlowMap(structure, omega) for structure in structures]


def times(case) -> np.ndarray:
    """Return the time of a period of each, in seconds."""
    timed, start = solvers(case), np.zeros(2 * len(case[0]))
    least = np.full(len(timed), math.inf)
    for _ in range(TURNS):
        for k, solver in enumerate(timed):
            begun = perf_counter()
            solver.advance(start, case[8], PERIODS)
            least[k] = min(least[k], perf_counter() - begun)
    return least / PERIODS


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=60)
    cases = (random_case(seed) for seed in range(parser.parse_args().cases))
    found = np.array([times(case) for case in cases if 0.0 not in case[4]])
    print(f"| of {len(found)} structures | all together | median |\n|---|---|---|")
    for name, (above, below) in PAIRS.items():
        total, ratios = found.sum(axis=0), found[:, above] / found[:, below]
        print(f"| {name} | {total[above] / total[below]:.2f} | {np.median(ratios):.2f} |")


if __name__ == "__main__":
    main()
