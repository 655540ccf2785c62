"""Independent references: Taylor series of the equation of motion, sharing no code with hpcsweep.

The unknowns are expanded in time around each step's start by the recurrences of

    u' = v,   S_k' = rho x_k' S_k (1 - S_k),
    M v' = -K u - C v - sum_k d_k kappa_k S_k x_k + A b sum_h a_h sin(h Omega tau + phi_h)

with x_k = d_k . u - g_k. S has its poles where rho x = +-i pi (mod 2 pi i). If rho times the
majorant of x, the sum of its |coefficients| R^j, is less than the distance of rho x_0 from them, S
is analytic in |t| <= R; a step is a fixed part of that R, so no layer, however thin, is stepped
over. At rho = inf S is 0 or 1 and a step ends at the first root of any x, found with a bound on
|x'| that excludes all others. A dashpot adds c_k x_k' to kappa_k x_k; without tension the contact
then pushes while x > 0 and f = kappa x + c x' > 0, and a step ends at roots of f, too.

`period` is compiled and in double precision. It also takes complex states: the imaginary part of a
state with imaginary perturbation 1e-30 is the exact derivative (no cancellation). It is certified
by `extended`, by a Runge-Kutta method and by closed forms in `test_reference.py`.
"""

import itertools
import math
from typing import NamedTuple

import numba
import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

jit = numba.njit(cache=True, error_model="numpy")

ORDER = 26
PART_OF_RADIUS = 0.3
TRUNCATION = 1e-18
IMAGINARY = 1e-30

CASES = [(beta, a) for beta in (100.0, 1000.0) for a in (0.01, 0.06, 0.0987, 0.15, 0.25)]
OMEGA = 0.445
"""The cases (beta, A) whose accuracy is promised, at rho = 1e4, zeta = 0.05, from rest."""


@jit
def expand(z, tau, closed, amplitude, omega, system, u, v, x):
    """Fill u, v, shape (n, ORDER + 1), and x, (m, ORDER + 1), with the Taylor coefficients at tau.

    u is measured from the offset of `System`.
    """
    n, m = u.shape[0], x.shape[0]
    rho = system.rho
    s = np.zeros_like(x)
    d = np.zeros_like(x)
    sd = np.zeros_like(x)
    for i in range(n):
        u[i, 0] = z[i] - system.offset[i]
        v[i, 0] = z[n + i]
    _distances(0, u, system, x)
    for k in range(m):
        if rho == np.inf:
            s[k, 0] = closed[k]
            d[k, 0] = 1.0 - closed[k]
            continue
        y = rho * x[k, 0]
        e = np.exp(-y) if y.real >= 0 else np.exp(y)
        near, far = 1.0 / (1.0 + e), e / (1.0 + e)
        s[k, 0], d[k, 0] = (near, far) if y.real >= 0 else (far, near)
    size = 1.0
    for j in range(ORDER):
        for i in range(n):
            force = 0.0 * u[i, 0]
            if j < system.ramp.shape[0]:
                ground = system.ramp[j] + (system.ramp[1] * tau if j == 0 else 0.0)
                force += system.forcing[i] * amplitude * ground
            for h in range(system.harmonics.shape[0]):
                order, share, phase = system.harmonics[h]
                angle = order * omega * tau + phase + (j % 4) * math.pi / 2
                ground = amplitude * share * (size * order**j) * math.sin(angle)
                force += system.forcing[i] * ground
            for c in range(n):
                force -= system.stiffness[i, c] * u[c, j] + system.damping[i, c] * v[c, j]
                if j == 0:
                    force -= system.stiffness[i, c] * system.offset[c]
            v[i, j + 1] = force
        for k in range(m):
            contact = 0.0 * x[k, 0]
            for q in range(j + 1):
                contact += s[k, q] * x[k, j - q]
            for i in range(n):
                v[i, j + 1] -= system.push[k, i] * contact
            if system.drag[k] > 0.0:
                speed = 0.0 * x[k, 0]
                for i in range(n):
                    speed += system.reach[k, i] * v[i, j]
                for i in range(n):
                    v[i, j + 1] -= closed[k] * system.kick[k, i] * system.drag[k] * speed
        size *= omega / (j + 1)
        for i in range(n):
            v[i, j + 1] /= j + 1
            u[i, j + 1] = v[i, j] / (j + 1)
        _distances(j + 1, u, system, x)
        if rho != np.inf and rho != 0.0:
            for k in range(m):
                total = 0.0 * x[k, 0]
                for q in range(j + 1):
                    total += s[k, q] * d[k, j - q]
                sd[k, j] = total
                total = 0.0 * x[k, 0]
                for q in range(j + 1):
                    total += (q + 1) * x[k, q + 1] * sd[k, j - q]
                s[k, j + 1] = rho * total / (j + 1)
                d[k, j + 1] = -s[k, j + 1]


