"""Quintics through value, slope and second derivative at both ends of [0, 1]."""

from hpcsweep.kernels.compile import inlined, kernel

NEAR = 1e-6
"""Last move to a root, which `impacts` finds exactly from there."""


@inlined
def hermite(d, left, right):
    """Return the coefficients of the quintic through value, slope and bend (u'') at 0 and 1."""
    c0, c1, c2 = left[0], d * left[1], 0.5 * d * d * left[2]
    r0 = right[0] - (c0 + c1 + c2)
    r1 = d * right[1] - (c1 + 2.0 * c2)
    r2 = d * d * right[2] - 2.0 * c2
    c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2
    c4 = -15.0 * r0 + 7.0 * r1 - r2
    c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2
    return c0, c1, c2, c3, c4, c5


@inlined
def value_of(c, t):
    """Evaluate a quintic."""
    return c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))


@inlined
def slope_of(c, t):
    """Differentiate a quintic."""
    return c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])))


@kernel
def turn_of(c, sign, t):
    """Return the maximum, or with sign -1 the minimum, of a quintic on [0, 1], starting from t."""
    for _ in range(4):
        bend = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]))
        if not sign * bend < 0.0:
            break
        t = min(max(t - slope_of(c, t) / bend, 0.0), 1.0)
    return t


@kernel
def root_of(c, a, b, sign):
    """Return the root of sign times a quintic, positive at a and negative at b."""
    t = 0.5 * (a + b)
    for _ in range(30):
        value, slope = value_of(c, t), slope_of(c, t)
        if sign * value > 0.0:
            a = t
        else:
            b = t
        step = t - value / slope if slope != 0.0 else a
        step = step if a < step < b else 0.5 * (a + b)
        if abs(step - t) <= NEAR:
            return step
        t = step
    return t
