"""Motions with rigid stops, independently of the program: closed forms, a dense search, brentq.

Between impacts the state, with the harmonics as states of their own, is exp(B t) of what it was;
stops that rest leave the coordinates u = u_0 + Z q, D Z = 0. Which do is found by trying all sets.
"""

import itertools
import math
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, null_space
from scipy.optimize import brentq

ROUNDING = 2.0**-46
NODES = 64
"""Of a search, over the period of the fastest motion: a sixth of it."""
ORDER = 30


class Rigid:
    """M u'' + C u' + K u = A b sum a_h sin(h w t + phi_h), d_k . u <= g_k, restitutions e_k.

    Attributes
    ----------
    counts : ndarray, shape (m,)
        Impacts, after hops above rounding.
    together : ndarray, shape (m,)
        Those of them while others that they push were at their stops.
    impulse, lost : ndarray, shape (m,)
        Impulses at impacts and their energy.
    closed : ndarray, shape (m,)
        Time of rest.
    """

    def __init__(self, mass, damping, stiffness, rows, gaps, e, push, omega, amplitude, harmonics):
        self.mass, self.damping, self.stiffness = mass, damping, stiffness
        self.rows, self.gaps, self.e = rows, gaps, e
        self.flexible = np.linalg.solve(mass, rows.T)  # M^-1 D^T
        self.gram = rows @ self.flexible
        self.push, self.omega, self.harmonics = push, omega, harmonics
        self.amplitude, self.n = amplitude, len(mass)
        self.counts, self.t, self.resting = np.zeros(len(gaps)), 0.0, ()
        self.impulse, self.lost, self.closed, self.together = np.zeros((4, len(gaps)))
        self.apart, self.coupled, self.size = np.ones(len(gaps), bool), 0, 0.0

    @lru_cache(maxsize=64)  # noqa: B019
    def _linear(self, resting):
        """Return the map from (q, q', forcing, 1) to u, B, and exp(B t) at the nodes."""
        n, h = self.n, len(self.harmonics)
        basis = null_space(self.rows[list(resting)]) if resting else np.eye(n)
        origin = np.zeros(n)
        if resting:
            picked = self.rows[list(resting)]
            origin = np.linalg.lstsq(picked, self.gaps[list(resting)], rcond=None)[0]
        r = basis.shape[1]
        size = 2 * r + 2 * h + 1
        mass = basis.T @ self.mass @ basis
        b = np.zeros((size, size))
        b[:r, r : 2 * r] = np.eye(r)
        b[r : 2 * r, :r] = -np.linalg.solve(mass, basis.T @ self.stiffness @ basis)
        b[r : 2 * r, r : 2 * r] = -np.linalg.solve(mass, basis.T @ self.damping @ basis)
        b[r : 2 * r, -1] = -np.linalg.solve(mass, basis.T @ self.stiffness @ origin)
        for k, (order, share, _) in enumerate(self.harmonics):
            at, w = 2 * r + 2 * k, order * self.omega
            b[r : 2 * r, at] = self.amplitude * share * np.linalg.solve(mass, basis.T @ self.push)
            b[at, at + 1], b[at + 1, at] = w, -w
        step = math.pi / 3.0 / max(np.abs(np.linalg.eigvals(b)).max(), self.omega) / 8.0
        whole = expm(b * step)
        nodes = [np.eye(size)]
        for _ in range(NODES):
            nodes.append(nodes[-1] @ whole)
        powers = [np.eye(size)]
        for k in range(1, ORDER):
            powers.append(powers[-1] @ b / k)
        return basis, origin, b, step, np.array(nodes), np.array(powers)

    def _augmented(self, u, v):
        basis, origin, *_ = self._linear(self.resting)
        angles = [order * self.omega * self.t + phase for order, _, phase in self.harmonics]
        forcing = np.array([(math.sin(a), math.cos(a)) for a in angles]).ravel()
        return np.concatenate((basis.T @ (u - origin), basis.T @ v, forcing, [1.0]))

    def _functionals(self):
        """Return rows of (q, q', forcing, 1): distances of open stops, minus other reactions."""
        basis, origin, b, *_ = self._linear(self.resting)
        r, size = basis.shape[1], len(b)
        listed = []
        free = np.zeros((self.n, size))  # M^-1 (forces but reactions)
        free[:, :r] = -np.linalg.solve(self.mass, self.stiffness @ basis)
        free[:, r : 2 * r] = -np.linalg.solve(self.mass, self.damping @ basis)
        free[:, -1] = -np.linalg.solve(self.mass, self.stiffness @ origin)
        for k, (_, share, _) in enumerate(self.harmonics):
            free[:, 2 * r + 2 * k] = self.amplitude * share * np.linalg.solve(self.mass, self.push)
        for k in range(len(self.gaps)):
            if k not in self.resting:
                row = np.zeros(size)
                row[:r] = self.rows[k] @ basis
                row[-1] = self.rows[k] @ origin - self.gaps[k]
                listed.append(row)
        if self.resting:
            picked = list(self.resting)
            reactions = np.linalg.solve(self.gram[np.ix_(picked, picked)], self.rows[picked] @ free)
            listed += list(-reactions)
        order = [k for k in range(len(self.gaps)) if k not in self.resting] + list(self.resting)
        return np.array(listed).reshape(-1, size), order

    def advance(self, u, v, end):
        """Advance (u, v) to the time `end`."""
        steps = 0
        touching = {k for k in range(len(self.gaps)) if self._at_stop(k, u)} - set(self.resting)
        if self.t == 0.0 and touching:
            u, v = self._rest(touching, u, v, max(1.0, np.abs(u).max(), np.abs(v).max()))
        while self.t < end:
            steps += 1
            if steps > 2_000_000:
                raise ArithmeticError("too many events")
            u, v, hit = self._flight(u, v, end)
            if hit is not None:
                u, v = self._event(hit, u, v)
        return u, v

    def _flight(self, u, v, end):
        """Return the state at the first event, or at the end, and the stop."""
        basis, origin, b, step, nodes, powers = self._linear(self.resting)
        rows, order = self._functionals()
        z, r = self._augmented(u, v), basis.shape[1]
        states = nodes @ z
        times = step * np.arange(NODES + 1)
        g, slope = states @ rows.T, states @ (rows @ b).T
        first = None
        for j, k in enumerate(order):
            starts = k not in self.resting and self._at_stop(k, u)
            t = self._first(rows[j], z, g[:, j], slope[:, j], times, b, nodes, powers, starts)
            if t is not None and (first is None or t < first[0]):
                first = t, k
        limit = min(times[-1], end - self.t)
        hit = None
        if first is not None and first[0] < limit:
            limit, hit = first
        place = min(int(limit / step), NODES)
        z1 = expm(b * (limit - times[place])) @ (nodes[place] @ z)
        past = (self.t + limit) if hit is not None or limit < end - self.t else end
        for k in self.resting:
            self.closed[k] += limit
        for k in range(len(self.gaps)):
            if k not in self.resting:
                seen = g[: place + 1, order.index(k)]
                near = rows[order.index(k)] @ (expm(b * (0.5 * limit)) @ z)
                if min(seen.min(), near) < -ROUNDING * max(self.size, self.gaps[k]):
                    self.apart[k] = True
        self.t = past
        return origin + basis @ z1[:r], basis @ z1[r : 2 * r], hit

    def _at_stop(self, k, u):
        return abs(self.rows[k] @ u - self.gaps[k]) <= 1e-14 * max(1.0, np.abs(u).max())

    def _first(self, row, z, g, slope, times, b, nodes, powers, starts):
        """Return when row . z first rises through 0, None if it does not."""
        if starts:
            w = row @ b @ z
            if w <= 0.0:
                # x / t by its series about the start, whatever rounding has made of x
                terms = np.array([row @ p @ z for p in powers])
                terms[0] = 0.0

                def over_time(t):
                    return np.polyval(terms[:0:-1], t)

                short = times[8]
                grid = np.linspace(0.0, short, 65)
                values = over_time(grid)
                up = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
                if up.size:
                    a, c = grid[up[0]], grid[up[0] + 1]
                    if a == 0.0:
                        while over_time(0.5 * c) >= 0.0:
                            c *= 0.5
                        a = 0.5 * c
                    return brentq(over_time, a, c, xtol=1e-300, rtol=8.9e-16)
        start = 8 if starts and row @ b @ z <= 0.0 else 0
        if not starts and g[0] >= 0.0 and slope[0] > 0.0:
            return 0.0
        if not starts and abs(g[0]) <= ROUNDING and g[1] > ROUNDING:  # from rest, say
            return 0.0

        def value(t):
            j = min(int(t / times[1]), NODES)
            return row @ (expm(b * (t - times[j])) @ (nodes[j] @ z))

        def rate(t):
            j = min(int(t / times[1]), NODES)
            return row @ b @ (expm(b * (t - times[j])) @ (nodes[j] @ z))

        for j in range(start, NODES):
            if g[j] < 0.0 <= g[j + 1]:
                return brentq(value, times[j], times[j + 1], xtol=1e-16, rtol=8.9e-16)
            if g[j] < 0.0 and g[j + 1] < 0.0 and slope[j] > 0.0 > slope[j + 1]:
                top = brentq(rate, times[j], times[j + 1], xtol=1e-16, rtol=8.9e-16)
                if value(top) > 1e-15:
                    return brentq(value, times[j], top, xtol=1e-16, rtol=8.9e-16)
        return None

    def _event(self, hit, u, v):
        if hit in self.resting:
            self.resting = tuple(k for k in self.resting if k != hit)
            return u, v
        size = max(1.0, np.abs(u).max(), np.abs(v).max())
        self.size = max(self.size, size)
        touching = {k for k in range(len(self.gaps)) if self._at_stop(k, u)} | {hit}
        touching |= set(self.resting)
        several = False
        for _ in range(10_000):
            speeds = self.rows @ v
            closing = [k for k in sorted(touching) if speeds[k] > ROUNDING * size]
            if not closing:
                break
            group = self._group(closing[0], touching, speeds, size)
            several = several or len(group) > 1
            asked = np.array([(1.0 + self.e[k]) * max(speeds[k], 0.0) for k in group])
            p = np.linalg.solve(self.gram[np.ix_(group, group)], asked)
            if p.min() < 0.0:
                k, group = closing[0], [closing[0]]
                p = np.array([(1.0 + self.e[k]) * speeds[k] / self.gram[k, k]])
                self.coupled += 1
            before = v
            v = v - self.flexible[:, group] @ p
            self.impulse[group] += p
            self.lost[group] += 0.5 * p * (self.rows[group] @ (before + v))
            for k in group:
                if speeds[k] > ROUNDING * size and self.apart[k]:
                    self.counts[k] += 1
                    self.together[k] += several
                self.apart[k] = False
        return self._rest(touching, u, v, size)

    def _group(self, k, touching, speeds, size):
        group, more = set(), {k}
        while more:
            group |= more
            more = {
                j
                for j in touching - group
                if speeds[j] >= -ROUNDING * size
                and any(abs(self.gram[i, j]) > 1e-14 for i in group)
            }
        return sorted(group)

    def _rest(self, touching, u, v, size):
        forcing = self.amplitude * sum(
            share * math.sin(order * self.omega * self.t + phase)
            for order, share, phase in self.harmonics
        )
        speeds = self.rows @ v
        free = np.linalg.solve(
            self.mass, forcing * self.push - self.damping @ v - self.stiffness @ u
        )
        held = [k for k in self.resting if abs(speeds[k]) <= 1e-12 * size]
        pulled = free
        if held:
            p = np.linalg.solve(self.gram[np.ix_(held, held)], self.rows[held] @ free)
            pulled = free - self.flexible[:, held] @ p
        ways = self.rows @ pulled
        slow = [
            k
            for k in sorted(touching)
            if abs(speeds[k]) <= 1e-12 * size
            or (speeds[k] < 0.0 < ways[k] and speeds[k] ** 2 <= 2.0 * ROUNDING * size * ways[k])
        ]
        for count in range(len(slow), -1, -1):
            for some in itertools.combinations(slow, count):
                picked = list(some)
                gram = self.gram[np.ix_(picked, picked)]
                if picked and np.linalg.matrix_rank(gram, 1e-10) < count:
                    continue
                p = np.linalg.solve(gram, self.rows[picked] @ free) if picked else np.zeros(0)
                after = self.rows @ (free - self.flexible[:, picked] @ p)
                others = [k for k in slow if k not in some]
                if (p >= -ROUNDING).all() and (after[others] <= 0.0).all():
                    for k in picked:
                        if speeds[k] < -1e-12 * size and self.e[k] < 1.0:
                            self.closed[k] += 2 * speeds[k] / (ways[k] * (1.0 - self.e[k]))
                    if picked:
                        v = v - self.flexible[:, picked] @ np.linalg.solve(gram, speeds[picked])
                    self.resting = some
                    return u, v
        raise ArithmeticError("no set of resting stops")


