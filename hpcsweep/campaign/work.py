"""Verify what the file of a campaign holds, and compute, write and report its unfinished tasks."""

import time
from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hpcsweep.campaign.costs import KnownCosts
from hpcsweep.campaign.progress import Silent
from hpcsweep.parallel import farm, memory
from hpcsweep.parallel.mpi import on_master
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import Journal, StoreError
from hpcsweep.store import reuse as reusing
from hpcsweep.store.commit import Blocks, Campaign
from hpcsweep.store.inferred import is_complete
from hpcsweep.store.journal import instant, spent
from hpcsweep.studies.run_names import run_name

LISTED_FAILURES = 10
SCAN_NOTES = 10.0
"""Seconds between two messages about the progress of verification."""


class Scanned(NamedTuple):
    """Contents of the file, on rank 0.

    Attributes
    ----------
    todo : list of int
        Unfinished tasks.
    done_runs : int
    done : ndarray of int, shape (n, n_axes)
        Indices of the valid blocks of these tasks.
    finished : bool
        Whether no rank had to stop; the same on every rank.
    """

    todo: list[int]
    done_runs: int
    done: np.ndarray
    finished: bool


def scan(comm, blocks: Blocks, flag: StopFlag, say: Callable[[str], None]) -> Scanned:
    """Verify the contents of the file on all ranks, each its share (collective)."""
    # no other task needs verifying
    begun = on_master(comm, blocks.begun, OSError, StoreError)
    mine = begun[comm.rank :: comm.size]
    todo, done_runs, done, finished = [], 0, array("q"), True
    started = reported = time.monotonic()

    def poll(number: int = 0) -> None:
        """Raise `Stop` if requested; report progress from time to time."""
        nonlocal reported
        if flag.is_set():
            raise farm.Stop
        now = time.monotonic()
        if comm.rank == 0 and now - reported > SCAN_NOTES:
            reported, share = now, 100 * number / len(mine)
            say(f"verifying what is in the file: {now - started:.0f} s, {share:.0f} % of its tasks")

    try:
        poll()
        for number, task in enumerate(mine):
            places, is_whole = array("q"), True
            for block, is_valid in blocks.verify(task, partial(poll, number)):
                is_whole &= is_valid
                if is_valid:
                    done_runs += block.n_runs
                    places.extend(block.place)
            if not is_whole:
                todo.append(task)
                done += places
    except farm.Stop:
        finished = False
    at = np.array(done, np.int64).reshape(-1, len(blocks.study.commit.dims))
    gathered = comm.gather(Scanned(todo, done_runs, at, finished))
    if gathered is not None:
        left = np.ones(blocks.study.n_tasks, bool)
        left[begun] = False
        left[[task for part in gathered for task in part.todo]] = True
        todo = np.flatnonzero(left).tolist()
        done_runs = sum(part.done_runs for part in gathered)
        at = np.concatenate([part.done for part in gathered])
        finished = all(part.finished for part in gathered)
    return Scanned(todo, done_runs, at, comm.bcast(finished))


@dataclass
class Failures:
    """Failed runs: all counted, the first few kept."""

    counts: Counter[int] = field(default_factory=Counter)
    first: list[dict] = field(default_factory=list)

    def add(self, other: "Failures") -> None:
        """Add the failures that a block reports."""
        self.counts.update(other.counts)
        self.first += other.first[: LISTED_FAILURES - len(self.first)]

    def show(self, display: Silent) -> None:
        """Show the failures and their remedies."""
        n_failed = sum(self.counts.values())
        if not n_failed:
            return
        display.message(f"{n_failed} runs failed; their results are NaN and the others went on:")
        for run in self.first:
            display.message(f"  {run_name(run)}: {run['outcome']}")
        if n_failed > len(self.first):
            display.message(f"  and {n_failed - len(self.first)} more; see hpcsweep status")
        for outcome, count in self.counts.items():
            remedy = REMEDIES.get(Outcome(outcome), "no remedy is known")
            display.message(f"  {Outcome(outcome).name} ({count}): {remedy}")


