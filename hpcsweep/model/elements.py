r"""Elements that act linearly in each of their modes, and the guards at which they change it.

An element acts along one row, an elongation y = y_i - y_j or y = y_i of the kernels' displacements.
In a mode its force is linear in (y, y') and in a *load* q that is constant between changes; a mode
ends where one of its guards

    s (a y + b y' - c - r p)

rises through 0: a linear row with an offset, which may be the state p of the element. Guards lead
to another mode; some set p = y + shift. So all that an element is stands in rows of numbers, and
one march (`hpcsweep.solvers.flow.guard.elements`) serves all:

- a contact, open, pushing or, without tension, past its stop and having let go; it opens and closes
  where y is at its stop, and lets go, or pushes again, where its force is 0 (`dashpot`);
- a rigid contact, open or resting at its stop: where y is there its speed jumps, and it rests until
  its reaction is 0, the guard on neither y nor y' (`rigid`);
- a smooth contact, open, pushing or within its layer, which it enters where y is at an edge of it:
  what happens within is no linear motion (`elements.layers`), and where it leaves is not a guard;
- a slider, sticking or slipping up or down: a spring k in series with a slider of strength F.
  With delta = F / k its force is

      k (y - p),  |y - p| <= delta, while it sticks,      +-F,  p = y -+ delta, while it slips.

  It slips from where y = p +- delta, and sticks from where y' = 0; p is then y -+ delta. The matrix
  of a structure whose sliders stick has their springs; that of a slider that slips is taken out
  (the bit of its mode), so that the matrix does not depend on which way it slips. The force is
  -k y + k q, q = p, and while it slips k q alone, q = -+delta;
- a flag, a slider that slips back home (`flags`);
- a slider that degrades, whose lines follow from a memory (`degrading`): held between two of them,
  going up or down, or without force;
- a limit of a drift, +-c, without a force: its guards, y beyond c and below -c, end the motion.

The force of a slider is continuous, and so is that of a contact but for its dashpot, which jumps
where the contact closes.
"""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.backbone import SIZE
from hpcsweep.model.kernel_contacts import DASHPOT, DRAG, LETS_GO, wide
from hpcsweep.model.kernel_contacts import SPRING as LAW
from hpcsweep.model.modes import per_mass
from hpcsweep.model.structure import Structure

SIGN, SPRING, SPEED, LEVEL, SHARE, TAKES, SHIFT, ENDS = range(8)
"""Columns of `Elements.guard`: s, a, b, c, r; 1 where p = y + `SHIFT` is taken; 1 where the motion
ends, and the path of the element is the time. Where a slider degrades -1 is taken."""
OWNER, AFTER, HELD = range(3)
"""Columns of `Elements.ways`: the element of a guard, the mode to which it leads, and where p is
among the states: that of the element, or in its memory."""
OPEN, PUSHING, LET_GO = range(3)
"""Modes of a contact, in order."""
WITHIN = LET_GO
"""In place of the last that of a smooth contact, within its layer."""


class Elements(NamedTuple):
    """The E elements, first contacts that have a dashpot or are beside sliders, then limits."""

    rows: np.ndarray
    """(E, 2) int: y = y[first] - y[second], or y[first] where the second is -1."""
    first: np.ndarray
    """(E,) int: first mode of each, from which it starts; modes are numbered through."""
    sets: np.ndarray
    """(M, 2) unsigned: bits of each mode among the contacts past their stops, and in the key of the
    tables: of contacts that push, and behind those of sliders that slip."""
    load: np.ndarray
    """(M, 2): q = load[0] + load[1] p."""
    guards: np.ndarray
    """(M + 1,) int: first guard of each mode."""
    guard: np.ndarray
    """(G, 8): see `SIGN`."""
    ways: np.ndarray
    """(G, 3) int: see `OWNER`."""
    drifts: int
    """The element from which on they are all drifts, in order; -1 if they are not."""
    stiffness: np.ndarray
    """(L,): what the bit of each slider takes out, as its elongation feels it; sliders are the last
    L elements."""
    reach: np.ndarray
    """(L, n): b_j ..."""
    kick: np.ndarray
    """(L, R): ... and M^-1 b_j over b_j . M^-1 b_j, of all rows."""


