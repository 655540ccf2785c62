"""Random structures of each element of the exact flow against exponentials in extended precision.

Sliders, multilinear springs, friction that slips with less than it sticks with, belts, gyroscopic
matrices; states after 30 periods. A case that differs by more than 1e-10 is told with what its
motion makes of a state that is 1e-13 away. Usage: elements.py [--cases N] [--first N] [KIND ...]
"""

import sys

import numpy as np
from exponentials import Law, Motion, asked

import hpcsweep

PERIODS, HEAVY = 30, 1e15
KINDS = "slider", "spring", "kinetic", "belt", "gyroscopic", "all"


def random_spring(rng, direction):
    """Return a table of 3 to 6 points through 0, softening parts included, hard at its ends."""
    d = np.sort(rng.uniform(-1.0, 1.0, rng.integers(3, 6)))
    d = np.concatenate((d[d < -0.02], [0.0], d[d > 0.02]))
    d = np.concatenate(([-1.5], d, [1.5]))
    slopes = rng.uniform(-0.6, 2.0, d.size - 1)
    slopes[[0, -1]] = rng.uniform(0.2, 2.0, 2)
    slopes[np.searchsorted(d, 0.0) - 1 : np.searchsorted(d, 0.0) + 1] = rng.uniform(0.1, 2.0, 2)
    force = np.concatenate(([0.0], np.cumsum(slopes * np.diff(d))))
    return direction, d, force - np.interp(0.0, d, force)


def case(kind, seed):
    """Return a random case: matrices, springs, sliders (b, k, F, F_k, speed), drive, start."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    of = {name: kind in (name, "all") for name in KINDS}
    root = rng.standard_normal((n, n))
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    stiffness = np.diag(rng.uniform(0.5, 2.0, n)) + 0.3 * root @ root.T
    root = rng.standard_normal((n, n))
    damping = np.diag(rng.uniform(0.05, 0.2, n)) + 0.05 * root @ root.T
    if of["gyroscopic"]:
        n = max(n, 2)
        if len(mass) < n:
            return case(kind, seed + 100_000)
        skew = rng.standard_normal((n, n))
        damping = damping + rng.uniform(0.1, 2.0) * (skew - skew.T)

    def direction():
        return np.eye(n)[rng.integers(n)] if rng.random() < 0.6 else rng.standard_normal(n)

    springs = [random_spring(rng, direction()) for _ in range(rng.integers(1, 3))]
    springs = springs if of["spring"] else []
    sliders = []
    for _ in range(int(rng.integers(1, 3))):
        strength = rng.uniform(0.05, 0.5)
        kinetic = strength * rng.uniform(0.3, 1.0) if of["kinetic"] else strength
        speed = rng.uniform(0.1, 1.0) * rng.choice((-1, 1)) if of["belt"] else 0.0
        sliders.append((direction(), rng.uniform(0.5, 5.0), strength, kinetic, speed))
    gap = [(direction(), rng.uniform(0.2, 1.0), rng.uniform(5.0, 50.0))]
    gap = gap if kind in ("slider", "gyroscopic") else []
    drive = rng.uniform(0.3, 1.5), rng.uniform(0.4, 2.0), rng.standard_normal(n)
    start = np.concatenate((np.zeros(n), rng.uniform(-0.1, 0.1, n)))  # where no slider slips
    return mass, stiffness, damping, springs, sliders, gap, drive, start


def motion(made):
    """Return a case as a motion of `exponentials`."""
    mass, stiffness, damping, springs, sliders, gaps, (amplitude, omega, push), start = made
    stops = [(b, gap, k, 0.0, True) for b, gap, k in gaps]
    law = Law(mass, stiffness, damping, push, springs, stops, sliders)
    return Motion(law, amplitude, omega, np.concatenate((start, np.zeros(len(sliders)))))


def reference(made, periods=PERIODS):
    """Return (u, u', p) after the periods, p of a belt less its way."""
    followed = motion(made)
    for _ in range(periods):
        followed.over_a_period()
    return followed.state


def exact(mass, stiffness, damping, springs, sliders, gaps, drive, start):
    """Return the same by the program; a belt is a heavy coordinate that starts with its speed."""
    amplitude, omega, push = drive
    n = len(mass)
    belts = [j for j, slider in enumerate(sliders) if slider[4]]
    size = n + len(belts)

    def wide(matrix, diagonal=0.0):
        out = diagonal * np.eye(size)
        out[:n, :n] = matrix
        return out

    def row(b, j=None):
        out = np.concatenate((b, np.zeros(len(belts))))
        if j in belts:
            out[n + belts.index(j)] = -1.0
        return tuple(out.tolist())

    structure = hpcsweep.Structure.from_matrices(
        wide(mass, HEAVY),
        wide(stiffness),
        [hpcsweep.Contact(row(b), g, k) for b, g, k in gaps],
        damping=wide(damping),
        forcing=[*push, *[0.0] * len(belts)],
        sliders=[
            hpcsweep.Slider(
                row(b, j), k, strength, f"s{j}", kinetic if kinetic < strength else None
            )
            for j, (b, k, strength, kinetic, _) in enumerate(sliders)
        ],
        springs=[hpcsweep.Spring(row(b), np.column_stack((d, f))) for b, d, f in springs],
    )
    state = np.concatenate((start[:n], np.zeros(len(belts)), start[n:],
                            [sliders[j][4] for j in belts], np.zeros(len(sliders))))  # fmt: skip
    end = hpcsweep.stroboscopic_points(structure, amplitude, omega, state, PERIODS)[-1]
    kept = [*range(n), *range(size, size + n), *range(2 * size, len(end))]
    return end[kept]


def growth(made):
    """Return the most that a motion makes of 1e-13, over that, from after a period to its end."""
    rng, most = np.random.default_rng(0), 0.0
    followed, forks = motion(made), []
    for done in range(PERIODS):
        followed.over_a_period()
        if done % 4 == 0:
            forks += [(followed.fork(), done) for _ in range(3)]
    for fork, done in forks:
        away = 1e-13 * rng.standard_normal(made[-1].size)
        fork.y[: away.size] += away
        for _ in range(PERIODS - done - 1):
            fork.over_a_period()
        moved = np.abs(fork.state - followed.state).max() / np.abs(away).max()
        most = max(most, float(moved))
    return most


def main() -> int:
    """Compare random cases; print those that differ, and return 1 if one is not its own fault."""
    kinds, seeds = asked(__doc__, KINDS)
    failed = False
    print("kind        cases  within 1e-10  median    worst  growth there  events", flush=True)
    for kind in kinds:
        errors, events, made_of = [], 0, 1.0
        for seed in seeds:
            made = case(kind, seed)
            followed = motion(made)
            for _ in range(PERIODS):
                followed.over_a_period()
            errors.append(float(np.abs(exact(*made) - followed.state).max()))
            events += followed.events
            if not errors[-1] < 1e-10:
                grown = growth(made)
                made_of = grown if errors[-1] >= max(errors) else made_of
                print(f"  {kind} {seed}: {errors[-1]:.1e}, growth {grown:.1e}", flush=True)
                failed |= not errors[-1] < 1e-13 * grown
        within = sum(error < 1e-10 for error in errors)
        median, worst = np.median(errors), max(errors)
        print(f"{kind:11s} {len(errors):5d} {within:13d} {median:8.1e} {worst:8.1e} "
              f"{made_of:13.1e} {events:7d}", flush=True)  # fmt: skip
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
