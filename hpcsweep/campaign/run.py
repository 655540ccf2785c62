"""Run jobs to completion, or to a stop, on all ranks, each into a file of its own."""

import contextlib
import gc
import resource
import socket
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from hpcsweep import store
from hpcsweep.campaign import provenance
from hpcsweep.campaign.progress import Silent, say_line
from hpcsweep.campaign.queue import Queue
from hpcsweep.campaign.rounds import RoundsWork
from hpcsweep.campaign.work import RankWork
from hpcsweep.job import Job
from hpcsweep.job.paths import followed
from hpcsweep.parallel.mpi import on_master
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store.inputs import Inputs
from hpcsweep.store.rows import check_transport
from hpcsweep.studies.study import Work

COMPLETE, FAILED, REFUSED, STOPPED = 0, 1, 2, 75
"""Exit codes (75 is EX_TEMPFAIL: run again to resume)."""
STOP_MARGIN = 5.0
"""Seconds before the time limit at which the ranks begin to stop."""


Opened = tuple[store.Layout, Path, store.Lock]
"""A job's file, prepared and locked."""


class JobEnd(NamedTuple):
    """Ending of a job: its exit code, and the reason if it is neither complete nor stopped."""

    output: Path
    code: int
    why: str = ""


def run(job: Job, output: Path, comm, **options) -> int:
    """Run one job on all ranks (collective); see `run_all`.

    Returns
    -------
    int
        0 if the job is complete, 75 if it was stopped in good order.

    Raises
    ------
    StoreError
        On every rank, if the file cannot be used. Nothing has been changed then.
    WriteError
        On one rank, if the disk does not take the results; what is committed is intact.
    """
    (ending,) = run_all([(job, output)], comm, **options)
    return ending.code


def run_all(
    jobs: Sequence[tuple[Job, Path]],
    comm,
    *,
    max_hours: float | None = None,
    progress: Callable[[int, int], Silent] | None = None,
    say: Callable[[str], None] = lambda text: None,
    flag: StopFlag | None = None,
    reuse: Sequence[Path] = (),
) -> list[JobEnd]:
    """Run jobs on all ranks, creating the file of each or resuming it (collective).

    Their tasks are one queue. One of several jobs that cannot be run, or fails, does not stop the
    others; an error of a single job is raised.

    Parameters
    ----------
    jobs : sequence of (Job, Path)
        Jobs and their files, all different; the same on every rank.
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    max_hours : float, optional
        Wall time shortly before which the jobs stop in good order.
    progress : callable (total_runs, done_runs), optional
        Return the progress display on rank 0.
    say : callable
        Called on rank 0 with messages before the first run.
    flag : hpcsweep.parallel.stopping.StopFlag, optional
        A flag that already listens to the signals; by default one listens during the call.
    reuse : sequence of Path
        Earlier files from which results are taken (`hpcsweep.store.reuse`).

    Returns
    -------
    list of Ending
        In the order of the jobs, the same on every rank.

    Raises
    ------
    StoreError, WriteError
        Of a single job; see `run`.
    """
    begun = time.time()
    with contextlib.nullcontext(flag) if flag else StopFlag(launched=comm.size > 1) as flag:
        if max_hours is not None:
            flag.deadline = begun + max_hours * 3600 - STOP_MARGIN
        if len(jobs) > 1:
            _allow_open_files()
        endings: dict[int, JobEnd] = {}
        opened: dict[int, Opened] = {}
        hosts = comm.gather(socket.gethostname())
        for k, (job, output) in enumerate(jobs):
            layout, output = store.Layout(store.with_inputs(job)), followed(output)
            lock = store.Lock(output)
            if comm.rank != 0:
                # to answer, it loads the modules of its solver, while rank 0 prepares the file
                job.study.is_compiled(comm.size)
            try:
                prepare = partial(_prepare, layout, output, lock, comm, hosts, say, reuse)
                on_master(comm, prepare, store.StoreError)
            except store.StoreError as error:
                if len(jobs) == 1:
                    raise
                endings[k] = JobEnd(output, REFUSED, str(error))
            else:
                lock.join()
                opened[k] = layout, output, lock
        if opened:
            ended = _run_opened([*opened.values()], comm, flag, hosts or [], progress, say, reuse)
            endings |= dict(zip(opened, ended, strict=True))
    return [endings[k] for k in range(len(jobs))]