class _Table:
    """Modes and guards as they are listed."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int]] = []
        self.first: list[int] = []
        self.modes: list[tuple[int, int, float, float]] = []
        self.guards: list[list[tuple[Any, ...]]] = []

    def add(self, row: tuple[int, int], *modes: tuple[tuple, list[tuple]]) -> None:
        """Add an element: of each mode past, key and load, and its guards.

        A guard is the mode to which it leads, counted from the element's first, and its columns.
        """
        self.rows.append(row)
        self.first.append(len(self.modes))
        for mode, guards in modes:
            self.modes.append(mode)
            self.guards.append(guards)

    def packed(self, drifts: int, *sliders: np.ndarray) -> Elements:
        """Return the elements."""
        listed = [guard for guards in self.guards for guard in guards]
        ends = [*self.first, len(self.modes)]
        of_mode = [e for e in range(len(self.rows)) for _ in range(ends[e], ends[e + 1])]
        owner = [of_mode[m] for m, guards in enumerate(self.guards) for _ in guards]
        columns = [(*guard[1:9], *(9 - len(guard)) * [0.0]) for guard in listed]
        count, ways = len(self.rows), []
        for e, guard in zip(owner, listed, strict=True):
            behind = count + SIZE * (e - count + len(sliders[0]))
            ways.append((e, self.first[e] + guard[0], behind + guard[9] if guard[9:] else e))
        return Elements(
            np.array(self.rows, np.int64).reshape(-1, 2),
            np.array(self.first, np.int64),
            np.array([mode[:2] for mode in self.modes], np.uint64).reshape(-1, 2),
            np.array([mode[2:] for mode in self.modes], float).reshape(-1, 2),
            np.cumsum([0, *map(len, self.guards)]).astype(np.int64),
            np.array(columns, float).reshape(-1, 8),
            np.array(ways, np.int64).reshape(-1, 3),
            drifts,
            *sliders,
        )


def kernel_elements(
    structure: Structure, contacts, slides, drifts, extra: np.ndarray, always: bool = False
) -> Elements:
    """Return the elements of a structure.

    Parameters
    ----------
    structure : Structure
    contacts : Contacts
    slides : list of (int, int, float)
        Two rows of each slider, see `Elements.rows`, and the sign of their difference.
    drifts : list of (int, int)
        Two rows of each drift.
    extra : ndarray, shape (R - n, n)
        Rows beyond n.
    always : bool
        Whether elastic contacts, or without any a row on which nothing acts, are elements, too.
    """
    table, sliders = _Table(), structure.sliders
    if always or sliders or contacts.edges[:, DRAG].any() or contacts.bounce.size:
        for k in range(len(contacts.row)):
            table.add((int(contacts.row[k]), -1), *_contact(k, contacts))
    length, rate = structure.length_unit, structure.frequency_unit
    for row, limit in zip(drifts, (structure.drift_limits / length).tolist(), strict=False):
        if limit < np.inf:
            guards = [(0, s, 1.0, 0.0, s * limit, 0.0, 0.0, 0.0, 1.0) for s in (1.0, -1.0)]
            table.add(row, ((0, 0, 0.0, 0.0), guards))
    if always and not table.rows:
        table.add((0, -1), ((0, 0, 0.0, 0.0), []))
    directions = structure.slider_directions.copy()
    softness = np.array([b @ per_mass(structure.mass_matrix, b) for b in directions])
    for j, (slider, (i, below, sign)) in enumerate(zip(sliders, slides, strict=True)):
        directions[j] *= sign
        table.add((i, below), *slider.modes(len(contacts.row) + j, length))
    stiffness = np.array([slider.taken for slider in sliders], float) * softness / rate**2
    kick = per_mass(structure.mass_matrix, directions.T).T / softness.reshape(-1, 1)
    same = slides and [slide[:2] for slide in slides] == drifts
    first = len(table.rows) - len(slides) if same else -1
    return table.packed(first, stiffness, directions, wide(kick, extra))


def _contact(k: int, contacts) -> list[tuple[tuple, list[tuple]]]:
    """Return the modes of a contact with their guards."""
    sign, gap = float(contacts.sign[k]), float(contacts.gap[k])
    law, dashpot, bit = float(contacts.edges[k, LAW]), float(contacts.edges[k, DASHPOT]), 1 << k
    before, beyond = contacts.edges[k, 1:3].tolist()
    if before != beyond:
        enters = [(WITHIN, s, 1.0, 0.0, at) for s, at in ((sign, before), (-sign, beyond))]
        return [
            ((0, 0, 0.0, 0.0), enters[:1]),
            ((bit, bit, 0.0, 0.0), enters[1:]),
            ((bit, 0, 0.0, 0.0), []),
        ]
    stop = sign * gap
    opens = (OPEN, -sign, 1.0, 0.0, stop)
    if contacts.bounce.size and contacts.bounce[k] >= 0.0:
        opens = (OPEN, -sign, 0.0, 0.0, stop)
    unit = max(law, dashpot) or 1.0
    force = sign * law / unit, sign * dashpot / unit, law / unit * gap
    lets_go = contacts.edges[k, LETS_GO] > 0.0
    return [
        ((0, 0, 0.0, 0.0), [(PUSHING, sign, 1.0, 0.0, stop)]),
        ((bit, bit, 0.0, 0.0), [opens, (LET_GO, -1.0, *force)] if lets_go else [opens]),
        ((bit, 0, 0.0, 0.0), [opens, (PUSHING, 1.0, *force)]),
    ]
