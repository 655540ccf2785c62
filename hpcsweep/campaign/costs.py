"""Estimate what each task costs: from a pilot's samples first, then from measured blocks.

Costs are kept in cells (stratum of the last axis of the runs, frame), at most `STRATA` strata, of
both directions together. The pilot estimates the cost of a run of a cell, interpolated over frames
that it did not sample. A measured cell counts as measured; others cost the mean of what is known
around them. A block costs what its cell costs, a task the sum of its remaining blocks. Only the
order of the work and the remaining time depend on this, never a result.

Time of the whole over the least possible one, without the pilot and with it (replayed with the
measured costs, updated from blocks in both): 1.16 and 1.03 for the 48 frames of
`jobs/paper/gaps.toml` on 16 ranks, 1.40 and 1.14 on 32; 1.33 and 1.18 for 40 frames of the whole
study on 4 ranks; nothing (1.36 and 1.37) for the same with the damping as described. It also makes
the remaining time known from the start.
"""

import contextlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.parallel.schedule import computing_ranks
from hpcsweep.store.journal import BlockCost, CampaignHistory, PilotCost, read_history
from hpcsweep.studies.study import Study, Work

STRATA = 8
PILOT_SHARE = 0.01
"""Largest share of the job's runs that a pilot may add."""
PILOT_TIMED = 2
"""Runs timed in one sample."""
PILOT_PER_FRAME = 4
"""Most samples a frame: more add nothing."""
PILOT_WEIGHT = 0.2
"""Share of the whole work that must be measured to weigh as much as the pilot in `remaining`."""
PRIOR_RUNS = 0.5
"""Weight, in runs, of the pilot's interpolated cost beside what is known around a frame."""
FRAMES_AROUND = 600
"""Share of the frames, as 1/x, over which a mean falls off ..."""
MAX_AROUND = 20.0
"""... and most frames."""
MAX_SAMPLES = 2048
MIN_ELAPSED = 0.5
"""Seconds of work after which the overhead besides the runs is known."""
SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps of the additive sequence (Roberts' R2) that fills frames x amplitudes evenly."""


class TaskCosts:
    """Estimated cost of every task of a study, updated as blocks are measured.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: Study):
        dims = study.commit.dims
        self._sizes = tuple(study.dimensions[dim] for dim in dims)
        *outer, number = place = np.ogrid[tuple(map(slice, self._sizes))]
        direction = outer.pop(dims.index("direction")) if "direction" in dims else np.array(0)
        # the other axes count frames, in their order
        frame = np.ravel_multi_index(tuple(outer), [places.size for places in outer])
        size, count = study.block_size, study.dimensions[study.run_dims[-1]]
        middle = np.minimum((number + 0.5) * size, count) / count
        middle = np.where(np.vectorize(study.descends)(direction), 1.0 - middle, middle)
        self._strata = min(STRATA, self._sizes[-1])
        stratum = np.minimum(middle * self._strata, self._strata - 1).astype(int)
        shape = self._strata, study.n_frames
        cell = np.ravel_multi_index((stratum, frame), shape)
        n_runs = np.minimum(size, count - number * size)
        self._task, self._cell, self._block_runs = (
            np.broadcast_to(values, self._sizes).ravel()
            for values in (study.task_of(*place), cell, n_runs)
        )
        self._left_runs = self._block_runs.astype(float)
        self._runs = np.zeros(shape, np.int64)
        self._seconds = np.zeros(shape)
        self._pilot_seconds = np.zeros(shape)
        self._pilot_runs = np.zeros(shape, np.int64)
        self._prior: np.ndarray | None = None
        self._left: np.ndarray | None = None

    def learn(self, history: CampaignHistory, done: np.ndarray) -> None:
        """Update from a journal, and from the places of the blocks that are done."""
        for cost in history.costs:
            self.measured(cost)
        for sample in history.samples:
            self.sampled(sample)
        self.done(done)

    def sampled(self, sample: PilotCost) -> None:
        """Update from a pilot's runs; a sample that the study does not have is ignored."""
        if sample.frame >= self._pilot_runs.shape[1] or sample.runs < 1:
            return
        cell = int(np.clip(sample.along * self._strata, 0, self._strata - 1)), sample.frame
        self._pilot_runs[cell] += sample.runs
        self._pilot_seconds[cell] += sample.seconds
        self._prior = self._left = None

    def measured(self, cost: BlockCost) -> None:
        """Update from a measured block; one that the study does not have is ignored."""
        with contextlib.suppress(ValueError):  # no such place
            cell = self._cell[np.ravel_multi_index(cost.place, self._sizes)]
            self._runs.flat[cell] += cost.runs
            self._seconds.flat[cell] += cost.seconds
            self._left = None

    def done(self, places: Any) -> None:
        """Record which blocks are done, shape (n, n_axes) or (n_axes,)."""
        self._left_runs[np.ravel_multi_index(tuple(np.transpose(places)), self._sizes)] = 0.0
        self._left = None

    def n_known(self) -> int:
        """Return the number of runs whose cost was measured or sampled."""
        return int(self._runs.sum() + self._pilot_runs.sum())

    def left(self, task: int) -> float:
        """Estimate the remaining cost (s) of a task; 1 a run if nothing is known."""
        return float(self._of_tasks_left()[task])

    def remaining(self, n_computing: int = 1) -> float | None:
        """Estimate the time (s) that the remaining work takes on a number of ranks.

        Returns
        -------
        float or None
            None if nothing is known.
        """
        if not self.n_known():
            return None
        left = self._of_tasks_left()
        return float(max(left.sum() / n_computing, left.max()))

    def totals(self) -> np.ndarray:
        """Estimate the cost (s) of every whole task, shape (n_tasks,)."""
        return self._of_tasks(self._block_runs)

    def _of_tasks_left(self) -> np.ndarray:
        """Estimate the remaining cost (s) of every task, shape (n_tasks,)."""
        if self._left is None:
            self._left = self._of_tasks(self._left_runs)
        return self._left

    def _of_tasks(self, runs: np.ndarray) -> np.ndarray:
        """Sum the costs (s) of runs, given their number in each block, over tasks."""
        return np.bincount(self._task, runs * self._per_run().flat[self._cell])

    def _per_run(self) -> np.ndarray:
        """Estimate the seconds a run, shape (stratum, frame).

        A sum may not rely on the nearest measured block. The pilot's samples scatter, and the ratio
        of one block to one sample would apply to everything not yet measured; and the frames left
        late are those whose samples happened to be too low. So the whole pilot is corrected by one
        ratio, which starts at 1 and tends to the measured one, and a frame takes the mean of all
        that is known around it, measured blocks and samples, weighted by their runs.
        """
        if not self.n_known():
            return np.ones(self._runs.shape)
        if self._prior is None:
            self._prior = _fill(self._pilot_runs, self._pilot_seconds)
        prior = self._prior
        cells = np.bincount(self._cell, self._block_runs, self._runs.size)
        # without a pilot the prior has no unit
        pilot = PILOT_WEIGHT * float(cells @ prior.ravel()) * bool(self._pilot_runs.any())
        ratio = (self._seconds.sum() + pilot) / ((self._runs * prior).sum() + pilot)
        around = _around(self._seconds + ratio * self._pilot_seconds) + PRIOR_RUNS * ratio * prior
        mean = around / (_around((self._runs + self._pilot_runs).astype(float)) + PRIOR_RUNS)
        return np.where(self._runs > 0, self._seconds / np.maximum(self._runs, 1), mean)


def _around(values: np.ndarray) -> np.ndarray:
    """Sum values over frames, the last axis, with weights that decay around each."""
    reach = min(max(values.shape[-1] / FRAMES_AROUND, 0.3), MAX_AROUND)
    far = int(np.ceil(5 * reach))
    weights = np.exp(-np.abs(np.arange(-far, far + 1)) / reach)
    return np.array([np.convolve(row, weights)[far : far + row.size] for row in values])


def _fill(runs: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Interpolate seconds a run over frames, then over strata; 1 if there are none.

    Parameters
    ----------
    runs, seconds : ndarray, shape (n_strata, n_frames)
    """
    n_strata, n_frames = runs.shape
    sampled = np.flatnonzero(runs.any(axis=1))
    if not sampled.size:
        return np.ones(runs.shape)
    filled = np.empty((sampled.size, n_frames))
    for row, stratum in zip(filled, sampled, strict=True):
        at = np.flatnonzero(runs[stratum])
        values = np.maximum(seconds[stratum, at] / runs[stratum, at], 1e-12)
        row[:] = np.interp(np.arange(n_frames), at, values)
    return np.array([np.interp(np.arange(n_strata), sampled, column) for column in filled.T]).T


def n_samples(study: Work) -> int:
    """Return the number of samples of a campaign's pilot: at most 1 % of the job's runs."""
    affordable = PILOT_SHARE * study.n_runs / (PILOT_TIMED + 1)
    return int(min(affordable, PILOT_PER_FRAME * study.n_frames, MAX_SAMPLES))


def sample_place(index: int) -> tuple[float, float]:
    """Return the place of a sample over the frames and along them; 0 to k fill both evenly."""
    first, second = ((0.5 + index * step) % 1.0 for step in SPREAD)
    return first, second


def time_sample(
    study: Work, index: int, poll: Callable[[], None] | None = None, n_runs: int = PILOT_TIMED
) -> PilotCost:
    """Time the runs of a sample."""
    (frame, along), runs, seconds = study.time_runs(*sample_place(index), n_runs, poll)
    return PilotCost(frame, along, runs, seconds)


class KnownCosts:
    """Costs of the unfinished tasks; made on every rank, held on rank 0.

    Nothing is kept where only one task is left: there is nothing to decide, and its runs show how
    fast it is. A single rank takes the tasks in their order, but reports the remaining time.

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    study : Study
    output : Path, optional
        File whose journal is read, where there is more than one task to do.
    done : ndarray of int, shape (n, n_axes)
        Places of the blocks of unfinished tasks that are done.
    """

    def __init__(self, comm, study: Study, output: Path | None = None, done: Any = ()):
        self.n_computing = computing_ranks(comm.size)
        self.begun: float | None = None
        self.spent = 0.0
        self.tasks: TaskCosts | None = None
        self._n_samples = n_samples(study)
        if comm.rank == 0 and output is not None:
            self.tasks = TaskCosts(study)
            self.tasks.learn(read_history(output), done)

    def n_samples(self) -> int:
        """Return the number of samples that a pilot has yet to time; 0 except on rank 0."""
        if not self.tasks or self.tasks.n_known() >= self._n_samples * PILOT_TIMED:
            return 0
        return self._n_samples

    def block_done(self, cost: BlockCost) -> None:
        """Update from a block."""
        if self.tasks:
            self.tasks.measured(cost)
            self.tasks.done(cost.place)
            self._spend(cost.seconds)

    def _spend(self, seconds: float) -> None:
        """Add the time of runs, from which the overhead besides them follows."""
        self.spent += seconds
        if self.begun is None:
            self.begun = time.monotonic() - seconds

    def seconds_left(self) -> float | None:
        """Estimate the wall time (s) that the runs take which are left; None if it is not known."""
        return self.tasks.remaining(self.n_computing) if self.tasks else None


def remaining_of(campaigns: Sequence[KnownCosts]) -> float | None:
    """Estimate the wall time (s) until several campaigns that share the ranks are done.

    Besides its runs a rank handles messages and commits, which take longer than the runs of single
    points: runs are scaled by the wall time that they have taken in this session.

    Returns
    -------
    float or None
        None if nothing is known of one of them.
    """
    lefts = [each.seconds_left() for each in campaigns]
    runs = sum(left for left in lefts if left is not None)
    if None in lefts:
        return None
    begun = [each.begun for each in campaigns if each.begun is not None]
    elapsed = time.monotonic() - min(begun) if begun else 0.0
    spent = sum(each.spent for each in campaigns)
    if elapsed < MIN_ELAPSED or not spent:
        return runs
    return runs * max(elapsed * campaigns[0].n_computing / spent, 1.0)