def _run_opened(opened: list[Opened], comm, flag, hosts, progress, say, reuse) -> list[JobEnd]:
    """Run jobs whose files are prepared and locked."""
    output = opened[0][1]
    try:
        campaigns = [store.open_campaign(output, layout, comm) for layout, output, _ in opened]
        _compile(comm, [layout.job.study for layout, _, _ in opened], flag, say)
        works = []
        for (layout, output, _), campaign in zip(opened, campaigns, strict=True):
            kind = RoundsWork if layout.growth else RankWork
            works.append(kind(comm, output, campaign, flag, hosts, say, store.Reuse(layout, reuse)))
        queue = Queue(comm, works, flag)
        try:
            queue.do(progress)
        except BaseException:
            # no other rank is waited for: the caller ends them all
            for work in works:
                with contextlib.suppress(store.WriteError):
                    work.flush()
            raise
        for k, work in enumerate(works):
            with contextlib.suppress(*((Exception,) if k in queue.failed else ())):
                work.close()
    except (OSError, store.DamagedError) as error:
        # found sound before: it has been removed or truncated since
        _release(opened, comm)
        said = str(error) if isinstance(error, store.StoreError) else f"{output}: {error}"
        raise store.WriteError(f"{said}; it was changed by somebody else in mid-run") from None
    except store.WriteError:
        _release(opened, comm)
        raise
    comm.barrier()
    _release(opened, comm)
    endings = []
    for k, (_, output, _) in enumerate(opened):
        if k in queue.failed:
            endings.append(JobEnd(output, FAILED, queue.failed[k]))
        else:
            endings.append(JobEnd(output, COMPLETE if queue.complete[k] else STOPPED))
    return endings


def _allow_open_files() -> None:
    """Raise the limit of open files to what the system allows: each campaign holds a few."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _release(opened: list[Opened], comm) -> None:
    for _, _, lock in opened:
        lock.release(remove=comm.rank == 0)


def _prepare(layout: store.Layout, output: Path, lock, comm, hosts: list[str], say, reuse) -> None:
    """Check or create the file, under the lock."""
    store.opening.check_place(output)
    check_transport()
    existing = output.exists()
    _check_earlier(layout, output, reuse, say)
    inputs = Inputs(layout)
    inputs.need()
    if existing:
        _check_same_job(layout, output, inputs)  # before the lock: it leaves nothing behind
    lock.acquire(comm.size)
    try:
        if not (existing or output.exists()):
            made = provenance.collect(comm.library, hosts)
            store.create(output, layout, made | inputs.attributes)
            store.Journal(output).begin()
            return
        # again, or for the first time: another campaign may just have created it
        _check_same_job(layout, output, inputs)
        with contextlib.suppress(OSError), output.open("r+b"):
            return
        raise store.StoreError(f"{output}: cannot be written")
    except BaseException:
        lock.release(remove=True)
        raise


def _check_earlier(layout: store.Layout, output: Path, reuse: Sequence[Path], say) -> None:
    """Check that earlier files fit the job; say where results may differ in the last digits."""
    for path in reuse:
        if path.resolve() == output.resolve():
            raise store.StoreError(f"{path}: is the file of the results; --reuse takes others")
        made = store.opening.check_file(path).get("libraries")
        if made != provenance.library_versions():
            say(f"{path}: made with {made}: what is taken may differ in the last digits")
    store.Reuse(layout, reuse).close()


def _check_same_job(layout: store.Layout, output: Path, inputs: Inputs) -> None:
    """Check that a file is of this job, plain, and sound apart from its results."""
    stored = store.opening.read_layout(output)  # a `DamagedError` if it is not of any job
    store.opening.check_own(output, stored, "resumes")
    if stored.fingerprint != layout.fingerprint:
        raise store.StoreError(
            f"{output}: holds the results of another job (named {stored.name!r}); give "
            "another file with -o"
        )
    inputs.check(output, store.opening.check_file(output))
    store.opening.check_layout(output, layout)
    if store.is_packed(output):
        raise store.StoreError(
            f"{output}: is packed, and a packed file cannot be resumed; give another file with "
            "-o (hpcsweep status tells what is in this one)"
        )


def _compile(comm, studies: Sequence[Work], flag: StopFlag, say: Callable[[str], None]) -> None:
    """Load the kernels; if any is not in the cache, one rank of each node compiles first.

    That may take minutes, so a signal ends the ranks at once: nothing is being written.
    """

    def leave(reason: str) -> None:
        say_line(f"hpcsweep: {reason} before the first run; run again to resume")
        comm.abort(STOPPED)

    flag.at_once = leave
    if flag.reason is not None:
        leave(flag.reason)
    for study in studies:
        at_once = comm.gather(study.is_compiled(comm.size))
        if not comm.bcast(at_once and all(at_once)):
            if comm.node_rank() == 0:
                study.warm_up(say if comm.rank == 0 else None, comm.size)
            comm.barrier()
        study.warm_up(n_ranks=comm.size)
    # no rank writes while another may still exit at once
    comm.barrier()
    flag.at_once = None
    # what is loaded stays: spare the garbage collector from scanning it repeatedly
    gc.freeze()
