"""Measures of a motion by name, in the units of its structure, from what has been gathered."""

from typing import Any

import numpy as np

from hpcsweep.model.kernel_model import Model
from hpcsweep.model.observed import CLOSINGS, FORCE, PEAKS, SPEED, TIME, TOGETHER, Measures
from hpcsweep.model.structure import Structure


def along_rows(model: Model, values: np.ndarray) -> dict[str, np.ndarray]:
    """Split values of the rows of `Model.watched`, shape (..., W), by quantity.

    Elongations of sliders are behind the drifts, bases behind the floors.
    """
    flags = model.watched[:, 3]
    return {quantity.name: values[..., flags == quantity.flag] for quantity in PEAKS}


def of_structure(structure: Structure, values: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return of values `along_rows` those of a structure's own drifts and floors."""
    sizes = {"storey": len(structure.drift_rows), "floor": structure.n_floors, "stop": None}
    return {quantity.name: values[quantity.name][..., : sizes[quantity.dim]] for quantity in PEAKS}


def peaks_of(structure: Structure, model: Model, peaks: np.ndarray) -> dict[str, np.ndarray]:
    """Return peaks, shape (..., W), `along_rows`, in the units of a structure."""
    values = along_rows(model, peaks)
    for quantity in PEAKS:
        values[quantity.name] = values[quantity.name] * (
            structure.length_unit * structure.frequency_unit**quantity.order
        )
    # of a contact the distance past its stop; that of a dashpot is the one at which the spring
    # alone exerts its force
    past = values["contact_force"]
    force = structure.switched(structure.force_per_length * past, past)
    values["contact_force"] = np.where(structure.is_rigid, np.nan, force)
    return values


def measures_of(structure: Structure, model: Model, gathered: Any, n_periods) -> Measures:
    """Return the measures of motions under a forcing from values gathered in the kernels' units.

    Parameters
    ----------
    structure : Structure
    model : Model
        Its kernel model.
    gathered
        Has `peaks`, shape (..., W), and `impacts`, shape (..., `N_IMPACTS`, m), over the window.
    n_periods : int or ndarray
        Forcing periods of the window, or of each.
    """
    impacts, rate = gathered.impacts, structure.frequency_unit
    a_period = 1.0 / np.asarray(n_periods, float)[..., None]
    impulse = structure.force_per_length * (structure.length_unit / rate)
    return Measures(
        **of_structure(structure, peaks_of(structure, model, gathered.peaks)),
        impacts=impacts[..., CLOSINGS, :] * a_period,
        simultaneous=impacts[..., TOGETHER, :] * a_period,
        impact_velocity=impacts[..., SPEED, :] * (structure.length_unit * rate),
        impulse=impacts[..., FORCE, :] * a_period * impulse,
        contact_share=impacts[..., TIME, :] * a_period / model.period,
    )
