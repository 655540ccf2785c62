"""A campaign: a job run to its end, or to a stop, on all ranks, into one file."""

import contextlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hpcsweep.campaign import provenance
from hpcsweep.campaign.pilot import BLOCK_COST, KnownCosts
from hpcsweep.campaign.progress import note
from hpcsweep.job import Job
from hpcsweep.parallel import farm, memory
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import Journal, Lock, StoreError, WriteError, create, open_campaign
from hpcsweep.store.commit import Blocks, check_file, check_writable, path_blocks
from hpcsweep.studies import amplitude_sweep as sweep

COMPLETE, STOPPED = 0, 75
"""Exit codes (75 is EX_TEMPFAIL: run again to go on)."""
LISTED_FAILURES = 10
MASTER_NOTES = 30.0
"""Seconds between two notes of the master's load in the journal."""
STOP_MARGIN = 5.0
"""Seconds before the time limit at which the ranks begin to stop."""


class Silent:
    """A progress display that shows nothing."""

    def advance(self, runs: int) -> None:
        """Count finished runs."""

    def message(self, text: str) -> None:
        """Say something."""

    def tick(self) -> None:
        """Hear that time has passed, several times a second."""

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
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    max_hours : float, optional
        Stop in good order a little before this much wall time has passed.
    progress : callable (total_runs, done_runs), optional
        Makes the progress display on rank 0.
    sweep_block : callable, optional
        In place of `hpcsweep.studies.amplitude_sweep.sweep_block`, for tests.
    flag : hpcsweep.parallel.farm.StopFlag, optional
        Hears the signals already; if it is not given, they are heard while this function runs.

    Returns
    -------
    int
        0 if the job is complete, 75 if it was stopped in good order before.

    Raises
    ------
    StoreError
        On every rank, if the file cannot be used. Nothing has been changed then.
    WriteError
        On one rank, if the disk does not take the results; what is committed is intact.
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
        _compile(comm, job, sweep_block, flag, note if progress else lambda text: None)
        todo, done_runs, done_blocks = _unfinished(comm, campaign.blocks, job)
        try:
            frame_costs = KnownCosts(comm, job, output, todo, done_blocks, sweep_block)
            finished = _farm_out(
                comm,
                job,
                output,
                campaign,
                todo,
                done_runs,
                frame_costs,
                flag,
                progress,
                sweep_block,
                hosts,
            )
        except BaseException:
            # no other rank is waited for: the caller ends them all
            with contextlib.suppress(WriteError):
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
    check_writable(output)
    if attributes["fingerprint"] != job.fingerprint:
        raise StoreError(
            f"{output}: holds the results of another job (named {attributes['name']!r}); give "
            "another file with -o"
        )


