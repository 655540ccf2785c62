r"""Steps on branches with corners, of sliders and rigid stops: up to a border, and across it.

*Families.* A slider that sticks over a whole orbit keeps its lasting elongation p, whatever that
is (`hpcsweep.dynamics.families`): the row of p in the tangent map is that of the identity. It is
taken as 0 over the last period of the orbit (`held`), as if the slider forgot its p. Newton's
method then leaves p as the guess has it, and a branch carries it from point to point, as a test
does whose amplitude rises slowly; of the multipliers the 1 of the family is a 0, as a slider that
slips has one too, and the others are those transverse to the family. So a branch has the same
unknowns, (u, u', p), all along.

*Borders.* The signature of an orbit counts, after the closings of each contact, the excursions of
each slider. Where a slider begins to slip within an orbit, or ceases, the map is continuous and its
tangent is not, however small the slip: it takes p from the elongation at its end. A branch has a
corner there, and may turn back: a fold without a multiplier of 1. So no step passes one. Up to it,
s along the tangent t, points of the old side are found with its tangent map alone, and the border
is the largest s at which that succeeds without another signature. A little ahead, at y + h t, the
motion slips (or no longer does); the tangent map there has the direction w of the other side, and
the branch goes on along w or -w, whichever leads to an orbit that is another one than before.

Where neither does, p is *dragged*: the slider comes to its strength at one end of its motion, and
gives way in each next test by as much as the motion has grown. Those orbits are the edges of their
families and have no tangent map; the branch ends there, at a border.

A contact that closes or opens is passed likewise: tangent maps of sliders are differences, which
see a contact that grazes within 1e-7.

*Rigid stops.* A motion that would go past its stop by p meets it with a speed w ~ sqrt(p), and the
saltation matrix has 1 / w. On the side of the impact orbits are smooth in w: the branch begins at
the grazing with a tangent along which p does not change, p ~ w^2 at a distance w, and multipliers
~ 1 / w. Newton's method solves for sqrt(p): it converges from every p > 0 below four times the one
sought. So the other side at a distance L is sought from where p ~ `SHALLOW` L^2, by the tangent map
there. Towards a grazing the method leads to half of w at most; the place of a grazing is then found
from the other side.

A contact that chatters, and rests at the end, has no number of impacts (`forced.CHATTERS`). Where
it rests no more, beyond its *chatter*, grazings accumulate: the branch ends, or one begins.

Where an impact passes phase 0 a stroboscopic point jumps by its law, from the speeds before to
those after it: an orbit goes on from there.
"""

import contextlib
import math
from collections.abc import Iterator
from itertools import product
from typing import Any, cast

import numpy as np

from hpcsweep.dynamics.continuation import branch
from hpcsweep.dynamics.continuation.catalogue import Catalogue, orbits_on
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution, unit
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.forced import CHATTERS, ForcedMap
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import CLOSING, SMOOTH

NEAR, NEAR_RIGID = 1e-4, 1e-5
"""Step, in units of y, from which on a border is sought within it, of rigid stops to the second."""
BISECTIONS = 40
BEYOND, BEYOND_RIGID = (1e-5, 1e-4, 1e-3), (1e-3, 3e-3, 1e-2)
"""Distances past a border, in units of y, at which its other side is sought; of rigid stops so far
that slopes by the parameter, differences over 1e-8 of it, are not across a grazing."""
SHALLOW = 0.0, 0.1, 0.01
"""Squares of these distances times these are how far past a rigid stop a motion would go; 0: the
distances themselves."""
ASTRAY = 10.0
"""Distances within which the other side is."""
PART = 0.01
"""Of the way past a grazing, over which a difference is taken."""
AT_PHASE_0 = 1e-4
"""Distance from a rigid stop, in units of the state, at which its impact may pass phase 0."""

Regime = tuple[tuple[int, ...], tuple[int, ...]]


def check_hardening(structure: Structure) -> None:
    """Make sure that springs keep the place of a structure while its sliders slip.

    Raises
    ------
    ValueError
    """
    if not CLOSING.of(structure) and structure.mechanisms.size:
        raise ValueError(
            "structure must have hardening for branches: no spring keeps its place while sliders "
            "slip"
        )


def catalogue_of(forced: ForcedMap, *settings) -> Catalogue:
    """Return an empty catalogue of branches of a structure; `settings` as for `Catalogue`."""
    kind: Any = Catalogue if SMOOTH.of(forced.structure) else CorneredCatalogue
    return kind(forced, *settings, costly=forced.is_costly)


