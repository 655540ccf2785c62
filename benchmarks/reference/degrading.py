"""Sliders that degrade (modified Ibarra-Medina-Krawinkler): a law and motions, a reference.

The law is a straight piece G(Y) = G_a + k (Y - Y_a) between two corners, on one side s (Y = s y,
G = s f), and memories that change at corners and reversals. `follow` takes a slider along a path.
`integrate` steps M u'' + C u' + K u + sum b f(b . u) = -M r a(t), a linear between samples, by the
classical method of Runge and Kutta (order 4), and halves the step in which a corner is passed or an
elongation turns until the instant is known to rounding. `plain` does the same by central
differences, which know nothing of instants (order 2). Nothing is taken from the package.
"""

import math

import numba
import numpy as np

jit = numba.njit(cache=True, error_model="numpy")
INF = math.inf

BILINEAR, PEAK, PINCHING = 0, 1, 2
RULES = "bilinear", "peak-oriented", "pinching"
K, F, A, C0, CAP, FR, TU, ET, KF, KD, RULE = range(11)
"""Of a law: stiffness, strength, slopes after yield and capping, intercept of the falling branch,
residual, ultimate elongation, energy that it has, kappas, rule."""

VIRGIN, HARD, FALL, FLAT, PINCH, LOCAL, GLOBAL, BACK, LINE, LOST = range(10)
"""Pieces: the start, the three of the backbone, three ways to it, unloading, the line with the
unloading stiffness from zero force to the backbone, and that of a slider without strength."""

# memories: piece, side, its anchor, slope and ends; work, that of the excursion; unloading
# stiffness; pinching point; where it moves (+-1, 0: at rest); then of each side F_s, a_s, C_s, U_g,
# F_g, U_l, F_l
PIECE, SIDE, YA, GA, SLOPE, LO, HI, W, W0, KU, UP, FP, WAY = range(13)
SIDES, STRIDE = 13, 7
FS, AS, CS, UG, FG, UL, FL = range(7)
SIZE = SIDES + 2 * STRIDE


def law(stiffness, strength, theta_p, theta_pc, theta_u=INF, residual=0.0, hardening=0.0,
        rule="bilinear", Lambda=INF, kappa_f=0.0, kappa_d=0.0):  # fmt: skip
    """Return a law by its numbers."""
    a = hardening * stiffness
    capped = strength + a * theta_p
    c0 = capped / theta_pc
    cap = capped + c0 * (strength / stiffness + theta_p)
    return np.array([stiffness, strength, a, c0, cap, residual * strength, theta_u,
                     Lambda * strength, kappa_f, kappa_d, RULES.index(rule)])  # fmt: skip


@jit
def fresh(p):
    """Return the memories of a slider that has never moved."""
    m, y = np.zeros(SIZE), p[F] / p[K]
    m[SIDE], m[SLOPE], m[KU], m[LO], m[HI] = 1.0, p[K], p[K], -y, y
    for s in range(2):
        i = SIDES + s * STRIDE
        m[i + FS], m[i + AS], m[i + CS] = p[F], p[A], p[CAP]
        m[i + UG], m[i + FG], m[i + UL], m[i + FL] = y, p[F], y, p[F]
    return m


@jit
def side(m):
    """Return where the memories of the present side are."""
    return SIDES if m[SIDE] > 0.0 else SIDES + STRIDE


@jit
def force(m, y):
    return m[SIDE] * (m[GA] + m[SLOPE] * (m[SIDE] * y - m[YA]))


@jit
def work(m, y):
    """Return the work done on the slider until y."""
    d = m[SIDE] * y - m[YA]
    return m[W] + d * (m[GA] + 0.5 * m[SLOPE] * d)


@jit
def hard_and_falling(p, m, y):
    """Return the two lines of the backbone of the present side."""
    i = side(m)
    return m[i + FS] * (1.0 - m[i + AS] / p[K]) + m[i + AS] * y, m[i + CS] - p[C0] * y


@jit
def envelope(p, m, y):
    hard, falling = hard_and_falling(p, m, y)
    return max(min(hard, falling), p[FR])


@jit
def enter(m, piece, ya, ga, slope, lo, hi):
    m[PIECE], m[YA], m[GA], m[SLOPE], m[LO], m[HI] = piece, ya, ga, slope, lo, hi


@jit
def lose(m):
    enter(m, LOST, m[YA], 0.0, 0.0, -INF, INF)


@jit
def load(p, m, piece, ya, ga, slope, hi):
    """Enter a loading branch, which ends at hi or at the ultimate elongation."""
    if ya >= p[TU]:
        enter(m, piece, ya, ga, 0.0, ya, ya)
        lose(m)
    else:
        enter(m, piece, ya, ga, slope, -INF, min(hi, p[TU]))


