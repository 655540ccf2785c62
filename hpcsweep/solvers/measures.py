"""Measures of a window, where requested: peaks of rows, impacts of contacts."""

from typing import Any

import numpy as np

from hpcsweep.model.kernel_model import ACCELERATION, Model
from hpcsweep.model.structure import Structure

IMPACT_FLAG = 64
"""Requests the impacts of all contacts, as `PEAK_FLAGS` request peaks."""
CLOSINGS, SPEED, FORCE, TIME, DISSIPATED = range(5)
N_IMPACTS = 5
"""Rows of impacts: closings of a contact, largest closing speed, integral of its force over its
unit (`LinearDynamics.force_per_length`), time in which it is closed, that is where its distance
past the stop is 0 or more, and energy that its dashpot has taken, over the unit of its force."""


def measures_of(structure: Structure, model: Model, gathered: Any, n_periods) -> np.ndarray:
    """Return the measures of an `Observation` from values gathered in the kernels' units.

    Parameters
    ----------
    structure : Structure
    model : Model
        Its kernel model.
    gathered
        Has `peaks`, shape (..., Q), of the rows of `Model.watched`, and `impacts`, shape (...,
        `N_IMPACTS`, m), over the window.
    n_periods : int or ndarray
        Forcing periods of the window, or of each.

    Returns
    -------
    ndarray, shape (..., D + 2 n + 5 m)
    """
    peaks, impacts = gathered.peaks, gathered.impacts
    length, rate = structure.length_unit, structure.frequency_unit
    a_period = 1.0 / np.asarray(n_periods, float)[..., None]
    flags = model.watched[:, 3]
    units = np.where(flags == ACCELERATION, length * rate**2, length)
    parts = [
        (peaks * units)[..., flags > 0],
        impacts[..., CLOSINGS, :] * a_period,
        impacts[..., SPEED, :] * (length * rate),
        impacts[..., FORCE, :] * a_period * (length / rate),
        impacts[..., TIME, :] * a_period / model.period,
    ]
    return np.concatenate(parts, axis=-1)
