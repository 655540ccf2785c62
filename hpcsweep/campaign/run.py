"""A campaign: a job run to its end, or to a stop, on all ranks, into one file."""

import contextlib
import gc
import time
from collections.abc import Callable
from pathlib import Path

from hpcsweep.campaign import provenance
from hpcsweep.campaign.progress import Silent, say_line
from hpcsweep.campaign.work import Work
from hpcsweep.job import Job
from hpcsweep.job.paths import followed
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store import (
    DamagedError,
    Journal,
    Layout,
    Lock,
    StoreError,
    WriteError,
    create,
    open_campaign,
)
from hpcsweep.store.commit import check_writable
from hpcsweep.store.opening import (
    check_file,
    check_place,
    layout_problems,
    read_layout,
    refuse_problems,
)
from hpcsweep.store.repair import repair
from hpcsweep.store.transport import check_transport

COMPLETE, STOPPED = 0, 75
"""Exit codes (75 is EX_TEMPFAIL: run again to resume)."""
STOP_MARGIN = 5.0
"""Seconds before the time limit at which the ranks begin to stop."""


def run(
    job: Job,
    output: Path,
    comm,
    *,
    max_hours: float | None = None,
    progress: Callable[[int, int], Silent] | None = None,
    say: Callable[[str], None] = lambda text: None,
    flag: StopFlag | None = None,
) -> int:
    """Run a job on all ranks, creating its file or resuming it (collective).

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
    say : callable
        Told on rank 0 what happens before the first run.
    flag : hpcsweep.parallel.stopping.StopFlag, optional
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
    output = followed(output)
    layout = Layout(job)
    with contextlib.nullcontext(flag) if flag else StopFlag(launched=comm.size > 1) as flag:
        if max_hours is not None:
            flag.deadline = begun + max_hours * 3600 - STOP_MARGIN
        lock = Lock(output)
        hosts = comm.gather(provenance.host())
        if comm.rank != 0:
            # loads what takes long to load, while rank 0 prepares the file
            job.study.is_compiled(comm.size)
        _on_master(comm, lambda: _prepare(layout, output, lock, comm, hosts, say))
        lock.join()
        try:
            campaign = open_campaign(output, layout, comm)
            _compile(comm, job.study, flag, say)
            work = Work(comm, output, campaign, flag, hosts or [], say)
            try:
                finished = work.do(progress)
            except BaseException:
                # no other rank is waited for: the caller ends them all
                with contextlib.suppress(WriteError):
                    campaign.flush()
                raise
            campaign.close()
        except (OSError, DamagedError) as error:
            # found sound before: it was taken away, or cut, since
            lock.release(remove=comm.rank == 0)
            said = str(error) if isinstance(error, StoreError) else f"{output}: {error}"
            raise WriteError(f"{said}; it was changed by somebody else in mid-run") from None
        except WriteError:
            lock.release(remove=comm.rank == 0)
            raise
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


def _prepare(layout: Layout, output: Path, lock: Lock, comm, hosts: list[str], say) -> None:
    """Check, repair or create the file, under the lock."""
    check_place(output)
    check_transport()
    existing = output.exists()
    if existing:
        with contextlib.suppress(DamagedError):
            _check_same_job(layout, output)  # before the lock: it leaves nothing behind
    lock.acquire(comm.size)
    try:
        if not (existing or output.exists()):
            create(output, layout, provenance.collect(comm.library, hosts))
            Journal(output).begin()
            return
        try:
            # again, or for the first time: another campaign may have made it just now
            _check_same_job(layout, output)
        except DamagedError as error:
            if not error.repairable:
                raise
            say(repair(output, layout, provenance.collect(comm.library, hosts)))
        with contextlib.suppress(OSError), output.open("r+b"):
            return
        raise StoreError(f"{output}: cannot be written")
    except BaseException:
        lock.release(remove=True)
        raise


def _check_same_job(layout: Layout, output: Path) -> None:
    """Make sure that a file is of this job, plain, and sound but for its results."""
    attributes = check_file(output)
    if attributes.get("fingerprint") != layout.fingerprint:
        stored = read_layout(output)  # a `DamagedError` if it is not of any job
        raise StoreError(
            f"{output}: holds the results of another job (named {stored.name!r}); give "
            "another file with -o"
        )
    read_layout(output)
    refuse_problems(output, layout_problems(output, layout))
    check_writable(output)


def _compile(comm, study, flag: StopFlag, say: Callable[[str], None]) -> None:
    """Load the kernels; if any is not in the cache, one rank of each node compiles first.

    That may take minutes, so a signal ends the ranks then and there: nothing is being written.
    """

    def leave(reason: str) -> None:
        say_line(f"hpcsweep: {reason} before the first run; run again to resume")
        comm.abort(STOPPED)

    flag.at_once = leave
    if flag.reason is not None:
        leave(flag.reason)
    at_once = comm.gather(study.is_compiled(comm.size))
    if comm.bcast(at_once and all(at_once)):
        study.warm_up(n_ranks=comm.size)
    else:
        first = comm.node_rank() == 0
        if first:
            study.warm_up(say if comm.rank == 0 else None, comm.size)
        comm.barrier()
        if not first:
            study.warm_up(n_ranks=comm.size)
    # no rank writes as long as another might leave at once
    comm.barrier()
    flag.at_once = None
    # what is loaded stays, and is not looked through for garbage again and again
    gc.freeze()
