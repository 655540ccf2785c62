"""Polynomials along a layer step: quintics of its ends, and one through ends and stages.

One component of the motion along a layer step: a polynomial through ends and stages
------------------------------------------------------------------------------------
Values and velocities at the ends and the `N_STAGES` stages have one polynomial of degree
2 `N_STAGES` + 3, right to kappa^-20 with kappa of `limits`. It is kept in Newton's form, every
node twice: its divided differences are in ``work.newton``.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import fma, load, total
from hpcsweep.model.contact import contact_forces
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, POINTS, WEIGHTS

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


TWICE = np.repeat(POINTS, 2)
INVERSES = np.zeros((TWICE.size, TWICE.size))
"""1 / (`TWICE`[i] - `TWICE`[i - order]) by order and i, 0 where they are the same."""
for _order in range(1, TWICE.size):
    _apart = TWICE[_order:] - TWICE[:-_order]
    INVERSES[_order, _order:] = np.divide(
        1.0, _apart, where=_apart > 0.0, out=np.zeros_like(_apart)
    )
SAME_INTEGRAL = 1e-13
MAX_PARTS = 256


@kernel
def interpolate(h, start, end, work):
    """Build the polynomial of ``work.stage_u`` and ``stage_v`` and of both ends."""
    c = work.newton
    last = c.size - 1
    for s in range(N_STAGES + 2):
        x = start[0]
        if s == N_STAGES + 1:
            x = end[0]
        elif s > 0:
            x = work.stage_u[s - 1]
        c[2 * s], c[2 * s + 1] = x, x
    for i in range(last, 0, -1):
        if i % 2 == 0:
            c[i] = (c[i] - c[i - 1]) * INVERSES[1, i]
        elif i == 1 or i == last:
            c[i] = h * (start[1] if i == 1 else end[1])
        else:
            c[i] = h * work.stage_v[i // 2 - 1]
    for order in range(2, last + 1):
        for i in range(last, order - 1, -1):
            c[i] = (c[i] - c[i - 1]) * INVERSES[order, i]


@kernel
def interpolated(s, work):
    """Evaluate the polynomial, its slope and half its second derivative at a part s of the step."""
    c, nodes = work.newton, TWICE
    value, slope, bend = 0.0, 0.0, 0.0
    for i in range(c.size - 1, -1, -1):
        bend = bend * (s - nodes[i]) + slope
        slope = slope * (s - nodes[i]) + value
        value = value * (s - nodes[i]) + c[i]
    return value, slope, bend


@kernel
def highest_near(s, peak, work):
    """Return the maximum of the polynomial near s, where one of lower degree has `peak`."""
    value = peak
    for _ in range(3):
        value, slope, bend = interpolated(s, work)
        if not bend < 0.0:
            break
        s = min(max(s - 0.5 * slope / bend, 0.0), 1.0)
    return value


@kernel
def integral_of_force(h, rho, work):
    """Integrate x S over the step, x the polynomial, in as many parts as that needs."""
    c, nodes = work.newton, TWICE
    found, parts = 0.0, 2
    while True:
        before, found = found, 0.0
        for part in range(parts):
            s = (load(NODES, 0) + part) * (1.0 / parts)
            x = s * 0.0
            for i in range(c.size - 1, -1, -1):
                x = fma(x, s - nodes[i], c[i])
            found += total(load(WEIGHTS, 0) * contact_forces(x, 1.0, rho))
        found *= h / parts
        if abs(found - before) <= SAME_INTEGRAL * abs(found) or parts >= MAX_PARTS:
            return found
        parts *= 2
