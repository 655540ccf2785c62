"""All measures of random structures over one forcing period, against the independent reference.

`bash benchmarks/run.sh measures [--cases N] [--seed S] [--worst K]` takes the structures of
`general`. The reference's Taylor series are searched for their extrema and roots, and the forces
integrated by Gauss's rule, step by step; nothing is shared with the solvers. Told is the error of
each kind of measure, relative to the largest of its kind, plain and over the conditioning,

    max(kappa, |dm| / |dz|),

with kappa of `accuracy`, and the change dm of the measures by a small change dz of the start. Where
a contact touches its stop within rounding, so that the reference counts another number of closings
itself after a change of 1e-12, no count can be told right: such cases are listed on their own.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from itertools import pairwise

import numpy as np
from accuracy import outline, quantiles, refer
from general import random_general_cases
from reference import ORDER, horner, reference_steps, system
from scipy.special import expit

from hpcsweep.model.observed import (
    ANY_PEAK,
    CLOSINGS,
    FORCE,
    IMPACT,
    MOTIONS,
    SPEED,
    TIME,
    Measures,
)
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome

KINDS = tuple(quantity.name for quantity in MOTIONS)
SAMPLES = np.linspace(0.0, 1.0, 17)
POWERS = np.vander(SAMPLES, ORDER + 1, increasing=True)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(30)
CHANGE = 1e-7
"""Of the start, in units of the state, for the conditioning."""


def slope_of(c):
    """Coefficients of the derivative of polynomials (..., K)."""
    return c[..., 1:] * np.arange(1, c.shape[-1])


def root_between(c, a, b):
    """Find the root of a polynomial between a and b, where it differs in sign."""
    rises = horner(c, b) > 0
    for _ in range(60):
        middle = 0.5 * (a + b)
        if (horner(c, middle) > 0) == rises:
            b = middle
        else:
            a = middle
    return 0.5 * (a + b)


def turns(c):
    """Return where the slope of a polynomial changes its sign on [0, 1]."""
    slope = slope_of(c)
    values = POWERS[:, : slope.size] @ slope
    changes = np.flatnonzero(values[:-1] * values[1:] < 0)
    return [root_between(slope, SAMPLES[k], SAMPLES[k + 1]) for k in changes]


def largest(c):
    """Largest value of each of R polynomials over S steps: c (S, R, K), on [0, 1].

    Steps whose samples miss the largest of all by more than a bound allows are passed over.
    """
    orders = np.arange(c.shape[-1])
    values = (c @ np.vander(SAMPLES, c.shape[-1], increasing=True).T).max(axis=-1)
    missed = (np.abs(c) * orders * (orders - 1)).sum(axis=-1) * SAMPLES[1] ** 2 / 8
    best = values.max(axis=0)
    for step, row in zip(*np.nonzero(values + missed >= best), strict=True):
        for turn in turns(c[step, row]):
            best[row] = max(best[row], horner(c[step, row], turn))
    return best


def series_of(case, state):
    """Lengths (S,) and starts of the reference's steps, and Taylor series on [0, 1] of each."""
    steps = list(reference_steps(case.structure, case.amplitude, case.omega, state, 1))
    sizes = np.array([h for h, _ in steps])
    c = np.array([one for _, one in steps])
    starts = np.concatenate(([0.0], np.cumsum(sizes)[:-1]))
    return sizes, starts, c * sizes[:, None, None] ** np.arange(c.shape[-1])


def accelerations(case, parts, sizes, starts, c):
    """Series of the absolute accelerations: those of v', and of the ground's where it shakes."""
    n, structure = c.shape[1] // 2, case.structure
    found = slope_of(c[:, n:]) / sizes[:, None, None]
    if not structure.shakes:
        return found
    order = np.arange(found.shape[-1])
    ground = np.zeros((len(sizes), order.size))
    for harmonic, size, phase in structure.harmonics:
        rate = harmonic * case.omega
        angle = rate * starts[:, None] + phase + order * math.pi / 2
        factorial = np.array([math.factorial(k) for k in order], float)
        ground += size * np.sin(angle) * (rate * sizes[:, None]) ** order / factorial
    return found - case.amplitude * ground[:, None] * parts.forcing[:, None]


