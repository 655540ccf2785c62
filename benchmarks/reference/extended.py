"""The Taylor series of `reference` in extended precision, which certifies it.

Written for mpmath at any precision and order, in code of its own. `bash benchmarks/run.sh extended`
computes and stores what the quick tests compare with.
"""

import math
from pathlib import Path

import mpmath
import numpy as np
from reference import (
    CASES,
    OMEGA,
    first_root,
    majorant,
    reference_monodromy,
    reference_points,
    system,
)

CERTIFIED = Path(__file__).parent.parent / "data" / "certified.npz"
"""Rounded results of `points_mp`; `bash benchmarks/run.sh extended` makes the file, in minutes."""
MATRIX_CASES = [(1000.0, 0.06), (1000.0, 0.0987)]


def points_mp(structure, amplitude, omega, state, n_periods, dps=30, order=36):
    """Stroboscopic points in extended precision, a list of lists of mpf; rho > 0, also inf."""
    with mpmath.workdps(dps):
        mp = mpmath.mp
        n = structure.n_floors
        # the matrices and T of the double precision problem, so that only the method differs
        _, _, parts = system(structure, amplitude, omega)
        beta, rho = structure.stiffness_ratio, parts.rho
        stiffness, damping = parts.stiffness, parts.damping
        k_rows = [[mp.mpf(a) for a in row] for row in stiffness]
        c_rows = [[mp.mpf(a) for a in row] for row in damping]
        ramp = rho == math.inf
        amplitude, omega, beta, rho = (mp.mpf(a) for a in (amplitude, omega, beta, rho))
        end = mp.mpf(2 * math.pi / float(omega))
        z = [mp.mpf(a) for a in state]
        closed = [_touches(z[i] - 1, z[n + i]) for i in range(n)]
        points = []
        for _ in range(n_periods):
            tau = mp.mpf(0)
            while tau < end:
                x = [[z[i] - 1] for i in range(n)]
                v = [[z[n + i]] for i in range(n)]
                if ramp:
                    s = [[mp.mpf(c)] for c in closed]
                    d = [[mp.mpf(1 - c)] for c in closed]
                else:
                    s = [[1 / (1 + mp.exp(-rho * x[i][0]))] for i in range(n)]
                    d = [[1 / (1 + mp.exp(rho * x[i][0]))] for i in range(n)]
                sd = [[] for _ in range(n)]
                sine, cosine = amplitude * mp.sin(omega * tau), amplitude * mp.cos(omega * tau)
                for k in range(order):
                    for i in range(n):
                        force = -sine - mp.fdot(k_rows[i], [a[k] for a in x])
                        force -= mp.fdot(c_rows[i], [a[k] for a in v])
                        if k == 0:
                            force -= mp.fsum(k_rows[i])
                        force -= beta * mp.fdot(s[i], x[i][::-1])
                        sd[i].append(mp.mpf(0) if ramp else mp.fdot(s[i], d[i][::-1]))
                        slope = 0 if ramp else rho * mp.fdot(v[i], sd[i][::-1]) / (k + 1)
                        s[i].append(slope)
                        d[i].append(-slope)
                        x[i].append(v[i][k] / (k + 1))
                        v[i].append(force / (k + 1))
                        # the other floors still need order k: appended values are not used yet
                    sine, cosine = (
                        cosine * omega / (k + 1),
                        -sine * omega / (k + 1),
                    )
                h = _step_mp(x, v, rho, end - tau, order, dps)
                floor = -1
                for i in range(n) if ramp else ():
                    root = _first_root_mp(x[i], v[i], h)
                    if root is not None:
                        floor, h = i, root
                z = [1 + _horner_mp(c, h) for c in x] + [_horner_mp(c, h) for c in v]
                tau += h
                if floor >= 0:
                    z[floor] = mp.mpf(1)
                    closed[floor] = _touches(mp.mpf(0), z[n + floor])
            points.append(list(z))
        return points


def _touches(x, v):
    return 1 if x > 0 or (x == 0 and v > 0) else 0


def _first_root_mp(x, v, h):
    """First zero of x in (0, h], a start at zero left out: found in double, then polished."""
    root = first_root(np.array([float(a) for a in x]), float(h))
    if root > h:
        return None
    root = mpmath.mpf(float(root))
    for _ in range(8):
        root -= _horner_mp(x, root) / _horner_mp(v, root)
    return min(root, h)


def _horner_mp(c, t):
    total = mpmath.mpf(0)
    for a in reversed(c):
        total = total * t + a
    return total


def _step_mp(x, v, rho, largest, order, dps):
    h = float(largest)
    for c in (*x, *v):
        last = max(abs(float(c[-1])), 1e-300)
        h = min(h, (10.0 ** (2 - dps) / last) ** (1.0 / order))
    for c in x if rho < mpmath.inf else ():
        sizes = np.abs(np.array([float(a) for a in c]))
        distance = math.hypot(float(c[0]), math.pi / float(rho))
        radius = 5.0 * h
        while majorant(sizes, radius) > 0.9 * distance:
            radius *= 0.9
        h = min(h, 0.2 * radius)
    return largest if h >= float(largest) else mpmath.mpf(h)


def monodromy_mp(structure, amplitude, omega, state, columns, delta=1e-10, dps=36):
    """Columns of d z(T) / d z(0) by central differences in extended precision.

    The error is delta^2 times third derivatives, which reach (rho delta)^2 = 1e-12.
    """
    with mpmath.workdps(dps):
        ends = []
        for column in columns:
            for sign in (1, -1):
                z = [mpmath.mpf(a) for a in state]
                z[column] += sign * mpmath.mpf(delta)
                ends.append(points_mp(structure, amplitude, omega, z, 1, dps, 44)[0])
        differences = [
            [float((a - b) / (2 * mpmath.mpf(delta))) for a, b in zip(up, down, strict=True)]
            for up, down in zip(ends[::2], ends[1::2], strict=True)
        ]
    return np.array(differences).T


def write_certified(n_periods=20):
    """Compute `CERTIFIED` and print how far `reference_points` is from it."""
    from hpcsweep.model.structure import Structure

    rest = np.zeros(6)
    points = []
    for beta, amplitude in CASES:
        structure = Structure(3, beta, 1e4, 0.05)
        exact = points_mp(structure, amplitude, OMEGA, rest, n_periods)
        points.append(np.array(exact, dtype=float))
        fast = reference_points(structure, amplitude, OMEGA, rest, n_periods)
        error = np.abs(fast - points[-1]).max()
        print(f"beta {beta:g} A {amplitude:g}: double - extended {error:.1e}", flush=True)
    matrices = []
    for beta, amplitude in MATRIX_CASES:
        structure = Structure(3, beta, 1e4, 0.05)
        state = points[CASES.index((beta, amplitude))][1]
        matrices.append(monodromy_mp(structure, amplitude, OMEGA, state, range(6)))
        fast = reference_monodromy(structure, amplitude, OMEGA, state, 1)[1]
        error = np.abs(fast - matrices[-1]).max()
        print(f"beta {beta:g} A {amplitude:g}: matrix {error:.1e}", flush=True)
    CERTIFIED.parent.mkdir(exist_ok=True)
    np.savez_compressed(CERTIFIED, points=np.array(points), matrices=np.array(matrices))


if __name__ == "__main__":
    write_certified()
