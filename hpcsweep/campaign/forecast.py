"""Forecast what a job will cost, from a timed sample, before it is run.

Runs spread over the study are timed, by the processor's time and by the clock. Their mean times the
number of runs is the cost of the whole; with one longest task d of a whole W no schedule ends
before max(W / N, d) on N ranks, so that at most W / d ranks are of use.

The interval of W has two parts. The mean of a sample of n runs has an error: Student's interval of
its relative error, on a logarithmic scale, holds less than its share where few runs are costly, so
that the one of `NOMINAL` stands for `SHARE` (measured for costs a hundredfold apart and lognormal
ones up to sigma = 1, from 2 runs on). And a core is not always as fast as in the sample: the upper
end is by the clock, or `LOAD` times the processor's time, whichever is longer.
"""

import math
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.campaign.describe import describe
from hpcsweep.campaign.progress import note
from hpcsweep.job import Job
from hpcsweep.parallel import memory
from hpcsweep.parallel.schedule import DEDICATED_MASTER
from hpcsweep.store import Layout, with_inputs
from hpcsweep.store.inputs import Inputs
from hpcsweep.studies.run_names import count
from hpcsweep.studies.study import Lines, Study

SAMPLE_SECONDS = 5.0
"""Time of the sample (s)."""
SHARE, NOMINAL = 0.9, 0.98
"""Least share of samples whose interval holds the whole, and Student's share that has it."""
LOAD = 2.0
"""Slowness of a core whose neighbours compute too, over that of one beside idle ones: two hardware
threads share a core, and many busy cores a clock and a memory."""
QUICK_SECONDS, TOGETHER = 2e-3, 64
"""Runs that take less than this (s) are timed as many together as a block has, up to so many: they
share the tables of their frame."""
COMMIT_SECONDS = (5e-5, 1e-3)
"""Time (s) of a block besides its runs: its checksum, its writes and messages."""
WANTED_SECONDS = 3600.0
"""Time (s) within which the advised ranks are done, where none is wanted."""
ROUNDING = 1e-9
"""Relative error of a sum of equal costs."""
COPIES = 3
"""Copies of a block of results that a rank holds at once: computed, ordered, checked."""
START_SECONDS = 600.0
"""Added to the time of a Slurm request: for the kernels that are compiled on a node's first run,
the pilot, and the signal before the time limit (`slurm/once.sh`: 300 s)."""
TIME_STEP = 5
"""The time of a request is a whole multiple of this (min)."""
MEMORY_MARGIN = 1.25
"""Memory of a request over that of the largest rank."""
MEMORY_STEP = 100 * 2**20
"""The memory of a request is a whole multiple of this (bytes)."""
MPI_BYTES = 40_000_000
"""Additional memory (bytes) of a process under MPI (MPICH: 25 MB)."""
BYTES_PER_TASK = 1000
"""Memory (bytes) that rank 0 keeps for each task, with its blocks."""


class TimeInterval(NamedTuple):
    """Ends of an interval (s)."""

    low: float
    high: float


class Sample(NamedTuple):
    """Timed runs of a job.

    Attributes
    ----------
    tasks : ndarray, shape (n_tasks,)
        Estimated cost (s) of every task.
    seconds : ndarray, shape (2, n)
        Of a run of each sample, by the processor's time and by the clock.
    n_runs : int
        Runs timed.
    """

    tasks: np.ndarray
    seconds: np.ndarray
    n_runs: int


def useful_ranks(tasks: np.ndarray) -> float:
    """Return the number of ranks beyond which the longest task is the bound: total / longest."""
    return float(tasks.sum() / tasks.max())


def mean_interval(seconds: np.ndarray) -> TimeInterval:
    """Return an interval of the mean cost (s) of a run, from `Sample.seconds`; see the module."""
    from scipy.special import stdtrit  # other commands do not need it

    mean, clock = seconds.mean(axis=1).tolist()
    n = seconds.shape[1]
    error = seconds[0].std(ddof=1) / math.sqrt(n) / mean
    factor = math.exp(stdtrit(n - 1, 0.5 + NOMINAL / 2) * error)
    return TimeInterval(mean / factor, max(clock, LOAD * mean) * factor)


def time_runs(study: Study, seconds: float = SAMPLE_SECONDS) -> Sample:
    """Time runs spread evenly over frames and amplitudes for about `seconds`, two at least."""
    study.warm_up(note)
    tasks, samples, n_runs = TaskCosts(study), [], 0
    first = costs.time_sample(study, 0)
    quick = first.seconds < QUICK_SECONDS * first.runs
    together = max(costs.PILOT_TIMED, min(study.block_size, TOGETHER) if quick else 0)
    end = time.perf_counter() + seconds
    for index in range(max(costs.PILOT_PER_FRAME * study.n_frames, 2)):
        clock, processor = time.perf_counter(), time.process_time()
        if index > 1 and clock > end:
            break
        sample = costs.time_sample(study, index, n_runs=together)
        processor, clock = time.process_time() - processor, time.perf_counter() - clock
        tasks.sampled(sample)
        each = max(sample.seconds, 1e-9) / sample.runs
        samples.append((each * min(processor / clock, 1.0), each))
        n_runs += sample.runs
    return Sample(tasks.totals(), np.transpose(samples), n_runs)