def random_case(seed: int, most: int = 6):
    """Return arguments of `Rigid`: 1 to `most` masses, 1 to 4 stops, no two along each other."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, most + 1)), int(rng.integers(1, 5))
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    if rng.random() < 0.3:
        r = rng.normal(size=(n, n)) * 0.15
        mass = mass + r @ r.T
    r = rng.normal(size=(n, n))
    stiffness = r @ r.T / n + np.diag(rng.uniform(0.3, 2.0, n))
    damping = mass * rng.uniform(0.02, 0.2) + stiffness * rng.uniform(0.0, 0.1)
    rows: list[np.ndarray] = []
    gaps, e = [], []
    for _ in range(m):
        kind, i, d = rng.random(), int(rng.integers(n)), np.zeros(n)
        if kind < 0.5 or n == 1:
            d[i] = rng.choice([-1.0, 1.0])
        elif kind < 0.8:
            d[i], d[(i + 1) % n] = 1.0, -1.0
        else:
            d = rng.normal(size=n)
        if any(np.linalg.matrix_rank(np.array([d, o]), 1e-6) < 2 and d @ o > 0 for o in rows):
            continue
        listed = [0.1, 0.3, 0.6] if 0.0 in gaps else [0.0, 0.1, 0.3, 0.6]
        gap = rng.choice(listed, p=None if 0.0 in gaps else [0.15, 0.35, 0.3, 0.2])
        rows.append(d)
        gaps.append(float(gap * (1.0 if rng.random() < 0.5 else rng.uniform(0.5, 1.5))))
        e.append(float(rng.choice([0.0, 1.0, rng.random()], p=[0.2, 0.1, 0.7])))
    push, omega, amplitude = -mass.sum(axis=1), rng.uniform(0.4, 2.5), rng.uniform(0.2, 1.5)
    harmonics = ((1, 1.0, 0.0),) if rng.random() < 0.6 else ((1, 1.0, 0.3), (2, 0.5, 1.0))
    matrices = (mass, damping, stiffness, np.array(rows), np.array(gaps), np.array(e))
    return *matrices, push, omega, amplitude, harmonics
