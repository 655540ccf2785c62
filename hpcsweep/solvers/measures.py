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
ROUNDING = 2.0**-46
"""Part of the size of a motion, 64 units of rounding, below which its distances and speeds tell
nothing: a closing counts that is faster, of a contact that has come apart by more since it has last
been closed.

A distance x = d . u - g is known to the rounding of g and of the state it is made of: to a few
units of the largest of |g|, |u_i| and |u_i'| over the unit of frequency. A contact that comes to
rest at its stop passes it any number of times. The size of a motion is the largest of these that it
has had where a contact has closed, and of the peaks of its floors where they are gathered. What has
opened with the speed w against an acceleration a comes apart by w^2 / 2 a, so that w of 2e-7 counts
where size and a are 1."""


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
