"""Peaks of storeys, floors and contacts over a window, as variables of the results."""

from collections.abc import Iterator

import numpy as np

from hpcsweep.model.kernel_model import PEAK_FLAGS
from hpcsweep.model.structure import Structure
from hpcsweep.studies.settings import PEAKS, SweepSettings


def wants_peaks(settings: SweepSettings) -> int:
    """Return the flags of those that are asked for, 0 for none."""
    flags = zip(PEAKS, PEAK_FLAGS, strict=True)
    return sum(flag for name, flag in flags if name in settings.metrics)


def empty_peaks(
    structure: Structure, n_runs: int, settings: SweepSettings
) -> Iterator[tuple[str, np.ndarray]]:
    """Allocate those that are asked for, as of runs that failed."""
    sizes = (
        len(structure.drift_rows),
        structure.n_floors,
        len(structure.all_contact_numbers),
    )
    for name, size in zip(PEAKS, sizes, strict=True):
        if name in settings.metrics:
            yield name, np.full((n_runs, size), np.nan)


def store_peaks(rows: dict[str, np.ndarray], structure: Structure, peaks: np.ndarray) -> None:
    """Write peaks, shape (k, D + n + m) as of an `Observation`, into rows of results.

    The force of a contact is largest where its floors are farthest past it: beyond the stop it
    grows with the distance. Contacts that no motion reaches exert none.
    """
    n_drifts, n = len(structure.drift_rows), structure.n_floors
    if "storey_drift" in rows:
        rows["storey_drift"][:] = peaks[:, :n_drifts]
    if "displacement" in rows:
        rows["displacement"][:] = peaks[:, n_drifts : n_drifts + n]
    if "contact_force" in rows:
        gaps = np.array([contact.gap for contact in structure.contacts])
        past = np.maximum(peaks[:, n_drifts + n :] - gaps, 0.0)
        force = structure.contact_stiffness * past
        if np.isfinite(structure.sharpness):
            force /= 1.0 + np.exp(-structure.sharpness * past)
        numbers = structure.all_contact_numbers
        rows["contact_force"][:] = 0.0
        places = [numbers.index(number) for number in structure.contact_numbers]
        rows["contact_force"][:, places] = force
