r"""A search for slips that the flow does not see, and for reversals of slip.

`bash benchmarks/run.sh slider_grazing [--tries N] [--seed S]` takes motions whose slider comes
within 1e-3 to 1e-13 of its strength, on either side, and turns; and motions that slip, whose
elongation comes nearly to rest, so that the slider sticks for a moment or does not. Matrix
exponentials tell which, and what the flow has to count: one slip or none, two slips or one.

A reversal is put at the time t* of one interval of a record. With the state there, in which d' is a
given speed, the ground's acceleration makes d'' = 0 and its slope d''' > 0. Backward in time the
motion that slips is affine in the strength F, which is chosen so that the slider has just begun to
slip at the start: k d(0) = F.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from collections import Counter
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from yielding import Yielding

from hpcsweep.model.record import Record
from hpcsweep.model.slider import Slider
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.response import response

UNDECIDED = 1e-12
"""Distance from the strength, or speed, over the size of the motion, that rounding may hide."""
PER_STRUCTURE = 50
LOOKS = 24
"""Of a row in a sample interval, to bracket its extrema."""


class Chain(NamedTuple):
    """A chain of masses, whose first sliders never slip and whose last one does."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rows: np.ndarray
    springs: np.ndarray

    def structure(self, strength: float) -> Structure:
        """Return it with a strength of the last slider."""
        strengths = [*[1e6] * (len(self.springs) - 1), strength]
        sliders = [Slider(*one) for one in zip(self.rows, self.springs, strengths, strict=True)]
        return Structure.from_matrices(
            self.mass, self.stiffness, [], damping=self.damping, sliders=sliders
        )

    def generator(self, slips: bool) -> np.ndarray:
        """Return the matrix of (u, u', F, a, a') in a mode of the last slider."""
        n, inverse = len(self.mass), np.linalg.inv(self.mass)
        springs = self.springs * ([True] * (len(self.springs) - 1) + [not slips])
        held = self.stiffness + (self.rows.T * springs) @ self.rows
        found = np.zeros((2 * n + 3, 2 * n + 3))
        found[:n, n : 2 * n] = np.eye(n)
        found[n : 2 * n, : 2 * n] = -inverse @ np.hstack((held, self.damping))
        found[n : 2 * n, 2 * n] = -inverse @ self.rows[-1] * slips
        found[n : 2 * n, 2 * n + 1] = -1.0
        found[2 * n + 1, 2 * n + 2] = 1.0
        return found


def random_chain(rng) -> Chain:
    """Draw one to six masses and one to four sliders, in storeys or in any direction.

    That of the last one is such that the ground moves it at once.
    """
    n = int(rng.integers(1, 7))
    steps, springs = np.eye(n) - np.eye(n, k=-1), rng.uniform(1.0, 8.0, n)
    elastic = (steps.T * springs) @ steps
    rows = steps[rng.integers(0, n, int(rng.integers(1, 5)))]
    anywhere = rng.random(len(rows)) < 0.3
    rows[anywhere] = np.round(rng.normal(0.0, 1.0, (anywhere.sum(), n)), 1)
    rows[:, 0] += np.abs(rows).sum(axis=1) == 0.0
    rows[-1, 0] += abs(rows[-1].sum()) < 0.1
    share = rng.uniform(0.1, 2.0, len(rows))
    damping = rng.uniform(0.0, 0.1) * elastic
    return Chain(np.diag(rng.uniform(0.5, 2.0, n)), elastic, damping, rows, share)


def largest(chain: Chain, samples, dt) -> float:
    """Return the largest |d| of the last slider, all of them stuck, from rest."""
    n, a = len(chain.mass), chain.generator(slips=False)
    row = np.r_[chain.rows[-1], np.zeros(n + 3)]
    speed, turn = row @ a, expm(a * (dt / LOOKS))
    x, top = np.zeros(2 * n + 3), 0.0
    for first, second in pairwise(samples):
        x[2 * n + 1 :] = first, (second - first) / dt
        for _ in range(LOOKS):
            y = turn @ x
            if (speed @ x) * (speed @ y) < 0.0:
                at = brentq(lambda s, x=x: speed @ (expm(a * s) @ x), 0.0, dt / LOOKS, xtol=1e-15)
                top = max(top, abs(row @ (expm(a * at) @ x)))
            x = y
        top = max(top, abs(row @ x))
    return top


