r"""Families of orbits of structures that yield, and which orbits are members of one.

A slider that sticks over a whole orbit keeps its lasting elongation p, whatever that is; nor does
it matter where a structure stands along a direction that no spring opposes (`free_drifts`), or one
without a spring from the first that no contact closes on (`Structure.n_rigid`). With
the p of the sliders that stick as parameters, the orbits of given p and of a period are isolated,
and by the implicit function theorem each that attracts transversally
(`stability.without_families`) lies in a family with as many dimensions as there are parameters.
The family attracts as a whole, and where in it a motion ends is its history. Without contacts, and
where nothing slips, it is a shift of one motion by K^-1 B^T k p; with a contact at a fixed gap its
members differ.

So the attractor of orbits that come in families is a family: two orbits are *one attractor* if
they have the same period, the same sliders slip on them, the same contacts close, and they are
joined by such orbits over the straight line between their p. This is tested, not proved: the orbit
in the middle of two is sought by Newton's method, which finds the member of the family that is
nearest. Where it is near the middle of the chord the two are joined, otherwise both halves are
tested, which ends at a kink, of members that graze a contact, too; where it is not there, repels or
is another orbit, they are not: so it is past a fold over p. Motions that ratchet are compared
relative to what drifts, as closing is. There is no such test of motions without a period: where
sliders stick on them, those with the same class, sliders that slip and contacts count as one.

A motion whose last slip dies out may end at the border of its family, where a slider comes to its
strength and turns, and which has no tangent map. It is replaced by a member `INWARD` of its
strength from there.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import Shakedown
from hpcsweep.dynamics.verification import verify_orbit
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.polling import Poll

STRAIGHT, NEAR, FAR, DEPTH = 0.01, 1e-3, 0.4, 12
"""Distance of the middle orbit from the middle of a chord, over its length or in units of the
state, at which the chord is not halved again; the largest over its length; and how often it is."""
SAME = 1e-6
"""Distance, in units of the state, at which orbits of a family are one."""
INWARD, RELAXED = 1e-3, 64
"""Part of the elongation at which a slider slips, and turns after which it has kept that or not."""


def told_of_sliders(
    structure: Structure, slid: Mapping[str, np.ndarray], period: int, tolerance: float
) -> dict[str, Any]:
    """Return what is stored of sliders: `Observation.slid`, and what it is over an orbit.

    A drift of less than the tolerance, in units of lengths, over an orbit of that period is
    rounding, and so is a path.
    """
    if not (period and slid):
        return dict(slid)
    limit = tolerance * structure.length_unit
    drift = np.where(np.abs(slid["plastic"]) * period > limit, slid["plastic"], 0.0)
    kind = Shakedown.PLASTIC if slipping(structure, slid, period, tolerance) else Shakedown.ELASTIC
    kind = Shakedown.RATCHETING if drift.any() else kind
    return {**slid, "plastic": drift, "shakedown": kind}


def slipping(
    structure: Structure, slid: Mapping[str, np.ndarray], period: int, tolerance: float
) -> tuple[int, ...]:
    """Return the sliders, from 0, that slip over an orbit."""
    if not slid:
        return ()
    strength = np.array([slider.strength for slider in structure.sliders])
    path = slid["slider_energy"] * period / strength
    return tuple(np.flatnonzero(path > tolerance * structure.length_unit).tolist())


def separation(structure: Structure, orbit: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of orbits, shape (p, 2n + L), in units of the state."""
    return float(np.abs(structure.without_drift(orbit - other) / structure.state_units).max())


def are_joined(
    solver,
    amplitude: float,
    orbit: np.ndarray,
    other: np.ndarray,
    families: int,
    poll: Poll = None,
    depth: int = DEPTH,
) -> bool:
    """Return whether two orbits that attract are members of one family.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    orbit, other : ndarray, shape (p, 2n + L)
        Points of orbits of the same period, on which the same sliders slip.
    families : int
        Dimensions of the family.
    poll : callable, optional
        Called before each piece of the work; may raise to leave.
    depth : int
        How often the line between them is halved.
    """
    structure, chord = solver.structure, separation(solver.structure, orbit, other)
    if chord <= SAME:
        return True
    middle = 0.5 * (orbit + other)
    between = verify_orbit(solver, middle, amplitude, len(orbit), FAR * chord, poll).orbit
    if between is None or (between.period, between.families) != (len(orbit), families):
        return False
    bent = separation(structure, between.points, middle)
    if not between.multiplier < 1.0 or bent > FAR * chord:
        return False
    if bent <= max(STRAIGHT * chord, NEAR):
        return True
    halves = (orbit, between.points), (between.points, other)
    return depth > 0 and all(
        are_joined(solver, amplitude, *half, families, poll, depth - 1) for half in halves
    )


def moved_inward(solver, state: np.ndarray, amplitude: float, period: int) -> np.ndarray:
    """Return a state near an orbit of a family, off the strength of sliders that just reach it.

    Such a slider keeps a p, with the structure moved likewise, to one side of its own: to the other
    it slips back. One that slips keeps none, and one that is off its strength both.
    """
    structure, n = solver.structure, solver.structure.n_floors
    for j, slider in enumerate(structure.sliders):
        step = np.zeros(state.size)
        step[2 * n + j] = moved = INWARD * slider.limit
        push = structure.slider_directions[j] * (slider.spring * moved)
        step[:n] = np.linalg.solve(structure.held_stiffness, push)
        ends = [
            solver.advance(state + way, amplitude, RELAXED * period).state for way in (step, -step)
        ]
        kept = [abs((end - state)[2 * n + j]) > 0.5 * moved for end in ends]
        if kept[0] != kept[1]:
            state = ends[kept.index(True)]
    return state
