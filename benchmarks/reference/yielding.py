"""Motions of structures with sliders and contacts: a reference.

In each mode the motion under a ground acceleration that is linear in time is z' = A z + b + c t, of
which exp gives the solution, where contacts are sharp. Guards are looked at `LOOKS` times in a
sample interval, and their roots found by bisection. Smooth contacts, kappa S(rho x) x, add a force
to that, and scipy's DOP853 integrates from change to change. Nothing is taken from the package.
"""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import expit

LOOKS = 400
TOUCH = 1e-11
"""Guards, in their units, that are passed by less are not: one that has just changed is at 0."""


class Yielding:
    """A structure M u'' + C u' + K u + sliders + contacts = -M r a(t).

    Of rows with limits, (row, c), the first with |row . u| > c ends the motion.
    """

    def __init__(self, mass, stiffness, damping, contacts, sliders, limits=()):
        n = self.n = len(mass)
        self.matrices = np.linalg.inv(mass), stiffness, damping
        self.rows = np.array([s.direction for s in sliders], float).reshape(-1, n)
        self.spring = np.array([s.stiffness for s in sliders])
        self.strength = np.array([s.strength for s in sliders])
        self.reach = np.array([c.direction for c in contacts], float).reshape(-1, n)
        self.law = [(c.gap, c.stiffness) for c in contacts]
        self.slip = np.zeros(len(sliders), int)
        self.closed = np.zeros(len(contacts), bool)
        self.plastic, self.path = np.zeros(len(sliders)), np.zeros(len(sliders))
        self.excursions = np.zeros(len(sliders), int)
        self.limits, self.collapse = limits, np.nan
        self.elongation, self.dissipated = np.zeros(len(sliders)), 0.0

    def _generator(self, a0, slope):
        """Return the matrix of (u, u', 1, t)."""
        inverse, stiffness, damping = self.matrices
        n, k, load = self.n, stiffness.copy(), np.zeros(self.n)
        for b, spring, strength, s, p in zip(
            self.rows, self.spring, self.strength, self.slip, self.plastic, strict=True
        ):
            k = k if s else k + spring * np.outer(b, b)
            load -= b * (s * strength if s else -spring * p)
        for d, (gap, kappa), closed in zip(self.reach, self.law, self.closed, strict=True):
            if closed:
                k, load = k + kappa * np.outer(d, d), load + d * kappa * gap
        a = np.zeros((2 * n + 2, 2 * n + 2))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = -inverse @ k, -inverse @ damping
        a[n : 2 * n, 2 * n] = inverse @ load - a0
        a[n : 2 * n, 2 * n + 1] = -slope
        a[2 * n + 1, 2 * n] = 1.0
        return a

    def _guards(self):
        """Return the guards of the present mode: rows of (u, u', 1), and what changes."""
        n, found = self.n, []
        for j, b in enumerate(self.rows):
            delta = self.strength[j] / self.spring[j]
            if self.slip[j]:
                found.append((np.r_[0 * b, -self.slip[j] * b / delta, 0.0], "stick", j, 0))
                continue
            for s in (1, -1):
                row = np.r_[s * b / delta, 0 * b, -1.0 - s * self.plastic[j] / delta]
                found.append((row, "slip", j, s))
        for k, d in enumerate(self.reach):
            s = -1 if self.closed[k] else 1
            found.append((np.r_[s * d, np.zeros(n), -s * self.law[k][0]], "contact", k, 0))
        for row, c in self.limits:
            found += [
                (np.r_[s * np.array(row) / c, np.zeros(n), -1.0], "end", 0, 0) for s in (1, -1)
            ]
        return found

    def _take(self, j, u):
        p = self.rows[j] @ u - self.slip[j] * self.strength[j] / self.spring[j]
        self.path[j] += abs(p - self.plastic[j])
        self.excursions[j] += abs(p - self.plastic[j]) > 1e-10
        self.plastic[j], self.slip[j] = p, 0

    def run(self, samples, dt, state=None):
        """Return (u, u') at the end; what sliders have done is in the attributes."""
        n = self.n
        z = np.zeros(2 * n) if state is None else np.array(state, float)
        for number, (first, second) in enumerate(pairwise(samples)):
            t, slope = 0.0, (second - first) / dt
            while t < dt:
                a, guards = self._generator(first + slope * t, slope), self._guards()
                x = np.r_[z, 1.0, 0.0]
                looks = int(np.ceil(LOOKS * (dt - t) / dt))
                step = (dt - t) / looks
                turn = expm(a * step)
                rows = np.array([g[0] for g in guards]).reshape(-1, 2 * n + 1)
                when, place = dt - t, -1
                for look in range(looks):
                    y = turn @ x
                    passed = np.flatnonzero(rows @ y[:-1] > TOUCH)
                    for g in passed:

                        def value(s, row=rows[g], x=x, a=a):
                            return row @ (expm(a * s) @ x)[:-1]

                        low = value(0.0)
                        root = brentq(value, 0.0, step, xtol=1e-16, rtol=1e-15) if low < 0 else 0.0
                        if look * step + root < when:
                            when, place = look * step + root, g
                    if place >= 0:
                        break
                    x = y
                    self.elongation = np.maximum(self.elongation, np.abs(self.rows @ x[:n]))
                z = (expm(a * when) @ np.r_[z, 1.0, 0.0])[: 2 * n]
                self.elongation = np.maximum(self.elongation, np.abs(self.rows @ z[:n]))
                t = dt if place < 0 else t + when
                if place >= 0:
                    _, what, k, s = guards[place]
                    if what == "slip":
                        self.slip[k] = s
                    elif what == "end":
                        self.collapse = number * dt + t
                        break
                    elif what == "stick":
                        self._take(k, z[:n])
                    else:
                        self.closed[k] = not self.closed[k]
            if self.collapse >= 0.0:
                break
        for j in np.flatnonzero(self.slip):
            self._take(j, z[:n])
        return z


