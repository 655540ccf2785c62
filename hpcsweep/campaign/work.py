"""The unfinished tasks of a campaign: farmed out, computed, written and reported."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.campaign.pilot import KnownCosts
from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.scan import Scan
from hpcsweep.parallel import farm, memory
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store import Campaign, Journal
from hpcsweep.store.records import BlockCost, block_record, load_record

LISTED_FAILURES = 10
MASTER_NOTES = 30.0
"""Seconds between two notes of the master's load in the journal."""


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
        """Return them, and what to do about them."""
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


class Work:
    """The unfinished tasks of a campaign, and one rank's share in them."""

    def __init__(self, comm, output: Path, campaign: Campaign, flag: StopFlag, hosts, say):
        self._comm, self._output, self._campaign = comm, output, campaign
        self._flag, self._hosts, self._say = flag, hosts, say
        self._study = campaign.blocks.study
        self._journal = Journal(output)
        self._failures, self._traffic = _Failures(), farm.Traffic()

    def do(self, progress: Callable[[int, int], Silent] | None) -> bool:
        """Compute the unfinished tasks on all ranks; tell whether all are finished."""
        begun = time.perf_counter()
        if self._comm.rank == 0:
            self._journal.append(
                "start",
                ranks=self._comm.size,
                hosts=sorted(set(self._hosts)),
                transport=self._campaign.transport.name,
            )
        scan = Scan(self._comm, self._campaign.blocks, self._flag, self._say)
        if not scan.finished:
            self._end(False, time.perf_counter() - begun, Silent())
            return False
        todo, done_runs = scan.todo, scan.done_runs
        costs = KnownCosts(self._comm, self._study, self._output, todo, scan.done)
        begun = time.perf_counter()
        display = Silent()
        if self._comm.rank == 0 and progress is not None:
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

    def _note_load(self) -> None:
        self._journal.note("master", **load_record(self._traffic))

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
            **load_record(self._traffic),
        )
        display.close()
        self._failures.tell(display)


def _every(seconds: float, always: Callable[[], None], then: Callable[[], None]) -> Callable:
    """Make a function that calls `always`, and `then` once in so many seconds."""
    due = [time.monotonic() + seconds]

    def tick() -> None:
        always()
        if time.monotonic() >= due[0]:
            due[0] = time.monotonic() + seconds
            then()

    return tick