class RankWork:
    """Unfinished tasks of one campaign: what one rank computes and reports to rank 0.

    Attributes
    ----------
    output : Path
    scanned : bool
        Whether the whole file was verified; the same on every rank.
    todo : list of int
        Unfinished tasks, on rank 0.
    done_runs : int
        Runs that the file holds, on rank 0.
    """

    def __init__(self, comm, output: Path, campaign: Campaign, flag: StopFlag, hosts, say, reuse):
        self._comm, self._campaign, self._reuse = comm, campaign, reuse
        self._flag = flag
        self.output, self.study = output, campaign.blocks.study
        self.journal = Journal(output)
        self._failures = Failures()
        if comm.rank == 0:
            self.journal.append(
                "start",
                ranks=comm.size,
                hosts=sorted(set(hosts)),
                transport=campaign.transport.name,
            )
        self._scan(say)

    def _scan(self, say) -> None:
        """Verify the contents of the file (collective)."""
        scanned = scan(self._comm, self._campaign.blocks, self._flag, say)
        self.todo, self.done_runs, self._done, self.scanned = scanned

    def estimate(self, wanted: bool) -> None:
        """Begin to estimate the costs of tasks if `wanted`, as rank 0 decides."""
        self.costs = KnownCosts(self._comm, self.study, self.output if wanted else None, self._done)

    def left(self, task: int) -> float:
        """Estimate the remaining cost (s) of a task, on rank 0; 0 where costs are not needed."""
        return self.costs.tasks.left(task) if self.costs.tasks and self._comm.size > 1 else 0.0

    def plan(self) -> tuple[np.ndarray, int] | None:
        """Return the runs of the next round, and how many need not be computed, on rank 0.

        None: the study has no rounds.
        """
        return None

    def begin(self, runs: np.ndarray) -> None:
        """Begin a round of runs; see `plan`."""
        raise AssertionError(runs)

    def is_complete(self) -> bool:
        """Return whether the file was verified and holds all, where no task is left; on rank 0."""
        return self.scanned and is_complete(self._campaign.blocks)

    def block_done(self, rank: int, value) -> int:
        """Record a completed block on rank 0; return the number of its runs."""
        cost, failures, taken = value
        self._failures.add(failures)
        if taken:
            if self.costs.tasks:
                self.costs.tasks.done(cost.place)
        else:
            self.costs.block_done(cost)
            self.journal.note("block", rank=rank, **cost._asdict())
        return cost.runs

    def compute(self, task: int, poll, report, rest=None) -> tuple | None:
        """Compute the blocks of one task that the file lacks, along its path.

        Parameters
        ----------
        rest : (position, state), optional
            Position and state to resume from, as returned by this function on any rank.

        Returns
        -------
        (position, state) or None
            Where to resume, if the task was recalled; None if it is finished.
        """
        first, state = rest or (0, self.study.initial_state)
        path = self.study.path(task)
        for position in range(first, len(path)):
            block = path[position]
            end = self._campaign.blocks.end_of(block, state)
            if end is None:
                poll()
                begun = instant()
                rows = self._reuse.rows(block, state)
                taken = rows is not None
                if rows is None:
                    rows = self.study.compute(block, state, poll)
                end = self._campaign.write_block(block, state, rows)
                cost = spent(block.place, block.n_runs, begun)
                recalled = report((cost, self._failed(block, rows), taken))
                if recalled and position + 1 < len(path):
                    return position + 1, end
            state = end
        return None

    def _failed(self, block, rows: dict[str, np.ndarray]) -> Failures:
        """Gather the failed runs of a block."""
        bad = np.flatnonzero(rows["outcome"] != Outcome.COMPLETE)
        outcomes = rows["outcome"][bad].tolist()
        return Failures(
            Counter(outcomes),
            [
                {**self.study.describe(block.run(int(row))), "outcome": Outcome(outcome).name}
                for row, outcome in zip(bad[:LISTED_FAILURES], outcomes, strict=False)
            ],
        )

    def flush(self) -> None:
        """Commit the results of this rank."""
        self._campaign.flush()

    def end(self, reason: str, seconds: float, traffic: farm.Traffic, display: Silent) -> None:
        """Write the last record and report failures (collective)."""
        peaks = self._comm.gather(memory.peak())
        reused = self._comm.gather(self._reuse.runs)
        if self._comm.rank != 0:
            return
        runs: Counter[str] = sum(reused, Counter())
        if runs:
            self.journal.append("reuse", **runs)
            display.message(reusing.as_text(runs))
        self.journal.append(
            "end",
            reason=reason,
            rank_seconds=round(self._comm.size * seconds, 6),
            peak_memory=[peaks[0], max(peaks)],
            **vars(traffic),
        )
        self._failures.show(display)

    def close(self) -> None:
        """Close the file (collective)."""
        self._campaign.close()
        self._reuse.close()
