"""Motions with rigid stops, independently of the program: closed forms, a dense search, brentq.

Between impacts the state, with the harmonics as states of their own, is exp(B t) of what it was;
stops that rest leave the coordinates u = u_0 + Z q, D Z = 0. Which do is found by trying all sets.
"""

import itertools
import math
from functools import cache

import numpy as np
from scipy.linalg import expm, null_space
from scipy.optimize import brentq

ROUNDING = 2.0**-46
LOWEST = 2.0**-72
"""Height of hops with e < 1, over the size of a state, that are followed."""
NEAR = 64.0
HALVES = np.arange(5.25, 40.0, 0.25)
NODES = 64
"""Of a search, over the period of the fastest motion: a sixth of it."""
ORDER = 30


def _root(terms, a, b):
    """Return where a polynomial, from its lowest term up, rises or falls through 0."""
    terms = terms[::-1].tolist()

    def value(t):
        found = 0.0
        for term in terms:
            found = found * t + term
        return found

    if value(a) == 0.0 or (value(a) < 0.0) == (value(b) < 0.0):
        return a if abs(value(a)) < abs(value(b)) else b  # rounding of the other node's series
    return brentq(value, a, b, xtol=1e-300, rtol=8.9e-16)


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
    chance : ndarray, shape (m,)
        Impacts and hops within `NEAR` of rounding, of which it is chance whether they count.
    alike : bool
        Whether several closed at once of which one could not open alone: no law tells whose e.
    beside : int
        Impacts of which another, that it pushes, is at its stop and does not rest.
    """

    at_stop = 5e-16
    """Distance, over the size of displacements, below which a stop is reached."""

    def __init__(self, mass, damping, stiffness, rows, gaps, e, push, omega, amplitude, harmonics):
        self.mass, self.damping, self.stiffness = mass, damping, stiffness
        self.rows, self.gaps, self.e = rows, gaps, e
        self.flexible = np.linalg.solve(mass, rows.T)  # M^-1 D^T
        self.gram = rows @ self.flexible
        self.push, self.omega, self.harmonics = push, omega, harmonics
        self.amplitude, self.n = amplitude, len(mass)
        self.counts, self.t, self.resting = np.zeros(len(gaps)), 0.0, ()
        self.impulse, self.lost, self.closed, self.together = np.zeros((4, len(gaps)))
        self.apart, self.beside, self.size = np.ones(len(gaps), bool), 0, 0.0
        self.chance, self.depth = np.zeros(len(gaps)), np.full(len(gaps), math.inf)
        self.alike = False
        self.begun: set[int] = set()  # at their stops where a flight begins

    @cache  # noqa: B019
    def _linear(self, resting):
        """Return the motion of a set that rests: with z = (q, q', forcing, 1), z' = B z.

        The map from q to u, the step between nodes, exp(B t) at these, B^k / k!, and the rows of z,
        times these, of the distances of open stops and of minus the reactions, and whose they are.
        """
        n, h, m = self.n, len(self.harmonics), len(self.gaps)
        picked = self.rows[list(resting)]
        basis = null_space(picked) if resting else np.eye(n)
        origin = np.linalg.lstsq(picked, self.gaps[list(resting)])[0] if resting else np.zeros(n)
        r = basis.shape[1]
        size = 2 * r + 2 * h + 1
        forces = np.zeros((n, size))  # but reactions
        forces[:, :r], forces[:, r : 2 * r] = -self.stiffness @ basis, -self.damping @ basis
        forces[:, -1] = -self.stiffness @ origin
        b = np.zeros((size, size))
        for k, (order, share, _) in enumerate(self.harmonics):
            at, w = 2 * r + 2 * k, order * self.omega
            forces[:, at] = self.amplitude * share * self.push
            b[at, at + 1], b[at + 1, at] = w, -w
        b[:r, r : 2 * r] = np.eye(r)
        b[r : 2 * r] = np.linalg.solve(basis.T @ self.mass @ basis, basis.T @ forces)
        step = math.pi / 3.0 / max(np.abs(np.linalg.eigvals(b)).max(), self.omega) / 8.0
        whole, nodes, powers = expm(b * step), [np.eye(size)], [np.eye(size)]
        for _ in range(NODES):
            nodes.append(nodes[-1] @ whole)
        for k in range(1, ORDER):
            powers.append(powers[-1] @ b / k)
        order = [k for k in range(m) if k not in resting]
        rows = np.zeros((m, size))
        rows[: len(order), :r] = self.rows[order] @ basis
        rows[: len(order), -1] = self.rows[order] @ origin - self.gaps[order]
        if resting:
            gram = self.gram[np.ix_(resting, resting)]
            free = picked @ np.linalg.solve(self.mass, forces)
            rows[len(order) :] = -np.linalg.solve(gram, free)
        series = np.array([rows @ power for power in powers])
        return basis, origin, step, np.array(nodes), np.array(powers), series, [*order, *resting]

    def _augmented(self, u, v):
        basis, origin, *_ = self._linear(self.resting)
        angles = [order * self.omega * self.t + phase for order, _, phase in self.harmonics]
        forcing = np.array([(math.sin(a), math.cos(a)) for a in angles]).ravel()
        return np.concatenate((basis.T @ (u - origin), basis.T @ v, forcing, [1.0]))

    def advance(self, u, v, end):
        """Advance (u, v) to the time `end`."""
        steps = 0
        touching = {k for k in range(len(self.gaps)) if self._at_stop(k, u)} - set(self.resting)
        if self.t == 0.0 and touching:
            self.begun = touching
            u, v = self._rest(touching, u, v, max(1.0, np.abs(u).max(), np.abs(v).max()))
        while self.t < end:
            steps += 1
            if steps > 20_000:
                raise ArithmeticError("too many events")
            u, v, hit = self._flight(u, v, end)
            if hit is not None:
                u, v = self._event(hit, u, v)
        return u, v

    def _flight(self, u, v, end):
        """Return the state at the first event, or at the end, and the stop."""
        basis, origin, step, nodes, powers, series, order = self._linear(self.resting)
        states, r = nodes @ self._augmented(u, v), basis.shape[1]
        terms = series @ states.T  # of each row in powers of the time from each node
        first, hit = min(step * NODES, end - self.t), None
        for j, k in enumerate(order):
            starts = k not in self.resting and k in self.begun
            t = self._first(terms[:, j], step, starts)
            if t is not None and t < first:
                first, hit = t, k
        past = self.t + first if hit is not None or first < end - self.t else end
        for k in self.resting:
            self.closed[k] += first
        middle, place = int(0.5 * first / step), min(int(first / step), NODES)
        near = np.polyval(terms[::-1, :, middle], 0.5 * first - step * middle)
        for j, k in enumerate(order[: len(order) - len(self.resting)]):
            lowest = min(terms[0, j, : place + 1].min(), near[j])
            self.apart[k] |= lowest < -ROUNDING * max(self.size, self.gaps[k])
            self.depth[k] = max(self.depth[k], -lowest)
        self.t, self.begun = past, set()
        z = (first - step * place) ** np.arange(ORDER) @ (powers @ states[place])
        return origin + basis @ z[:r], basis @ z[r : 2 * r], hit

    def _at_stop(self, k, u):
        return abs(self.rows[k] @ u - self.gaps[k]) <= self.at_stop * max(1.0, np.abs(u).max())

    def _first(self, terms, step, starts):
        """Return when a row first rises through 0, None if it does not."""
        g, slope = terms[0], terms[1]
        after_bounce = starts and slope[0] <= 0.0
        if after_bounce:  # x / t by its series about the start, whatever rounding has made of x
            # it may land soon, and be let go again
            grid = np.unique([*np.linspace(0.0, 4 * step, 33), *4 * step * 2.0**-HALVES])
            values = np.polyval(terms[:0:-1, 0], grid)
            up = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
            if up.size:
                a, c = grid[up[0]], grid[up[0] + 1]
                if a == 0.0:
                    while np.polyval(terms[:0:-1, 0], 0.5 * c) >= 0.0:
                        c *= 0.5
                    a = 0.5 * c
                return _root(terms[1:, 0], a, c)
        elif not starts and g[0] >= -ROUNDING and g[1] > max(g[0], ROUNDING):  # from rest, say
            return 0.0
        begun = 4 if after_bounce else 0
        up = (g[:-1] < 0.0) & (g[1:] >= 0.0)
        top = (g[:-1] < 0.0) & (g[1:] < 0.0) & (slope[:-1] > 0.0) & (slope[1:] < 0.0)
        for j in begun + np.flatnonzero(up[begun:] | top[begun:]):
            end = step
            if top[j]:
                end = _root(terms[1:, j] * np.arange(1, ORDER), 0.0, step)
                if np.polyval(terms[::-1, j], end) <= 1e-15:
                    continue
            return step * j + _root(terms[:, j], 0.0, end)
        return None

    def _event(self, hit, u, v):
        if hit in self.resting:
            self.resting, self.begun = tuple(k for k in self.resting if k != hit), {hit}
            return u, v
        u = u - self.flexible[:, hit] * (self.rows[hit] @ u - self.gaps[hit]) / self.gram[hit, hit]
        size = max(1.0, np.abs(u).max(), np.abs(v).max())
        self.size = max(self.size, size)
        touching = {k for k in range(len(self.gaps)) if self._at_stop(k, u)} | {hit}
        touching |= set(self.resting)
        several, moving = False, touching - set(self.resting) - {hit}
        self.beside += any(abs(self.gram[hit, k]) > 1e-14 for k in moving)
        for _ in range(10_000):
            speeds = self.rows @ v
            closing = [k for k in sorted(touching) if speeds[k] > ROUNDING * size]
            if not closing:
                break
            group = self._group(closing[0], touching, speeds, size)
            several = several or len(group) > 1
            self.alike |= len(group) > np.linalg.matrix_rank(self.gram[np.ix_(group, group)], 1e-10)
            asked = np.array([(1.0 + self.e[k]) * max(speeds[k], 0.0) for k in group])
            p = np.linalg.lstsq(self.gram[np.ix_(group, group)], asked)[0]  # some may be parallel
            if p.min() < 0.0:
                k, group = closing[0], [closing[0]]
                p = np.array([(1.0 + self.e[k]) * speeds[k] / self.gram[k, k]])
            before = v
            v = v - self.flexible[:, group] @ p
            self.impulse[group] += p
            self.lost[group] += 0.5 * p * (self.rows[group] @ (before + v))
            for k in group:
                if speeds[k] > ROUNDING * size and self.apart[k]:
                    self.counts[k] += 1
                    self.together[k] += several
                if speeds[k] > ROUNDING / NEAR * size and self.depth[k] > ROUNDING / NEAR * size:
                    self.chance[k] += min(speeds[k], self.depth[k]) < ROUNDING * NEAR * size
                self.apart[k], self.depth[k] = False, 0.0
            u, v = self._rest(touching, u, v, size)
        self.begun = touching
        return self._rest(touching, u, v, size)

    def _group(self, k, touching, speeds, size):
        group, more = set(), {k}
        while more:
            group |= more
            more = {
                j
                for j in touching - group
                if (speeds[j] > ROUNDING * size or j in self.resting)
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
        still, lowest = 1e-12 * size, np.where(self.e < 1.0, LOWEST, ROUNDING)
        if any(speeds[k] > ROUNDING * size for k in touching):
            still, lowest = 1e-16 * size, 0.0 * lowest  # others close now, and may push it
        slow = [
            k
            for k in sorted(touching)
            if abs(speeds[k]) <= still
            or (speeds[k] < 0.0 < ways[k] and speeds[k] ** 2 <= 2.0 * lowest[k] * size * ways[k])
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
