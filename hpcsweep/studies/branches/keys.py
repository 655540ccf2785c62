"""Keys of a study of branches."""

import numpy as np

from hpcsweep.dynamics.continuation.forced import check_parameter
from hpcsweep.model.structure import Structure

LEAST_STEP = 1e-6
"""Longest step from which on a branch gets somewhere."""


def seeds_of(values) -> tuple[str, ...]:
    """Read the results files whose motions are the seeds."""
    given = values.get("branches.seeds")
    return values.names("branches.seeds", given, "a results file, or a list of them")


def need_parameter(values, structure: Structure, parameter: str) -> None:
    """Refuse a number that the structure does not have as one."""
    try:
        check_parameter(structure, parameter)
    except ValueError as error:
        raise values.error("branches.parameter", parameter, str(error)) from None


def pair_of(values, key: str, default: list[float] | None) -> tuple[list, float, float]:
    """Read two numbers; return them as they are given, too."""
    given = values.get(key, default)
    if not isinstance(given, list) or len(given) != 2:
        raise values.error(key, given, "must be [low, high]")
    low, high = (values.number(key, one) for one in given)
    return given, low, high


def span_of(
    values, parameter: str, omega: np.ndarray, amplitude: np.ndarray
) -> tuple[float, float]:
    """Read the span; default, along A and Omega, that of the job's own."""
    own = {"omega": omega, "amplitude": amplitude}.get(parameter, np.empty(0))
    default = [float(own.min()), float(own.max())] if own.size > 1 else None
    given, low, high = pair_of(values, "branches.span", default)
    if not -1e200 <= low < high <= 1e200:
        raise values.error("branches.span", given, "must have low below high, both at most 1e200")
    if parameter in ("omega", "amplitude"):
        values.check_range("branches.span", **{parameter: (low, high)})
    elif low < 0:
        raise values.error("branches.span", given, f"{parameter} must be at least 0")
    return low, high


def lines_of(parameter: str, omega: np.ndarray, amplitude: np.ndarray, span) -> np.ndarray:
    """Return frequency and amplitude of each line, the parameter's at the end of its span."""
    ends = np.array(span[1:])
    first = ends if parameter == "omega" else omega
    second = ends if parameter == "amplitude" else amplitude
    return np.array([each.ravel() for each in np.meshgrid(first, second, indexing="ij")])


def largest_step_of(values, default: float) -> float:
    """Read the longest step, of units of the state and of the span."""
    value = values.get("branches.largest_step", default)
    return values.within("branches.largest_step", value, LEAST_STEP, 1.0)