@jit
def on_backbone(p, m, y, piece=-1):
    """Enter the backbone at y; on a given piece of it where y is its corner."""
    i = side(m)
    hard, falling = hard_and_falling(p, m, y)
    rises = (p[FR] - hard) / m[i + AS] if m[i + AS] > 0.0 else INF
    ends = (m[i + CS] - p[FR]) / p[C0]
    capping = y + (falling - hard) / (m[i + AS] + p[C0])
    if piece < 0:
        piece = FLAT if min(hard, falling) < p[FR] else HARD if hard <= falling else FALL
    if p[FR] == 0.0 and y >= ends and piece in (FALL, FLAT):
        enter(m, piece, y, 0.0, 0.0, y, y)
        lose(m)
    elif piece == HARD:
        load(p, m, HARD, y, hard, m[i + AS], capping)
    elif piece == FALL:
        load(p, m, FALL, y, falling, -p[C0], ends)
    else:
        later = y + rises if rises > 0.0 and y + rises < ends else INF
        if later == INF and p[FR] == 0.0:
            later = ends
        load(p, m, FLAT, y, p[FR], 0.0, later)


@jit
def towards(p, m, piece, ya, ga, yb, gb):
    load(p, m, piece, ya, ga, (gb - ga) / (yb - ya), yb)


@jit
def elastic(p, m, y):
    """Enter the line with the unloading stiffness from zero force at y to the backbone."""
    i, k = side(m), m[KU]
    hard, falling = hard_and_falling(p, m, y)
    best = 0.0 if envelope(p, m, y) <= 0.0 else INF
    slower = k - m[i + AS]
    for t in (hard / slower if slower != 0.0 else INF, falling / (k + p[C0]), p[FR] / k):
        if 0.0 < t < best and k * t >= envelope(p, m, y + t) * (1.0 - 1e-13):
            best = t
    if best == 0.0:
        m[YA], m[GA] = y, 0.0
        on_backbone(p, m, y)
    elif y >= p[TU]:
        lose(m)
    else:
        enter(m, LINE, y, 0.0, k, y, min(y + best, p[TU]))


@jit
def excursion(p, m):
    """Begin an excursion to the other side, from zero force."""
    u0 = -m[LO]
    m[SIDE] = -m[SIDE]
    i = side(m)
    enter(m, LINE, u0, 0.0, 0.0, u0, u0)
    if p[ET] < INF:
        left, spent = p[ET] - m[W], max(0.0, m[W] - m[W0])
        if left <= 0.0 or spent >= left:
            lose(m)
            return
        for j in (FS, AS, CS):
            m[i + j] *= 1.0 - spent / left
    m[W0] = m[W]
    m[i + FG] = envelope(p, m, m[i + UG])
    ug, fg, ul, fl = m[i + UG], m[i + FG], m[i + UL], m[i + FL]
    if p[RULE] == BILINEAR:
        elastic(p, m, u0)
        return
    if fg <= 0.0:
        lose(m)
        return
    if p[RULE] == PINCHING:
        m[UP] = (1.0 - p[KD]) * (ug - fg / m[KU])
        m[FP] = p[KF] * fg * (m[UP] - u0) / (ug - u0)
    if ug <= u0:
        elastic(p, m, u0)
    elif p[RULE] == PINCHING and u0 < m[UP]:
        towards(p, m, PINCH, u0, 0.0, m[UP], m[FP])
    elif u0 < ul and fl < fg and fl / (ul - u0) > fg / (ug - u0):
        towards(p, m, LOCAL, u0, 0.0, ul, fl)
    else:
        towards(p, m, GLOBAL, u0, 0.0, ug, fg)


@jit
def settle(m, y):
    """Count the work until y, from where the present piece goes on."""
    at = work(m, y)
    m[GA] += m[SLOPE] * (m[SIDE] * y - m[YA])
    m[W], m[YA] = at, m[SIDE] * y


@jit
def reverse(p, m, y):
    """Turn at y; return whether that counts: on a loading branch."""
    if not HARD <= m[PIECE] <= GLOBAL:
        return False
    settle(m, y)
    i, u, g = side(m), m[YA], m[GA]
    m[i + UL], m[i + FL] = u, g
    if u > m[i + UG]:
        m[i + UG], m[i + FG] = u, g
    if p[ET] < INF:
        kept = g * g / (2.0 * m[KU])
        left, spent = p[ET] - (m[W] - kept), max(0.0, m[W] - m[W0] - kept)
        if left <= 0.0 or spent >= left:
            lose(m)
            return True
        m[KU] *= 1.0 - spent / left
    enter(m, BACK, u, g, m[KU], u - g / m[KU], u)
    if g <= 0.0:
        excursion(p, m)
    return True