def impacts(x, sizes, rho):
    """Closings, largest speed, integral of x S and time at x >= 0 of one contact: x (S, K).

    Roots are looked for where samples differ in sign, or may miss a change of it.
    """
    found = np.zeros(4)
    order = np.arange(x.shape[-1])
    at = x @ np.vander(0.5 * (NODES + 1), order.size, increasing=True).T
    values = x @ POWERS.T
    if rho == math.inf:
        # steps end at the stops
        inside = values[:, len(SAMPLES) // 2] > 0
        share = inside[:, None].astype(float)
        closes = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
        found[CLOSINGS] = closes.size
        found[SPEED] = np.abs(x[closes, 1] / sizes[closes]).max(initial=0.0)
        found[TIME] = sizes @ inside
    else:
        share = expit(rho * at)
        above = values >= 0
        before = np.concatenate((above[:1, 0], above[:-1, -1]))
        missed = (np.abs(x) * order * (order - 1)).sum(axis=-1) * SAMPLES[1] ** 2 / 8
        plain = (above == before[:, None]).all(axis=1) & (np.abs(values).min(axis=1) > missed)
        found[TIME] = sizes @ (plain & before)
        for step in np.flatnonzero(~plain):
            _follow(x[step], sizes[step], before[step], found)
    found[FORCE] = 0.5 * sizes @ ((at * share) @ WEIGHTS)
    return found


def _follow(c, h, closed, found):
    """Add the closings and the time at x >= 0 of one step; `closed` tells how it is entered."""
    nodes = np.sort(np.concatenate((SAMPLES, turns(c))))
    values = np.polynomial.polynomial.polyval(nodes, c)
    changes = np.flatnonzero((values[:-1] >= 0) != (values[1:] >= 0))
    cuts = [0.0, *(root_between(c, nodes[k], nodes[k + 1]) for k in changes), 1.0]
    for begin, end in pairwise(cuts):
        now = horner(c, 0.5 * (begin + end)) >= 0
        if now and not closed:
            found[CLOSINGS] += 1
            found[SPEED] = max(found[SPEED], abs(horner(slope_of(c), begin)) / h)
        closed = now
        found[TIME] += (end - begin) * h * now


def reference_measures(case, state=None):
    """Return the measures of an `Observation` of one forcing period, by the reference."""
    structure = case.structure
    parts = system(structure, case.amplitude, case.omega)[2]
    sizes, starts, c = series_of(case, case.state if state is None else state)
    n = structure.n_floors
    past = parts.reach @ c[:, :n]
    past[..., 0] -= parts.gap
    u = c[:, :n].copy()
    u[..., 0] += parts.offset
    own = accelerations(case, parts, sizes, starts, c)
    peaks = [np.maximum(largest(one), largest(-one)) for one in (structure.drift_rows @ u, u, own)]
    each = [impacts(past[:, k], sizes, parts.rho) for k in range(past.shape[1])]
    found = np.array(each).reshape(-1, 4).T
    found[TIME] /= 2 * math.pi / case.omega
    past, spring = np.maximum(largest(past), 0.0), structure.force_per_length
    return Measures(
        *peaks,
        structure.switched(spring * past, past),
        found[CLOSINGS],
        found[SPEED],
        spring * found[FORCE],
        found[TIME],
        np.zeros_like(past),
    )


def over_springs(structure, measures):
    """Return measures of springs by name, forces and impulses over the stiffness of contacts."""
    values = dict(vars(measures))
    assert not values.pop("simultaneous").any()
    for name in ("contact_force", "impulse"):
        values[name] = values[name] / structure.force_per_length
    return values


def scales(structure, expected):
    """Return the largest of each kind, at least the structure's unit of it."""
    length, rate = structure.length_unit, structure.frequency_unit
    units = (length, length, length * rate**2, length, 1.0, length * rate, length / rate, 1.0)
    parts = over_springs(structure, expected).values()
    return [max(unit, *part.tolist()) for unit, part in zip(units, parts, strict=True)]


def differences(structure, one, other, scale):
    """Return the largest difference of each kind over its scale."""
    both = (over_springs(structure, each).values() for each in (one, other))
    parts = zip(*both, scale, strict=True)
    return np.array([np.abs(a - b).max(initial=0.0) / size for a, b, size in parts])


def compare(case):
    """Return the errors of all kinds, plain and over the conditioning, and whether counts agree.

    Counts are None where the reference itself cannot tell them.
    """
    structure, z = case.structure, np.array(case.state)
    expected = reference_measures(case)
    flow = FlowMap(structure, case.omega)
    seen = flow.observe(z, case.amplitude, 1, measures=ANY_PEAK + IMPACT)
    if seen.outcome is not Outcome.COMPLETE:
        return None
    scale = scales(structure, expected)
    plain = differences(structure, seen.measures, expected, scale)
    rng = np.random.default_rng(case.number)
    push = rng.uniform(-1.0, 1.0, z.size) * structure.state_units
    changed = reference_measures(case, z + CHANGE * push)
    steep = differences(structure, changed, expected, scale) / CHANGE
    counts = bool(np.array_equal(seen.measures.impacts, expected.impacts))
    if not counts:
        near = [reference_measures(case, z + sign * 1e-12 * push) for sign in (1.0, -1.0)]
        if any((e.impacts != expected.impacts).any() for e in near):
            counts = None
    return plain, plain / np.maximum(refer(case).kappa, steep), counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worst", type=int, default=5)
    options = parser.parse_args()
    found = []
    for case in random_general_cases(options.cases, options.seed):
        errors = compare(case)
        if errors is None:
            print(f"not completed: {case.kind}, {case.number}: {outline(case.structure)}")
        else:
            found.append((case, *errors))
    wrong = [case for case, _, _, counts in found if counts is False]
    unknown = [case for case, _, _, counts in found if counts is None]
    print(f"{len(found)} cases; closings differ in {len(wrong)}, within rounding in {len(unknown)}")
    known = [one for one in found if one[3]]
    print(f"{'':16s} | plain error: 50 %, 90 %, 99 %, max    | over the conditioning")
    for place, kind in enumerate(KINDS):
        columns = (quantiles([one[which][place] for one in known]) for which in (1, 2))
        print(f"{kind:16s} | " + " | ".join(columns))
    known.sort(key=lambda one: -one[2].max())
    for case, plain, scaled, _ in known[: options.worst]:
        kind = KINDS[int(scaled.argmax())]
        print(f"{scaled.max():.1e} (plain {plain.max():.1e}) {kind}: {case.kind}, {case.number}: ")
        print("    ", outline(case.structure))
    for case in wrong:
        print(f"closings differ: {case.kind}, {case.number}: {outline(case.structure)}")


if __name__ == "__main__":
    main()
