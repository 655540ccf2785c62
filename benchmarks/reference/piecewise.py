"""One mass between two sharp stops: its piecewise closed solution in extended precision.

    u'' + 2 zeta u' + u + beta max(u - g, 0) - beta max(-u - l, 0) = -A sin(Omega tau)

In each of its three states the motion is a particular solution plus an exponential; the times of
the contact changes are roots of that, found by steps too short for two of them and by Newton's
method. The steps are looked at in double precision, and again in extended precision where the mass
is within `CLOSE` of a stop, far more than rounding moves it.
"""

import math

import mpmath
import numpy as np

mp = mpmath.mp
STEPS = 150
"""Looks for a contact change in a period of the fastest free motion."""
CLOSE = 1e-9
HALVINGS = 20
"""Of a step: Newton's method starts from 8 digits, and has 64 three steps later."""


class OneMass:
    """The oscillator; all values are numbers of the working precision."""

    def __init__(self, beta, zeta, gap, gap_left, amplitude, omega):
        self.beta, self.zeta = mp.mpf(beta), mp.mpf(zeta)
        self.stops = mp.mpf(gap), mp.mpf(gap_left)
        self.amplitude, self.omega = mp.mpf(amplitude), mp.mpf(omega)
        self.n_changes = 0

    def _side(self, u, v):
        """Return which stop is in contact: 1 the right one, -1 the left one, 0 none."""
        right, left = self.stops
        if u > right or (u == right and v > 0):
            return 1
        return -1 if -u > left or (-u == left and v < 0) else 0

    def _motion(self, side, tau, u, v):
        """Return the motion from a state on as a function of the time since.

        In extended precision with its speed; in double precision, of many times, without.
        """
        stiffness = 1 + (self.beta if side else 0)
        rest = (
            self.beta * (self.stops[0] if side > 0 else -self.stops[1]) / stiffness if side else 0
        )
        w, zeta = self.omega, self.zeta
        response = -self.amplitude / mp.mpc(stiffness - w * w, 2 * zeta * w)

        def steady(t):
            turn = response * mp.expj(w * t)
            return rest + turn.imag, (turn * mp.mpc(0, w)).imag

        u0, v0 = steady(tau)
        q, p = u - u0, v - v0
        rate = mp.sqrt(mp.mpc(stiffness - zeta * zeta))

        def at(s):
            decay, c, sn = mp.exp(-zeta * s), mp.cos(rate * s), mp.sin(rate * s) / rate
            us, vs = steady(tau + s)
            x = decay * (q * c + (p + zeta * q) * sn)
            y = decay * (p * c - (stiffness * q + zeta * p) * sn)
            return us + x.real, vs + y.real

        forced, shape = complex(response), complex(rate)
        cosine, sine = complex(q), complex((p + zeta * q) / rate)
        about, phase, decay_rate = float(rest), float(w * tau), float(zeta)

        def roughly(s):
            decay, turn = np.exp(-decay_rate * s), forced * np.exp(1j * (phase + float(w) * s))
            free = cosine * np.cos(shape * s) + sine * np.sin(shape * s)
            return about + turn.imag + decay * free.real

        return at, roughly, float(mp.sqrt(stiffness))

    def period(self, u, v, end):
        """Integrate from tau = 0 to `end`."""
        tau, side = mp.mpf(0), self._side(u, v)
        while tau < end:
            at, roughly, fastest = self._motion(side, tau, u, v)
            step = 2 * math.pi / fastest / STEPS
            times = step * np.arange(math.ceil((end - tau) / step))
            index = self._first_change(at, roughly, side, times)
            if index is not None:
                left, right = times[index - 1], times[index]
            elif self._side(*at(end - tau)) != side:
                left, right = times[-1], end - tau
            else:
                return at(end - tau)
            time, side = self._change(at, side, mp.mpf(left), mp.mpf(right))
            u, v = at(time)
            tau += time
            self.n_changes += 1
        return u, v

    def _first_change(self, at, roughly, side, times):
        """Find the first of the times but 0 at which the side is another; None if there is none."""
        x = roughly(times)
        right, left = map(float, self.stops)
        sides = np.where(x > right, 1, np.where(-x > left, -1, 0))
        unsure = np.minimum(abs(x - right), abs(x + left)) < CLOSE
        for index in 1 + np.flatnonzero(((sides != side) | unsure)[1:]):
            if not unsure[index] or self._side(*at(mp.mpf(times[index]))) != side:
                return index
        return None

    def _change(self, at, side, left, right):
        """Find the time at which the side changes between two times, and the new side."""
        for _ in range(HALVINGS):
            middle = (left + right) / 2
            if self._side(*at(middle)) == side:
                left = middle
            else:
                right = middle
        new = self._side(*at(right))
        touched = side or new
        stop = self.stops[0] if touched > 0 else -self.stops[1]
        time = right
        for _ in range(6):
            x, w = at(time)
            time -= (x - stop) / w
        return time, new


def one_mass_points(structure, amplitude, omega, state, n_periods, digits=45):
    """Stroboscopic points as floats, shape (n_periods, 2), and the number of contact changes."""
    with mpmath.workdps(digits):
        gaps = structure.gap, structure.gap_left
        mass = OneMass(structure.stiffness_ratio, structure.damping_ratio, *gaps, amplitude, omega)
        # T of the double precision problem
        end = mp.mpf(2 * math.pi / omega)
        u, v = (mp.mpf(value) for value in state)
        points = []
        for _ in range(n_periods):
            u, v = mass.period(u, v, end)
            points.append((float(u), float(v)))
        return points, mass.n_changes
