"""Random structures of each element of the exact flow against DOP853 from event to event.

Multilinear springs, friction that slips with less than it sticks with, belts, gyroscopic matrices;
states after 30 periods. Usage: elements.py [--cases N] [--first N] [KIND ...]
"""

import argparse
import math
import sys

import numpy as np
from scipy.integrate import solve_ivp

import hpcsweep

PERIODS, HEAVY = 30, 1e15
KINDS = "spring", "kinetic", "belt", "gyroscopic", "all"


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
    gap = gap if kind == "gyroscopic" else []
    drive = rng.uniform(0.3, 1.5), rng.uniform(0.4, 2.0), rng.standard_normal(n)
    start = np.concatenate((np.zeros(n), rng.uniform(-0.1, 0.1, n)))  # where no slider slips
    return mass, stiffness, damping, springs, sliders, gap, drive, start


def reference(mass, stiffness, damping, springs, sliders, gaps, drive, start):
    """Return (u, u', p) after the periods, p of a belt less its way."""
    amplitude, omega, push = drive
    n, inverse = len(mass), np.linalg.inv(mass)
    part, slip = [], np.zeros(len(sliders), int)
    plastic, z, t = np.zeros(len(sliders)), np.array(start), 0.0
    laws = [(b, d, force) for b, d, force in springs]
    laws += [(b, np.array([-1e9, g, g + 1.0]), np.array([0.0, 0.0, k])) for b, g, k in gaps]
    part = [int(np.clip(np.searchsorted(d, b @ z[:n], "right") - 1, 0, d.size - 2))
            for b, d, _ in laws]  # fmt: skip
    rows = np.array([s[0] for s in sliders]).reshape(-1, n)
    k, strength, kinetic, speed = np.array([s[1:] for s in sliders]).reshape(-1, 4).T

    def motion(t, z):
        u, v = z[:n], z[n:]
        force = np.where(slip, slip * kinetic, k * (rows @ u - speed * t - plastic))
        total = push * amplitude * math.sin(omega * t) - damping @ v - stiffness @ u
        total = total - rows.T @ force
        for (b, d, f), i in zip(laws, part, strict=True):
            slope = (f[i + 1] - f[i]) / (d[i + 1] - d[i])
            total = total - b * (f[i] + slope * (b @ u - d[i]))
        return np.concatenate((v, inverse @ total))

    def guards():
        for j in range(len(rows)):
            for way in (1,) if slip[j] else (1, -1):
                yield "slider", j, way
        for j, (_, d, _) in enumerate(laws):
            if part[j] < d.size - 2:
                yield "law", j, 1
            if part[j] > 0:
                yield "law", j, -1

    def event(kind, j, way):
        def guard(t, z):
            if kind == "law":
                b, d, _ = laws[j]
                return way * (b @ z[:n] - d[part[j] + (way > 0)])
            if slip[j]:
                return -slip[j] * (rows[j] @ z[n:] - speed[j])
            return way * k[j] * (rows[j] @ z[:n] - speed[j] * t - plastic[j]) - strength[j]

        guard.terminal, guard.direction = True, 1.0
        return guard

    end = PERIODS * 2 * math.pi / omega
    while t < end:
        listed = list(guards())
        done = solve_ivp(
            *(motion, (t, end), z),
            method="DOP853",
            rtol=1e-13,
            atol=1e-14,
            max_step=0.05 * 2 * math.pi / omega,
            events=[event(*one) for one in listed],
        )
        t, z = done.t[-1], done.y[:, -1]
        # what turns at the same instant does so, too: a root is found to rounding
        at_once = t < end
        for (kind, j, way), times in zip(listed, done.t_events, strict=True):
            if kind == "law":
                b, d, _ = laws[j]
                turns = abs(b @ z[:n] - d[part[j] + (way > 0)]) < 1e-12 and way * (b @ z[n:]) > 0.0
            else:
                turns = slip[j] and abs(rows[j] @ z[n:] - speed[j]) < 1e-12
            if not (len(times) or (at_once and turns)):
                continue
            if kind == "law":
                part[j] += way
            elif slip[j]:
                plastic[j] = rows[j] @ z[:n] - speed[j] * t - slip[j] * kinetic[j] / k[j]
                slip[j] = 0
            else:
                slip[j] = way
    lasting = np.where(slip, rows @ z[:n] - speed * t - slip * kinetic / k, plastic)
    return np.concatenate((z, lasting))


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


def main() -> int:
    """Compare random cases; print the worst, and return 1 if one differs by more than 1e-10."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=KINDS)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    worst = 0.0
    for kind in given.kinds:
        errors, refused = [0.0], 0
        for seed in range(given.first, given.first + given.cases):
            made = case(kind, seed)
            try:
                found = exact(*made)
            except (ValueError, ArithmeticError) as error:
                refused += 1
                print(kind, seed, error)
                continue
            errors.append(float(np.abs(found - reference(*made)).max()))
            if not errors[-1] < 1e-10:
                print(f"{kind} {seed}: {errors[-1]:.1e}", flush=True)
        worst = max(worst, *errors)
        within = sum(error < 1e-10 for error in errors)
        print(f"{kind}: {within} of {len(errors)} within 1e-10, worst {max(errors):.1e}, "
              f"median {np.median(errors):.1e}, {refused} refused", flush=True)  # fmt: skip
    return int(not worst < 1e-10)


if __name__ == "__main__":
    sys.exit(main())