@jit
def _distances(j, u, system, x):
    """Fill coefficient j of every distance past a stop."""
    for k in range(x.shape[0]):
        x[k, j] = -system.gap[k] if j == 0 else 0.0
        for i in range(u.shape[0]):
            x[k, j] += system.reach[k, i] * u[i, j]


@jit
def horner(c, t):
    """Evaluate a polynomial with ascending coefficients c at t."""
    total = c[-1]
    for k in range(c.shape[0] - 2, -1, -1):
        total = total * t + c[k]
    return total


@jit
def majorant(c, t):
    """Bound |x(t) - x(0)|."""
    total = 0.0
    for k in range(c.shape[0] - 1, 0, -1):
        total = (total + abs(c[k])) * t
    return total


@jit
def step_size(u, v, x, rho, part, largest):
    """Choose the step: truncation error, and a part of the radius of analyticity of S."""
    n = u.shape[0]
    h = largest
    scale = 0.0
    for i in range(n):
        scale = max(scale, abs(u[i, 0]), abs(v[i, 0]))
    for i in range(n):
        for k in (ORDER - 1, ORDER):
            for c in (abs(u[i, k]), abs(v[i, k])):
                if c > 0:
                    h = min(h, (TRUNCATION * max(scale, 1e-3) / c) ** (1.0 / k))
    if rho == np.inf or rho == 0.0:
        return h
    for i in range(x.shape[0]):
        distance = math.hypot(x[i, 0].real, math.pi / rho)
        radius = h / part
        while majorant(x[i], radius) > 0.95 * distance:
            radius *= 0.9
        h = min(h, radius * part)
    return h


@jit
def shifted(p, t, out):
    """Write the coefficients of p about t into `out` (Horner's scheme, repeated)."""
    out[:] = p
    for first in range(p.shape[0] - 1):
        for k in range(p.shape[0] - 2, first - 1, -1):
            out[k] += t * out[k + 1]


@jit
def first_root(c, h):
    """First root in (0, h] of a real polynomial, the root at 0 left out; inf if none.

    Depth-first over binary parts of [0, h]: about the middle m of a part, of half-length r, there
    is no root if |p_0| > sum_1 |p_k| r^k, and at most one if |p_1| > sum_2 k |p_k| r^(k-1).
    """
    start = 0
    while start < c.shape[0] and c[start] == 0.0:
        start += 1
    p = c[start:]
    if p.shape[0] < 2:
        return np.inf
    about = np.empty_like(p)
    left = [0.0]
    right = [h]
    while len(left) > 0:
        a, b = left.pop(), right.pop()
        middle = 0.5 * (a + b)
        half = 0.5 * (b - a)
        shifted(p, middle, about)
        rest = 0.0
        bend = 0.0
        for k in range(p.shape[0] - 1, 0, -1):
            rest = (rest + abs(about[k])) * half
            if k > 1:
                bend = (bend + k * abs(about[k])) * half
        if abs(about[0]) > rest:
            continue
        if abs(about[1]) > bend or b - a < 1e-13 * h:
            fa, fb = horner(p, a), horner(p, b)
            # signs, not products: those may underflow
            if (fa > 0) == (fb > 0):
                continue
            for _ in range(200):
                middle = 0.5 * (a + b)
                if middle in (a, b):
                    break
                fm = horner(p, middle)
                if (fm > 0) == (fa > 0):
                    a = middle
                else:
                    b = middle
            return b
        left.append(middle)
        right.append(b)
        left.append(a)
        right.append(middle)
    return np.inf


@jit
def is_closed(x, v):
    """Return 1.0 or 0.0: whether a contact of infinite sharpness touches."""
    return 1.0 if x > 0 or (x == 0 and v > 0) else 0.0


