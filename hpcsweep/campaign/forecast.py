"""Forecast what a job will cost, from a timed sample, before it is run."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hpcsweep.campaign import costs, slurm
from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.campaign.describe import describe
from hpcsweep.campaign.progress import note
from hpcsweep.job import Job
from hpcsweep.parallel import memory
from hpcsweep.parallel.schedule import DEDICATED_MASTER
from hpcsweep.parallel.simulation import MESSAGE_SECONDS, Prediction, ranks_that_help, simulate
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.store import Layout, read_history
from hpcsweep.store.crossing import Crossing
from hpcsweep.studies.refine.refinement import Refinement, map_shape, refinement_of
from hpcsweep.studies.refine.rounds import n_least
from hpcsweep.studies.run_names import count

SAMPLE_SECONDS = 5.0
"""Default time of the sample (s)."""
RANKS = tuple(2**k for k in range(13))
MOST_BLOCKS, MOST_TASKS = 200_000, 40_000
"""Most blocks in a simulation, beyond which each task is one; and most tasks, beyond which several
are one, whose messages come together. On 4,096 ranks that is still ten a rank."""
COPIES = 3
"""Copies of a block of results that a rank holds at once: computed, ordered, checked."""
MPI_BYTES = 40_000_000
"""Additional memory (bytes) of a process under MPI (MPICH: 25 MB)."""
BYTES_PER_TASK = 1000
"""Memory (bytes) that rank 0 keeps for each task, with its blocks."""


@dataclass(frozen=True)
class Forecast:
    """Costs of a job.

    Attributes
    ----------
    costs : TaskCosts
    run_seconds, error : float
        Mean cost of a run and its standard error (s).
    n_timed : int
        Runs behind the estimate.
    """

    costs: TaskCosts
    run_seconds: float
    error: float
    n_timed: int


def sample(job: Job, seconds: float = SAMPLE_SECONDS) -> Forecast:
    """Time runs spread evenly over frames and amplitudes for about `seconds`, two at least."""
    study = job.study
    study.warm_up(note)
    task_costs = TaskCosts(study)
    per_run: list[float] = []
    most = costs.PILOT_PER_FRAME * study.n_frames
    begun = time.perf_counter()
    while len(per_run) < 2 or (time.perf_counter() - begun < seconds and len(per_run) < most):
        timed = costs.time_sample(study, len(per_run))
        task_costs.sampled(timed)
        per_run.append(timed.seconds / timed.runs)
    mean = float(task_costs.totals().sum()) / study.n_runs
    error = float(np.std(per_run, ddof=1) / np.sqrt(len(per_run)))
    return Forecast(task_costs, mean, error, task_costs.n_known())


def from_journal(job: Job, path: Path) -> Forecast | None:
    """Return the costs in a file's journal; None if it holds none."""
    study, task_costs = job.study, TaskCosts(job.study)
    measured = read_history(path).costs
    if not measured:
        return None
    for cost in measured:
        task_costs.measured(cost)
    per_run = [cost.seconds / cost.runs for cost in measured]
    mean = float(task_costs.totals().sum()) / study.n_runs
    error = float(np.std(per_run) / np.sqrt(len(per_run))) * (task_costs.n_known() < study.n_runs)
    return Forecast(task_costs, mean, error, task_costs.n_known())


def predict(
    job: Job,
    forecast: Forecast,
    ranks: Sequence[int] = RANKS,
    message_seconds: float = MESSAGE_SECONDS,
) -> list[Prediction]:
    """Simulate the job's schedule on numbers of ranks."""
    blocks, together = forecast.costs.blocks(MOST_BLOCKS, MOST_TASKS)
    # between two polls a computing master does a run or a start, or one period
    cycles = job.settings.transient_cycles + job.settings.sampling_cycles
    each_period = SOLVERS[job.settings.solver].polls_each_period
    poll = forecast.run_seconds / (cycles if each_period else job.study.polls_per_run)
    served = {"message_seconds": together * message_seconds, "poll_seconds": together * poll}
    return [simulate(blocks, n, **served) for n in ranks]


def ranks_text(job: Job, forecast: Forecast, predictions: Sequence[Prediction]) -> list[str]:
    """Format predictions and the number of useful ranks for people."""
    totals = forecast.costs.totals()
    costliest, study = int(totals.argmax()), job.study
    helpful = ranks_that_help(totals)
    lines = ["   ranks     makespan  efficiency  bound met  master busy"]
    for p in predictions:
        reached = p.bound / p.makespan if p.makespan else 1.0
        lines.append(
            f"  {p.n_ranks:6d}  {p.makespan:9.4g} s  {100 * p.efficiency:8.1f} %"
            f"  {100 * reached:7.1f} %  {100 * p.master_load:9.2g} %"
        )
    lines.append(
        f"costliest {study.task_noun}: {study.describe_task(costliest)}, "
        f"{totals[costliest]:.4g} s; cheapest {totals.min():.4g} s, "
        f"median {np.median(totals):.4g} s"
    )
    most = count(max(int(np.ceil(helpful)), 1), "rank")
    lines.append(
        f"limit:      beyond about {most} more do not help: the "
        f"costliest {study.task_noun} is the bound ({study.why_whole})"
    )
    lines.append(f"master:     computes on up to {DEDICATED_MASTER} ranks, beyond it only serves")
    return lines


