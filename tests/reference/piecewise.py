"""One mass between two sharp stops: its piecewise closed solution in extended precision.

    u'' + 2 zeta u' + u + beta max(u - g, 0) - beta max(-u - l, 0) = -A sin(Omega tau)

In each of its three states the motion is a particular solution plus an exponential; the times of
the contact changes are roots of that, found by steps too short for two of them and by Newton's
method.
"""

import math

import mpmath

mp = mpmath.mp
STEPS = 400
"""Looks for a contact change in a period of the fastest free motion."""


class OneMass:
    """The oscillator; all values are numbers of the working precision."""

    def __init__(self, beta, zeta, gap, gap_left, amplitude, omega):
        self.beta, self.zeta = mp.mpf(beta), mp.mpf(zeta)
        self.stops = mp.mpf(gap), mp.mpf(gap_left)
        self.amplitude, self.omega = mp.mpf(amplitude), mp.mpf(omega)
        self.n_changes = 0

    def _side(self, u, v):
        """Tell which stop touches: 1 the right one, -1 the left one, 0 none."""
        right, left = self.stops
        if u > right or (u == right and v > 0):
            return 1
        return -1 if -u > left or (-u == left and v < 0) else 0

    def _motion(self, side, tau, u, v):
        """Give the motion from a state on as a function of the time since, with its speed."""
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

        return at, float(mp.sqrt(stiffness))

    def period(self, u, v, end):
        """Integrate from tau = 0 to `end`."""
        tau, side = mp.mpf(0), self._side(u, v)
        while tau < end:
            at, fastest = self._motion(side, tau, u, v)
            step = mp.mpf(2 * math.pi / fastest / STEPS)
            left, after = mp.mpf(0), None
            while tau + left < end:
                right = min(left + step, end - tau)
                x, w = at(right)
                if self._side(x, w) != side:
                    after = self._change(at, side, left, right)
                    break
                left = right
            if after is None:
                return at(end - tau)
            time, side = after
            u, v = at(time)
            tau += time
            self.n_changes += 1
        return u, v

    def _change(self, at, side, left, right):
        """Find the time at which the side changes between two times, and the new side."""
        for _ in range(60):
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


def one_mass_points(structure, amplitude, omega, state, n_periods, digits=30):
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
