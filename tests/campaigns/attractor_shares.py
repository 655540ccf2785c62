"""Shares of attractors against plain Monte Carlo: attractor_shares.py POINTS STARTS [SEED].

At random points of the range of Figure 3, half of them with the damping as printed and half as
described, the shares of 459 low-discrepancy starts are compared with those of STARTS independent
ones, each decided in the same way. Told are: how often the interval holds the share of the many,
what the many find that 459 starts did not, and the largest share of that.
"""

import sys
import time

import numpy as np

from hpcsweep.dynamics.attractors import portrait
from hpcsweep.dynamics.resemblance import distance
from hpcsweep.dynamics.starts import box_of, starting_states
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

DESCRIBED = (0.12622293348805766, 0.016077603302694768, 0.007699463209247604)
STARTS, PROMISED, CYCLES, CONFIDENCE = 459, 0.01, 3000, 0.95
SAME = 0.05
"""Distance, in units of the state, of attractors that are one."""


def main(points: int, many: int, seed: int) -> None:
    """Compare, point by point, and tell the sums."""
    rng = np.random.default_rng(seed)
    held = compared = missed = 0
    largest = 0.0
    for number in range(points):
        structure = Structure(damping_ratio=DESCRIBED if number % 2 else 0.05)
        amplitude, omega = rng.uniform(0.02, 0.25), rng.uniform(0.4, 0.6)
        solver = make_solver("flow", structure, omega, 1e-9)
        box = box_of(None, structure.state_units)
        begun = time.process_time()
        few = starting_states(box, STARTS, seed, omega, amplitude)
        own = _search(solver, amplitude, few)
        middle = time.process_time()
        rest = box[:, 0] + rng.random((many, len(box))) * (box[:, 1] - box[:, 0])
        plain = _search(solver, amplitude, rest)
        ended = time.process_time()
        words = []
        for one in plain.attractors:
            twin = _twin(one, own.attractors, structure.state_units)
            if twin is None:
                missed += 1
                largest = max(largest, one.share)
                words.append(f"missed, share {one.share:.4f}")
                continue
            good = twin.share_low <= one.share <= twin.share_high
            held, compared = held + good, compared + 1
            words.append(
                f"{one.share:.4f}{' in ' if good else ' not in '}"
                f"[{twin.share_low:.4f}, {twin.share_high:.4f}]"
            )
        print(
            f"{'described' if number % 2 else 'printed'} A = {amplitude:.5f} Omega = {omega:.5f}: "
            f"{'; '.join(words) or 'none'}; undecided {own.n_undecided} and {plain.n_undecided}; "
            f"{1e3 * (middle - begun) / STARTS:.3g} and {1e3 * (ended - middle) / many:.3g} ms "
            f"a start, {own.cycles / STARTS:.0f} periods",
            flush=True,
        )
    print(f"{held} of {compared} intervals hold; {missed} missed, the largest of share {largest}")
    assert largest <= 3 * PROMISED


def _search(solver, amplitude: float, starts: np.ndarray):
    nothing = np.zeros((0, starts.shape[1]))
    return portrait(solver, amplitude, nothing, starts, SweepSettings(), CYCLES, CONFIDENCE)


def _twin(one, others, units):
    """Find the same attractor among others."""
    alike = [each for each in others if each.orbit_period == one.orbit_period]
    far = [distance(one.points / units, each.points / units) for each in alike]
    best = int(np.argmin(far)) if far else -1
    return alike[best] if best >= 0 and far[best] <= SAME else None


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