def yields(rng, chain: Chain):
    """Return a function of a distance that gives a try: seen, right, and distance over the size."""
    samples = rng.standard_normal(int(rng.integers(6, 30))) * rng.uniform(0.5, 6.0)
    dt = float(rng.uniform(0.05, 0.3))
    force = chain.springs[-1] * largest(chain, samples, dt)
    record = Record(samples, dt)

    def one(distance):
        seen = response(chain.structure(force * (1.0 - distance)), record)
        return int(seen.excursions[-1] > 0), int(distance > 0.0), abs(distance)

    return one


def reversals(rng, chain: Chain):
    """Return such a function of the least speed of a motion that slips.

    It gives None where there is no F > 0, or the speed falls elsewhere, too.
    """
    n, a = len(chain.mass), chain.generator(slips=True)
    b, k = chain.rows[-1], chain.springs[-1]
    row, speed = np.r_[b, np.zeros(n + 3)], np.r_[0.0 * b, b, 0.0, 0.0, 0.0]
    before, after = rng.uniform(0.1, 0.8, 2) / math.sqrt(np.abs(a).max())
    u, v = rng.uniform(-1.0, 1.0, (2, n))
    jerk, weight = rng.uniform(0.5, 2.0), b @ b

    def one(least):
        x = np.r_[u, v + b * (least - b @ v) / weight, 0.0, 0.0, 0.0]
        back = expm(-a * before)
        ends = []
        for strength in (0.0, 1.0):
            x[2 * n :] = strength, 0.0, 0.0
            # b . u'' = 0 and b . u''' = jerk, by the ground's acceleration and its slope
            for order, wanted in ((1, 0.0), (2, jerk)):
                x[2 * n + order] = 0.0
                power = speed @ np.linalg.matrix_power(a, order)
                x[2 * n + order] = (wanted - power @ x) / power[2 * n + order]
            ends.append(back @ x)
        # d(0) = alpha + beta F, and k d(0) = F
        alpha, beta = row @ ends[0], row @ (ends[1] - ends[0])
        strength = k * alpha / (1.0 - k * beta)
        x = ends[0] + strength * (ends[1] - ends[0])
        whole = before + after
        speeds = [speed @ (expm(a * s) @ x) for s in np.linspace(0.0, whole, 40)]
        stuck = 3.0 * math.sqrt(2.0 * abs(least) / jerk)
        if not strength > 0.0 or min(speeds) < min(0.0, 2.0 * least) or stuck > after:
            return None
        samples = x[2 * n + 1] + x[2 * n + 2] * np.array([0.0, whole])
        size = max(np.abs(x[: 2 * n]).max(), strength / k)
        structure, state = chain.structure(strength), x[: 2 * n]
        seen = response(structure, Record(samples, whole), state=state).excursions[-1]
        right = 1 if least > 0.0 else 2
        if seen != right:  # does it slip again before the end?
            given = chain.mass, chain.stiffness, chain.damping, [], structure.sliders
            judge = Yielding(*given)
            judge.run(samples, whole, state)
            right = judge.excursions[-1]
        return int(seen), int(right), abs(least) / size

    return one


def main() -> None:
    """Search, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    for kind in (yields, reversals):
        decades: Counter[int] = Counter()
        wrong, hidden, tried = [], 0, 0
        while tried < asked.tries // 2:
            one = kind(rng, random_chain(rng))
            for _ in range(PER_STRUCTURE):
                given = 10.0 ** rng.uniform(-13.0, -3.0) * rng.choice((-1.0, 1.0))
                found = one(given)
                if found is None:
                    continue
                seen, right, near = found
                tried += 1
                decades[math.floor(math.log10(near))] += 1
                hidden += near <= UNDECIDED
                if seen != right and near > UNDECIDED:
                    wrong.append((given, seen, right))
        print(f"{kind.__name__}: {tried} tries, within rounding {hidden}, wrong {len(wrong)}")
        print("  " + ", ".join(f"1e{k}: {decades[k]}" for k in sorted(decades)))
        for case in wrong[:10]:
            print("  wrong: distance {:.1e}, seen {}, right {}".format(*case))


if __name__ == "__main__":
    main()
