"""What rows do over a forcing period (`output.rows`) against quadrature in extended precision.

Random structures with elastic stops, stops with dashpots, which let go or pull, sliders, rigid
stops; of three rows the smallest and largest value, half peak-to-peak, mean, rms and the first
harmonics over the sixth period from rest, against Gauss' rule and the zeros of the rates along
`exponentials`. Usage: what_rows_do.py [--cases N] [--first N] [KIND ...]
"""

import math
import sys

import numpy as np
from exponentials import REAL, Law, Motion, Series, asked, real, root, value

import hpcsweep
from hpcsweep.solvers.solver import make_solver

KINDS = "elastic", "dashpots", "pulling", "sliders", "rigid", "mixed"
ORDERS, BEFORE = 5, 5
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def case(kind, seed):
    """Return a random law, amplitude, frequency, and three rows."""
    rng = np.random.default_rng((KINDS.index(kind), seed))
    n = int(rng.integers(1, 4))
    root = rng.standard_normal((n, n))
    mass, stiffness = np.diag(rng.uniform(0.5, 2.0, n)), np.diag(rng.uniform(0.5, 2.0, n))
    law = Law(mass, stiffness + 0.3 * root @ root.T, np.diag(rng.uniform(0.05, 0.2, n)),
              rng.standard_normal(n))  # fmt: skip
    for _ in range(int(rng.integers(1, 3))):
        b = np.eye(n)[rng.integers(n)] if rng.random() < 0.6 else rng.standard_normal(n)
        k, gap = rng.uniform(5.0, 80.0), rng.uniform(0.05, 0.5)
        c = rng.uniform(0.1, 1.0) * 2.0 * math.sqrt(k / (b @ np.linalg.inv(mass) @ b))
        if kind == "rigid":
            law.stops.append((b, gap, math.inf, rng.uniform(0.3, 1.0), False))
        elif kind != "sliders":
            c = 0.0 if kind == "elastic" else c
            law.stops.append((b, gap, k, c, kind == "pulling"))
        if kind in ("sliders", "mixed"):
            strength = rng.uniform(0.05, 0.5)
            law.sliders.append((b[::-1].copy(), rng.uniform(0.5, 5.0), strength, strength, 0.0))
    rows = np.vstack((np.eye(n)[:1], rng.standard_normal((2, n))))
    return law, rng.uniform(0.5, 2.0), rng.uniform(0.4, 2.0), rows


def structure_of(law):
    """Return the structure of a law."""
    stops = [
        hpcsweep.Contact(tuple(b), gap, k, restitution=c)
        if k == math.inf
        else hpcsweep.Contact(tuple(b), gap, k, c, pulls)
        for b, gap, k, c, pulls in law.stops
    ]
    sliders = [hpcsweep.Slider(tuple(b), k, f) for b, k, f, *_ in law.sliders]
    return hpcsweep.Structure.from_matrices(
        *(law.mass, law.stiffness, stops), damping=law.damping, forcing=law.push, sliders=sliders,
        sharpness=math.inf,
    )  # fmt: skip


class Watched:
    """What rows do along the stretches of a motion."""

    def __init__(self, motion, rows):
        self.rows = np.zeros((len(rows), motion.size), REAL)
        self.rows[:, : motion.n] = real(rows)
        self.omega, self.period = motion.omega, motion.period
        start = self.rows @ motion.y
        self.low, self.high = start.copy(), start.copy()
        self.sums = np.zeros((len(rows), 2 + 2 * ORDERS), REAL)

    def __call__(self, a, y, s, t):
        """Add a stretch of length s."""
        terms = Series(a, y).terms @ self.rows.T
        at = s / 2 * (NODES.astype(REAL) + 1)
        values = (at[:, None] ** np.arange(len(terms))) @ terms
        angles = self.omega * (t + at)[:, None] * np.arange(1, ORDERS + 1)
        waves = np.hstack((np.cos(angles), np.sin(angles))) * (s / 2 * WEIGHTS)[:, None]
        self.sums[:, 0] += s / 2 * WEIGHTS @ values
        self.sums[:, 1] += s / 2 * WEIGHTS @ values**2
        self.sums[:, 2:] += values.T @ waves
        for r, of in enumerate(terms.T):
            slope = of[1:] * np.arange(1, len(of))
            seen = [value(of, s)]
            if (value(slope, 0) > 0) != (value(slope, s) > 0):
                seen.append(value(of, root(slope, REAL(0), s)))
            self.low[r], self.high[r] = min(self.low[r], *seen), max(self.high[r], *seen)

    @property
    def result(self):
        """Smallest, largest, half peak-to-peak, mean, rms, and harmonics a exp(i phi)."""
        means = self.sums / self.period
        cosine, sine = 2 * means[:, 2 : 2 + ORDERS], 2 * means[:, 2 + ORDERS :]
        half = (self.high - self.low) / 2
        return self.low, self.high, half, means[:, 0], np.sqrt(means[:, 1]), sine + 1j * cosine


def compare(kind, seed):
    """Return the errors of a case, and whether a stop or slider has acted."""
    law, amplitude, omega, rows = case(kind, seed)
    structure = structure_of(law)
    solver = make_solver("flow", structure, omega, 1e-9, yields=True)
    state = np.zeros(structure.state_units.size)
    state = solver.points(state, amplitude, BEFORE)[0][-1]
    seen = solver.rows_of(state[None], amplitude, rows, ORDERS)
    motion = Motion(law, amplitude, omega, state)
    watched = Watched(motion, rows)
    motion.over_a_period(watched)
    turned = seen.amplitude * np.exp(1j * seen.phase)
    held = seen.low, seen.high, seen.range, seen.mean, seen.rms, turned
    errors = [abs(x - y).max() for x, y in zip(held, watched.result, strict=True)]
    return [float(e) for e in errors], motion.events


def main() -> int:
    """Print the largest differences; return 1 if one is above 1e-10."""
    kinds, seeds = asked(__doc__, KINDS)
    failed = False
    print("kind       cases  act  refused      low     high     half     mean      rms  harmonics")
    for kind in kinds:
        errors, acted, refused = [], 0, 0
        for seed in seeds:
            try:
                found, events = compare(kind, seed)
            except ArithmeticError as error:
                refused += 1
                print(f"  {kind} {seed}: {error}")
                continue
            errors.append(found)
            acted += events > 0
            if not max(found) < 1e-10:
                failed = True
                print(f"  {kind} {seed}: {max(found):.1e}", flush=True)
        worst = " ".join(f"{e:8.1e}" for e in np.max(errors, axis=0))
        print(f"{kind:10s} {len(errors):5d} {acted:4d} {refused:8d} {worst}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