@jit
def period(z, amplitude, omega, system, part, starts, sizes, series):
    """Integrate z over one period in place; record the steps where `starts` has room.

    Returns the number of steps.
    """
    n, m, rho = system.stiffness.shape[0], system.gap.shape[0], system.rho
    u = np.zeros((n, ORDER + 1), z.dtype)
    v = np.zeros((n, ORDER + 1), z.dtype)
    x = np.zeros((m, ORDER + 1), z.dtype)
    closed = np.empty(m)
    pushing = np.empty(m)
    force = np.zeros((m, ORDER + 1))
    at_zero = np.zeros(m, np.bool_)
    _look(z, system, u, x)
    for k in range(m):
        closed[k] = is_closed(x[k, 0].real, x[k, 1].real)
        pushing[k] = closed[k]
        if system.lets_go[k] and x[k, 0].real > 0.0:
            f = system.kappa[k] * x[k, 0].real + system.drag[k] * x[k, 1].real
            pushing[k] = 1.0 if f > 0 else 0.0
    # one that rests at its stop goes where it accelerates to
    expand(z, 0.0, pushing, amplitude, omega, system, u, v, x)
    for k in range(m if rho == np.inf else 0):
        if x[k, 0].real == 0.0 and x[k, 1].real == 0.0 and x[k, 2].real > 0.0:
            closed[k] = pushing[k] = 1.0
    end = system.length if system.ramp.shape[0] > 0 else 2 * math.pi / omega
    tau = 0.0
    count = 0
    event = -1
    while tau < end:
        expand(z, tau, pushing, amplitude, omega, system, u, v, x)
        for k in range(m if event >= 0 else 0):
            if system.together[event, k]:
                # at the stop, whatever rounding says
                x[k, 0] -= x[k, 0].real
        h = step_size(u, v, x, rho, part, end - tau)
        event = -1
        if rho == np.inf:
            for k in range(m):
                root = first_root(x[k].real.copy(), h)
                if root <= h:
                    h = root
                    event = k
            for k in range(m):
                if not (system.lets_go[k] and closed[k] > 0.0):
                    continue
                _force_series(k, u, v, system, x, force)
                if at_zero[k]:
                    force[k, 0] = 0.0
                root = first_root(force[k].copy(), h)
                if root <= h:
                    h = root
                    event = m + k
        if count < starts.shape[0]:
            starts[count] = tau
            sizes[count] = h
            series[count, :n] = u.real
            series[count, n:] = v.real
        count += 1
        for i in range(n):
            z[i] = system.offset[i] + horner(u[i], h)
            z[n + i] = horner(v[i], h)
        if rho == np.inf:
            at_zero[:] = False
            if event >= m:
                _switch(event - m, h, system, closed, force, pushing, at_zero)
                event = -1
            if event >= 0:
                _put_at_stop(event, z, system)
            _look(z, system, u, x)
            for k in range(m):
                before = closed[k]
                # beside the event a way through a stop that rounding has hidden from the roots
                if event >= 0 and system.together[event, k]:
                    closed[k] = is_closed(0.0, x[k, 1].real)
                elif x[k, 0].real != 0.0 or x[k, 1].real != 0.0:
                    closed[k] = is_closed(x[k, 0].real, x[k, 1].real)
                if closed[k] != before or not system.lets_go[k]:
                    pushing[k] = closed[k]
        tau = end if h >= end - tau else tau + h
        if not np.isfinite(z[0].real) or count > 10_000_000:
            z[:] = np.nan
            break
    return count


@jit
def _force_series(k, u, v, system, x, force):
    """Fill the coefficients of kappa x + c x' of contact k."""
    for j in range(ORDER + 1):
        speed = 0.0
        for i in range(u.shape[0]):
            speed += system.reach[k, i] * v[i, j].real
        force[k, j] = system.kappa[k] * x[k, j].real + system.drag[k] * speed


@jit
def _switch(event, h, system, closed, force, pushing, at_zero):
    """Let contacts go, or push again, whose kappa x + c x' is 0 at the end of a step."""
    for k in range(closed.shape[0]):
        if not (system.lets_go[k] and closed[k] > 0.0):
            continue
        value, slope, size = horner(force[k], h), 0.0, 0.0
        for j in range(ORDER, 0, -1):
            slope = slope * h + j * force[k, j]
            size = size * h + abs(force[k, j])
        # of mirrored contacts rounding may have hidden the root of the second
        both = abs(value) <= 1e-13 * (size * h + abs(force[k, 0]))
        if k == event or (both and (slope > 0) == (pushing[k] == 0.0)):
            pushing[k] = 1.0 - pushing[k]
            at_zero[k] = True


