"""Say in words, with units, where the starts of a study of attractors or basins lie."""

from hpcsweep.model.unit_names import known_unit


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
        + known_unit(own.structure, "length" if index < n else "velocity")
        for name, (index, low, high) in getattr(own, "starting_range", {}).items()
    ]
