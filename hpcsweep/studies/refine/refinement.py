"""Read how a job refines a map, and define the labels of its points."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from hpcsweep.solvers.outcome import Outcome

LABELS = {
    "class": ("motion", "orbit_period"),
    "contact": ("contact",),
    "number": ("n_attractors",),
}
"""What points may be told apart by, and the variables that tell it."""
MOST_LEVELS = 12
LEAST_WRONG = 1e-6
MOST_SEED = 2**31 - 1
KEYS = ("levels", "on", "wrong", "seed")


class Source(IntEnum):
    """Source of the value of a point of a refined map."""

    UNKNOWN = 0
    """The map is not complete."""
    COMPUTED = 1
    INFERRED = 2
    """From the cell it lies in, all of whose computed points agree."""
    AUDIT = 3
    """Computed because the audit drew it from the inferred points."""


@dataclass(frozen=True)
class Refinement:
    """Refinement of a map.

    Attributes
    ----------
    levels : int
        The coarsest cells have 2**levels steps of the grid a side.
    on : tuple of str
        Labels, of `LABELS`, in which the points of a cell must agree.
    wrong : float
        Limit of the upper end of the interval of the share of wrong points among the inferred ones.
    seed : int
        Seed of the audit.
    """

    levels: int = 4
    on: tuple[str, ...] = ("class", "contact")
    wrong: float = 0.003
    seed: int = 0

    @property
    def variables(self) -> list[str]:
        """Variables in which points must agree."""
        return [variable for name in self.on for variable in LABELS[name]]

    def labels(self, rows: dict[str, np.ndarray]) -> np.ndarray:
        """Return the labels of k runs, shape (k, 1 + len(variables)).

        The first column is 1 where a run failed, which agrees with none.
        """
        columns = [rows["outcome"] != Outcome.COMPLETE, *(rows[name] for name in self.variables)]
        return np.stack([np.asarray(column).astype(np.uint64) for column in columns], axis=1)


def read_refinement(
    values, settings, block_size: int, known: tuple[str, ...] = ("class", "contact")
) -> Refinement | None:
    """Read the table ``study.refine`` of a job; None if there is none.

    Parameters
    ----------
    values : hpcsweep.job.values.Values
    settings : SweepSettings
    block_size : int
    known : tuple of str
        What the runs may be told by, of `LABELS`; the default is all of it.

    Raises
    ------
    JobError
        If a value is not allowed, or the job does not store the variables of a label.
    """
    if not values.has("study.refine"):
        return None
    given = values.get("study.refine")
    if not isinstance(given, Mapping):
        raise values.error("study.refine", given, "must be a table such as {levels = 4}")
    values.check_keys("study.refine", given, KEYS)
    if values.has("study.points"):
        limit = "does not go with study.points: a list of points has no cells"
        raise values.error("study.refine", given, limit)
    if block_size != 1:
        limit = "must be 1 with study.refine: each point is committed on its own"
        raise values.error("output.block", block_size, limit)
    default = Refinement()
    on = given.get("on", list(known))
    if not isinstance(on, list) or not on or not all(name in known for name in map(str, on)):
        raise values.error("study.refine.on", on, f"must be a list of {', '.join(known)}")
    if len(set(on)) < len(on):
        raise values.error("study.refine.on", on, "must not hold a word twice")
    if "class" in on and not settings.classify_cycles:
        limit = '"class" needs sweep.classify_cycles above 0, and solver.method = "flow"'
        raise values.error("study.refine.on", on, limit)
    if "contact" in on and "contact" not in settings.metrics:
        raise values.error("study.refine.on", on, '"contact" needs output.contact = true')
    wrong = values.number("study.refine.wrong", given.get("wrong", default.wrong))
    if not LEAST_WRONG <= wrong < 1:
        limit = f"must lie between 0 and 1, at least {LEAST_WRONG:g}"
        raise values.error("study.refine.wrong", wrong, limit)
    levels, seed = (
        values.whole_in(
            f"study.refine.{name}", given.get(name, getattr(default, name)), least, most
        )
        for name, least, most in (("levels", 1, MOST_LEVELS), ("seed", 0, MOST_SEED))
    )
    return Refinement(levels, tuple(on), wrong, seed)


def refinement_of(study) -> Refinement | None:
    """Return the refinement of a study's map; None if all of its runs are computed."""
    return getattr(study, "refine", None)


def not_refinable(study) -> str:
    """Return why the points of a map have no neighbours and cannot be refined; '' if they can."""
    if refinement_of(study) is None:
        return ""
    grid = study.part((0,) * len(study.axes))
    axes = {f"sweep.{name}": getattr(grid, name) for name in ("omega", "amplitude")}
    axes |= {f"vary.{axis.key}": axis.values for axis in study.axes}
    for key, values in axes.items():
        numbers = np.asarray(values)
        if numbers.dtype.kind not in "if" or numbers.size < 2 or np.any(np.diff(numbers) <= 0):
            return f"study.refine: {key} must have two numbers or more, which ascend"
    return ""


def map_shape(study) -> tuple[int, ...]:
    """Return the number of points of every axis of a map: varied keys, frequencies, amplitudes."""
    return tuple(study.dimensions[dim] for dim in study.run_dims if dim != "direction")
