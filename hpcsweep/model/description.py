"""A structure told in plain values, for files that are read without their job."""

import json

from hpcsweep.model.structure import Structure


def describe(structure: Structure) -> dict:
    """Tell all that the equations of `hpcsweep.model.matrices` need, but A and Omega."""
    return {
        "n_floors": structure.n_floors,
        "mass": structure.mass_matrix.tolist(),
        "stiffness": structure.stiffness_matrix.tolist(),
        "damping": structure.damping_matrix.tolist(),
        "forcing": structure.forcing_vector.tolist(),
        "harmonics": [list(harmonic) for harmonic in structure.harmonics],
        "sharpness": structure.sharpness,
        "contacts": [
            {
                "number": number,
                "direction": list(contact.direction),
                "gap": contact.gap,
                "stiffness": contact.stiffness,
            }
            for number, contact in zip(structure.contact_numbers, structure.contacts, strict=True)
        ],
        "drift": structure.drift_rows.tolist(),
    }


def as_text(structure: Structure) -> str:
    """Write `describe` as JSON (an infinite sharpness as Infinity)."""
    return json.dumps(describe(structure))