def _compile(comm, job: Job, sweep_block, flag: farm.StopFlag, say: Callable) -> None:
    """Let one rank of each node compile the kernels, or load them, before the others.

    That may take minutes, so a signal ends the ranks then and there: nothing is being written.
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
        sweep.warm_up(job.settings, say if comm.rank == 0 else lambda text: None)
    comm.barrier()
    if not first:
        sweep.warm_up(job.settings)
    flag.at_once = None


def _unfinished(comm, blocks: Blocks, job: Job) -> tuple[list[int], int, list[tuple]]:
    """Verify every frame, shared among the ranks; list what is unfinished on rank 0.

    Returns
    -------
    frames : list of int
    done_runs : int
    done_blocks : list of tuple
        (frame, direction, block, runs) of the valid blocks of these frames.
    """
    todo, done_runs, done_blocks = [], 0, []
    for frame in range(comm.rank, job.omega.size, comm.size):
        valid = blocks.valid(frame)
        good = []
        for (direction, block), is_good in valid.items():
            low, high = blocks.rows(direction, block)
            if is_good:
                good.append((frame, direction, block, high - low))
                done_runs += high - low
        if len(good) < len(valid):
            todo.append(frame)
            done_blocks += good
    gathered = comm.gather((todo, done_runs, done_blocks))
    if comm.rank != 0:
        return [], 0, []
    return (
        sorted(frame for part in gathered for frame in part[0]),
        sum(part[1] for part in gathered),
        [block for part in gathered for block in part[2]],
    )


class _Failures:
    """Failed runs: all counted, the first few kept."""

    def __init__(self):
        self.counts: dict[Outcome, int] = {}
        self.first: list[tuple] = []

    def add(self, runs: list[tuple], counts: dict[int, int]) -> None:
        """Add what a block reports."""
        for outcome, count in counts.items():
            self.counts[Outcome(outcome)] = self.counts.get(Outcome(outcome), 0) + count
        self.first += runs[: LISTED_FAILURES - len(self.first)]


def _farm_out(
    comm, job, output, campaign, todo, done_runs, frame_costs, flag, progress, sweep_block, hosts
) -> bool:
    """Compute the unfinished frames on all ranks."""
    journal = Journal(output)
    begun = time.perf_counter()
    display = Silent()
    failures, traffic = _Failures(), farm.Traffic()
    if comm.rank == 0:
        journal.append(
            "start", ranks=comm.size, hosts=sorted(set(hosts)), transport=campaign.transport.name
        )
        if progress is not None:
            display = progress(job.n_runs, done_runs)

    def on_report(rank, value) -> None:
        *cost, failed, counts = value
        failures.add(failed, counts)
        journal.note("block", rank=rank, **dict(zip(BLOCK_COST, cost, strict=True)))
        frame_costs.block_done(*cost)
        display.advance(cost[3])

    def compute(frame, poll, report, rest=None) -> tuple | None:
        return _compute_frame(
            job, campaign, frame, poll, report, sweep_block or sweep.sweep_block, rest
        )

    def tick() -> None:
        display.tick()
        if time.monotonic() >= next_note[0]:
            next_note[0] = time.monotonic() + MASTER_NOTES
            journal.note("master", **_traffic_record(traffic))

    next_note = [time.monotonic() + MASTER_NOTES]
    finished = frame_costs.sample(journal, flag) and farm.run(
        comm, todo, compute, flag, on_report, frame_costs.left, traffic, tick, campaign.flush
    )
    campaign.flush()
    used = comm.gather((campaign.written_bytes, campaign.write_seconds, memory.peak()))
    if comm.rank == 0:
        reason = "complete" if finished else (flag.reason or "stopped")
        journal.append(
            "end",
            reason=reason,
            written_bytes=sum(rank[0] for rank in used),
            write_seconds=round(sum(rank[1] for rank in used), 6),
            rank_seconds=round(comm.size * (time.perf_counter() - begun), 6),
            peak_memory=[used[0][2], max(rank[2] for rank in used)],
            **_traffic_record(traffic),
        )
        display.close()
        _list_failures(display, failures)
    return finished


def _traffic_record(traffic: farm.Traffic) -> dict:
    return {
        "messages": traffic.messages,
        "message_seconds": round(traffic.message_seconds, 6),
        "master_seconds": round(traffic.seconds, 6),
        "recalls": traffic.recalls,
    }


def _compute_frame(
    job: Job, campaign, frame: int, poll, report, sweep_block, rest=None
) -> tuple | None:
    """Compute the blocks of one frame that are not in the file, along its path.

    Parameters
    ----------
    rest : (position, state), optional
        Where to go on, and from which state: what this function returned, on any rank.

    Returns
    -------
    (position, state) or None
        What is left, if the frame was wanted back; None if it is finished.
    """
    amplitude = job.amplitude
    first, state = rest or (0, None)
    position, n_positions = first - 1, len(path_blocks(job))
    chain = campaign.blocks.chain(frame, first, state)
    computed = None
    with contextlib.suppress(StopIteration):
        while True:
            direction, block, start, valid, _end = chain.send(computed)
            position += 1
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
                for i in bad[:LISTED_FAILURES]
            ]
            kinds, counts = np.unique(result["outcome"][bad], return_counts=True)
            seconds = round(time.perf_counter() - begun, 6)
            counted = dict(zip(kinds.tolist(), counts.tolist(), strict=True))
            wanted = report((frame, direction, block, high - low, seconds, failed, counted))
            if wanted and position + 1 < n_positions:
                return position + 1, computed
    return None


def _list_failures(display, failures: _Failures) -> None:
    n_failed = sum(failures.counts.values())
    if not n_failed:
        return
    display.message(f"{n_failed} runs failed; their results are NaN and the sweep went on:")
    for omega, amplitude, direction, outcome in failures.first:
        display.message(f"  Omega = {omega:.6g}, A = {amplitude:.6g}, {direction}: {outcome}")
    if n_failed > len(failures.first):
        display.message(f"  and {n_failed - len(failures.first)} more; see hpcsweep status")
    for outcome, count in failures.counts.items():
        display.message(
            f"  {outcome.name} ({count}): {REMEDIES.get(outcome, 'no remedy is known')}"
        )
