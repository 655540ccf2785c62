"""Forecast what a job will cost, from a timed sample, before it is run.

Runs spread over the study are timed twice, by the processor's time and by the clock. Their mean
times the number of runs is the cost of the whole; with one longest task d of a whole W no schedule
ends before max(W / N, d) on N ranks, so that at most W / d ranks are of use.

The interval of W has two parts. The mean of a sample of n runs has an error: Student's interval of
its relative error, on a logarithmic scale, holds less than its share where few runs are costly, so
that the one of `NOMINAL` stands for `SHARE` (measured for costs a hundredfold apart and lognormal
ones up to sigma = 1, from 2 runs on). And a core is not always as fast as in the sample: the lower
end is the faster pass by the processor's time, the upper end the slower pass by the clock, or
`LOAD` times the processor's time, whichever is longer.
"""

import math
import time
from collections import Counter
from dataclasses import dataclass
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
from hpcsweep.studies.study import Lines, Work

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
TIME_STEP = 300.0
"""The time of a request is a whole multiple of this (s)."""
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


@dataclass(frozen=True)
class Pilot:
    """Timed runs of a job.

    Attributes
    ----------
    tasks : ndarray, shape (n_tasks,)
        Estimated cost (s) of every task.
    samples : ndarray, shape (2, 2, n)
        Seconds a run of the same samples in two passes, by the processor's time and by the clock.
    n_runs : int
        Runs timed in a pass.
    load_seconds, kernel_seconds : float
        Time to load the program and the job, and to load the kernels, or to compile them.
    compiled : bool
        Whether kernels were compiled.
    """

    tasks: np.ndarray
    samples: np.ndarray
    n_runs: int
    load_seconds: float
    kernel_seconds: float
    compiled: bool


def useful_ranks(tasks: np.ndarray) -> float:
    """Return the number of ranks beyond which the longest task is the bound: total / longest."""
    return float(tasks.sum() / tasks.max())


def mean_interval(samples: np.ndarray) -> TimeInterval:
    """Return an interval of the mean cost (s) of a run, from `Pilot.samples`; see the module."""
    from scipy.special import stdtrit  # other commands do not need it

    processor, n = samples[:, 0], samples.shape[-1]
    means, clock = processor.mean(axis=-1), samples[:, 1].mean(axis=-1)
    errors = processor.std(axis=-1, ddof=1) / np.sqrt(n) / means
    factor = float(np.exp(stdtrit(n - 1, 0.5 + NOMINAL / 2) * errors.max()))
    slowest = max(clock.max(), LOAD * means.max())
    return TimeInterval(float(means.min()) / factor, float(slowest) * factor)


def time_pilot(job: Job, seconds: float = SAMPLE_SECONDS) -> Pilot:
    """Time runs spread evenly over frames and amplitudes for about `seconds`, two at least."""
    study, said = job.study, []
    load, begun = time.process_time(), time.perf_counter()

    def say(text: str) -> None:
        said.append(text)
        note(text)

    study.warm_up(say)
    kernels = time.perf_counter() - begun
    tasks = TaskCosts(study)
    most = costs.PILOT_PER_FRAME * study.n_frames
    first = costs.time_sample(study, 0)
    quick = first.seconds < QUICK_SECONDS * first.runs
    together = max(costs.PILOT_TIMED, min(study.block_size, TOGETHER) if quick else 0)
    begun = time.perf_counter()
    once: list[tuple[float, float, int]] = []
    while len(once) < 2 or (time.perf_counter() - begun < seconds / 2 and len(once) < most):
        once.append(_time(study, tasks, len(once), together))
    again = [_time(study, tasks, index, together) for index in range(len(once))]
    samples = np.array([once, again])[..., :2].swapaxes(1, 2)
    n_runs = sum(runs for _, _, runs in once)
    return Pilot(tasks.totals(), samples, n_runs, load, kernels, bool(said))


def _time(study: Work, tasks: TaskCosts, index: int, n_runs: int) -> tuple[float, float, int]:
    """Time a sample; return the seconds a run, of the processor and by the clock, and its runs."""
    clock, processor = time.perf_counter(), time.process_time()
    sample = costs.time_sample(study, index, n_runs=n_runs)
    processor, clock = time.process_time() - processor, time.perf_counter() - clock
    tasks.sampled(sample)
    each = max(sample.seconds, 1e-9) / sample.runs
    return each * min(processor / clock, 1.0), each, sample.runs


def whole(job: Job, samples: np.ndarray, n_least_runs: int) -> TimeInterval:
    """Return an interval of the processor's time (s) of a whole job, `n_least_runs` at least."""
    study, mean = job.study, mean_interval(samples)
    n_blocks = study.n_runs / study.block_size
    low = n_least_runs / study.n_runs * n_blocks * COMMIT_SECONDS[0] + n_least_runs * mean.low
    return TimeInterval(low, n_blocks * COMMIT_SECONDS[1] + study.n_runs * mean.high)


def advised_ranks(useful: float, total: TimeInterval, within: float) -> int:
    """Return the fewest ranks that are done within a time (s), or else all that are of use."""
    return max(min(int(useful), math.ceil(total.high / within)), 1)


