"""Cost of a point of a branch: Figure 3's P1 along the amplitude, with damping as printed.

`python tests/campaigns/branch_cost.py` prints microseconds a point, of the whole branch with its
special points and of a stretch without any, and how many plain forcing periods that is: of the
orbits at these points, each integrated many times, and of one in a long motion at A = 0.06.
Processor time, the least of several turns, in turn in one run.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import time
from collections.abc import Callable

import numpy as np

import hpcsweep
from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.cycle import Curve, solve_at
from hpcsweep.dynamics.continuation.forced import ForcedMap

OMEGA, AMPLITUDE = 0.445, 0.06
SPANS = {"whole branch": (0.005, 0.25), "a stretch": (0.03, 0.08)}
TURNS, REPEATED, PERIODS = 9, 200, 5000


def least(work: Callable[[], object]) -> float:
    """Return the least processor time of several turns, in seconds."""
    times = []
    for _ in range(TURNS):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return min(times)


def plain_period(forced: ForcedMap, arc: Arc) -> float:
    """Return the mean time of a forcing period of the orbits of a branch, in seconds."""
    times = []
    for one in arc.points[::4]:
        points, value = arc.curve.split(one.y)
        many = np.repeat(points, REPEATED, axis=0)
        forced.images(many, value)
        begun = time.process_time()
        forced.images(many, value)
        times.append((time.process_time() - begun) / REPEATED)
    return float(np.mean(times))


def main() -> None:
    """Measure, and print a table in Markdown."""
    structure = hpcsweep.Structure(3)
    z = hpcsweep.stroboscopic_points(structure, AMPLITUDE, OMEGA, np.zeros(6), 400)[-1]
    forced = ForcedMap(structure, AMPLITUDE, OMEGA)
    curve = Curve(forced, 1, 0.1)
    start = solve_at(curve, z[None] / forced.units, AMPLITUDE)
    solver, _ = forced.solver(AMPLITUDE)
    alone = least(lambda: solver.advance(z, AMPLITUDE, PERIODS)) / PERIODS
    print("| | points | special | us a point | periods of these orbits | at A = 0.06 |")
    print("|---|" + "---:|" * 5)
    for name, span in SPANS.items():
        limits = Limits(*span, 2000)
        arc = follow(curve, start, limits)
        cost = least(lambda limits=limits: follow(curve, start, limits)) / len(arc.points)
        shares = cost / plain_period(forced, arc), cost / alone
        counts = f"{len(arc.points)} | {len(arc.specials)}"
        print(f"| {name} | {counts} | {1e6 * cost:.0f} | {shares[0]:.0f} | {shares[1]:.0f} |")


if __name__ == "__main__":
    main()
