"""Random structures with rigid stops over 30 forcing periods, against a reference.

`bash benchmarks/run.sh random_rigid [--cases N] [--first S]` draws structures of 1 to 6 masses with
1 to 4 rigid stops, e from 0 to 1 (`rigid.random_case`), and compares the states after each forcing
period with the reference's. The limit is 1e-11 of the size of the motion times its conditioning,
the largest growth of a tangent vector from any of the periods before; counts of impacts are equal.
A motion beyond it is told, and put to the proof: the reference, jolted by 1e-13 in its amplitude
and after each period, by a unit of rounding in displacements after each event, and in how near a
stop is reached, or the program, jolted in its amplitude, has to differ from itself beyond the
limit, or the program is at fault. Counts may differ by impacts that are
within 64 of rounding.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from collections import Counter
from contextlib import suppress
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from rigid import Rigid, random_case

from hpcsweep.model.matrices import Contact
from hpcsweep.model.observed import IMPACT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

LIMIT, JOLT, UNIT, PERIODS = 1e-11, 1e-13, 1e-16, 30
ALL = 1e-3
"""A difference that is allowed by the conditioning and changes the impacts of a motion."""
TOGETHER, GRAZING, FAULT = "push each other, chatter together", "grazing", "FAULT"
ALIKE = "dependent stops of different e close at once"
ENDLESS = "hops with e = 1 about as high as rounding"


class Found(NamedTuple):
    """Of a motion: its largest error over size and conditioning, and that, and what it is."""

    seed: int
    error: float
    conditioning: float
    equal: bool
    impacts: float
    kind: str


def structure_of(case) -> Structure:
    """Return the structure of a case."""
    mass, damping, stiffness, rows, gaps, e, *_, harmonics = case
    stops = zip(rows, gaps, e, strict=True)
    contacts = [Contact(tuple(d), gap, math.inf, restitution=b) for d, gap, b in stops]
    return Structure.from_matrices(mass, stiffness, contacts, damping=damping, harmonics=harmonics)


class Jolted(Rigid):
    """The reference with a random unit of rounding in displacements after each event."""

    rng = None

    def _event(self, hit, u, v):
        u, v = super()._event(hit, u, v)
        return (u if self.rng is None else u + UNIT * self.rng.normal(size=len(u))), v


def reference_of(case, jolt: int = 0) -> tuple[np.ndarray, Rigid]:
    """Return the states of the reference after each period, and the reference."""
    rng, states = np.random.default_rng(jolt + 9), []
    reference = Jolted(*case[:8], case[8] * (1.0 + jolt * JOLT), case[9])
    reference.rng = rng if jolt else None
    reference.at_stop *= 4.0 ** abs(jolt)
    z, n = np.zeros(2 * len(case[0])), len(case[0])
    for period in range(1, PERIODS + 1):
        u, v = reference.advance(z[:n], z[n:], period * 2 * math.pi / case[7])
        states.append(np.r_[u, v])
        z = states[-1] + jolt * JOLT * rng.choice((-1.0, 1.0), 2 * n)
    return np.array(states), reference


def conditionings(case, points) -> np.ndarray:
    """Return the largest growth of a tangent vector from any period to the end of each."""
    solver, amplitude, n = FlowMap(structure_of(case), case[7]), case[8], points.shape[1]
    grown, found = [], []
    for state in np.vstack((np.zeros(n), points[:-1])):
        matrix = solver.monodromy(state, amplitude, 1)[1]
        grown = [matrix @ one for one in [*grown, np.eye(n)]]
        found.append(max(1.0, *(np.abs(one).sum(axis=1).max() for one in grown)))
    return np.array(found)


def differs(first, second, limits) -> float:
    """Return the largest difference of two motions over their limits."""
    return float((np.abs(first - second).max(axis=1) / limits).max())


def judge(seed: int) -> Found:
    """Compare a motion with the reference."""
    case = random_case(seed)
    structure, start = structure_of(case), np.zeros(2 * len(case[0]))
    seen = FlowMap(structure, case[7]).observe(start, case[8], PERIODS, measures=IMPACT)
    try:
        exact, reference = reference_of(case)
    except ArithmeticError:
        return Found(seed, 0.0, 1.0, True, 0.0, ENDLESS)
    growth = conditionings(case, seen.points)
    sizes = np.maximum.accumulate(np.maximum(1.0, np.abs(exact).max(axis=1)))
    error = differs(seen.points, exact, sizes * growth)
    moves = reference.closed == 0.0  # bounces before rest are as high as rounding, too
    off = np.round(seen.measures.impacts * PERIODS) - reference.counts
    equal, kind = bool((np.abs(off) <= reference.chance)[moves].all()), ""
    equal = equal or growth.max() * LIMIT > ALL  # of another motion
    if error > LIMIT or not equal:
        apart = 0.0
        for jolt in (-3, -2, -1, 1, 2, 3):
            other = FlowMap(structure, case[7]).observe(
                start, case[8] * (1.0 + jolt * JOLT), PERIODS
            )
            apart = max(apart, differs(other.points, seen.points, sizes * growth))
            with suppress(ArithmeticError):
                apart = max(apart, differs(reference_of(case, jolt)[0], exact, sizes * growth))
        kind = (TOGETHER if reference.beside else GRAZING) if apart > LIMIT else FAULT
        kind = ALIKE if reference.alike else kind
    return Found(seed, error, float(growth.max()), equal, float(reference.counts.sum()), kind)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    seeds, found = range(given.first, given.first + given.cases), []
    with get_context("spawn").Pool(given.processes) as pool:
        for one in pool.imap(judge, seeds, chunksize=4):
            found.append(one)
            if one.kind or given.verbose:
                print(
                    f"{one.seed}: {one.error:.1e} over {one.conditioning:.1e}, {one.kind}",
                    flush=True,
                )
    print("\n| conditioning | structures | impacts | largest error over it | beyond 1e-11 |")
    print("|---|---|---|---|---|")
    for low, high in ((0.0, 1e1), (1e1, 1e3), (1e3, 1e6), (1e6, math.inf)):
        those = [one for one in found if low < one.conditioning <= high]
        within = max((one.error for one in those if one.error <= LIMIT), default=0.0)
        beyond = sum(one.error > LIMIT for one in those)
        impacts = sum(one.impacts for one in those)
        print(f"| {low:g} to {high:g} | {len(those)} | {impacts:.0f} | {within:.1e} | {beyond} |")
    unequal = sum(not one.equal for one in found)
    print(f"\n{unequal} with other counts of impacts; of these and those beyond:")
    for kind, count in Counter(one.kind for one in found if one.kind).items():
        print(f"- {kind}: {count}")
    raise SystemExit(any(one.kind == FAULT for one in found))


if __name__ == "__main__":
    main()