def whole(job: Job, seconds: np.ndarray, n_least_runs: int) -> TimeInterval:
    """Return an interval of the processor's time (s) of a whole job, `n_least_runs` at least."""
    study, mean = job.study, mean_interval(seconds)
    n_blocks = study.n_runs / study.block_size
    low = n_least_runs / study.n_runs * n_blocks * COMMIT_SECONDS[0] + n_least_runs * mean.low
    return TimeInterval(low, n_blocks * COMMIT_SECONDS[1] + study.n_runs * mean.high)


def advised_ranks(useful: float, total: TimeInterval, within: float) -> int:
    """Return the fewest ranks that are done within a time (s), or else all that are of use."""
    return max(min(int(useful), math.ceil(total.high / within)), 1)


def largest_rank(job: Job, peak: int) -> float:
    """Return the memory (bytes) of rank 0, from the peak of a process that ran a sample (bytes)."""
    study = job.study
    blocks = COPIES * study.block_size * Layout(job).file_size() / study.n_runs
    return peak + MPI_BYTES + blocks + BYTES_PER_TASK * study.n_tasks


def slurm_lines(n_computing: int, work: float, memory: float) -> list[str]:
    """Return the lines of a batch script for ranks that compute, and a master beside many of them.

    Parameters
    ----------
    n_computing : int
        At most the ranks that are of use.
    work : float
        Most processor time (s) of all tasks.
    memory : float
        Bytes of the largest rank.
    """
    minutes = TIME_STEP * math.ceil((work / n_computing + START_SECONDS) / (60 * TIME_STEP))
    bytes_of_each = MEMORY_STEP * math.ceil(MEMORY_MARGIN * memory / MEMORY_STEP)
    return [
        f"#SBATCH --ntasks={n_computing + (n_computing > DEDICATED_MASTER)}",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={minutes // 60:02d}:{minutes % 60:02d}:00",
        f"#SBATCH --mem-per-cpu={bytes_of_each // 2**20}M",
    ]


def _hours(low: float, high: float) -> str:
    return f"{low / 3600:.2g} to {high / 3600:.2g} core-hours ({low:.2g} to {high:.2g} s)"


def cost_lines(
    job: Job, sample: Sample, total: TimeInterval, peak: int, within: float = WANTED_SECONDS
) -> Lines:
    """Yield what a job costs, and the lines of a batch script that fit."""
    study, noun, memory_bytes = job.study, job.study.run_noun, largest_rank(job, peak)
    processor, clock = 1e3 * sample.seconds.mean(axis=1)
    longest, useful = int(sample.tasks.argmax()), useful_ranks(sample.tasks) * (1 + ROUNDING)
    n_runs = sum(block.n_runs for block in study.path(longest))
    n_ranks = advised_ranks(useful, total, within)
    yield (
        f"one {noun}",
        f"{processor:.3g} ms of processor time, {clock:.3g} ms by the clock "
        f"({count(sample.n_runs, noun)} timed, spread over the study)",
    )
    yield (
        "in all",
        f"{_hours(*total)}: the sample's error, {100 * SHARE:.0f} %, and cores up to {LOAD:g} "
        "times as slow among busy neighbours",
    )
    yield "memory", f"about {memory_bytes / 1e6:.0f} MB a rank, however long the job"
    yield "longest", f"{count(n_runs, noun)} that one rank computes, {study.describe_task(longest)}"
    yield (
        "ranks",
        f"{n_ranks}, done in up to {total.high / n_ranks / 3600:.3g} h, wanted {within / 3600:.3g} "
        f"h; no more than {int(useful)} are of use, whole over longest",
    )
    margins = (
        f"{count(n_ranks, 'rank')}; the time of the upper end and {START_SECONDS / 60:g} min; "
        f"{MEMORY_MARGIN:g} times the memory:"
    )
    yield "batch job", "\n".join([margins, *slurm_lines(n_ranks, total.high, memory_bytes)])


def estimate(job: Job, output: Path, sums: Counter, within: float = WANTED_SECONDS) -> Lines:
    """Time a sample of runs and extrapolate.

    Parameters
    ----------
    job : Job
    output : Path
    sums : Counter
        To which the job's runs, bytes, and ends of its time (s) are added.
    within : float
        Wall time (s) that is wanted.

    Yields
    ------
    str, str
        Names and texts for people: runs, bytes, core-hours, memory, the fewest ranks for the
        wanted time, beyond how many more do not help, and the Slurm request.
    """
    job = with_inputs(job)
    study, layout = job.study, Layout(job)
    size = layout.file_size()
    sample, peak = time_runs(study), memory.peak()
    yield from describe(job)
    yield "file", f"{output}, {size} bytes ({size / 1e6:.4g} MB) and a few kB of names"
    least, inputs = study.n_runs, Inputs(layout)
    if inputs.growth is not None:
        least, row = inputs.growth.describe(inputs.crossed())
        yield row
    total = whole(job, sample.seconds, least)
    sums.update(runs=study.n_runs, bytes=size, **total._asdict())
    yield from cost_lines(job, sample, total, peak, within)


def sum_lines(sums: Counter) -> Lines:
    """Yield what several jobs cost together, from the sums of `estimate`."""
    low, high = sums["low"], sums["high"]
    yield "runs", f"{sums['runs']}"
    yield "files", f"{sums['bytes']} bytes ({sums['bytes'] / 1e6:.4g} MB)"
    yield "in all", f"{_hours(low, high)}, on one core or shared by the ranks of one run"
