"""A campaign: a job run to its end, or to a stop, on all ranks, into one file."""

import contextlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hpcsweep import farm, provenance, sweep
from hpcsweep.job import Job
from hpcsweep.outcome import Outcome
from hpcsweep.store import Journal, Lock, StoreError, create, open_campaign
from hpcsweep.store.commit import Blocks, check_file

COMPLETE, STOPPED = 0, 75
"""Exit codes (75 is EX_TEMPFAIL: run again to go on)."""
LISTED_FAILURES = 10
STOP_MARGIN = 5.0
"""Seconds before the time limit at which the ranks begin to stop."""


class Silent:
    """A progress display that shows nothing."""

    def advance(self, runs: int) -> None:
        """Count finished runs."""

    def message(self, text: str) -> None:
        """Say something."""

    def close(self) -> None:
        """End."""


def run(
    job: Job,
    output: Path,
    comm,
    *,
    max_hours: float | None = None,
    progress: Callable[[int, int], Silent] | None = None,
    sweep_block: Callable | None = None,
    flag: farm.StopFlag | None = None,
) -> int:
    """Run a job on all ranks, creating its file or going on with it (collective).

    Parameters
    ----------
    job : Job
        The same on every rank.
    output : Path
    comm : hpcsweep.mpi.Serial or hpcsweep.mpi.Ranks
    max_hours : float, optional
        Stop in good order a little before this much wall time has passed.
    progress : callable (total_runs, done_runs), optional
        Makes the progress display on rank 0.
    sweep_block : callable, optional
        In place of `hpcsweep.sweep.sweep_block`, for tests.
    flag : hpcsweep.farm.StopFlag, optional
        Hears the signals already; if it is not given, they are heard while this function runs.

    Returns
    -------
    int
        0 if the job is complete, 75 if it was stopped in good order before.

    Raises
    ------
    StoreError
        On every rank, if the file cannot be used. Nothing has been changed then.
    """
    begun = time.time()
    with contextlib.nullcontext(flag) if flag else farm.StopFlag(launched=comm.size > 1) as flag:
        if max_hours is not None:
            flag.deadline = begun + max_hours * 3600 - STOP_MARGIN
        lock = Lock(output)
        hosts = comm.gather(provenance.host())
        _on_master(comm, lambda: _prepare(job, output, lock, comm, hosts))
        lock.join()
        campaign = open_campaign(output, job, comm)
        _compile(comm, job, sweep_block, flag)
        todo, done_runs = _unfinished(comm, campaign.blocks, job)
        try:
            finished = _farm_out(
                comm, job, output, campaign, todo, done_runs, flag, progress, sweep_block, hosts
            )
        except BaseException:
            # no other rank is waited for: the caller ends them all
            campaign.flush()
            raise
        campaign.close()
        comm.barrier()
        lock.release(remove=comm.rank == 0)
    return COMPLETE if finished else STOPPED


def _on_master(comm, action: Callable[[], None]) -> None:
    """Do something on rank 0; a `StoreError` there is raised on every rank."""
    problem = None
    if comm.rank == 0:
        try:
            action()
        except StoreError as error:
            problem = str(error)
    problem = comm.bcast(problem)
    if problem is not None:
        raise StoreError(problem)


def _prepare(job: Job, output: Path, lock: Lock, comm, hosts: list[str]) -> None:
    """Check or create the file, under the lock."""
    if not output.parent.is_dir():
        raise StoreError(f"{output}: folder {output.parent} does not exist")
    if output.is_dir():
        raise StoreError(f"{output}: is a folder")
    existing = output.exists()
    if existing:
        _check_same_job(job, output)
    lock.acquire(comm.size)
    try:
        if output.exists() and not existing:
            # made, and given up, by another campaign just now
            _check_same_job(job, output)
            existing = True
        if not existing:
            notes = provenance.collect(comm.library, hosts)
            create(output, job, {**notes, "solver": job.settings.solver, "rtol": job.settings.rtol})
        else:
            with contextlib.suppress(OSError), output.open("r+b"):
                return
            raise StoreError(f"{output}: cannot be written")
    except BaseException:
        lock.release(remove=True)
        raise


def _check_same_job(job: Job, output: Path) -> None:
    attributes = check_file(output)
    if attributes["fingerprint"] != job.fingerprint:
        raise StoreError(
            f"{output}: holds the results of another job (named {attributes['name']!r}); give "
            "another file with -o"
        )


