"""A campaign: a job run to its end, or to a stop, on all ranks, into one file."""

import array
import contextlib
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.campaign import provenance
from hpcsweep.campaign.pilot import KnownCosts
from hpcsweep.campaign.progress import say_line
from hpcsweep.job import Job
from hpcsweep.parallel import farm, memory
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import (
    Campaign,
    DamagedError,
    Journal,
    Layout,
    Lock,
    StoreError,
    WriteError,
    create,
    open_campaign,
)
from hpcsweep.store.commit import Blocks, check_writable
from hpcsweep.store.opening import (
    check_file,
    check_place,
    layout_problems,
    read_layout,
    refuse_problems,
)
from hpcsweep.store.records import BlockCost, MasterLoad, block_record
from hpcsweep.store.repair import repair
from hpcsweep.store.transport import check_transport

COMPLETE, STOPPED = 0, 75
"""Exit codes (75 is EX_TEMPFAIL: run again to resume)."""
LISTED_FAILURES = 10
MASTER_NOTES = 30.0
"""Seconds between two notes of the master's load in the journal."""
SCAN_NOTES = 10.0
"""Seconds between two notes of how far the file has been verified."""
POLL_BLOCKS = 64
"""Blocks verified between two looks whether to stop."""
STOP_MARGIN = 5.0
"""Seconds before the time limit at which the ranks begin to stop."""


class Silent:
    """A progress display that shows nothing."""

    def advance(self, runs: int) -> None:
        """Count finished runs."""

    def message(self, text: str) -> None:
        """Say something."""

    def expect(self, remaining: Callable[[], float | None]) -> None:
        """Be given a function that estimates the remaining time (s)."""

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
    layout = Layout(job)
    with contextlib.nullcontext(flag) if flag else StopFlag(launched=comm.size > 1) as flag:
        if max_hours is not None:
            flag.deadline = begun + max_hours * 3600 - STOP_MARGIN
        lock = Lock(output)
        hosts = comm.gather(provenance.host())
        _on_master(comm, lambda: _prepare(layout, output, lock, comm, hosts, say))
        lock.join()
        try:
            campaign = open_campaign(output, layout, comm)
            _compile(comm, job.study, flag, say)
            work = _Work(comm, output, campaign, flag, hosts or [], say)
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
    """Let one rank of each node compile the kernels, or load them, before the others.

    That may take minutes, so a signal ends the ranks then and there: nothing is being written.
    """

    def leave(reason: str) -> None:
        say_line(f"hpcsweep: {reason} before the first run; run again to resume")
        comm.abort(STOPPED)

    flag.at_once = leave
    if flag.reason is not None:
        leave(flag.reason)
    first = comm.node_rank() == 0
    if first:
        study.warm_up(say if comm.rank == 0 else lambda text: None)
    comm.barrier()
    if not first:
        study.warm_up()
    flag.at_once = None


@dataclass
class _Failures:
    """Failed runs: all counted, the first few kept."""

    counts: Counter[int] = field(default_factory=Counter)
    first: list[dict] = field(default_factory=list)

    def add(self, other: "_Failures") -> None:
        """Add what a block reports."""
        self.counts.update(other.counts)
        self.first += other.first[: LISTED_FAILURES - len(self.first)]

    def tell(self, display: Silent) -> None:
        """List them, and what to do about them."""
        n_failed = sum(self.counts.values())
        if not n_failed:
            return
        display.message(f"{n_failed} runs failed; their results are NaN and the others went on:")
        for run in self.first:
            display.message(
                f"  Omega = {run['omega']:.6g}, A = {run['amplitude']:.6g}, {run['direction']}: "
                f"{run['outcome']}"
            )
        if n_failed > len(self.first):
            display.message(f"  and {n_failed - len(self.first)} more; see hpcsweep status")
        for outcome, count in self.counts.items():
            remedy = REMEDIES.get(Outcome(outcome), "no remedy is known")
            display.message(f"  {Outcome(outcome).name} ({count}): {remedy}")