def _block_bytes(job: Job) -> float:
    return COPIES * job.study.block_size * Layout(job).file_size() / job.study.n_runs


def largest_rank(job: Job, peak: int) -> float:
    """Return the memory (bytes) of rank 0, from the peak of a process that ran a sample (bytes)."""
    return peak + MPI_BYTES + _block_bytes(job) + BYTES_PER_TASK * job.study.n_tasks


def memory_text(job: Job, peak: int) -> str:
    """Format the memory of a rank, given the peak (bytes) of a process that ran a sample."""
    study, block = job.study, _block_bytes(job)
    first = BYTES_PER_TASK * study.n_tasks
    rank = largest_rank(job, peak) - first
    return (
        f"memory:     about {rank / 1e6:.0f} MB a rank whatever the number of {study.task_noun}s "
        f"({peak / 1e6:.0f} MB as in this process, {MPI_BYTES / 1e6:.0f} MB for MPI, "
        f"{block / 1e6:.2g} MB for a block of results), "
        f"rank 0 up to {first / 1e6:.2g} MB more"
    )


def slurm_text(
    job: Job, forecast: Forecast, predictions: Sequence[Prediction], peak: int
) -> list[str]:
    """Format the lines of a batch script that fit predictions on powers of two of ranks."""
    known = {p.n_ranks: p for p in predictions}
    useful = slurm.useful_ranks(
        lambda n: known[n] if n in known else predict(job, forecast, (n,))[0], max(known)
    )
    resources = slurm.request(useful, largest_rank(job, peak))
    return [
        f"batch job:  {count(useful.n_ranks, 'rank')}, the most with an efficiency of "
        f"{100 * slurm.EFFICIENCY:.0f} %; {slurm.TIME_MARGIN:g} times their makespan and "
        f"{slurm.START_SECONDS / 60:g} min; {slurm.MEMORY_MARGIN:g} times the memory:",
        *slurm.as_lines(resources),
    ]


def study_text(study) -> str:
    """Format the number of runs of a study, and their dimensions."""
    counts = [(study.dimensions[dim], dim) for dim in study.run_dims]
    sizes = [count(size, dim) for size, dim in counts]
    runs = count(study.n_runs, study.run_noun)
    return f"{' x '.join(sizes)} = {runs} ({study.kind.replace('_', ' ')})"


def refined_text(study, refinement: Refinement, forecast: Forecast) -> str:
    """Format how many points of a refined map are computed at least."""
    least = n_least(map_shape(study), refinement, Crossing(study).boxes())
    seconds = forecast.run_seconds * least
    crossed = ", those that curves cross" if refinement.curves else ""
    return (
        f"refined:    all numbers are those of all points, the most there can be; the coarsest "
        f"cells{crossed} and the first draw of the audit are {least} points "
        f"({100 * least / study.n_runs:.2g} %, {seconds:.3g} s), the least"
    )


def estimate(job: Job, output: Path, seconds: float = SAMPLE_SECONDS) -> str:
    """Time a stratified sample of runs and extrapolate.

    Returns
    -------
    str
        Lines for people: runs, bytes, core-hours with their standard error, memory, makespan on 1
        to 4,096 ranks, the number beyond which more do not help, and the Slurm request.
    """
    study, size = job.study, Layout(job).file_size()
    forecast, peak = sample(job, seconds), memory.peak()
    predictions = predict(job, forecast)
    total, error = forecast.run_seconds * study.n_runs, forecast.error * study.n_runs
    refinement = refinement_of(study)
    lines = [
        f"{job.name}: {study_text(study)}, solver {study.settings.solver}",
        *job.notes,
        *describe(job),
        f"file:       {output}, {size} bytes ({size / 1e6:.4g} MB) and a few kB of names",
        f"{f'one {study.run_noun}:':12}{1e3 * forecast.run_seconds:.4g} ms +- "
        f"{1e3 * forecast.error:.2g} ms ({count(forecast.n_timed, study.run_noun)} timed, "
        "spread over the study)",
        f"in all:     {total / 3600:.3g} +- {error / 3600:.2g} core-hours ({total:.4g} s)",
        *([refined_text(study, refinement, forecast)] if refinement else []),
        memory_text(job, peak),
        *ranks_text(job, forecast, predictions),
        *slurm_text(job, forecast, predictions, peak),
    ]
    return "\n".join(lines)
