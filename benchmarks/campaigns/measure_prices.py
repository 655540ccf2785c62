"""Time of a window with one measure over that of the same window without, in turn.

`bash benchmarks/run.sh measure_prices [--repeats N] [--specialised]` takes the least processor
time of each, all by the kernels of any structure, or all by those specialised to it, which are
compiled first. The window gathers points, contact set, drift and modal norms, as a job does by
default.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
import time

from tools import JOBS, PAPER

from hpcsweep.job import load_job
from hpcsweep.model.observed import IMPACT, PEAKS
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.specialised import FOR_ANY, use
from hpcsweep.studies.compilation import load, needed
from hpcsweep.studies.quantities import METRICS
from hpcsweep.studies.settings import SweepSettings

FLAGS = dict(
    zip(
        ("storey_drift", "displacement", "floor_acceleration", "contact_force", "impacts"),
        (*(quantity.flag for quantity in PEAKS), IMPACT),
        strict=True,
    )
)
FLAGS["all"] = sum(FLAGS.values())


def cases():
    """Name, structure, A and Omega."""
    printed = load_job(PAPER / "figure3.toml").structure
    described = load_job(PAPER / "figure3-described.toml").structure
    yield "as printed", printed, 0.06, 0.445
    yield "as described", described, 0.128, 0.445
    yield "chaos", printed, 0.3, 0.445
    yield "infinite sharpness", Structure(3, 1000.0, math.inf), 0.3, 0.445
    yield "beta 1e5, rho 1e6", Structure(3, 1e5, 1e6), 0.1, 0.3
    for sharpness in (10.0, 100.0, 1000.0):
        yield f"wide, rho = {sharpness:g}", Structure(3, 1000.0, sharpness), 0.1, 0.445
    yield "pounding, n = 8", load_job(JOBS / "structures" / "pounding.toml").structure, 0.15, 0.4


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=25)
    parser.add_argument("--periods", type=int, default=400)
    parser.add_argument("--specialised", action="store_true")
    options = parser.parse_args()
    print(f"{'':20s} us a period | " + " ".join(f"{name:>13s}" for name in FLAGS))
    for name, structure, amplitude, omega in cases():
        if options.specialised:
            everything = SweepSettings(metrics=frozenset(METRICS))
            load(needed(everything, structure, specialised=True))
            use(structure)
        flow = FlowMap(structure, omega)
        if not options.specialised:
            flow._kernels = FOR_ANY
        assert flow.is_specialised == options.specialised
        z = flow.advance([0.0] * (2 * structure.n_floors), amplitude, 400).state
        least = dict.fromkeys((0, *FLAGS.values()), math.inf)
        for _ in range(options.repeats):
            for flags in least:
                begun = time.process_time()
                flow.observe(z, amplitude, options.periods, modal_norm=True, measures=flags)
                least[flags] = min(least[flags], time.process_time() - begun)
        ratios = " ".join(f"{least[flags] / least[0]:13.2f}" for flags in FLAGS.values())
        print(f"{name:20s} {1e6 * least[0] / options.periods:11.2f} | {ratios}", flush=True)


if __name__ == "__main__":
    main()
