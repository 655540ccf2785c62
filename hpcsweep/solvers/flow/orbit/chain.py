"""Advance several states side by side, each by one forcing period, as the points of an orbit are.

A call from Python takes longer than a period; Newton's method for the p points of an orbit needs p
of them at a time.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, entry_point
from hpcsweep.model.units import Units
from hpcsweep.solvers.flow.march.march import advance
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.outcome import COMPLETE, Outcome
from hpcsweep.solvers.polling import Polling


@entry_point((INT, INT), BYTES, MATRIX, FLOAT, MATRIX, MATRIX, specialises=True)
def advance_chain(shared, states, amplitude, tangent, matrices):
    """Advance states over one forcing period, in place, with their tangent maps.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`.
    states : ndarray, shape (p, 2R)
    amplitude : float
    tangent : ndarray, shape (2R, m)
        Workspace.
    matrices : ndarray, shape (2R p, m) or (0, m)
        If not empty, 2R rows a state: tangent vectors, advanced in place.

    Returns
    -------
    n_done : int
    outcome : int
    """
    common = read_shared(shared)
    size = states.shape[1]
    for k in range(states.shape[0]):
        z = as_long_as(states[k], common.work.step.z_end)
        if matrices.shape[0] == 0:
            _, outcome = advance(shared, z, amplitude, 1, None)
        else:
            for i in range(size):
                copy_state(matrices[k * size + i], tangent[i])
            _, outcome = advance(shared, z, amplitude, 1, tangent)
            for i in range(size):
                copy_state(tangent[i], matrices[k * size + i])
        if outcome != COMPLETE:
            return k, outcome
    return states.shape[0], COMPLETE


class Images(NamedTuple):
    """States a forcing period later.

    Attributes
    ----------
    states : ndarray, shape (p, 2n)
    matrices : ndarray, shape (p, 2n, 2n) or (0, 2n, 2n)
        The derivative of each by the state before.
    """

    states: np.ndarray
    matrices: np.ndarray


def images(
    kernel: Callable,
    packed: np.ndarray,
    units: Units,
    polling: Polling,
    states: np.ndarray,
    amplitude: float,
    tangents: bool,
    poll: Callable[[], None] | None,
) -> Images:
    """Integrate several states over one forcing period each.

    Parameters
    ----------
    kernel : callable
        `advance_chain`, or one specialised to the structure.
    packed, units, polling
        Of the solver.
    states : ndarray, shape (p, 2n)
    amplitude : float
        A.
    tangents : bool
        Whether to compute the matrices.
    poll : callable, optional
        Called before each piece of the work (`polling`).

    Raises
    ------
    ArithmeticError
        If the solver fails.
    """
    z, amplitude = units.into(states), amplitude / units.amplitude_unit
    size, height = states.shape[1], z.shape[1]
    unit = columns = np.empty((0, size))
    if tangents:
        unit = units.tangent_into(np.eye(size))
        columns = np.tile(unit, (len(z), 1))
    for first, last in polling.cut(len(z), poll):
        rows = columns[first * height : last * height]
        done, outcome = kernel(packed, z[first:last], amplitude, unit, rows)
        if outcome != COMPLETE:
            raise ArithmeticError(f"flow: {Outcome(outcome).name} of state {first + done + 1}")
    turned = columns.reshape(-1, height, size).swapaxes(1, 2)
    return Images(units.out_of(z), units.out_of(turned).swapaxes(1, 2))
