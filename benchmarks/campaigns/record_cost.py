"""Cost of a ground-motion record: microseconds a sample, over the number of floors.

`bash benchmarks/run.sh record_cost` prints a table in Markdown: a mass before a stop, or two
buildings that pound each other, under a record of 6,001 samples, all peaks followed; without
contacts, with contacts that stay open, elastic ones at four times the scale of first contact, and
those with dashpots there. Processor time, the least of several turns, in turn in one run.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import time

import numpy as np

import hpcsweep
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.record_map import RecordMap

STOREYS = {1: (1,), 3: (1, 2), 8: (3, 5), 20: (8, 12), 40: (16, 24)}
"""Of each building, by the number of floors."""
TURNS = 7
RESTITUTION = 0.65


def structure_of(n: int, restitution: float | None) -> Structure:
    """Return a structure with n floors, in newtons, kilograms and metres."""
    if n == 1:
        mass, given = [2.5e5], ([1.0], 0.02, 2e9)
        contact = hpcsweep.Contact(*given)
        if restitution is not None:
            contact = hpcsweep.Contact.from_restitution(*given, restitution, mass)
        return Structure.from_matrices(mass, [[3e7]], [contact], damping_ratio=0.05)
    buildings = [
        hpcsweep.Building(mass=[2.5e5] * storeys, storey_stiffness=stiff)
        for storeys, stiff in zip(STOREYS[n], (3e8, 2e8), strict=True)
    ]
    return hpcsweep.adjacent(buildings, gap=0.02, stiffness=2e9, restitution=restitution)


def main() -> None:
    """Measure, and print the table."""
    record = hpcsweep.synthetic_records(1, seed=1, dt=0.01, duration=60.0, rms=1.0)[0]
    print("| floors | contacts | without | open | elastic | impacts | dashpots | impacts |")
    print("|" + "---:|" * 8)
    for n in STOREYS:
        elastic, lossy = structure_of(n, None), structure_of(n, RESTITUTION)
        first = hpcsweep.first_contact_scale(elastic, record)
        runs = [
            (RecordMap(elastic.without_contacts(), record.dt), first),
            (RecordMap(elastic, record.dt), 0.9 * first),
            (RecordMap(elastic, record.dt), 4.0 * first),
            (RecordMap(lossy, record.dt), 4.0 * first),
        ]
        best, found = np.full(len(runs), np.inf), []
        for _ in range(TURNS):
            found = []
            for place, (solver, scale) in enumerate(runs):
                begun = time.process_time()
                found.append(solver.respond(record.acceleration, scale))
                best[place] = min(best[place], time.process_time() - begun)
        cells = [f"{1e6 * one / record.n_samples:.2f}" for one in best]
        cells[3:3] = [f"{found[2].impacts.sum()}"]
        print(f"| {n} | {len(elastic.contacts)} |", " | ".join(cells), end="")
        print(f" | {found[3].impacts.sum()} |", flush=True)


if __name__ == "__main__":
    main()