def largest_rank(job: Job, peak: int) -> float:
    """Return the memory (bytes) of rank 0, from the peak of a process that ran a sample (bytes)."""
    return peak + MPI_BYTES + _block_bytes(job) + BYTES_PER_TASK * job.study.n_tasks


def _block_bytes(job: Job) -> float:
    return COPIES * job.study.block_size * Layout(job).file_size() / job.study.n_runs


def memory_text(job: Job, peak: int) -> str:
    """Format the memory of a rank, given the peak (bytes) of a process that ran a sample."""
    first = BYTES_PER_TASK * job.study.n_tasks
    each = (largest_rank(job, peak) - first, peak, MPI_BYTES)
    rank, process, mpi = (f"{size / 1e6:.0f} MB" for size in each)
    return (
        f"about {rank} a rank, however long the job ({process} as in this process, {mpi} for MPI, "
        f"{_block_bytes(job) / 1e6:.2g} MB for a block of results), rank 0 up to "
        f"{first / 1e6:.2g} MB more"
    )


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
    seconds = TIME_STEP * math.ceil((work / n_computing + START_SECONDS) / TIME_STEP)
    bytes_of_each = MEMORY_STEP * math.ceil(MEMORY_MARGIN * memory / MEMORY_STEP)
    return [
        f"#SBATCH --ntasks={n_computing + (n_computing > DEDICATED_MASTER)}",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={_slurm_time(seconds)}",
        f"#SBATCH --mem-per-cpu={bytes_of_each // 2**20}M",
    ]


def _slurm_time(seconds: float) -> str:
    """Format a time for Slurm: [days-]hours:minutes:seconds."""
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return f"{f'{days}-' if days else ''}{hours:02d}:{minutes:02d}:{rest:02d}"


def _hours(low: float, high: float) -> str:
    return f"{low / 3600:.2g} to {high / 3600:.2g} core-hours ({low:.2g} to {high:.2g} s)"


def cost_lines(
    job: Job, pilot: Pilot, total: TimeInterval, peak: int, within: float = WANTED_SECONDS
) -> Lines:
    """Yield what a job costs, and the lines of a batch script that fit."""
    study, noun = job.study, job.study.run_noun
    each = pilot.samples.mean(axis=(0, 2))
    kernels = "compiled, once for this type of processor" if pilot.compiled else "loaded"
    longest, useful = int(pilot.tasks.argmax()), useful_ranks(pilot.tasks) * (1 + ROUNDING)
    n_runs = sum(block.n_runs for block in study.path(longest))
    n_ranks = advised_ranks(useful, total, within)
    wanted, taken = (f"{seconds / 3600:.3g} h" for seconds in (within, total.high / n_ranks))
    fit = total.high <= n_ranks * within
    fewest = f"the fewest for {wanted}" if fit else f"take up to {taken}, not {wanted}"
    yield (
        f"one {noun}",
        f"{1e3 * each[0]:.3g} ms of processor time, {1e3 * each[1]:.3g} ms by the clock "
        f"({count(pilot.n_runs, noun)} timed twice, spread over the study)",
    )
    yield (
        "start",
        f"{pilot.load_seconds:.2g} s for the program and the job; kernels {kernels} in "
        f"{pilot.kernel_seconds:.2g} s",
    )
    yield (
        "in all",
        f"{_hours(*total)}: the sample's error, {100 * SHARE:.0f} %, and cores up to {LOAD:g} "
        "times as slow among busy neighbours",
    )
    yield "memory", memory_text(job, peak)
    yield "longest", f"{count(n_runs, noun)} that one rank computes, {study.describe_task(longest)}"
    yield "ranks", f"{n_ranks}, {fewest}; no more than {int(useful)} are of use, whole over longest"
    script = slurm_lines(n_ranks, total.high, largest_rank(job, peak))
    margins = (
        f"{count(n_ranks, 'rank')}; the time of the upper end and {START_SECONDS / 60:g} min; "
        f"{MEMORY_MARGIN:g} times the memory:"
    )
    yield "batch job", "\n".join([margins, *script])


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
    pilot, peak = time_pilot(job), memory.peak()
    yield from describe(job)
    yield "file", f"{output}, {size} bytes ({size / 1e6:.4g} MB) and a few kB of names"
    least, inputs = study.n_runs, Inputs(layout)
    if inputs.growth is not None:
        least, row = inputs.growth.describe(inputs.crossed())
        yield row
    total = whole(job, pilot.samples, least)
    sums.update(runs=study.n_runs, bytes=size, **total._asdict())
    yield from cost_lines(job, pilot, total, peak, within)


def sum_lines(sums: Counter) -> Lines:
    """Yield what several jobs cost together, from the sums of `estimate`."""
    low, high = sums["low"], sums["high"]
    yield "runs", f"{sums['runs']}"
    yield "files", f"{sums['bytes']} bytes ({sums['bytes'] / 1e6:.4g} MB)"
    yield "in all", f"{_hours(low, high)}, on one core or shared by the ranks of one run"