@jit
def _look(z, system, u, x):
    """Fill the distances past all stops, and their speeds, of a state."""
    n = u.shape[0]
    for i in range(n):
        u[i, 0] = z[i] - system.offset[i]
        u[i, 1] = z[n + i]
    _distances(0, u, system, x)
    _distances(1, u, system, x)


@jit
def _put_at_stop(k, z, system):
    """Remove what rounding has left of a distance; the imaginary part (a tangent) is kept."""
    n = system.stiffness.shape[0]
    past = -system.gap[k]
    square = 0.0
    for i in range(n):
        past += system.reach[k, i] * (z[i].real - system.offset[i])
        square += system.reach[k, i] ** 2
    for i in range(n):
        z[i] -= system.reach[k, i] * past / square


NO_RECORD = (np.empty(0), np.empty(0), np.empty((0, 0, ORDER + 1)))


class System(NamedTuple):
    """The equations, solved for the accelerations."""

    harmonics: np.ndarray
    """(H, 3): order, amplitude, phase."""
    ramp: np.ndarray
    """(2,): G and G' at the start of a sample interval of a record; (0,) without one."""
    length: float
    """Of that interval."""
    rho: float
    stiffness: np.ndarray
    damping: np.ndarray
    forcing: np.ndarray
    """M^-1 b"""
    offset: np.ndarray
    """(n,): where u is measured from: at the stops, if every coordinate has one."""
    reach: np.ndarray
    """(m, n): d_k."""
    gap: np.ndarray
    """(m,): of u measured so."""
    push: np.ndarray
    """(m, n): kappa_k M^-1 d_k."""
    kick: np.ndarray
    """(m, n): M^-1 d_k."""
    kappa: np.ndarray
    drag: np.ndarray
    """(m,): c_k of a dashpot."""
    lets_go: np.ndarray
    """(m,) bool: whether it never pulls."""
    together: np.ndarray
    """(m, m) bool: contacts whose stops are at one place, so that both are reached at once."""


def system(structure, amplitude, omega):
    """Arguments of `period`: A, Omega and the `System`, made from the definitions."""
    n = structure.n_floors
    if structure.matrices is None:
        mass = np.diag(np.broadcast_to(1.0 if structure.mass is None else structure.mass, n))
        spring = 1.0 if structure.storey_stiffness is None else structure.storey_stiffness
        spring = np.broadcast_to(np.asarray(spring, float), n)
        stiffness = np.diag(spring + np.append(spring[1:], 0.0))
        stiffness = stiffness - np.diag(spring[1:], 1) - np.diag(spring[1:], -1)
        kappa = np.broadcast_to(structure.stiffness_ratio, n) * spring
        stops = [
            (
                sign * np.eye(n)[i],
                gap,
                kappa[i],
                _drag(structure, i, kappa[i], mass),
                structure.tension,
            )
            for sign, gaps in ((1.0, structure.gap), (-1.0, structure.gap_left))
            for i, gap in enumerate(np.broadcast_to(gaps, n))
            if gap < np.inf
        ]
        forcing = -mass.sum(axis=1)
    else:
        given = structure.matrices
        mass, stiffness = np.array(given.mass), np.array(given.stiffness)
        stops = [
            (np.array(c.direction), c.gap, c.stiffness, c.damping, c.tension)
            for c in given.contacts
        ]
        forcing = -mass.sum(axis=1) if given.forcing is None else np.array(given.forcing)
    inverse = np.linalg.inv(mass)
    offset = np.zeros(n)
    if len(stops) == n and np.array_equal([stop[0] for stop in stops], np.eye(n)):
        offset = np.array([stop[1] for stop in stops], float)
    directions, gaps, kappa, drag, tension = list(zip(*stops, strict=True)) or [()] * 5
    reach = np.array(directions, float).reshape(-1, n)
    parts = System(
        np.array(structure.harmonics, float).reshape(-1, 3),
        np.empty(0),
        0.0,
        float(structure.sharpness),
        inverse @ stiffness,
        inverse @ _damping(structure, mass, stiffness),
        inverse @ forcing,
        offset,
        reach,
        np.array(gaps, float) - reach @ offset,
        np.array(
            [k * (inverse @ d) for d, k in zip(directions, kappa, strict=True)], float
        ).reshape(-1, n),
        np.array([inverse @ d for d in directions], float).reshape(-1, n),
        np.array(kappa, float),
        np.array(drag, float),
        np.array([c > 0 and not pulls for c, pulls in zip(drag, tension, strict=True)], bool),
        np.array([[_at_one_place(a, b) for b in stops] for a in stops], bool).reshape(
            -1, len(stops)
        ),
    )
    return float(amplitude), float(omega), parts


