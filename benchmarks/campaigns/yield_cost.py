"""Cost of storeys that yield: microseconds a sample, over the ratio of strength.

`bash benchmarks/run.sh yield_cost [--storeys N]` prints a table in Markdown: a building under a
record of 3,001 samples, all peaks followed, elastic, and with storeys that yield at the R-th part
of their elastic drift, each its own; with the largest ductility and the number of slips. Processor
time, the least of several turns, in turn in one run.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import time

import numpy as np

import hpcsweep
from hpcsweep.solvers.flow.record_map import RecordMap

RATIOS = 1, 2, 4, 8
TURNS = 15


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--storeys", type=int, default=5)
    n = parser.parse_args().storeys
    record = hpcsweep.synthetic_records(1, seed=1, dt=0.01, duration=30.0, rms=1.0)[0]

    def solver(**given) -> RecordMap:
        building = hpcsweep.Building(mass=[2.5e5] * n, storey_stiffness=2e8, **given)
        return RecordMap(building.structure, record.dt)

    elastic = solver()
    drift = elastic.respond(record.acceleration).drift
    solvers = [elastic]
    solvers += [solver(yield_drift=(drift / r).tolist(), hardening=0.03) for r in RATIOS]
    best, found = np.full(len(solvers), np.inf), []
    for _ in range(TURNS):
        found = []
        for place, one in enumerate(solvers):
            begun = time.process_time()
            found.append(one.respond(record.acceleration))
            best[place] = min(best[place], time.process_time() - begun)
    print("| R | ductility | slips | us a sample | over elastic |")
    print("|" + "---:|" * 5)
    for ratio, response, seconds in zip(("elastic", *RATIOS), found, best, strict=True):
        ductility = f"{response.ductility.max(initial=0.0):.1f}" if len(response.ductility) else ""
        cells = (
            ratio,
            ductility,
            response.excursions.sum(),
            f"{1e6 * seconds / record.n_samples:.3f}",
        )
        print("|", " | ".join(map(str, (*cells, f"{seconds / best[0]:.2f}"))), "|", flush=True)


if __name__ == "__main__":
    main()
