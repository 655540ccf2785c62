"""Cost of a point of a branch: Figure 3's P1 along the amplitude, with damping as printed.

`bash benchmarks/run.sh branch_cost` prints microseconds a point, of the whole branch with its
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
WHOLE, STRETCH = (0.005, 0.25), (0.115, 0.23)
"""Spans: of all, and between a doubling and a fold."""
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
        times.append(least(lambda own=(many, value): forced.images(*own)) / REPEATED)
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
    for name, span, most in (
        ("whole branch", WHOLE, 0.05),
        ("a stretch", STRETCH, 0.05),
        ("in steps of a tenth", STRETCH, 0.005),
    ):
        limits = Limits(*span, 2000, most)
        arc = follow(curve, start, limits)
        cost = least(lambda own=(curve, start, limits): follow(*own)) / len(arc.points)
        middle = 0.5 * sum(STRETCH) / curve.scale
        start = min(arc.points, key=lambda point: abs(point.y[-1] - middle))
        shares = cost / plain_period(forced, arc), cost / alone
        counts = f"{len(arc.points)} | {len(arc.specials)}"
        print(f"| {name} | {counts} | {1e6 * cost:.0f} | {shares[0]:.0f} | {shares[1]:.0f} |")


if __name__ == "__main__":
    main()