def _at_one_place(one, other):
    """Return whether d . u = g of two stops (d, g, kappa) are one condition."""
    conditions = np.array([[*d, gap] for d, gap, *_ in (one, other)])
    return np.linalg.matrix_rank(conditions) == 1


def _drag(structure, floor, kappa, mass):
    """Find c of a stop of a floor by its collision."""
    if structure.restitution is None:
        return 0.0
    e = float(np.broadcast_to(structure.restitution, structure.n_floors)[floor])
    xi = 0.0 if e == 1.0 else brentq(lambda xi: _restitution(xi, structure.tension) - e, 1e-12, 1e6)
    return 2 * xi * math.sqrt(kappa * mass[floor, floor])


def _restitution(xi, tension):
    """Speed at the first root of x, or of x'', of x'' + 2 xi x' + x = 0, x(0) = 0, x'(0) = 1."""
    if xi >= 1.0:
        root = math.sqrt(xi * xi - 1.0) or 1e-9
        slow, fast = xi - root, xi + root
        t = 2.0 * math.log(fast / slow) / (fast - slow)
        last = (fast * math.exp(-fast * t) - slow * math.exp(-slow * t)) / (fast - slow)
        return 0.0 if tension else -last
    s = math.sqrt(1.0 - xi * xi)
    t = math.pi if tension else math.atan2(2 * xi * s, 2 * xi * xi - 1)
    return -math.exp(-xi * t / s) * (math.cos(t) - xi / s * math.sin(t))


def _damping(structure, mass, stiffness):
    if structure.matrices is not None and structure.matrices.damping is not None:
        return np.array(structure.matrices.damping)
    squares, phi = eigh(stiffness, mass)
    if structure.rayleigh is not None:
        factors = structure.rayleigh
        if len(factors) > 2:
            w = np.array([2 * np.pi / period for period in factors.periods or ()])
            w = w if w.size else np.sqrt(squares)[np.array(factors.modes) - 1]
            factors = np.linalg.solve(np.column_stack((1 / w, w)) / 2, [factors.ratio] * 2)
        return factors[0] * mass + factors[1] * stiffness + _dashpots(structure)
    zeta = np.broadcast_to(np.asarray(structure.damping_ratio, dtype=float), squares.shape)
    modal = mass @ phi @ np.diag(2 * zeta * np.sqrt(squares)) @ phi.T @ mass
    return modal + _dashpots(structure)


def _dashpots(structure):
    n = structure.n_floors
    steps = np.eye(n) - np.eye(n, k=-1)
    own = 0.0 if structure.matrices is not None else structure.storey_damping
    return steps.T @ np.diag(np.broadcast_to(own, n)) @ steps


def reference_points(structure, amplitude, omega, state, n_periods, part=PART_OF_RADIUS):
    """Stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n), in double precision."""
    z = np.array(state, dtype=float)
    arguments = system(structure, amplitude, omega)
    points = np.empty((n_periods, z.size))
    for k in range(n_periods):
        period(z, *arguments, part, *NO_RECORD)
        points[k] = z
    return points


def reference_record(structure, samples, dt, scale, state):
    """Follow a record, G linear between samples.

    Returns
    -------
    ndarray, shape (2n,)
        State at the last sample.
    list of (time, h, coefficients (2n, ORDER + 1))
        Of every step; displacements are measured from the offset of `System`.
    """
    z = np.array(state, dtype=float)
    amplitude, omega, parts = system(structure, scale, 1.0)
    parts = parts._replace(harmonics=np.empty((0, 3)), ramp=np.empty(2), length=float(dt))
    samples = np.asarray(samples, float)
    steps = []
    for j, (before, after) in enumerate(itertools.pairwise(samples.tolist())):
        parts.ramp[:] = before, (after - before) / dt
        given = amplitude, omega, parts, PART_OF_RADIUS
        count = period(z.copy(), *given, *NO_RECORD)
        record = np.empty(count), np.empty(count), np.empty((count, z.size, ORDER + 1))
        period(z, *given, *record)
        steps += [(j * dt + tau, h, c) for tau, h, c in zip(*record, strict=True)]
    return z, steps


