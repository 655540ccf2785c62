"""Harmonic motions that are linear from event to event, by exponentials in extended precision.

In each mode y = (u, u', p, 1, t, cos, sin) obeys y' = A y, so that y(t + h) = exp(A h) y, which a
Taylor series gives for small h; p are the plastic elongations, t the time in the period (of
belts, whose p is that less their way so far). A mode ends
where a guard g = r . y rises through 0. Steps are some 1/20 of the fastest period; in each
extremes of g are found as well, by the sign of g', so that two roots in a step are not missed.
All in `np.longdouble`: errors are some 1e-18 times what the motion itself makes of them. Nothing
is taken from the package.

What acts: springs by a table (b, d, F), also elastic stops; stops with dashpots, which push where
x > 0 and k x + c x' > 0, or with tension where x > 0; rigid stops; sliders (b, k, F, F_k, speed of
a belt).
"""

import argparse
import math
from copy import copy
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

REAL = np.longdouble
TERMS = 28
BLOCK = 32
STEP = 0.3
"""Steps times the norm of A, about: a twentieth of the fastest period."""
CLOSE = REAL(1e-16)
"""Guards are passed where they rise beyond it; one that has just been passed is at 0."""
SLOW = 1e-9
"""Speed after an impact of a stop with which it rests: it would rise by some 1e-18."""
PI = REAL("3.14159265358979323846264338327950288")
OPEN, PUSHING, LET_GO, RESTING = range(4)


def asked(told, kinds):
    """Return the kinds of cases that a command is asked for, and their seeds."""
    parser = argparse.ArgumentParser(description=told)
    parser.add_argument("kinds", nargs="*", default=kinds)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    return given.kinds, range(given.first, given.first + given.cases)


def real(values):
    """Return what doubles are, in extended precision."""
    return np.asarray(values, dtype=float).astype(REAL)


def inverse_of(matrix):
    """Return the inverse by Newton's method."""
    found = np.linalg.inv(matrix.astype(float)).astype(REAL)
    for _ in range(3):
        found = found @ (2 * np.eye(len(matrix), dtype=REAL) - matrix @ found)
    return found


