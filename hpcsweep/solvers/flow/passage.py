"""Fast passage of a floor: which one is at the stop, and whether it may pass in closed form.

The passage itself is that of `crossing`. What may not pass that way is integrated by `layer`.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.model.contact import FULL_POTENTIAL, STOP
from hpcsweep.solvers.flow.crossing import NEGLECTED, add_kick, moments, passage_is_fast
from hpcsweep.solvers.flow.events import floor_bit
from hpcsweep.solvers.flow.polynomials import value_and_slope

EXTRAPOLATION = 1.005
"""How far beyond its step a polynomial is used, in steps: its error grows less than fivefold."""


class Arrival(NamedTuple):
    """A floor at the stop."""

    floor: int
    key: np.uint64
    """Contact set before."""
    tau: float
    ground: float
    """A sin(Omega tau)."""
    quadrature: float
    """A cos(Omega tau)."""


@kernel
def time_at_stop(rows, floor, h, s, sign):
    """Follow the floor from the edge of its layer (time s) to the stop; NaN if it turns."""
    for _ in range(40):
        value, slope = value_and_slope(rows, floor, h, s)
        if not sign * slope > 0.0:
            return math.nan
        step = (STOP - value) / slope
        s += step
        if abs(step) <= 1e-15 * h:
            return s
    return s


@kernel
def first_at_stop(floor, at_stop, key, rows, h, n):
    """Choose the floor that is first at the stop, not after `at_stop`.

    The floor that is first at the edge of its layer may be overtaken inside by a faster one.
    """
    for i in range(n):
        if i != floor and at_stop <= h * EXTRAPOLATION:
            sign = -1.0 if key & floor_bit(i) else 1.0
            value, slope = value_and_slope(rows, i, h, at_stop)
            if sign * (value - STOP) > 0.0 and sign * slope > 0.0:
                earlier = time_at_stop(rows, i, h, at_stop, sign)
                if earlier < at_stop:
                    floor = i
                    at_stop = earlier
    return floor, at_stop


@kernel
def _passes_apart(arrival, z, a, amplitude, model):
    """Tell whether the floor at the stop may pass its layer apart from all other floors.

    That holds where no other floor comes near its layer meanwhile, and also where those that do
    will pass as fast. While two floors are inside their layers the contact force of one moves the
    other only through the coupling D_12 + K_12 t of the floors, t the time both take: it changes
    the speed of the second by J_1 coupling t and hence its impulse J_2 by J_1 J_2 coupling t / v,
    which must be negligible.

    Returns
    -------
    bool
    promised : uint64
        The floors on their way to the stop that were found to pass fast. They may be inside their
        layers already, so that they have to be taken through in closed form, too.
    """
    floor, key, tau = arrival.floor, arrival.key, arrival.tau
    stiffness, damping = model.stiffness, model.damping
    beta, rho, omega, layer = model.beta, model.rho, model.omega, model.layer
    n = stiffness.shape[0]
    end = 2.0 * math.pi / omega
    energy = 2.0 * FULL_POTENTIAL * beta / (rho * rho)
    least = abs(z[n + floor])
    span = 2.0 * layer / least
    promised = np.uint64(0)
    found = floor_bit(floor)
    searching = True
    while searching:
        searching = False
        if tau - span < 0.0 or tau + span > end:
            return False, promised
        for i in range(n):
            bit = floor_bit(i)
            x = abs(z[i] - STOP)
            w = abs(z[n + i])
            if found & bit or x - (w + abs(a[i]) * span) * span > layer:
                continue
            way = 2.0 * layer + x
            square = w * w - 2.0 * (abs(a[i]) + beta * way) * way
            if not square > 0.25 * w * w:
                return False, promised
            slowest = math.sqrt(square)
            span = max(span, way / slowest)
            least = min(least, slowest)
            coupling = 0.0
            jerk = omega * abs(amplitude)
            for j in range(n):
                jerk += abs(stiffness[i, j] * z[n + j]) + abs(damping[i, j] * a[j])
                if j != i:
                    coupling = max(coupling, abs(damping[i, j]) + abs(stiffness[i, j]) * span)
            if not energy * energy * coupling * span <= NEGLECTED * least**3:
                return False, promised
            if not passage_is_fast(slowest, abs(a[i]), jerk, model):
                return False, promised
            found |= bit
            if (z[n + i] < 0.0) == (key & bit != np.uint64(0)):
                promised |= bit
            searching = True
    return True, promised


@kernel
def pass_layer(arrival, z, a, promised, amplitude, model):
    """Take the floor at the stop, in state z, through its layer if that is fast.

    Returns
    -------
    bool
        False, with z unchanged, if the passage has to be integrated instead. `a` then holds
        the accelerations at the stop without the contact force of the floor.
    float
        Jerk of the floor, likewise.
    promised : uint64
        Floors whose next passage has to be in closed form, see `_passes_apart`; brought up to date.
    """
    floor = arrival.floor
    stiffness, damping, beta, rho = model.stiffness, model.damping, model.beta, model.rho
    n = stiffness.shape[0]
    v = z[n + floor]
    z[floor] = STOP
    for i in range(n):
        force = -arrival.ground
        if i != floor and arrival.key & floor_bit(i):
            force -= beta * (z[i] - STOP)
        for j in range(n):
            force -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        a[i] = force
    jerk = -model.omega * arrival.quadrature
    for j in range(n):
        jerk -= stiffness[floor, j] * z[n + j] + damping[floor, j] * a[j]
    if not passage_is_fast(v, a[floor], jerk, model):
        return False, jerk, promised
    if rho == math.inf:
        return True, jerk, promised
    if promised & floor_bit(floor) == np.uint64(0):
        apart, more = _passes_apart(arrival, z, a, amplitude, model)
        if not apart:
            return False, jerk, promised
        promised |= more
    add_kick(moments(v, a[floor], jerk, beta, rho), floor, model, z)
    return True, jerk, promised & ~floor_bit(floor)