@jit
def corner(p, m, upper):
    """Pass the upper or lower corner of the present piece."""
    piece, end = m[PIECE], m[HI] if upper else m[LO]
    settle(m, m[SIDE] * end)
    i = side(m)
    ug, fg, ul, fl, up, fp = m[i + UG], m[i + FG], m[i + UL], m[i + FL], m[UP], m[FP]
    if piece == VIRGIN:
        if not upper:
            m[SIDE], m[YA], m[GA] = -1.0, -end, -m[GA]
        on_backbone(p, m, abs(end), HARD)
    elif not upper:
        excursion(p, m)
    elif piece != BACK and end >= p[TU]:
        lose(m)
    elif piece == HARD:
        on_backbone(p, m, end, FALL if hard_and_falling(p, m, end)[1] > p[FR] else FLAT)
    elif piece == FALL:
        on_backbone(p, m, end, FLAT)
    elif piece == FLAT:
        on_backbone(p, m, end, FLAT if hard_and_falling(p, m, end)[1] <= p[FR] else HARD)
    elif piece == PINCH:
        if up < ul and fp < fl < fg and (fl - fp) / (ul - up) > (fg - fp) / (ug - up):
            towards(p, m, LOCAL, up, fp, ul, fl)
        else:
            towards(p, m, GLOBAL, up, fp, ug, fg)
    elif piece == LOCAL:
        towards(p, m, GLOBAL, ul, fl, ug, fg)
    elif piece == BACK and p[RULE] != BILINEAR and ul < ug:
        if (p[RULE] == PINCHING and ul < up < ug and fl < fp < fg
                and (fp - fl) / (up - ul) < (fg - fl) / (ug - ul)):  # fmt: skip
            towards(p, m, PINCH, ul, fl, up, fp)
        else:
            towards(p, m, GLOBAL, ul, fl, ug, fg)
    else:
        on_backbone(p, m, end)


@jit
def advance(p, m, y, new, log):
    """Take a slider straight from y to new; add the pieces that it enters to the log."""
    way = 1.0 if new > y else -1.0 if new < y else 0.0
    if way != 0.0:
        if way == -m[WAY] and reverse(p, m, y):
            log.append((m[PIECE], m[SIDE]))
        m[WAY] = way
        while m[SIDE] * new > m[HI] or m[SIDE] * new < m[LO]:
            corner(p, m, m[SIDE] * new > m[HI])
            log.append((m[PIECE], m[SIDE]))
    return force(m, new)


@jit
def follow(p, path):
    """Return forces at the elongations, straight between them, from rest; memories; the log."""
    m, y, out = fresh(p), 0.0, np.empty(len(path))
    log = [(0.0, 0.0)]
    log.clear()
    for j, new in enumerate(path):
        out[j] = advance(p, m, y, new, log)
        y = new
    return out, m, log


@jit
def rates(z, t, load, linear):
    """Return z' = linear z + load_0 + t load_1."""
    return linear @ z + load[0] + t * load[1]


@jit
def stepped(z, t, h, load, linear):
    a = rates(z, t, load, linear)
    b = rates(z + 0.5 * h * a, t + 0.5 * h, load, linear)
    c = rates(z + 0.5 * h * b, t + 0.5 * h, load, linear)
    d = rates(z + h * c, t + h, load, linear)
    return z + h / 6.0 * (a + 2.0 * (b + c) + d)


@jit
def generator(inverse, stiffness, damping, rows, memories, stops, closed, a0, slope):
    """Return the matrix of (u, u'), and its load, while all pieces stay."""
    n = len(inverse)
    k, load = stiffness.copy(), np.zeros((2, 2 * n))
    for j in range(len(rows)):
        m, b = memories[j], rows[j]
        k += m[SLOPE] * np.outer(b, b)
        load[0, n:] -= m[SIDE] * (m[GA] - m[SLOPE] * m[YA]) * b
    for j in np.flatnonzero(closed):
        d, gap, kappa = stops[j, :n], stops[j, n], stops[j, n + 1]
        k += kappa * np.outer(d, d)
        load[0, n:] += kappa * gap * d
    linear = np.zeros((2 * n, 2 * n))
    linear[:n, n:] = np.eye(n)
    linear[n:, :n], linear[n:, n:] = -inverse @ k, -inverse @ damping
    load[0, n:] = inverse @ load[0, n:] - a0
    load[1, n:] = -slope
    return linear, load


