"""Write the job of a finer grid over a part of another job's, which contains its old points.

Between two neighbours of the old grid lie `factor` - 1 new values, evenly spaced. They are written
as a range where that reproduces the old values to the last bit, else as a list.
"""

import copy
import itertools
from collections.abc import Mapping

import numpy as np

from hpcsweep.job.job import Job, JobError
from hpcsweep.job.keys import every_key
from hpcsweep.job.reading import parse_job
from hpcsweep.job.tree import NOT_INHERITED, parse_toml, write
from hpcsweep.job.values import Values

MAX_FACTOR = 1000


def zoom(
    job: Job,
    factor: int,
    omega: tuple[float, float] | None = None,
    amplitude: tuple[float, float] | None = None,
) -> str:
    """Write a job of a finer grid.

    Parameters
    ----------
    job : Job
    factor : int
        Number of steps that replace one, at least 1.
    omega, amplitude : (float, float), optional
        Ends of the part, widened to the nearest points of the grid. Omega is in the job's own form,
        e.g. ``sweep.frequency``. By default an axis is unchanged.

    Returns
    -------
    str
        TOML text.

    Raises
    ------
    JobError
        If the job has no grid, or no part of it lies there.
    """
    tree = copy.deepcopy(parse_toml(job.text, job.name))
    for key in NOT_INHERITED:
        tree.pop(key, None)
    sweep = tree.get("sweep", {})
    if not 1 <= factor <= MAX_FACTOR:
        raise JobError(f"--factor {factor}: must be from 1 to {MAX_FACTOR}")
    frequency = "frequency" if "frequency" in sweep else "omega"
    for name, key, ends in (("omega", frequency, omega), ("amplitude", "amplitude", amplitude)):
        if ends is None:
            continue
        if key not in sweep:
            raise JobError(f"{job.name}: has no sweep.{key} that could be made finer")
        if isinstance(sweep[key], str):
            raise JobError(
                f"--{name}: sweep.{key} = {sweep[key]!r} is a formula, which has no grid"
            )
        old = Values(job.name, tree).numbers(f"sweep.{key}", sweep[key], ascending=False)
        sweep[key] = _finer(f"--{name}", np.sort(old), factor, *ends)
    text = write(tree, every_key())
    parse_job(text, "zoom", "zoom")
    return text


def _finer(option: str, old: np.ndarray, factor: int, low: float, high: float) -> Mapping | list:
    if not low <= high:
        raise JobError(f"{option} {low:g} {high:g}: must be the lower and the upper end")
    first = max(int(np.searchsorted(old, low, side="right")) - 1, 0)
    last = min(int(np.searchsorted(old, high, side="left")), old.size - 1)
    if old[last] < low or old[first] > high or last <= first:
        there = f"from {old[0]:g} to {old[-1]:g}"
        raise JobError(
            f"{option} {low:g} {high:g}: must hold more than one value of the grid, {there}"
        )
    kept = old[first : last + 1]
    count = factor * (kept.size - 1) + 1
    table = {"from": float(kept[0]), "to": float(kept[-1]), "count": count}
    even = Values("", {}).numbers("grid", table, ascending=True)
    if np.array_equal(even[::factor], kept):
        return table
    parts = [
        left + (right - left) * (np.arange(factor) / factor)
        for left, right in itertools.pairwise(kept)
    ]
    return [*np.concatenate(parts).tolist(), float(kept[-1])]