class SmoothYielding(Yielding):
    """The same with contacts of a finite sharpness rho, without energies."""

    NEAR = 1e-10
    """Guards, in their units, that rise are passed at the instant of another."""
    LOOKS, MISSED = 100, 1e-6

    def __init__(self, sharpness, *given):
        super().__init__(*given)
        self.sharpness = sharpness

    def _guards(self):
        return [one for one in super()._guards() if one[1] != "contact"]

    def _rates(self, t, z, a):
        """Return z', with the contacts."""
        found = (a @ np.r_[z, 1.0, t])[:-2]
        for d, (gap, kappa) in zip(self.reach, self.law, strict=True):
            x = d @ z[: self.n] - gap
            force = kappa * expit(self.sharpness * x) * x
            found[self.n :] -= self.matrices[0] @ d * force
        return found

    def _follow(self, t, dt, z, a):
        """Return when the motion first passes a guard, and the state; change what passes one."""
        guards = self._guards()

        def event(row):
            def guard(_t, z, _a):
                return row[:-1] @ z + row[-1]

            guard.terminal, guard.direction = True, 1.0
            return guard

        events = [event(row) for row, *_ in guards]
        more = {"args": (a,), "events": events, "max_step": dt / self.LOOKS}
        done = solve_ivp(self._rates, (t, dt), z, "DOP853", rtol=1e-13, atol=1e-14, **more)
        t, z = done.t[-1], done.y[:, -1]
        elongation = np.abs(self.rows @ done.y[: self.n]).max(axis=1)
        self.elongation = np.maximum(self.elongation, elongation)
        rates = self._rates(t, z, a)
        for (row, what, j, s), times in zip(guards, done.t_events, strict=True):
            at = row[:-1] @ z + row[-1]
            if at > self.MISSED:
                raise ArithmeticError(f"missed: {what} of {j} at {t}")
            if len(times) or (t < dt and at > -self.NEAR and row[:-1] @ rates > 0.0):
                if what == "end":
                    self.collapse = t
                elif what == "stick":
                    self._take(j, z[: self.n])
                else:
                    self.slip[j] = s
        return t, z

    def run(self, samples, dt, state=None):
        """Return (u, u') at the end; what sliders have done is in the attributes."""
        z = np.zeros(2 * self.n) if state is None else np.array(state, float)
        for number, (first, second) in enumerate(pairwise(samples)):
            t = 0.0
            while t < dt and np.isnan(self.collapse):
                t, z = self._follow(t, dt, z, self._generator(first, (second - first) / dt))
            if not np.isnan(self.collapse):
                self.collapse += number * dt
                break
        for j in np.flatnonzero(self.slip):
            self._take(j, z[: self.n])
        return z
