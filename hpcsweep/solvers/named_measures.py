"""Measures of a motion by name, in the units of its structure."""

from dataclasses import dataclass

import numpy as np

from hpcsweep.model.structure import Structure


@dataclass(frozen=True, eq=False)
class ContactMeasures:
    """What contacts have done; a sum of a motion is that of a forcing period.

    Attributes
    ----------
    impacts : ndarray, shape (..., k)
        How often each has closed, having been open by more than rounding (`measures`).
    impact_velocity : ndarray, shape (..., k)
        Largest speed with which it has closed.
    impulse : ndarray, shape (..., k)
        Integral of its force over time.
    """

    impacts: np.ndarray
    impact_velocity: np.ndarray
    impulse: np.ndarray


@dataclass(frozen=True, eq=False)
class Measures(ContactMeasures):
    """Measures of motions: peaks over time, and what contacts have done.

    Attributes
    ----------
    storey_drift : ndarray, shape (..., D)
    displacement, floor_acceleration : ndarray, shape (..., n)
    contact_force : ndarray, shape (..., k)
        Largest where the floors of a contact are farthest past it. That of a dashpot comes as the
        distance at which the spring alone exerts it.
    contact_share : ndarray, shape (..., k)
        Share of the time in which each is closed.
    """

    storey_drift: np.ndarray
    displacement: np.ndarray
    floor_acceleration: np.ndarray
    contact_force: np.ndarray
    contact_share: np.ndarray


def named_measures(structure: Structure, values: np.ndarray) -> Measures:
    """Return the measures of an `Observation`, shape (..., M), by name."""
    n, m = structure.n_floors, len(structure.contacts)
    # where sliders slip, elongations follow the drifts
    ends = np.cumsum((values.shape[-1] - 2 * n - 5 * m, n, n, *4 * (m,)))
    drift, displacement, acceleration, past, *of_contacts = np.split(values, ends, axis=-1)
    closings, speed, force, share = of_contacts
    unit = structure.force_per_length
    return Measures(
        impacts=closings,
        impact_velocity=speed,
        impulse=unit * force,
        storey_drift=drift[..., : len(structure.drift_rows)],
        displacement=displacement,
        floor_acceleration=acceleration,
        contact_force=structure.switched(unit * past, past),
        contact_share=share,
    )
