"""Read how a job refines a map, and define the labels of its points."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.keys import Key, names

LABELS = {
    "class": ("motion", "orbit_period"),
    "period": ("orbit_period",),
    "contact": ("contact",),
    "number": ("n_attractors",),
    "attractor": ("label",),
}
"""What distinguishes points, and the variables that hold it."""
COSTS = ("cycles", "classification_cycles")
"""Variables whose sum a run costs, in forcing periods."""
OF_RUNS = ("class", "period", "contact")
"""Labels of single runs."""
LEVELS = Key("levels", "the coarsest cells have 2^levels steps of the grid a side", 4, (1, 12))
ON = Key(
    "on",
    'what the points of a cell must agree in: a list of `"class"` (of motion, and the orbit '
    'period) or `"period"` (which does not tell chaos, tori and long periods apart), and '
    '`"contact"`; of attractors their `"number"`, of basins the `"attractor"`',
    told="class and contact, or what there is",
)
MIN_WRONG = 1e-6
WRONG = Key(
    "wrong",
    "share of the inferred points below which the upper end of the interval of the wrong ones "
    "must lie, between 0 and 1",
    0.003,
)
SEED = Key("seed", "of the points that the audit draws", 0, (0, 2**31 - 1))
CURVES = Key(
    "curves",
    "results of a [study of branches](branches.md#curves-of-a-study), a file or a list of files, "
    "where the job is run: cells that their curves cross are cut down to the grid",
    told="none",
)
KEYS = (LEVELS, ON, WRONG, SEED, CURVES)
REFINE = Key(
    "refine",
    "table: the map is computed [only where something "
    "happens](growing.md#maps-computed-only-where-something-happens); its keys are "
    + "; ".join(
        f"`{key.name}`, {key.description} (default {key.told or key.shown})" for key in KEYS
    ),
    told="all points are computed",
)


class Source(IntEnum):
    """Source of the value of a point of a refined map."""

    UNKNOWN = 0
    """The map is not complete."""
    COMPUTED = 1
    INFERRED = 2
    """From the cell it lies in, or the nearest point where the cell's points differ."""
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
    curves : tuple of str
        Results files of branches: cells that their curves cross are cut.
    """

    levels: int = LEVELS.default
    on: tuple[str, ...] = ("class", "contact")
    wrong: float = WRONG.default
    seed: int = SEED.default
    curves: tuple[str, ...] = field(default=(), metadata={"later": True})

    @property
    def variables(self) -> list[str]:
        """Variables in which points must agree."""
        return list(dict.fromkeys(variable for name in self.on for variable in LABELS[name]))

    def labels(self, rows: Rows) -> np.ndarray:
        """Return the labels of k runs, shape (k, 2 + len(variables)).

        The first column is 1 where a run failed, which agrees with none; the last is its cost in
        forcing periods.
        """
        cost = sum(rows[name].astype(np.int64) for name in COSTS if name in rows)
        failed = rows["outcome"] != Outcome.COMPLETE
        columns = [failed, *(rows[name] for name in self.variables), cost]
        return np.stack([np.asarray(column).astype(np.uint64) for column in columns], axis=1)


def read_refinement(
    values, settings, block_size: int, labels: tuple[str, ...] = OF_RUNS
) -> Refinement | None:
    """Read the table ``study.refine`` of a job; None if there is none.

    Parameters
    ----------
    values : hpcsweep.job.values.Values
    settings : SweepSettings
    block_size : int
    labels : tuple of str
        What distinguishes the runs, of `LABELS`; the default of a job is all of it, of `OF_RUNS`
        class and contact set.

    Raises
    ------
    JobError
        If a value is not allowed, or the job does not store the variables of a label.
    """
    if not values.has("study.refine"):
        return None
    table = values.get("study.refine")
    values.check_table("study.refine", table, names(KEYS), ())
    if values.has("study.points"):
        limit = "does not go with study.points: a list of points has no cells"
        raise values.error("study.refine", table, limit)
    if block_size != 1:
        limit = "must be 1 with study.refine: each point is committed on its own"
        raise values.error("output.block", block_size, limit)
    default = Refinement()
    on = table.get("on", list(default.on if labels is OF_RUNS else labels))
    if not values.choices("study.refine.on", on, labels):
        raise values.error("study.refine.on", on, "must not be empty")
    if "class" in on and not settings.classify_cycles:
        limit = '"class" needs sweep.classify_cycles above 0, and solver.method = "flow"'
        raise values.error("study.refine.on", on, limit)
    if "contact" in on and "contact" not in settings.metrics:
        raise values.error("study.refine.on", on, '"contact" needs output.contact = true')
    wrong = values.number("study.refine.wrong", table.get("wrong", default.wrong))
    if not MIN_WRONG <= wrong < 1:
        limit = f"must lie between 0 and 1, at least {MIN_WRONG:g}"
        raise values.error("study.refine.wrong", wrong, limit)
    levels, seed = (
        values.whole(f"study.refine.{key.name}", table.get(key.name, key.default), *key.limits)
        for key in (LEVELS, SEED)
    )
    return Refinement(levels, tuple(on), wrong, seed, _curves(values, table, labels))


def _curves(values, table: Mapping, labels: tuple[str, ...]) -> tuple[str, ...]:
    """Read the results files whose curves are not to be missed."""
    if "curves" not in table:
        return ()
    what = "a results file of branches, or a list of them"
    listed = values.names("study.refine.curves", table["curves"], what)
    if "attractor" in labels:
        limit = "does not go with basins: curves lie over sweep.omega and sweep.amplitude"
        raise values.error("study.refine.curves", table["curves"], limit)
    return listed
