"""Keys of a study of branches."""

import numpy as np

from hpcsweep.dynamics.continuation.forced import PARAMETERS, check_parameter
from hpcsweep.model.structure import Structure
from hpcsweep.studies.keys import Key

PARAMETER = Key("parameter", "what changes along a branch", "amplitude", PARAMETERS)
_NUMBERS = (
    Key("steps", "most points of a branch to either side of a motion", 2000, (1, 100_000)),
    Key("largest_step", "longest step, in units of the state and of the span", 0.05, (1e-6, 1.0)),
    Key("max_branches", "room for branches of each line", 64, (1, 10_000)),
    Key("max_points", "room for points of branches of each line", 20_000, (1, 10_000_000)),
    Key("max_seeds", "room for motions of each line", 4000, (1, 10_000_000)),
    Key("starts", "starts of a search for orbits that no motion shows", 0, (0, 1_000_000)),
    Key("seed", "of the sequence of these starts", 0, (0, 2**62)),
    Key("max_curves", "room for curves of each line", 256, (1, 10_000)),
    Key("max_curve_points", "room for points of curves of each line", 5000, (1, 10_000_000)),
)
NUMBERS = {key.name: key for key in _NUMBERS}
KEYS = (
    Key(
        "seeds",
        "results files of sweeps, points or attractors, one or a list, relative to where the job "
        "is run: branches go through their periodic motions ([how](branches.md#a-study))",
    ),
    PARAMETER,
    Key(
        "span",
        "lowest and highest value of the parameter",
        told="those of `sweep.amplitude`, or `sweep.omega`",
    ),
    *_NUMBERS[:7],
    Key(
        "curves",
        'kinds of special points, a list of `"fold"`, `"doubling"`, `"torus"`, `"grazing"`, that '
        "are followed over A and Omega, of orbits up to `sweep.max_orbit_period`, each line's half "
        "way to the next line ([how](branches.md#curves-of-a-study)); with `branches.parameter` "
        "amplitude",
        told="[]",
    ),
    Key(
        "curve_span",
        "lowest and highest frequency of curves",
        told="those of `sweep.omega`",
    ),
    *_NUMBERS[7:],
)


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
