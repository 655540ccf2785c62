"""Independent references: Taylor series of the equation of motion, sharing no code with hpcsweep.

The unknowns are expanded in time around each step's start by the recurrences of

    x' = v,   S' = rho v S (1 - S),   v' = -K (x + 1) - 2 gamma C v - beta S x - A sin(Omega tau)

with x = u - 1. S has its poles where rho x = +-i pi (mod 2 pi i). If rho times the majorant
sum_k |x_k| R^k is less than the distance of rho x_0 from them, S is analytic in |t| <= R; a step is
a fixed part of that R, so no layer, however thin, is stepped over. At rho = inf S is 0 or 1 and
a step ends at the first root of any x, found with a bound on |x'| that excludes all others.

`period` is compiled and in double precision. It also takes complex states: the imaginary part of a
state with imaginary perturbation 1e-30 is the exact derivative (no cancellation). It is certified
by `extended`, by a Runge-Kutta method and by closed forms in `test_reference.py`.
"""

import itertools
import math

import numpy as np

from hpcsweep.kernels.compile import jit

ORDER = 26
PART_OF_RADIUS = 0.3
TRUNCATION = 1e-18
IMAGINARY = 1e-30

CASES = [(beta, a) for beta in (100.0, 1000.0) for a in (0.01, 0.06, 0.0987, 0.15, 0.25)]
OMEGA = 0.445
"""The cases (beta, A) whose accuracy is promised, at rho = 1e4, zeta = 0.05, from rest."""


@jit
def expand(z, tau, closed, amplitude, omega, beta, rho, stiffness, damping, x, v):
    """Fill x and v, shape (n, ORDER + 1), with the Taylor coefficients at tau."""
    n = stiffness.shape[0]
    s = np.zeros_like(x)
    d = np.zeros_like(x)
    sd = np.zeros_like(x)
    for i in range(n):
        x[i, 0] = z[i] - 1.0
        v[i, 0] = z[n + i]
        if rho == np.inf:
            s[i, 0] = closed[i]
            d[i, 0] = 1.0 - closed[i]
        else:
            y = rho * x[i, 0]
            if y.real >= 0:
                e = np.exp(-y)
                s[i, 0] = 1.0 / (1.0 + e)
                d[i, 0] = e / (1.0 + e)
            else:
                e = np.exp(y)
                s[i, 0] = e / (1.0 + e)
                d[i, 0] = 1.0 / (1.0 + e)
    size = 1.0
    for k in range(ORDER):
        ground = amplitude * size * math.sin(omega * tau + (k % 4) * math.pi / 2)
        size *= omega / (k + 1)
        for i in range(n):
            force = -ground
            for j in range(n):
                force -= stiffness[i, j] * x[j, k] + damping[i, j] * v[j, k]
                if k == 0:
                    force -= stiffness[i, j]
            contact = 0.0 * x[i, 0]
            for m in range(k + 1):
                contact += s[i, m] * x[i, k - m]
            v[i, k + 1] = (force - beta * contact) / (k + 1)
            x[i, k + 1] = v[i, k] / (k + 1)
            if rho != np.inf and rho != 0.0:
                total = 0.0 * x[i, 0]
                for m in range(k + 1):
                    total += s[i, m] * d[i, k - m]
                sd[i, k] = total
                total = 0.0 * x[i, 0]
                for m in range(k + 1):
                    total += v[i, m] * sd[i, k - m]
                s[i, k + 1] = rho * total / (k + 1)
                d[i, k + 1] = -s[i, k + 1]


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
def step_size(x, v, rho, part, largest):
    """Choose the step: truncation error, and a part of the radius of analyticity of S."""
    n = x.shape[0]
    h = largest
    scale = 0.0
    for i in range(n):
        scale = max(scale, abs(x[i, 0]), abs(v[i, 0]))
    for i in range(n):
        for k in (ORDER - 1, ORDER):
            for c in (abs(x[i, k]), abs(v[i, k])):
                if c > 0:
                    h = min(h, (TRUNCATION * max(scale, 1e-3) / c) ** (1.0 / k))
    if rho == np.inf or rho == 0.0:
        return h
    for i in range(n):
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
    """Tell (1.0 or 0.0) whether a floor touches a stop of infinite sharpness."""
    return 1.0 if x > 0 or (x == 0 and v > 0) else 0.0