def step_up_to_border(
    curve: Curve, last: Solution, bend: np.ndarray, step: float, limits: branch.Limits
) -> branch.Step | None:
    """Take a step like `step_of_branch`, or one to a border and across it; None if too far."""
    with contextlib.suppress(ArithmeticError):
        point = branch.sought(curve, last, branch.ahead_of(last, bend, step), step)
        if curve.signature(point) == curve.signature(last):
            taken = branch.step_of_branch(curve, last, bend, step, limits, point)
            if taken is not None:
                return taken
    if step > NEAR or (step < NEAR_RIGID and not _forced(curve).structure.sliders):
        return None
    try:
        return _across(curve, last, step, limits)
    except ArithmeticError:
        return None


class CorneredCatalogue(Catalogue):
    """Branches of a structure with sliders or rigid stops, each family of orbits once."""

    step = staticmethod(step_up_to_border)

    def is_on(self, arc: branch.Arc, points: np.ndarray, value: float) -> bool:
        """Return whether an orbit lies on a branch, or is of the family of an orbit that does."""
        is_on = super().is_on(arc, points, value)
        if is_on or CLOSING.of(_forced(arc.curve).structure):
            return is_on
        turns = [np.roll(points, k, axis=0) for k in range(len(points))]
        pairs = product(orbits_on(arc, value), turns)
        return any(_forced(arc.curve).joins(*both, value) for both in pairs)


def _across(curve: Curve, last: Solution, step: float, limits: branch.Limits) -> branch.Step | None:
    """Go to a border within two steps, and across it; None if there is none."""
    edge, share = _edge(curve, last, 2.0 * step)
    if share == 1.0:
        return None
    regime, structure = _regime(curve, edge), _forced(curve).structure
    rigid = bool(structure.is_rigid.any())
    for length in BEYOND_RIGID if rigid else BEYOND:
        for point in _beyond(curve, edge, length):
            if not limits.low <= curve.split(point.y)[1] <= limits.high:
                return last, [], 0.0, "end of the span"
            there = _regime(curve, point)
            if there != regime:
                turns, corner = point.tangent[-1] * edge.tangent[-1] < 0.0, edge
                if rigid and sum(there[0]) < sum(regime[0]):
                    corner = branch.turned(_edge(curve, branch.turned(point), 4.0 * length)[0])
                specials = _special(curve, corner, share, regime[0], there[0])
                if rigid and not _meets(corner, edge, specials):
                    continue
                if [special.kind for special in specials] == [Kind.CHATTER]:
                    return last, specials, 0.0, "chatter"
                if turns and [special.kind for special in specials] == [Kind.GRAZING]:
                    specials.append(Special(Kind.FOLD, corner, share))
                return point, specials, 0.0, ""
    for point in _past_phase_0(curve, edge, last.tangent):
        if limits.low <= curve.split(point.y)[1] <= limits.high:
            return point, [], 0.0, ""
    ahead = curve.map.signature(*curve.split(edge.y + BEYOND[0] * edge.tangent))
    specials = _special(curve, edge, share, regime[0], ahead)
    end = "border" if structure.sliders or not specials else specials[0].kind.name.lower()
    return (last, specials, 0.0, end) if specials else None


def _meets(end: Solution, edge: Solution, specials: list[Special]) -> bool:
    """Return whether both sides of a border of a rigid stop meet, at one impact of each contact."""
    near = np.abs(end.y - edge.y).max() <= BEYOND_RIGID[0]
    return bool(near) and max(map(abs, specials[0].change)) == 1


def _edge(curve: Curve, last: Solution, length: float) -> tuple[Solution, float]:
    """Return the last point along a tangent before another regime, and its share of a length."""
    near, regime = curve.solve(last.y, last.tangent), _regime(curve, last)
    low, high, edge = 0.0, 2.0, near
    for _ in range(BISECTIONS):
        place, same = 0.5 * (low + high), False
        with contextlib.suppress(ArithmeticError):
            ahead = near.y + place * length * near.tangent
            point = curve.solve(ahead, near.tangent, near, keeps=True)
            near_it = np.abs(point.y - ahead).max() <= length
            same = bool(near_it) and _regime(curve, point) == regime
        if same and place == 1.0:
            return point, place
        low, high, edge = (place, high, point) if same else (low, place, edge)
    return edge, low