def _compile(comm, job: Job, sweep_block, flag: farm.StopFlag) -> None:
    """Let one rank of each node compile the kernels, or load them, before the others.

    That may take a minute, so a signal ends the ranks then and there: nothing is being written.
    """
    if sweep_block is not None:
        return

    def leave(reason: str) -> None:
        print(f"hpcsweep: {reason} before the first run; run again to go on", file=sys.stderr)
        sys.stderr.flush()
        comm.abort(STOPPED)

    flag.at_once = leave
    if flag.reason is not None:
        leave(flag.reason)
    first = comm.node_rank() == 0
    if first:
        sweep.warm_up(job.settings)
    comm.barrier()
    if not first:
        sweep.warm_up(job.settings)
    flag.at_once = None


def _unfinished(comm, blocks: Blocks, job: Job) -> tuple[list[int], int]:
    """Verify every frame, shared among the ranks; list the unfinished ones on rank 0."""
    todo, done_runs = [], 0
    for frame in range(comm.rank, job.omega.size, comm.size):
        valid = blocks.valid(frame)
        if not all(valid.values()):
            todo.append(frame)
        for (direction, block), good in valid.items():
            low, high = blocks.rows(direction, block)
            done_runs += (high - low) * good
    gathered = comm.gather((todo, done_runs))
    if comm.rank != 0:
        return [], 0
    return sorted(frame for part, _ in gathered for frame in part), sum(n for _, n in gathered)


def _farm_out(
    comm, job, output, campaign, todo, done_runs, flag, progress, sweep_block, hosts
) -> bool:
    """Compute the unfinished frames on all ranks."""
    journal = Journal(output)
    display = Silent()
    failures: list[tuple] = []
    if comm.rank == 0:
        journal.append(
            "start", ranks=comm.size, hosts=sorted(set(hosts)), transport=campaign.transport.name
        )
        if progress is not None:
            display = progress(job.n_runs, done_runs)

    def on_report(rank, value) -> None:
        frame, direction, block, runs, seconds, failed = value
        failures.extend(failed)
        journal.append(
            "block",
            rank=rank,
            frame=frame,
            direction=direction,
            block=block,
            runs=runs,
            seconds=seconds,
        )
        display.advance(runs)

    def compute(frame, poll, report) -> None:
        _compute_frame(job, campaign, frame, poll, report, sweep_block or sweep.sweep_block)

    finished = farm.run(comm, todo, compute, flag, on_report)
    campaign.flush()
    comm.barrier()
    if comm.rank == 0:
        reason = "complete" if finished else (flag.reason or "stopped")
        journal.append("end", reason=reason)
        display.close()
        _list_failures(display, failures)
    return finished


def _compute_frame(job: Job, campaign, frame: int, poll, report, sweep_block) -> None:
    """Compute the blocks of one frame that are not in the file, along its path."""
    amplitude = job.amplitude
    chain = campaign.blocks.chain(frame)
    computed = None
    with contextlib.suppress(StopIteration):
        while True:
            direction, block, start, valid, _end = chain.send(computed)
            computed = None
            if valid:
                continue
            poll()
            begun = time.perf_counter()
            low, high = campaign.blocks.rows(direction, block)
            path = amplitude[low:high] if direction == 0 else amplitude[low:high][::-1]
            result = sweep_block(
                job.structure, float(job.omega[frame]), path, start, job.settings, poll
            )
            computed = campaign.write_block(direction, frame, block, start, result)
            bad = np.flatnonzero(result["outcome"] != Outcome.COMPLETE)
            failed = [
                (
                    float(job.omega[frame]),
                    float(path[i]),
                    job.directions[direction],
                    Outcome(int(result["outcome"][i])).name,
                )
                for i in bad
            ]
            seconds = time.perf_counter() - begun
            report((frame, direction, block, high - low, round(seconds, 6), failed))


def _list_failures(display, failures: list[tuple]) -> None:
    if not failures:
        return
    display.message(f"{len(failures)} runs failed; their results are NaN and the sweep went on:")
    for omega, amplitude, direction, outcome in failures[:LISTED_FAILURES]:
        display.message(f"  Omega = {omega:.6g}, A = {amplitude:.6g}, {direction}: {outcome}")
    if len(failures) > LISTED_FAILURES:
        display.message(f"  and {len(failures) - LISTED_FAILURES} more; see hpcsweep status")
    if any(failure[3] != Outcome.NON_FINITE.name for failure in failures):
        display.message("  STEP_LIMIT, SOLVER_FAILED: try a larger solver.rtol or the other solver")
