"""Say in words, with units, where the starts of a study of attractors or basins lie."""

from hpcsweep.model.unit_names import is_in_gaps, unit_of


def starting_range(study) -> list[str]:
    """Return a line for each component, or group of equal ones, with the range of the starts.

    Parameters
    ----------
    study
        Of a study that varies keys the part at the first values.

    Returns
    -------
    list of str
        Empty for a study without a box or slice of starts.
    """
    own = study.base if study.axes else study
    n = own.structure.n_floors
    return [
        f"{name} from {low:.6g} to {high:.6g}"
        + unit_after(own.structure, "length" if index < n else "velocity")
        for name, (index, low, high) in getattr(own, "starting_range", {}).items()
    ]


def unit_after(structure, quantity: str) -> str:
    """Format the unit that follows a number; empty where it has no name."""
    known = any(structure.unit_names) or is_in_gaps(structure)
    return f" {unit_of(structure, quantity)}" if known else ""