@jit
def period(z, amplitude, omega, beta, rho, stiffness, damping, part, starts, sizes, series):
    """Integrate z over one period in place; record the steps where `starts` has room.

    Returns the number of steps.
    """
    n = stiffness.shape[0]
    x = np.zeros((n, ORDER + 1), z.dtype)
    v = np.zeros((n, ORDER + 1), z.dtype)
    closed = np.empty(n)
    for i in range(n):
        closed[i] = is_closed(z[i].real - 1.0, z[n + i].real)
    end = 2 * math.pi / omega
    tau = 0.0
    count = 0
    while tau < end:
        expand(z, tau, closed, amplitude, omega, beta, rho, stiffness, damping, x, v)
        h = step_size(x, v, rho, part, end - tau)
        event = -1
        if rho == np.inf:
            for i in range(n):
                root = first_root(x[i].real.copy(), h)
                if root <= h:
                    h = root
                    event = i
        if count < starts.shape[0]:
            starts[count] = tau
            sizes[count] = h
            series[count, :n] = x.real
            series[count, n:] = v.real
        count += 1
        for i in range(n):
            z[i] = 1.0 + horner(x[i], h)
            z[n + i] = horner(v[i], h)
        if event >= 0:
            # the real part is exactly at the stop; the imaginary part (a tangent) is kept
            z[event] += 1.0 - z[event].real
            closed[event] = is_closed(0.0, z[n + event].real)
        if rho == np.inf:
            # a way through the stop that rounding has hidden from the roots
            for i in range(n):
                if z[i].real != 1.0:
                    closed[i] = is_closed(z[i].real - 1.0, z[n + i].real)
        tau = end if h >= end - tau else tau + h
        if not np.isfinite(z[0].real) or count > 10_000_000:
            z[:] = np.nan
            break
    return count


NO_RECORD = (np.empty(0), np.empty(0), np.empty((0, 0, ORDER + 1)))


def system(structure, amplitude, omega):
    """Arguments of `period`: A, Omega, beta, rho, K and 2 gamma C, made from the definitions."""
    n = structure.n_floors
    stiffness = np.diag([2.0] * (n - 1) + [1.0]) - np.eye(n, k=1) - np.eye(n, k=-1)
    squares, phi = np.linalg.eigh(stiffness)
    zeta = np.broadcast_to(np.asarray(structure.damping_ratio, dtype=float), (n,))
    damping = phi @ np.diag(2 * zeta * np.sqrt(squares)) @ phi.T
    return (
        float(amplitude), float(omega), float(structure.stiffness_ratio),
        float(structure.sharpness), stiffness, damping,
    )  # fmt: skip


def reference_points(structure, amplitude, omega, state, n_periods, part=PART_OF_RADIUS):
    """Stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n), in double precision."""
    z = np.array(state, dtype=float)
    arguments = system(structure, amplitude, omega)
    points = np.empty((n_periods, z.size))
    for k in range(n_periods):
        period(z, *arguments, part, *NO_RECORD)
        points[k] = z
    return points


def reference_monodromy(structure, amplitude, omega, state, n_periods):
    """State and d z(n_periods T) / d z(0), shape (2n, 2n), by the complex step."""
    size = len(state)
    arguments = system(structure, amplitude, omega)
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
    return np.polynomial.polynomial.polyval(t, coefficients.T)


def reference_window(structure, amplitude, omega, state, n_periods, samples=17):
    """Contact bits, peak drift, and mean modal norms over continuous time, from every step."""
    n = structure.n_floors
    stiffness = system(structure, amplitude, omega)[4]
    phi = np.linalg.eigh(stiffness)[1]
    contact, drift = 0, 0.0
    modal, free = np.zeros(n), 0.0
    for h, c in reference_steps(structure, amplitude, omega, state, n_periods):
        t = np.linspace(0.0, h, samples)
        between = np.diff(c[:n], axis=0, prepend=np.zeros((1, ORDER + 1)))
        between[0, 0] += 1.0
        for i in range(n):
            if _largest(c[i], t) >= 0:
                contact |= 1 << i
            drift = max(drift, _largest(between[i], t), _largest(-between[i], t))
        for a, b in itertools.pairwise(t):
            add, time = _free_part(c[:n], phi, a, b, 0)
            modal += add
            free += time
    return contact, drift, modal / free if free > 0 else np.full(n, math.nan)


def _largest(c, t):
    """Largest value of a polynomial over samples t and the extrema between them."""
    slope = np.polynomial.polynomial.polyder(c)
    speeds = np.polynomial.polynomial.polyval(t, slope)
    best = np.polynomial.polynomial.polyval(t, c).max()
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


def _free_part(c, phi, a, b, depth):
    """Integrate |q_j| / ||q|| over the part of [a, b] with every x < 0, splitting at kinks."""
    ends = _values(c, np.array([a, 0.5 * (a + b), b]))
    inside = ends >= 0
    signs = phi.T @ (ends + 1.0) >= 0
    kink = np.any(inside != inside[:, :1]) or np.any(signs != signs[:, :1])
    if kink and depth < 30:
        middle = 0.5 * (a + b)
        left = _free_part(c, phi, a, middle, depth + 1)
        right = _free_part(c, phi, middle, b, depth + 1)
        return left[0] + right[0], left[1] + right[1]
    if np.any(inside[:, 1]):
        return np.zeros(len(phi)), 0.0
    half = 0.5 * (b - a)
    q = np.abs(phi.T @ (_values(c, a + half * (NODES + 1)) + 1.0))
    size = np.linalg.norm(q, axis=0)
    return half * (np.divide(q, size, out=np.zeros_like(q), where=size > 0) @ WEIGHTS), b - a
