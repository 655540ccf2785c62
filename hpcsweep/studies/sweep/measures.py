"""Store measures of storeys, floors and contacts over a window in the results."""

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import CONTACT_MEASURES, MEASURES


def store_measures(rows: Rows, structure: Structure, measures: np.ndarray) -> None:
    """Store measures, shape (k, D + 2 n + 5 m) as in an `Observation`, in rows of results.

    The force of a contact is largest where its floors are farthest past it. That of a dashpot comes
    as the distance at which the spring alone exerts it. Contacts that no motion reaches exert none.
    """
    n_drifts, n, m = len(structure.drift_rows), structure.n_floors, len(structure.contacts)
    ends = np.cumsum((n_drifts, n, n, *4 * (m,)))
    parts = dict(zip(MEASURES, np.split(measures, ends, axis=1), strict=True))
    past = parts["contact_force"]
    parts["contact_force"] = structure.switched(structure.force_per_length * past, past)
    parts["impulse"] = structure.force_per_length * parts["impulse"]
    numbers = structure.all_contact_numbers
    places = [numbers.index(number) for number in structure.contact_numbers]
    for name in rows.keys() & parts.keys():
        if name not in CONTACT_MEASURES:
            rows[name][:] = parts[name]
        else:
            rows[name][:] = 0.0
            rows[name][:, places] = parts[name]