class _Work:
    """The unfinished tasks of a campaign, and one rank's share in them."""

    def __init__(self, comm, output: Path, campaign: Campaign, flag: StopFlag, hosts, say):
        self._comm, self._output, self._campaign = comm, output, campaign
        self._flag, self._hosts, self._say = flag, hosts, say
        self._study = campaign.blocks.study
        self._journal = Journal(output)
        self._failures, self._traffic = _Failures(), farm.Traffic()

    def do(self, progress: Callable[[int, int], Silent] | None) -> bool:
        """Compute the unfinished tasks on all ranks; tell whether all are finished."""
        scan = _Scan(self._comm, self._campaign.blocks, self._flag, self._say)
        if not scan.finished:
            self._campaign.flush()
            return False
        todo, done_runs = scan.todo, scan.done_runs
        costs = KnownCosts(self._comm, self._study, self._output, todo, scan.done)
        begun = time.perf_counter()
        display = Silent()
        if self._comm.rank == 0:
            self._journal.append(
                "start",
                ranks=self._comm.size,
                hosts=sorted(set(self._hosts)),
                transport=self._campaign.transport.name,
            )
            if progress is not None:
                display = progress(self._study.n_runs, done_runs)
                display.expect(costs.remaining)

        def on_report(rank, value) -> None:
            cost, failures = value
            self._failures.add(failures)
            self._journal.note("block", rank=rank, **block_record(cost))
            costs.block_done(cost)
            display.advance(cost.runs)

        finished = costs.sample(self._journal, self._flag) and farm.run(
            self._comm,
            todo,
            self._compute,
            self._flag,
            on_report,
            costs.left,
            self._traffic,
            _every(MASTER_NOTES, display.tick, self._note_load),
            self._campaign.flush,
        )
        self._campaign.flush()
        self._end(finished, time.perf_counter() - begun, display)
        return finished

    def _compute(self, task: int, poll, report, rest=None) -> tuple | None:
        """Compute the blocks of one task that are not in the file, along its path.

        Parameters
        ----------
        rest : (position, state), optional
            Where to resume, and from which state: what this function returned, on any rank.

        Returns
        -------
        (position, state) or None
            What is left, if the task was wanted back; None if it is finished.
        """
        first, state = rest or (0, None)
        position, n_positions = first - 1, len(self._study.path(task))
        chain = self._campaign.blocks.chain(task, first, state)
        computed = None
        with contextlib.suppress(StopIteration):
            while True:
                block, start, valid = chain.send(computed)
                position += 1
                computed = None
                if valid:
                    continue
                poll()
                begun = time.perf_counter()
                rows = self._study.compute(block, start, poll)
                computed = self._campaign.write_block(block, start, rows)
                seconds = round(time.perf_counter() - begun, 6)
                cost = BlockCost(block.place, block.n_runs, seconds)
                wanted = report((cost, self._failed(block, rows)))
                if wanted and position + 1 < n_positions:
                    return position + 1, computed
        return None

    def _failed(self, block, rows: dict[str, np.ndarray]) -> _Failures:
        """Gather the failed runs of a block."""
        bad = np.flatnonzero(rows["outcome"] != Outcome.COMPLETE)
        outcomes = rows["outcome"][bad].tolist()
        return _Failures(
            Counter(outcomes),
            [
                {**self._study.describe(block.run(int(row))), "outcome": Outcome(outcome).name}
                for row, outcome in zip(bad[:LISTED_FAILURES], outcomes, strict=False)
            ],
        )

    def _load(self) -> dict:
        traffic = self._traffic
        return MasterLoad(
            traffic.messages, traffic.message_seconds, traffic.seconds, traffic.recalls
        ).record()

    def _note_load(self) -> None:
        self._journal.note("master", **self._load())

    def _end(self, finished: bool, seconds: float, display: Silent) -> None:
        """Write the last record and say what failed (collective)."""
        campaign = self._campaign
        used = self._comm.gather((campaign.written_bytes, campaign.write_seconds, memory.peak()))
        if self._comm.rank != 0:
            return
        self._journal.append(
            "end",
            reason="complete" if finished else (self._flag.reason or "stopped"),
            written_bytes=sum(rank[0] for rank in used),
            write_seconds=round(sum(rank[1] for rank in used), 6),
            rank_seconds=round(self._comm.size * seconds, 6),
            peak_memory=[used[0][2], max(rank[2] for rank in used)],
            **self._load(),
        )
        display.close()
        self._failures.tell(display)


class _Scan:
    """What the file holds already: verified by all ranks, each its share, known on rank 0.

    Attributes
    ----------
    todo : list of int
        Unfinished tasks.
    done_runs : int
    done : ndarray of int, shape (n, n_axes)
        Places of the valid blocks of these tasks.
    finished : bool
        Whether nobody was told to stop; the same on every rank.
    """

    def __init__(self, comm, blocks: Blocks, flag: StopFlag, say: Callable[[str], None]):
        self._flag, self._say = flag, say if comm.rank == 0 else lambda text: None
        self._begun = self._told = time.monotonic()
        self._asked = 0
        study = blocks.study
        self.todo: list[int] = []
        self.done_runs = 0
        done = array.array("q")
        finished = True
        try:
            for task in range(comm.rank, study.n_tasks, comm.size):
                self._poll(task, study.n_tasks)
                done += self._verify(blocks, task)
        except farm.Stop:
            finished = False
        n_axes = len(study.commit.dims)
        places = np.array(done, np.int64).reshape(-1, n_axes)
        gathered = comm.gather((self.todo, self.done_runs, places, finished))
        if gathered is not None:
            self.todo = sorted(task for part in gathered for task in part[0])
            self.done_runs = sum(part[1] for part in gathered)
            places = np.concatenate([part[2] for part in gathered])
            finished = all(part[3] for part in gathered)
        self.done = places
        self.finished = comm.bcast(finished)

    def _verify(self, blocks: Blocks, task: int) -> array.array:
        """Verify a task; give the places of its valid blocks, one after the other."""
        places = array.array("q")
        n_blocks = n_good = 0
        for block, valid in blocks.verify(task, self._poll_sometimes):
            n_blocks += 1
            if valid:
                n_good += 1
                self.done_runs += block.n_runs
                places.extend(block.place)
        if n_good == n_blocks:
            return array.array("q")
        self.todo.append(task)
        return places

    def _poll_sometimes(self) -> None:
        self._asked += 1
        if self._asked % POLL_BLOCKS == 0:
            self._poll()

    def _poll(self, task: int = 0, n_tasks: int = 0) -> None:
        """Stop if that is wanted; say from time to time what takes so long."""
        if self._flag.is_set():
            raise farm.Stop
        now = time.monotonic()
        if now - self._told > SCAN_NOTES:
            self._told = now
            where = f", {100 * task / n_tasks:.0f} % of its tasks" if n_tasks else ""
            self._say(f"verifying what is in the file: {now - self._begun:.0f} s{where}")


def _every(seconds: float, always: Callable[[], None], then: Callable[[], None]) -> Callable:
    """Make a function that calls `always`, and `then` once in so many seconds."""
    due = [time.monotonic() + seconds]

    def tick() -> None:
        always()
        if time.monotonic() >= due[0]:
            due[0] = time.monotonic() + seconds
            then()

    return tick