@dataclass
class Law:
    """A structure: M u'' + C u' + K u + what acts = push A sin(Omega t), all in doubles."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    push: np.ndarray
    springs: list = field(default_factory=list)
    """(b, d, F): force F(b . u), linear between its points and beyond."""
    stops: list = field(default_factory=list)
    """(b, gap, k, c, tension), or (b, gap, inf, restitution, False)."""
    sliders: list = field(default_factory=list)
    """(b, k, F, F_k, speed)."""


class Motion:
    """A motion of a `Law` from (u, u', p) at phase 0."""

    def __init__(self, law, amplitude, omega, state):
        self.law, n, m = law, len(law.mass), len(law.sliders)
        self.n, self.m, self.size = n, m, 2 * n + m + 4
        self.amplitude, self.omega = REAL(amplitude), REAL(omega)
        self.period = 2 * PI / self.omega
        self.inverse = inverse_of(real(law.mass))
        self.y = np.zeros(self.size, REAL)
        self.y[: 2 * n + m] = real(state)
        self.y[2 * n + m], self.y[2 * n + m + 2] = 1, 1
        self.t, self.made, self.events = REAL(0), {}, 0
        self.speeds, self.ways = real([slider[4] for slider in law.sliders]), REAL(0)
        self.springs = [self._part(*spring) for spring in law.springs]
        self.stops = [self._begin(*stop) for stop in law.stops]
        self.sliders = [self._slips(j) for j in range(m)]

    def row(self, of_u=None, of_v=None, one=0.0, **others):
        """Return a row of y."""
        n, row = self.n, np.zeros(self.size, REAL)
        row[:n] = 0 if of_u is None else of_u
        row[n : 2 * n] = 0 if of_v is None else of_v
        row[2 * n + self.m] = one
        row[2 * n + self.m + 1] = others.get("t", 0)
        if "p" in others:
            row[2 * n + others["p"][0]] = others["p"][1]
        return row

    def _part(self, b, d, _):
        """Return the part of a table; at a point that to which it moves."""
        x, v = real(b) @ self.y[: self.n], real(b) @ self.y[self.n : 2 * self.n]
        side = "left" if v < 0 else "right"
        return int(np.clip(np.searchsorted(real(d), x, side) - 1, 0, len(d) - 2))

    def _begin(self, b, gap, k, c, tension):
        x = real(b) @ self.y[: self.n] - REAL(gap)
        v = real(b) @ self.y[self.n : 2 * self.n]
        if k == math.inf:
            return RESTING if abs(x) < 1e-13 and abs(v) < 1e-13 else OPEN
        if not (x > 0 or (x == 0 and v > 0)):
            return OPEN
        return PUSHING if tension or k * x + c * v > 0 else LET_GO

    def _slips(self, j):
        """Return 1 or -1 where a slider slips: p tells it, to rounding."""
        b, k, _, kinetic, speed = self.law.sliders[j]
        force = REAL(k) * (real(b) @ self.y[: self.n] - self.y[2 * self.n + j])
        v = real(b) @ self.y[self.n : 2 * self.n] - REAL(speed)
        at = abs(abs(force) - kinetic) < 1e-12 * kinetic or abs(force) > self.law.sliders[j][2]
        return int(np.sign(force)) if at and force * v > 0 else 0

    def _acceleration(self):
        """Return u'' as rows of y, (n, size), and rows of the resting stops among them."""
        law, n, m = self.law, self.n, self.m
        force = np.zeros((n, self.size), REAL)
        force[:, :n], force[:, n : 2 * n] = -real(law.stiffness), -real(law.damping)
        force[:, 2 * n + m + 3] = real(law.push) * self.amplitude
        for (b, d, f), i in zip(law.springs, self.springs, strict=True):
            b, d, f = real(b), real(d), real(f)
            slope = (f[i + 1] - f[i]) / (d[i + 1] - d[i])
            force -= np.outer(b, self.row(slope * b, one=f[i] - slope * d[i]))
        for (b, gap, k, c, _), mode in zip(law.stops, self.stops, strict=True):
            if mode == PUSHING:
                b, k = real(b), REAL(k)
                force -= np.outer(b, self.row(k * b, REAL(c) * b, -k * REAL(gap)))
        for j, (b, k, _, kinetic, speed) in enumerate(law.sliders):
            b, k, way = real(b), REAL(k), self.sliders[j]
            elastic = self.row(k * b, t=-k * REAL(speed), p=(j, -k))
            force -= np.outer(b, self.row(one=way * REAL(kinetic)) if way else elastic)
        rate = self.inverse @ force
        resting = [i for i, mode in enumerate(self.stops) if mode == RESTING]
        reactions = {}
        if resting:
            rows = np.array([real(law.stops[i][0]) for i in resting])
            pull = inverse_of(rows @ self.inverse @ rows.T) @ rows @ rate
            rate = rate - self.inverse @ rows.T @ pull
            reactions = dict(zip(resting, pull, strict=True))
        return rate, reactions

    def _guards(self, reactions):
        """Return what ends the mode: rows and what then is done."""
        listed = []
        for j, (b, d, _) in enumerate(self.law.springs):
            b, d, i = real(b), real(d), self.springs[j]
            if i < len(d) - 2:
                listed.append((self.row(b, one=-d[i + 1]), "springs", j, i + 1))
            if i > 0:
                listed.append((self.row(-b, one=d[i]), "springs", j, i - 1))
        for j, (b, gap, k, c, tension) in enumerate(self.law.stops):
            b, gap, mode = real(b), REAL(gap), self.stops[j]
            if mode == RESTING:
                listed.append((-reactions[j], "stops", j, OPEN))
            elif mode == OPEN:
                way = "hits" if k == math.inf else "stops"
                listed.append((self.row(b, one=-gap), way, j, PUSHING))
            else:
                listed.append((self.row(-b, one=gap), "stops", j, OPEN))
                push = self.row(REAL(k) * b, REAL(c) * b, -REAL(k) * gap)
                if not tension and c > 0:
                    way = -1 if mode == PUSHING else 1
                    listed.append((way * push, "stops", j, LET_GO if way < 0 else PUSHING))
        for j, (b, k, strength, _, speed) in enumerate(self.law.sliders):
            b, k, speed, way = real(b), REAL(k), REAL(speed), self.sliders[j]
            if way:
                listed.append((self.row(of_v=-way * b, one=way * speed), "sticks", j, 0))
                continue
            for s in (1, -1):
                row = s * self.row(k * b, t=-k * speed, p=(j, -k))
                listed.append((row + self.row(one=-REAL(strength)), "sliders", j, s))
        return listed

    def _mode(self):
        """Return A, the step, its powers, guards, their rows and those of their rates."""
        key = (*self.springs, -1, *self.stops, -1, *self.sliders)
        if key not in self.made:
            n, m = self.n, self.m
            a = np.zeros((self.size, self.size), REAL)
            a[:n, n : 2 * n] = np.eye(n, dtype=REAL)
            a[n : 2 * n], reactions = self._acceleration()
            a[2 * n + m + 1, 2 * n + m] = 1
            a[-2, -1], a[-1, -2] = -self.omega, self.omega
            pace = math.sqrt(float(np.abs(a[n : 2 * n, :n]).sum(1).max()))
            pace += float(np.abs(a[n : 2 * n, n : 2 * n]).sum(1).max()) + float(self.omega)
            h = self.period / math.ceil(float(self.period) * pace / STEP)
            turn = np.eye(self.size, dtype=REAL)
            for k in range(TERMS, 0, -1):
                turn = np.eye(self.size, dtype=REAL) + a @ turn * (h / k)
            powers = [np.eye(self.size, dtype=REAL)]
            for _ in range(BLOCK):
                powers.append(turn @ powers[-1])
            guards = self._guards(reactions)
            rows = np.array([g[0] for g in guards], REAL).reshape(-1, self.size)
            self.made[key] = a, h, np.array(powers), guards, rows, rows @ a
        return self.made[key]

    def over_a_period(self, look=None):
        """Advance by a period; `look(a, y, s, t)` is called with each stretch of length s."""
        n, m = self.n, self.m
        self.t, self.ways = REAL(0), self.ways + self.y[2 * n + m + 1]
        self.y[2 * n : 2 * n + m] += self.speeds * self.y[2 * n + m + 1]
        self.y[2 * n + m + 1 :] = 0, 1, 0
        while self.t < self.period:
            a, h, powers, guards, rows, rates = self._mode()
            whole = int(min(BLOCK, math.floor((self.period - self.t) / h)))
            path = powers[: whole + 1] @ self.y
            values, slopes = path @ rows.T, path @ rates.T
            first = self._first(values, slopes, h)
            taken, last = whole if first < 0 else first, h
            if whole == 0:
                first, last = 0, self.period - self.t
            for i in range(taken):
                if look:
                    look(a, path[i], h, self.t + i * h)
            self.y = path[taken].copy()
            self.t = self.t + taken * h
            if first < 0:
                if self.period - self.t < h * REAL(1e-15):
                    break
                continue
            series = Series(a, self.y)
            s, event = self._within(series, rows, last)
            if look:
                look(a, self.y, s, self.t)
            self.y = series(s)
            self.t = self.period if event < 0 and whole == 0 else self.t + s
            if event >= 0:
                self._pass(*guards[event][1:])
        return self.y[: 2 * n + m]

    def _first(self, values, slopes, h):
        """Return the first step in which a guard may be passed, -1 if there is none."""
        if len(values) < 2 or not values.shape[1]:
            return -1
        top = np.maximum(values[:-1], values[1:])
        turns = (slopes[:-1] > 0) != (slopes[1:] > 0)
        reach = top + np.where(turns, h * np.maximum(abs(slopes[:-1]), abs(slopes[1:])), 0)
        risen = np.flatnonzero(((values[1:] > CLOSE) | (turns & (reach > CLOSE))).any(1))
        return int(risen[0]) if risen.size else -1

    def _within(self, series, rows, h):
        """Return where within h the first guard is passed, and which; h and -1 if none is."""
        best, place = h, -1
        for g, row in enumerate(rows):
            of = series.terms @ row
            slope = of[1:] * np.arange(1, len(of))
            ends = [REAL(0), h]
            if (value(slope, 0) > 0) != (value(slope, h) > 0):
                ends.insert(1, root(slope, REAL(0), h))
            for low, high in pairwise(ends):
                if value(of, high) > CLOSE:
                    at = root(of, low, high) if value(of, low) < 0 else low
                    if place < 0 or at < best:
                        best, place = at, g
                    break
        return best, place

    def _pass(self, what, j, mode):
        self.events += 1
        n = self.n
        u, v = self.y[:n], self.y[n : 2 * n]
        if what in ("springs", "stops", "sliders"):
            getattr(self, what)[j] = mode
        elif what == "hits":
            b, e = real(self.law.stops[j][0]), REAL(self.law.stops[j][3])
            resting = [i for i, kind in enumerate(self.stops) if kind == RESTING]
            if resting:
                raise ArithmeticError("a stop is hit while another rests")
            kick = self.inverse @ b
            speed = b @ v
            v -= (1 + e) * speed / (b @ kick) * kick
            if e * speed < SLOW:
                self.stops[j] = RESTING
                v -= (b @ v) / (b @ kick) * kick
                u -= (b @ u - REAL(self.law.stops[j][1])) / (b @ kick) * kick
        else:
            b, k, _, kinetic, speed = self.law.sliders[j]
            time = self.y[2 * n + self.m + 1]
            slack = self.sliders[j] * REAL(kinetic) / REAL(k)
            self.y[2 * n + j] = real(b) @ u - REAL(speed) * time - slack
            self.sliders[j] = 0

    def fork(self):
        """Return a motion that goes on from here on its own."""
        other = copy(self)
        other.y, other.springs = self.y.copy(), list(self.springs)
        other.stops, other.sliders = list(self.stops), list(self.sliders)
        return other

    @property
    def state(self):
        """(u, u', p), p of what slips as its force tells it."""
        n, m, out = self.n, self.m, self.y[: 2 * self.n + self.m].copy()
        out[2 * n :] -= self.speeds * self.ways
        way = self.speeds * (self.ways + self.y[2 * n + m + 1])
        for j, (b, k, _, kinetic, _) in enumerate(self.law.sliders):
            if self.sliders[j]:
                slack = self.sliders[j] * REAL(kinetic) / REAL(k)
                out[2 * n + j] = real(b) @ out[:n] - way[j] - slack
        return out


class Series:
    """The Taylor series of exp(a s) y."""

    def __init__(self, a, y):
        terms = [y]
        for k in range(1, TERMS + 1):
            terms.append(a @ terms[-1] / k)
        self.terms = np.array(terms)

    def __call__(self, s):
        return value(self.terms, s)


def value(series, s):
    """Return a polynomial, ascending."""
    total = series[-1]
    for term in series[-2::-1]:
        total = total * s + term
    return total


def root(series, low, high):
    """Return the root of a polynomial between two points where it has not the same sign.

    By halving in doubles and Newton's method in extended precision.
    """
    rough = series.astype(float).tolist()
    a, b, rising = float(low), float(high), value(series, high) > value(series, low)
    for _ in range(30):
        middle = 0.5 * (a + b)
        if (value(rough, middle) > 0) == rising:
            b = middle
        else:
            a = middle
    at, slope = REAL(0.5 * (a + b)), series[1:] * np.arange(1, len(series))
    for _ in range(4):
        rate = value(slope, at)
        if rate == 0:
            break
        at = min(max(at - value(series, at) / rate, low), high)
    return at
