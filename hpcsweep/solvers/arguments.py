"""Check the arguments of solvers; see `hpcsweep.model.arguments`."""

import math

import numpy as np

from hpcsweep.model.arguments import count, instance, number, positive, real, refused, vector
from hpcsweep.model.structure import Structure

MAX_PERIOD = 10_000
"""Longest orbit period to look for, in forcing periods: the mutual distances of as many points take
0.8 GB."""
AT_STRENGTH = 1e-9
"""Part by which a slider may start beyond its strength: rounding of a state put there."""


def solver_arguments(
    structure, omega, rtol, *, yields: bool = False
) -> tuple[Structure, float, float]:
    """Return the validated arguments of a solver, which may know sliders.

    Raises
    ------
    ValueError
        One line that names the argument.
    """
    instance("structure", structure, Structure)
    if structure.sliders and not yields:
        raise ValueError(
            "a structure with sliders moves under ground-motion records, and under a harmonic "
            "forcing in jobs and in hpcsweep.stroboscopic_points, trajectory, orbit and branch"
        )
    omega = positive("omega", omega)
    rtol = number("rtol", rtol)
    if not 0 < rtol < 1:
        raise refused("rtol", "between 0 and 1", rtol)
    return structure, omega, rtol


def tangent_column(structure: Structure, direction) -> np.ndarray:
    """Return a tangent vector, shape (2n,), as one column.

    None stands for (1, ..., 1), of length 1 in units of the state.
    """
    size = structure.state_units.size
    if direction is None:
        return np.full((size, 1), math.sqrt(1.0 / size)) * structure.state_units[:, None]
    return vector("direction", direction, size)[:, None]


def motion(solver, state, amplitude, n_periods) -> tuple[np.ndarray, float, int]:
    """Return the validated start of a motion; the state is a copy.

    State and amplitude may be inf or NaN: the outcome of the motion reports it.

    Parameters
    ----------
    solver : Solver
    state : array_like, shape (2n,)
    amplitude : float
    n_periods : int

    Raises
    ------
    ValueError
        One line that names the argument.
    """
    z = vector("state", state, solver.structure.state_units.size)
    return z, real("amplitude", amplitude), count("n_periods", n_periods)


def points_array(n_periods: int, size: int) -> np.ndarray:
    """Allocate stroboscopic points, shape (n_periods, size).

    Raises
    ------
    ValueError
        If memory does not suffice.
    """
    try:
        return np.empty((n_periods, size))
    except (MemoryError, ValueError):
        need = 8e-9 * n_periods * size
        raise ValueError(
            f"n_periods must be less, is {n_periods}: its points need {need:.3g} GB of memory"
        ) from None


def closing_arguments(max_period, settled, same, near) -> tuple[int, float, float, float]:
    """Return when an orbit counts as closed; see `hpcsweep.solvers.flow.orbit.transient.Closing`.

    Raises
    ------
    ValueError
        One line that names the argument.
    """
    return (
        count("max_period", max_period, 1, MAX_PERIOD),
        real("settled", settled),
        real("same", same),
        real("near", near),
    )