def _beyond(curve: Curve, edge: Solution, length: float) -> Iterator[Solution]:
    """Go through orbits at a distance past a border, on whichever side."""
    rigid = _forced(curve).structure.is_rigid.any()
    for past in [share * length**2 or length for share in (SHALLOW if rigid else SHALLOW[:1])]:
        ahead = edge.y + past * edge.tangent
        try:
            _, matrices, slopes = curve.linearise(ahead)
            whole = curve.bordered(matrices, slopes, edge.tangent)
            if past < length:
                whole[:-1, -1] = _slope(curve, whole[:-1, :-1], ahead, past * edge.tangent)
            inverse = np.linalg.inv(whole)
        except (ArithmeticError, np.linalg.LinAlgError):
            continue
        way, begin = inverse[:, -1] / np.linalg.norm(inverse[:, -1]), ahead if rigid else edge.y
        for along in (way, -way):
            with contextlib.suppress(NotConvergedError):
                point = curve.solve(begin + length * along, along)
                if np.abs(point.y - edge.y).max() <= ASTRAY * length:
                    yield point


def _slope(curve: Curve, jacobian: np.ndarray, y: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return dG/dy by the last component, from that along a way on one side of a grazing.

    A difference by the parameter alone would be one across it.
    """
    along = (curve.residual(y + PART * way) - curve.residual(y - PART * way)) / (2.0 * PART)
    return (along - jacobian @ way[:-1]) / way[-1]


def _past_phase_0(curve: Curve, edge: Solution, way: np.ndarray) -> Iterator[Solution]:
    """Go through orbits one of whose points passes an impact at phase 0, forth or back.

    The point is moved to the impact, which is past / speed away, jumps there, and is moved back.
    """
    forced, n = _forced(curve), curve.sizes[1] // 2
    rigid = np.flatnonzero(forced.structure.is_rigid).tolist()
    for j, k, length in product(range(curve.period), rigid, BEYOND):
        y = edge.y + length * way
        structure, amplitude, _ = forced.at(curve.split(y)[1])
        point, contact = y[2 * j * n :][: 2 * n], structure.contacts[k]
        (u, v), row = np.split(point * forced.units, 2), np.array(contact.direction)
        e = contact.restitution or 0.0
        past, speed = row @ u - contact.gap, row @ v
        near = abs(past) <= (AT_PHASE_0 + ASTRAY * length) * structure.length_unit
        if near and (speed > 0.0 or speed < 0.0 < e):
            push, after = np.linalg.solve(structure.mass_matrix, row), past / speed
            push = (1.0 + (e if speed > 0.0 else 1.0 / e)) / (row @ push) * push
            u, v = u - after * v, v - after * _rates(structure, amplitude, u, v)
            v = v - row @ v * push
            u, v = u + after * v, v + after * _rates(structure, amplitude, u, v)
            point[:] = np.append(u, v) / forced.units
            with contextlib.suppress(NotConvergedError):
                solved = curve.solve(y, unit(y.size, -1, np.copysign(1.0, way[-1])))
                if np.abs(solved.y - y).max() <= ASTRAY * length:
                    yield solved


def _rates(structure: Structure, amplitude: float, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the accelerations in a state at phase 0, without the forces of rigid contacts."""
    from hpcsweep.solvers.instants import accelerations  # imports the compiler

    state = np.append(u, v)[None]
    forces = np.nan_to_num(structure.contact_forces(state)), np.empty((1, 0))
    ground = amplitude * sum(size * math.sin(start) for _, size, start in structure.forcing.terms)
    return accelerations(structure, state, forces, [ground])[0]


def _forced(curve: Curve) -> ForcedMap:
    return cast(ForcedMap, curve.map)


def _regime(curve: Curve, point: Solution) -> Regime:
    """Return the signature of an orbit, and how often each slider slips as a period ends."""
    forced = _forced(curve)
    seen = forced.observe(*curve.split(point.y))
    return forced.counted(seen), tuple(np.ravel(seen.slid.get("slipping", ())).tolist())


def _special(curve: Curve, edge: Solution, share: float, before, after) -> list[Special]:
    """Return the special point at a border; none where a slip begins as a period does."""
    change = tuple(b - a for a, b in zip(before, after, strict=True))
    kind = Kind.SLIP if any(change[len(_forced(curve).structure.contacts) :]) else Kind.GRAZING
    pairs = zip(before, after, strict=True)
    if any(rests := tuple((a == CHATTERS) - (b == CHATTERS) for a, b in pairs)):
        kind, change = Kind.CHATTER, rests
    return [Special(kind, edge, share, change)] if any(change) else []
