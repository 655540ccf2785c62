r"""Sliders that degrade: their force between two events is a line, their memory changes at events.

Forces are over k, elongations and energies likewise over a unit of length, so that the force of an
element that has not yielded is y, and in general G = kappa y - q, kappa a slope and q the load of
`hpcsweep.model.elements`. In Y = s y and G = s f of a side s = +-1 its *backbone* is

    E(Y) = max(min(F (1 - a) + a Y, C - c Y), R),

hardening by a from the strength F on, falling by c from the capping point on, R the residual
strength. F, a and C are those of a side, and deteriorate. A line ends

- where it comes to rest, if it goes along the backbone or towards a point: the *local* peak of the
  side is there, the *global* one if nothing was further out. It unloads with kappa = K_u, held
  between the peak and G = 0;
- at G = 0: an *excursion* to the other side begins. Bilinear, it goes on with K_u up to the
  backbone, held both ways; peak-oriented, it goes towards the local peak, if that is stiffer than
  towards the global one, and from there to the global one; pinching, first to the point

      U_p = (1 - kappa_d) (U_g - F_g / K_u),    F_p = kappa_f F_g (U_p - u_0) / (U_g - u_0);

- at a peak to which it has come back, from which on it goes towards the next point;
- on the backbone, at its corners, and where all force is lost.

Deterioration: with the work W, of which G^2 / (2 K_u) comes back, and W_0 that where the excursion
began, an event takes the part

    beta = (W - W_0) / (E - W),    W less what comes back, E = Lambda F_y,

of K_u where it unloads, of F, a and C of the side to which an excursion begins. Nothing is left
where that is 1. Between two events the work is that along a line, by its ends.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel

LOW, HIGH, SLOPE, BRANCH, SIDE, LAST, WORK, BEGUN, UNLOADS, PINCH, PINCH_FORCE = range(11)
SLIPS, PEAK, TURNS, LOST = range(11, 15)
RULE, YIELD, ULTIMATE, FLOOR, FALL, ENERGY, KAPPA_F, KAPPA_D = range(15, 23)
SIDES = ABOVE, BELOW = 23, 30
"""Places in the memory: ends of the line and its slope; what it is, and its side; elongation at the
last event, work until then, and where the excursion began; K_u; the pinching point; how often it
has come to the backbone, largest |G| of events, which way a line held both ways is gone, when its
force was lost; parameters; what a side has, see `STRENGTH`."""
STRENGTH, HARDENING, CAPPING, GLOBAL, GLOBAL_FORCE, LOCAL, LOCAL_FORCE = range(7)
IS_BILINEAR, IS_PEAK_ORIENTED, IS_PINCHING = range(3)
VIRGIN, UNLOADING, RISING, TO_PINCH, TO_LOCAL, TO_GLOBAL, ON_BACKBONE = range(7)
"""What a line is; the first three are held."""
HELD, SOFTENED, UP, DOWN, NO_FORCE, RISES, FALLS = range(7)
"""Modes of an element that degrades, in order, see `Backbone.modes`."""
AHEAD = 1e-12
"""Part of an elongation by which a corner is ahead, not reached."""


@kernel
def turn(way, y, load, memory):
    """Pass an event at the elongation y.

    Parameters
    ----------
    way : float
        1 or -1 at the upper or lower end of the line, 0 where it has come to rest.
    y, load : float
        Elongation, and q until then.
    memory : ndarray, shape (SIZE,)

    Returns
    -------
    mode : int
    load : float
        q from now on.
    """
    slope, last, side, branch = memory[SLOPE], memory[LAST], memory[SIDE], int(memory[BRANCH])
    memory[WORK] += (0.5 * slope * (y + last) - load) * (y - last)
    memory[LAST] = y
    force = slope * y - load
    memory[PEAK] = max(memory[PEAK], abs(force))
    if branch == VIRGIN:
        memory[SIDE] = way
        return _along_backbone(way * y, way * force, memory)
    if way == 0.0 and branch == RISING:
        memory[TURNS] = RISES + FALLS - memory[TURNS]
        return int(memory[TURNS]), load
    if way == 0.0:
        return _unload(side * y, side * force, memory)
    if way != side:
        return _begin_excursion(-side * y, memory)
    y, force = side * y, side * force
    if y >= memory[ULTIMATE]:
        return _lose(memory)
    if branch == UNLOADING:
        return _go_on(y, force, memory)
    if branch == TO_PINCH:
        return _towards_peak(y, force, memory)
    if branch == TO_LOCAL:
        return _towards_global(y, force, memory)
    return _along_backbone(y, force, memory)


@inlined
def _place(memory):
    """Return the place of what the present side has."""
    return ABOVE if memory[SIDE] > 0.0 else BELOW


@kernel
def _line(branch, y, force, slope, outer, inner, memory):
    """Begin a line from (Y, G) on; return mode and load. `inner` is where one that is held ends."""
    side, outer = memory[SIDE], min(outer, memory[ULTIMATE])
    memory[BRANCH], memory[SLOPE] = branch, slope
    memory[LOW], memory[HIGH] = (inner, outer) if side > 0.0 else (-outer, -inner)
    mode = UP if side > 0.0 else DOWN
    if branch == RISING:
        mode = RISES if side > 0.0 else FALLS
        memory[TURNS] = mode
    elif branch < RISING:
        mode = HELD if slope == 1.0 else SOFTENED
    return mode, side * (slope * y - force)


@inlined
def _towards(branch, y, force, outer, target, memory):
    """Go from (Y, G) towards a point."""
    return _line(branch, y, force, (target - force) / (outer - y), outer, -math.inf, memory)


@kernel
def _lose(memory):
    """Lose all force."""
    memory[SLOPE], memory[LOW], memory[HIGH] = 0.0, -math.inf, math.inf
    return NO_FORCE, 0.0


@inlined
def _taken(dissipated, memory):
    """Return beta of the energy that an excursion has dissipated, given that of all until now."""
    left, since = memory[ENERGY] - dissipated, dissipated - memory[BEGUN]
    if since >= left:
        return 1.0
    return max(since, 0.0) / left


@kernel
def _unload(y, force, memory):
    """Unload from (Y, G), where it has come to rest."""
    side_at, recovered = _place(memory), 0.5 * force * force / memory[UNLOADS]
    memory[side_at + LOCAL], memory[side_at + LOCAL_FORCE] = y, force
    if y > memory[side_at + GLOBAL]:
        memory[side_at + GLOBAL], memory[side_at + GLOBAL_FORCE] = y, force
    beta = _taken(memory[WORK] - recovered, memory)
    if beta >= 1.0:
        return _lose(memory)
    memory[UNLOADS] *= 1.0 - beta
    if force <= 0.0:
        return _begin_excursion(-y, memory)
    inner = y - force / memory[UNLOADS]
    return _line(UNLOADING, y, force, memory[UNLOADS], y, inner, memory)


@kernel
def _begin_excursion(y, memory):
    """Begin an excursion to the other side from Y of that, G = 0."""
    memory[SIDE] = -memory[SIDE]
    side_at, beta = _place(memory), _taken(memory[WORK], memory)
    if beta >= 1.0 or y >= memory[ULTIMATE]:
        return _lose(memory)
    memory[BEGUN] = memory[WORK]
    for place in range(side_at, side_at + GLOBAL):
        memory[place] *= 1.0 - beta
    peak, stiff = memory[side_at + GLOBAL], memory[UNLOADS]
    top = memory[side_at + GLOBAL_FORCE] = _backbone(peak, memory)
    if memory[RULE] == IS_BILINEAR or peak <= y:
        outer = _meeting(y, 0.0, stiff, memory)
        if outer <= y:
            return _along_backbone(y, 0.0, memory)
        return _line(RISING, y, 0.0, stiff, outer, y, memory)
    if top <= 0.0:
        return _lose(memory)
    if memory[RULE] == IS_PINCHING:
        pinch = memory[PINCH] = (1.0 - memory[KAPPA_D]) * (peak - top / stiff)
        memory[PINCH_FORCE] = memory[KAPPA_F] * top * (pinch - y) / (peak - y)
        if y < pinch:
            return _towards(TO_PINCH, y, 0.0, pinch, memory[PINCH_FORCE], memory)
    return _towards_peak(y, 0.0, memory)


@kernel
def _towards_peak(y, force, memory):
    """Go from (Y, G) towards the local peak where that is stiffer, else towards the global one."""
    side_at = _place(memory)
    peak, top = memory[side_at + GLOBAL], memory[side_at + GLOBAL_FORCE]
    local, push = memory[side_at + LOCAL], memory[side_at + LOCAL_FORCE]
    is_stiffer = (push - force) * (peak - y) > (top - force) * (local - y)
    if y < local and force < push < top and is_stiffer:
        return _towards(TO_LOCAL, y, force, local, push, memory)
    return _towards_global(y, force, memory)


@kernel
def _go_on(y, force, memory):
    """Go on from the local peak (Y, G), to which it has come back."""
    side_at, pinch, pinched = _place(memory), memory[PINCH], memory[PINCH_FORCE]
    peak, top = memory[side_at + GLOBAL], memory[side_at + GLOBAL_FORCE]
    is_between = y < pinch < peak and force < pinched < top
    is_softer = (pinched - force) * (peak - y) < (top - force) * (pinch - y)
    if memory[RULE] == IS_BILINEAR:
        return _along_backbone(y, force, memory)
    if memory[RULE] == IS_PINCHING and is_between and is_softer:
        return _towards(TO_PINCH, y, force, pinch, pinched, memory)
    return _towards_global(y, force, memory)


@kernel
def _towards_global(y, force, memory):
    """Go from (Y, G) towards the global peak, or along the backbone beyond it."""
    side_at = _place(memory)
    peak, top = memory[side_at + GLOBAL], memory[side_at + GLOBAL_FORCE]
    if y >= peak:
        return _along_backbone(y, force, memory)
    return _towards(TO_GLOBAL, y, force, peak, top, memory)


@inlined
def _pieces(memory):
    """Return of the backbone of the present side G at Y = 0 and slope, C, c and R."""
    side_at = _place(memory)
    hardening = memory[side_at + HARDENING]
    start = memory[side_at + STRENGTH] * (1.0 - hardening)
    return start, hardening, memory[side_at + CAPPING], memory[FALL], memory[FLOOR]


@inlined
def _backbone(y, memory):
    """Return E(Y) of the present side."""
    start, hardening, capping, fall, floor = _pieces(memory)
    return max(min(start + hardening * y, capping - fall * y), floor)


@inlined
def _meeting(y, force, slope, memory):
    """Return where a line from (Y, G) below the backbone meets it."""
    start, hardening, capping, fall, floor = _pieces(memory)
    begun = slope * y - force
    level = (floor + begun) / slope
    if _backbone(level, memory) <= floor:
        return level
    hard = (start + begun) / (slope - hardening) if slope > hardening else math.inf
    return min(hard, (capping + begun) / (slope + fall))


@kernel
def _along_backbone(y, force, memory):
    """Go along the backbone from (Y, G) on, up to its next corner."""
    start, hardening, capping, fall, floor = _pieces(memory)
    ahead = y + AHEAD * (abs(y) + memory[YIELD])
    corner, bottom = (capping - start) / (hardening + fall), (capping - floor) / fall
    slope, outer = 0.0, math.inf
    if ahead < corner and start + hardening * ahead > floor:
        slope, outer = hardening, corner
    elif corner <= ahead < bottom:
        slope, outer = -fall, bottom
    elif ahead < corner and hardening > 0.0:
        rise = (floor - start) / hardening
        outer = rise if rise < corner else math.inf
    elif ahead >= bottom and floor == 0.0:
        return _lose(memory)
    if memory[BRANCH] != ON_BACKBONE:
        memory[SLIPS] += 1.0
    return _line(ON_BACKBONE, y, force, slope, outer, -math.inf, memory)


def along(memory, elongations):
    """Return the forces over k along a path straight between elongations, from rest on."""
    mode, load, y, forces = HELD, 0.0, 0.0, []
    for target in elongations:
        way = math.copysign(1.0, target - y)
        if target != y and way * memory[SIDE] < 0.0 and mode in (UP, DOWN):
            mode, load = turn(0.0, y, load, memory)
        while way * (target - (end := memory[HIGH if way > 0.0 else LOW])) > 0.0:
            mode, load = turn(way, end, load, memory)
        y = target
        forces.append(memory[SLOPE] * y - load)
    return forces
