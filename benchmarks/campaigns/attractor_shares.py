"""Shares of attractors against plain Monte Carlo: attractor_shares.py POINTS STARTS [options].

At random points of the range of Figure 3, half of them with the damping as printed and half as
described, the shares of 459 low-discrepancy starts are compared with those of STARTS independent
ones, each decided in the same way. Printed are: how often the interval holds the share of the many,
what the many find that 459 starts did not, and the largest share of that. With --orbits points are
drawn until all their attractors are orbits, with --several until there are two or more.
"""

import argparse
import time
from collections import Counter

import numpy as np
from tools import DESCRIBED

from hpcsweep.dynamics.attractor import UNDECIDED
from hpcsweep.dynamics.attractors import AttractorSearch
from hpcsweep.dynamics.basins import portrait
from hpcsweep.dynamics.known import distance
from hpcsweep.dynamics.starts import box_of, starting_states
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

STARTS, PROMISED, CYCLES, CONFIDENCE = 459, 0.01, 3000, 0.95
DEAR = 0.15
"""Milliseconds a start above which a point of orbits alone is drawn anew."""
SAME = 0.05
"""Distance, in units of the state, of attractors that are one."""


def main() -> None:
    """Compare, point by point, and print the sums."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("points", type=int)
    parser.add_argument("starts", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--orbits", action="store_true", help="points with orbits alone")
    parser.add_argument("--several", action="store_true", help="points with two attractors or more")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    tally = Counter()
    largest = 0.0
    for number in range(options.points):
        structure = Structure(damping_ratio=DESCRIBED if number % 2 else 0.05)
        solver, amplitude, own, cost = _point(rng, structure, options)
        box = box_of(None, structure.state_units)
        middle = time.process_time()
        rest = box[:, 0] + rng.random((options.starts, len(box))) * (box[:, 1] - box[:, 0])
        plain = _search(solver, amplitude, rest)
        ended = time.process_time()
        words = []
        for one in plain.attractors:
            twin = _twin(one, own.attractors, structure.state_units)
            if twin is None:
                tally["missed"] += 1
                largest = max(largest, one.share)
                words.append(f"missed, share {one.share:.5f}")
                continue
            good = twin.share_low <= one.share <= twin.share_high
            tally["held"], tally["compared"] = (
                tally["held"] + good,
                tally["compared"] + 1,
            )
            sole = len(own.attractors) == 1 == len(plain.attractors)
            tally["several held"] += good and not sole
            tally["several"] += not sole
            words.append(
                f"{one.share:.5f}{' in ' if good else ' not in '}"
                f"[{twin.share_low:.4f}, {twin.share_high:.4f}]"
            )
        lost = [int((one.labels == UNDECIDED).sum()) for one in (own, plain)]
        print(
            f"{number + 1} {'described' if number % 2 else 'printed'} A = {amplitude:.5f} Omega = "
            f"{solver.omega:.5f}: {'; '.join(words) or 'none'}; undecided {lost[0]} and "
            f"{lost[1]}; {cost:.3g} and "
            f"{1e3 * (ended - middle) / options.starts:.3g} ms a start, "
            f"{own.cycles / STARTS:.0f} periods",
            flush=True,
        )
    print(
        f"{tally['held']} of {tally['compared']} intervals hold, {tally['several held']} of "
        f"{tally['several']} where there are several; {tally['missed']} missed, the largest of "
        f"share {largest}"
    )
    assert largest <= 3 * PROMISED


def _point(rng, structure, options):
    """Draw a point and search it; give its cost in ms a start, too."""
    while True:
        amplitude, omega = float(rng.uniform(0.02, 0.25)), float(rng.uniform(0.4, 0.6))
        solver = make_solver("flow", structure, omega, 1e-9)
        box = box_of(None, structure.state_units)
        few = starting_states(box, STARTS, options.seed, omega, amplitude)
        begun = time.process_time()
        own = _search(solver, amplitude, few)
        cost = 1e3 * (time.process_time() - begun) / STARTS
        if options.orbits:
            orbits = all(one.orbit_period for one in own.attractors)
            if not orbits or np.any(own.labels == UNDECIDED) or cost > DEAR:
                continue
        if not options.several or len(own.attractors) > 1:
            return solver, amplitude, own, cost


def _search(solver, amplitude: float, starts: np.ndarray):
    search = AttractorSearch(solver, amplitude, SweepSettings(), CYCLES, CONFIDENCE, None)
    return portrait(search, np.zeros((0, starts.shape[1])), starts)


def _twin(one, others, units):
    """Find the same attractor among others."""
    alike = [each for each in others if each.orbit_period == one.orbit_period]
    far = [distance(one.points / units, each.points / units) for each in alike]
    best = int(np.argmin(far)) if far else -1
    return alike[best] if best >= 0 and far[best] <= SAME else None


if __name__ == "__main__":
    main()
