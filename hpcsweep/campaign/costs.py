"""What each frame costs: a pilot's samples first, measured blocks as they come in.

Kept in cells (direction, stratum of amplitudes, frame), at most `STRATA` strata, so that memory
grows with the number of frames alone: about 0.5 kB each, on rank 0.

The pilot gives the cost of a run per (stratum, frame), interpolated over frames where it did not
look. A measured cell counts as it is; its ratio to the pilot's, interpolated over frames too,
corrects the cells around it. Only the order of the work depends on this, never a result.
"""

import time
from collections.abc import Callable

import numpy as np

from hpcsweep.job import Job
from hpcsweep.studies import amplitude_sweep as sweep

STRATA = 8
PILOT_SHARE = 0.01
"""Largest share of the job's runs that a pilot may add."""
PILOT_TIMED = 2
"""Runs timed in one sample."""
PILOT_PER_FRAME = 4
"""Samples a frame beyond which more tell nothing."""
MAX_SAMPLES = 2048
SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps of the additive sequence (Roberts' R2) that fills frames x amplitudes evenly."""


class FrameCosts:
    """Estimated cost of every frame of a job, learning.

    Parameters
    ----------
    job : Job
    """

    def __init__(self, job: Job):
        n_blocks = -(-job.amplitude.size // job.block)
        self._n_amplitudes, self._block = job.amplitude.size, job.block
        self._n_strata = min(STRATA, n_blocks)
        shape = (len(job.directions), self._n_strata, job.omega.size)
        sizes = np.full(n_blocks, job.block)
        sizes[-1] = job.amplitude.size - (n_blocks - 1) * job.block
        self._total = np.zeros(shape[:2])
        for direction in range(shape[0]):
            for block in range(n_blocks):
                self._total[direction, self._stratum_of_block(direction, block)] += sizes[block]
        self._done = np.zeros(shape, np.int32)
        self._runs = np.zeros(shape, np.int32)
        self._seconds = np.zeros(shape)
        self._pilot_seconds = np.zeros(shape[1:])
        self._pilot_runs = np.zeros(shape[1:], np.int32)
        self._prior: np.ndarray | None = None
        self._left: list[float] | None = None

    def sampled(self, frame: int, amplitude: int, runs: int, seconds: float) -> None:
        """Learn from a pilot's runs from amplitude index `amplitude` on."""
        stratum = self._stratum(amplitude + 0.5 * runs)
        self._pilot_runs[stratum, frame] += runs
        self._pilot_seconds[stratum, frame] += seconds
        self._prior = self._left = None

    def measured(self, frame: int, direction: int, block: int, runs: int, seconds: float) -> None:
        """Learn what a block cost."""
        cell = direction, self._stratum_of_block(direction, block), frame
        self._runs[cell] += runs
        self._seconds[cell] += seconds
        self._left = None

    def done(self, frame: int, direction: int, block: int, runs: int) -> None:
        """Note that a block need not be computed any more."""
        self._done[direction, self._stratum_of_block(direction, block), frame] += runs
        self._left = None

    def n_known(self) -> int:
        """Count the runs whose cost was measured or sampled."""
        return int(self._runs.sum() + self._pilot_runs.sum())

    def left(self, frame: int) -> float:
        """Give the estimated cost (s) of what is left of a frame; 1 a run if nothing is known."""
        if self._left is None:
            runs = np.maximum(self._total[:, :, None] - self._done, 0)
            self._left = (runs * self._per_run()).sum(axis=(0, 1)).tolist()
        return self._left[frame]

    def totals(self) -> np.ndarray:
        """Estimate the cost (s) of every whole frame, shape (n_frames,)."""
        return (self._total[:, :, None] * self._per_run()).sum(axis=(0, 1))

    def pieces(self) -> list[np.ndarray]:
        """Estimate the cost (s) of every frame's strata, in the order of its path."""
        cells = self._total[:, :, None] * self._per_run()
        cells[1:] = cells[1:, ::-1]
        return list(cells.reshape(-1, cells.shape[2]).T)

    def _per_run(self) -> np.ndarray:
        """Estimated seconds a run, shape (direction, stratum, frame)."""
        if self._prior is None:
            self._prior = _fill(self._pilot_runs, self._pilot_seconds)
        prior = self._prior
        known = self._runs > 0
        if not known.any():
            return np.broadcast_to(prior, known.shape).copy()
        expected = self._runs * prior
        # a cell with no measured neighbour over the frames is corrected as the whole is
        ratio = np.full(known.shape, self._seconds.sum() / expected.sum())
        frames = np.arange(known.shape[2])
        for direction, stratum in np.ndindex(known.shape[:2]):
            at = np.flatnonzero(known[direction, stratum])
            if at.size:
                cell = direction, stratum, at
                ratio[direction, stratum] = np.interp(
                    frames, at, self._seconds[cell] / expected[cell]
                )
        return ratio * prior

    def _stratum(self, amplitude: float) -> int:
        return min(int(amplitude / self._n_amplitudes * self._n_strata), self._n_strata - 1)

    def _stratum_of_block(self, direction: int, block: int) -> int:
        middle = min((block + 0.5) * self._block, self._n_amplitudes)
        return self._stratum(self._n_amplitudes - middle if direction else middle)


def _fill(runs: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Interpolate seconds a run over frames, then over strata; 1 if there are none.

    Parameters
    ----------
    runs, seconds : ndarray, shape (n_strata, n_frames)
    """
    n_strata, n_frames = runs.shape
    filled = np.full(runs.shape, np.nan)
    for stratum in range(n_strata):
        at = np.flatnonzero(runs[stratum])
        if at.size:
            values = np.maximum(seconds[stratum, at] / runs[stratum, at], 1e-12)
            filled[stratum] = np.interp(np.arange(n_frames), at, values)
    known = np.flatnonzero(~np.isnan(filled[:, 0]))
    if not known.size:
        return np.ones(runs.shape)
    for stratum in np.flatnonzero(np.isnan(filled[:, 0])):
        above = np.searchsorted(known, stratum)
        low, high = known[max(above - 1, 0)], known[min(above, known.size - 1)]
        share = (stratum - low) / (high - low) if high > low else 0.0
        filled[stratum] = (1 - share) * filled[low] + share * filled[high]
    return filled


def n_samples(job: Job) -> int:
    """Count the samples of a campaign's pilot: all runs of them are 1 % of the job's at most."""
    affordable = PILOT_SHARE * job.n_runs / (PILOT_TIMED + 1)
    return int(min(affordable, PILOT_PER_FRAME * job.omega.size, MAX_SAMPLES))


def sample_place(job: Job, index: int) -> tuple[int, int]:
    """Give frame and amplitude index of a sample; samples 0 to k fill both evenly for any k."""
    frame, amplitude = ((0.5 + index * step) % 1.0 for step in SPREAD)
    last = max(job.amplitude.size - PILOT_TIMED - 1, 0) + 1
    return int(frame * job.omega.size), int(amplitude * last)


def time_sample(
    job: Job, frame: int, amplitude: int, poll: Callable[[], None] | None = None
) -> tuple[int, float]:
    """Time runs of one frame from an amplitude index on.

    Returns
    -------
    runs : int
    seconds : float
    """
    omega = float(job.omega[frame])
    path = job.amplitude[amplitude : amplitude + PILOT_TIMED + 1]
    # one run to arrive on the attractor, not timed
    arrived = sweep.sweep_block(
        job.structure, omega, path[:1], job.initial_state, job.settings, poll
    )
    state = arrived["final_state"][-1]
    if not np.isfinite(state).all():
        state = job.initial_state
    path = path[1:] if path.size > 1 else path
    begun = time.perf_counter()
    sweep.sweep_block(job.structure, omega, path, state, job.settings, poll)
    return path.size, time.perf_counter() - begun