def reference_monodromy(structure, amplitude, omega, state, n_periods):
    """State and d z(n_periods T) / d z(0), shape (2n, 2n), by the complex step.

    Not of dashpots: their force jumps, and with it the tangent.
    """
    size = len(state)
    arguments = system(structure, amplitude, omega)
    assert not np.any(arguments[2].drag)
    matrix = np.empty((size, size))
    for column in range(size):
        z = np.array(state, dtype=complex)
        z[column] += 1j * IMAGINARY
        for _ in range(n_periods):
            period(z, *arguments, PART_OF_RADIUS, *NO_RECORD)
        matrix[:, column] = z.imag / IMAGINARY
    return z.real, matrix


def reference_steps(structure, amplitude, omega, state, n_periods):
    """Yield (h, coefficients (2n, ORDER + 1) of x and v) of every step."""
    z = np.array(state, dtype=float)
    arguments = system(structure, amplitude, omega)
    for _ in range(n_periods):
        count = period(z.copy(), *arguments, PART_OF_RADIUS, *NO_RECORD)
        record = np.empty(count), np.empty(count), np.empty((count, z.size, ORDER + 1))
        period(z, *arguments, PART_OF_RADIUS, *record)
        yield from zip(record[1], record[2], strict=True)


def _values(coefficients, t):
    """Evaluate polynomials, coefficients (k, ORDER + 1), at times (q,): shape (k, q)."""
    return coefficients @ np.vander(t, coefficients.shape[-1], increasing=True).T


def reference_window(structure, amplitude, omega, state, n_periods, samples=17):
    """Contact bits, peak drift, and mean modal norms over continuous time, from every step."""
    n = structure.n_floors
    parts = system(structure, amplitude, omega)[2]
    phi = structure.modes
    numbers, rows = structure.contact_numbers, structure.drift_rows
    contact, drift = 0, 0.0
    modal, free = np.zeros(n), 0.0
    for h, c in reference_steps(structure, amplitude, omega, state, n_periods):
        t = np.linspace(0.0, h, samples)
        past = parts.reach @ c[:n]
        past[:, 0] -= parts.gap
        between = rows @ c[:n]
        between[:, 0] += rows @ parts.offset
        for number, distance in zip(numbers, past, strict=True):
            if _largest(distance, t) >= 0:
                contact |= 1 << (number - 1)
        for row in between:
            drift = max(drift, _largest(row, t), _largest(-row, t))
        whole = c[:n].copy()
        whole[:, 0] += parts.offset
        transform = phi.T @ structure.mass_matrix
        add, time = _free_part(transform @ whole, past, t[:-1], t[1:])
        modal += add
        free += time
    return contact, drift, modal / free if free > 0 else np.full(n, math.nan)


def _largest(c, t):
    """Largest value of a polynomial over samples t and the extrema between them."""
    slope = c[1:] * np.arange(1, c.size)
    speeds = _values(slope, t)
    best = _values(c, t).max()
    for k in np.flatnonzero((speeds[:-1] > 0) & (speeds[1:] < 0)):
        a, b = t[k], t[k + 1]
        for _ in range(60):
            middle = 0.5 * (a + b)
            if horner(slope, middle) > 0:
                a = middle
            else:
                b = middle
        best = max(best, horner(c, a))
    return best


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
HALVINGS = 30
"""Of an interval that a kink is in."""


def _free_part(q, past, a, b):
    """Integrate |q_j| / ||q|| over the parts of intervals without contact, splitting at kinks."""
    modal, free = np.zeros(len(q)), 0.0
    for depth in range(HALVINGS + 1):
        middle, half = 0.5 * (a + b), 0.5 * (b - a)
        times = np.concatenate((a, middle, b))
        inside, signs = (_values(c, times).reshape(len(c), 3, a.size) >= 0 for c in (past, q))
        kink = _changes(inside) | _changes(signs) if depth < HALVINGS else np.zeros(a.size, bool)
        smooth = ~kink & ~inside[:, 1].any(axis=0)
        nodes = middle[smooth, None] + half[smooth, None] * NODES
        size_of = np.abs(_values(q, nodes.ravel())).reshape(len(q), *nodes.shape)
        size = np.linalg.norm(size_of, axis=0)
        share = np.divide(size_of, size, out=np.zeros_like(size_of), where=size > 0)
        modal += (share @ WEIGHTS) @ half[smooth]
        free += 2 * half[smooth].sum()
        if not kink.any():
            break
        a, b = np.append(a[kink], middle[kink]), np.append(middle[kink], b[kink])
    return modal, free


def _changes(signs):
    """Return which intervals see any sign change; signs (k, 3, intervals)."""
    return (signs != signs[:, :1]).any(axis=(0, 1))
