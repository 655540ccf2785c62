"""Orbits of one impact a period of one floor beside a piecewise linear stop, in closed form.

    u'' + 2 zeta u' + u + beta max(u - 1, 0) = -A sin(Omega tau)

With the times t1 < t2 at which the contact closes and opens the motion is a sum of known functions
on [t1, t2] and on [t2, t1 + T]: two free terms each, and A times the forced one. Five of the six
conditions at the ends are linear in the four coefficients and A; what the sixth leaves determines
t1 for a duration t2 - t1 that is given. So the branch is a curve over the duration.
"""

import mpmath as mp
import numpy as np

NEAR, STEP = 0.01, 1e-9


class OneImpact:
    def __init__(self, zeta, beta, omega, digits=30):
        self.zeta, self.beta, self.omega = mp.mpf(zeta), mp.mpf(beta), mp.mpf(omega)
        self.period = 2 * mp.pi / self.omega
        self.digits = digits

    def _terms(self, stiffness, load, t, since):
        """Values and slopes of both free terms, the forced term of A = 1 and the constant."""
        decay = mp.sqrt(stiffness - self.zeta**2)
        s = t - since
        e = mp.exp(-self.zeta * s)
        cos, sin = mp.cos(decay * s), mp.sin(decay * s)
        free = [(e * cos, e * (-self.zeta * cos - decay * sin))]
        free.append((e * sin, e * (-self.zeta * sin + decay * cos)))
        complex_response = -1 / (stiffness - self.omega**2 + 2j * self.zeta * self.omega)
        turn = complex_response * mp.expj(self.omega * t)
        forced = (mp.im(turn), mp.im(1j * self.omega * turn))
        return [*free, forced, (load / stiffness, mp.mpf(0))]

    def _solve(self, t1, duration):
        t2 = t1 + duration
        stiff = 1 + self.beta
        begin = self._terms(stiff, self.beta, t1, t1)
        end = self._terms(stiff, self.beta, t2, t1)
        out = self._terms(mp.mpf(1), mp.mpf(0), t2, t2)
        back = self._terms(mp.mpf(1), mp.mpf(0), t1 + self.period, t2)
        zero = mp.mpf(0)
        # unknown: c1, c2 in contact, d1, d2 free, A
        rows = [
            [begin[0][0], begin[1][0], zero, zero, begin[2][0], 1 - begin[3][0]],
            [end[0][0], end[1][0], zero, zero, end[2][0], 1 - end[3][0]],
            [zero, zero, out[0][0], out[1][0], out[2][0], mp.mpf(1)],
            [zero, zero, back[0][0], back[1][0], back[2][0], mp.mpf(1)],
            [end[0][1], end[1][1], -out[0][1], -out[1][1], end[2][1] - out[2][1], zero],
        ]
        solved = mp.lu_solve(mp.matrix([r[:5] for r in rows]), mp.matrix([r[5] for r in rows]))
        c1, c2, d1, d2, amplitude = solved
        slope_in = c1 * begin[0][1] + c2 * begin[1][1] + amplitude * begin[2][1]
        slope_back = d1 * back[0][1] + d2 * back[1][1] + amplitude * back[2][1]
        return slope_in - slope_back, amplitude, (t2, d1, d2)

    def orbit(self, duration, guess):
        """Return A, the state at phase 0 and t1, from a guess of t1."""
        with mp.workdps(self.digits):
            t1 = mp.findroot(
                lambda t: self._solve(t, mp.mpf(duration))[0], (mp.mpf(guess), mp.mpf(guess) + NEAR)
            )
            _, amplitude, (t2, d1, d2) = self._solve(t1, mp.mpf(duration))
            # the stroboscopic point on the free piece that holds it
            at = self.period * mp.ceil(t2 / self.period)
            terms = self._terms(mp.mpf(1), mp.mpf(0), at, t2)
            u, v = (d1 * terms[0][k] + d2 * terms[1][k] + amplitude * terms[2][k] for k in (0, 1))
            assert at <= t1 + self.period
            return float(amplitude), np.array([float(u), float(v)]), t1

    def fold(self, shortest, longest, guess):
        """Return A at the fold between two durations, from a guess of t1."""
        with mp.workdps(self.digits):

            def amplitude(d):
                pair = mp.mpf(guess), mp.mpf(guess) + NEAR
                t1 = mp.findroot(lambda t: self._solve(t, d)[0], pair)
                return self._solve(t1, d)[1]

            def slope(d):
                return (amplitude(d + STEP) - amplitude(d - STEP)) / STEP

            ends = mp.mpf(shortest), mp.mpf(longest)
            return float(amplitude(mp.findroot(slope, ends, solver="anderson", tol=1e-20)))