@jit
def passed(rows, memories, stops, closed, z, limit):
    """Return what happens: 4 j turns, 4 j + 1 up, 4 j + 2 down, 4 j + 3 a stop; -2 ends; or -1."""
    n = len(z) // 2
    for j in range(len(rows)):
        m, y, v = memories[j], rows[j] @ z[:n], rows[j] @ z[n:]
        if m[SIDE] * y > m[HI]:
            return 4 * j + 1
        if m[SIDE] * y < m[LO]:
            return 4 * j + 2
        if m[WAY] * v < 0.0:
            return 4 * j
    for j in range(len(stops)):
        if (stops[j, :n] @ z[:n] > stops[j, n]) != closed[j]:
            return 4 * j + 3
    return -2 if np.abs(rows @ z[:n]).max() > limit else -1


@jit
def integrate(inverse, stiffness, damping, rows, laws, stops, samples, dt, parts, limit):
    """Return (u, u') at the end, memories, log (time, slider, piece, side), largest y and f, end.

    The motion ends where an elongation passes the limit.
    """
    n, count = len(inverse), len(rows)
    z, memories = np.zeros(2 * n), np.empty((count, SIZE))
    largest, closed = np.zeros((2, count)), np.zeros(len(stops), np.bool_)
    log = [(0.0, 0, 0.0, 0.0)]
    log.clear()
    for j in range(count):
        memories[j] = fresh(laws[j])
    fixed = inverse, stiffness, damping, rows, memories, stops
    for number in range(len(samples) - 1):
        a0, slope = samples[number], (samples[number + 1] - samples[number]) / dt
        linear, load = generator(*fixed, closed, a0, slope)
        for part in range(parts):
            t, end = dt * part / parts, dt * (part + 1) / parts
            while t < end:
                new, h = stepped(z, t, end - t, load, linear), end - t
                what = passed(rows, memories, stops, closed, new, limit)
                if what != -1:
                    low = 0.0
                    for _ in range(200):
                        middle = 0.5 * (low + h)
                        if not low < middle < h:
                            break
                        tried = stepped(z, t, middle, load, linear)
                        happens = passed(rows, memories, stops, closed, tried, limit)
                        if happens == -1:
                            low = middle
                        else:
                            h, new, what = middle, tried, happens
                z, t = new, (end if what == -1 else t + h)
                for j in range(count):
                    y, v = rows[j] @ z[:n], rows[j] @ z[n:]
                    if memories[j, WAY] == 0.0:
                        memories[j, WAY] = np.sign(v)
                    largest[0, j] = max(largest[0, j], abs(y))
                    largest[1, j] = max(largest[1, j], abs(force(memories[j], y)))
                if what == -2:
                    return z, memories, log, largest, number * dt + t
                if what >= 0:
                    j, kind = what // 4, what % 4
                    if kind == 3:
                        closed[j] = not closed[j]
                    else:
                        m, counts = memories[j], True
                        if kind == 0:
                            counts = reverse(laws[j], m, rows[j] @ z[:n])
                            m[WAY] = -m[WAY]
                        else:
                            corner(laws[j], m, kind == 1)
                        if counts:
                            log.append((number * dt + t, j, m[PIECE], m[SIDE]))
                    linear, load = generator(*fixed, closed, a0, slope)
    return z, memories, log, largest, np.nan


@jit
def plain(inverse, stiffness, damping, rows, laws, samples, dt, parts):
    """Return u at the end by central differences."""
    n, count, h = len(inverse), len(rows), dt / parts
    u, v = np.zeros(n), np.zeros(n)
    memories, forces, y = np.empty((count, SIZE)), np.zeros(count), np.zeros(count)
    log = [(0.0, 0.0)]
    log.clear()
    for j in range(count):
        memories[j] = fresh(laws[j])
    half = np.linalg.inv(np.eye(n) + 0.5 * h * inverse @ damping)
    for step in range((len(samples) - 1) * parts):
        s = (step % parts) / parts
        i = step // parts
        ground = samples[i] * (1.0 - s) + samples[i + 1] * s
        restoring = stiffness @ u + rows.T @ forces
        if step == 0:
            v = -0.5 * h * (inverse @ restoring + ground)
        else:
            v = half @ (v - h * (inverse @ (restoring + 0.5 * damping @ v) + ground))
        u = u + h * v
        for j in range(count):
            new = rows[j] @ u
            forces[j] = advance(laws[j], memories[j], y[j], new, log)
            y[j] = new
    return u
