"""Motions that no spring opposes: whether something else confines them, or they drift away.

Rigid modes N are confined where the potential of the contacts, and of the mean force on N, grows
along every v = N c: a contact with a spring grows where d_k . v > 0, and a mean A a_0 b of the
forcing drives v back where A a_0 b . v < 0. So a motion drifts away for good if there is a c with

    d_k . N c <= 0 for every contact k with a spring,    A a_0 b . N c >= 0,    c not 0.

That is a cone: it holds more than 0 if some entry of c can be driven from it in a box, which a
linear program tells. What sliders hold is not rigid.
"""

import math

import numpy as np

from hpcsweep.model.arguments import wrong
from hpcsweep.model.linear_dynamics import ROUNDED

HELD = "neither springs nor sliders nor contacts on both sides hold it back"
PART, TOLD = 0.1, 4
"""Displacement over the largest, of coordinates that are named, and most of these."""
FREE = 1e-6
"""Entry of c, of a box of 1, that is not rounding of the linear program."""


def unconfined(structure, amplitude: float = 1.0) -> str:
    """Tell the coordinates of a motion that nothing confines at amplitudes of this sign, if any."""
    if not structure.n_rigid:
        return ""
    from scipy.optimize import linprog  # takes 0.2 s to load, and few structures need it

    shapes = structure.modes[:, : structure.n_rigid]
    mean = math.fsum(size for order, size, _ in structure.forcing.terms if order == 0)
    held = structure.felt * (structure.directions @ shapes)
    held = held[(structure.contact_stiffness > 0.0) | structure.is_rigid]
    force = -math.copysign(mean, mean * amplitude) * (structure.forcing_vector @ shapes)
    rows = np.vstack((held, force))
    rows /= np.abs(rows).max(axis=1, initial=ROUNDED, keepdims=True)
    for wanted in np.vstack((np.eye(shapes.shape[1]), -np.eye(shapes.shape[1]))):
        way = linprog(-wanted, rows, np.zeros(len(rows)), bounds=(-1.0, 1.0)).x
        if wanted @ way > FREE:
            moved = np.abs(shapes @ way)
            moving = np.flatnonzero(moved > PART * moved.max())
            names = ", ".join(structure.floor_names[i] for i in moving[:TOLD])
            word = f"coordinate{'s' * (moving.size > 1)} {names}{', ...' * (moving.size > TOLD)}"
            return f"lets {word} drift away: {HELD}"
    return ""


def demand_confined(structure, amplitude: float = 1.0) -> None:
    """Refuse a structure of which a motion drifts away, where motions must recur."""
    if told := unconfined(structure, amplitude):
        raise wrong("structure", told)
