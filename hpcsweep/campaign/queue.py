"""Farm out the unfinished tasks of one or several campaigns, as one list, to all ranks.

Tasks of all campaigns are numbered consecutively, so that the farm hands out the costliest first,
whichever file it belongs to. A rank on which a campaign fails leaves that one alone from then on;
the others go on.
"""

import contextlib
import itertools
import time
import traceback
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import remaining_of
from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.work import RankWork
from hpcsweep.parallel import farm
from hpcsweep.parallel.stopping import LauncherLostError, Stop, StopFlag
from hpcsweep.store import StoreError, WriteError

MASTER_NOTES = 30.0
"""Seconds between two records of the master's load in the journal."""


class Queue:
    """Tasks of several campaigns, as one rank sees them.

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    works : sequence of Work
        One for each campaign, in the same order on every rank.
    flag : StopFlag

    Attributes
    ----------
    failed : dict of int to str
        Reason of failure by campaign number; after `do` the same on every rank.
    complete : list of bool
        After `do`, whether each campaign's file holds all of its job; the same on every rank.
    """

    def __init__(self, comm, works: Sequence[RankWork], flag: StopFlag):
        self._comm, self._works, self._flag = comm, works, flag
        self._firsts = [0, *itertools.accumulate(work.study.n_tasks for work in works)]
        self._traffic = farm.Traffic()
        self._display = Silent()
        self._at = 0
        self._due = time.monotonic() + MASTER_NOTES
        # tasks that are not done, on rank 0
        self._left: set[int] = set()
        self._take(range(len(works)))
        self.complete: list[bool] = []
        self.failed: dict[int, str] = {}

    def do(self, progress: Callable[[int, int, str], Silent] | None) -> None:
        """Compute the unfinished tasks on all ranks (collective)."""
        begun = time.perf_counter()
        if all(work.scanned for work in self._works):
            wanted = self._comm.bcast(sum(len(work.todo) for work in self._works) > 1)
            for work in self._works:
                work.estimate(wanted)
            begun = time.perf_counter()
            if self._comm.rank == 0 and progress is not None:
                total = sum(work.study.n_runs for work in self._works)
                nouns = {work.study.run_noun for work in self._works}
                unit = nouns.pop() if len(nouns) == 1 else "run"
                self._display = progress(total, sum(work.done_runs for work in self._works), unit)
                self._display.expect(self._remaining)
            more = self._sample()
            while more:
                self._next_round()
                more = self._comm.bcast(bool(self._left)) and farm.run(
                    self._comm,
                    sorted(self._left),
                    self._compute,
                    self._flag,
                    self._on_report,
                    self._cost,
                    self._left.discard,
                    self._traffic,
                    self._tick,
                    self._flush,
                )
                self._flush()
            self._flush()
        self._end(time.perf_counter() - begun)

    def _sample(self) -> bool:
        """Time the pilots of all campaigns on all ranks; return whether to go on (collective)."""
        counts = [work.costs.n_samples() for work in self._works]
        firsts = [0, *itertools.accumulate(self._comm.bcast(counts))]

        def compute(number, poll, report) -> None:
            k = bisect_right(firsts, number) - 1
            sample = costs.time_sample(self._works[k].study, number - firsts[k], poll)
            report((k, sample._replace(seconds=round(sample.seconds, 6))))

        def on_report(_rank, value) -> None:
            k, sample = value
            self._works[k].costs.tasks.sampled(sample)
            self._guarded(k, partial(self._works[k].journal.note, "pilot", **sample._asdict()))

        if firsts[-1] == 0:
            return True
        return farm.run(self._comm, range(firsts[-1]), compute, self._flag, on_report)

    def _take(self, numbers: Iterable[int]) -> None:
        """Add the unfinished tasks of campaigns to those that are not done, on rank 0."""
        if self._comm.rank == 0:
            for k in numbers:
                self._left.update(self._firsts[k] + task for task in self._works[k].todo)

    def _next_round(self) -> None:
        """Begin the next round of the campaigns that have rounds (collective)."""
        self._agree()
        for k, work in enumerate(self._works):
            if k in self.failed:
                continue
            runs = None
            if self._comm.rank == 0:
                runs, inferred = self._guarded(k, work.plan) or (None, 0)
                if inferred:
                    self._display.advance(inferred)
            runs = self._comm.bcast(runs)
            if runs is not None:
                work.begin(runs)
                self._take([k])

    def _agree(self) -> None:
        """Gather which campaigns failed anywhere, so that all ranks know (collective)."""
        gathered = self._comm.gather(self.failed)
        failed: dict[int, str] = {}
        for part in reversed(gathered or []):
            failed |= part
        self.failed = self._comm.bcast(failed)

    def _place(self, number: int) -> tuple[int, int]:
        """Return the campaign and its task behind a number of the list."""
        k = bisect_right(self._firsts, number) - 1
        return k, number - self._firsts[k]

    def _cost(self, number: int) -> float:
        k, task = self._place(number)
        return 0.0 if k in self.failed else self._works[k].left(task)

    def _remaining(self) -> float | None:
        """Estimate the wall time (s) until all is done; None if it is not known."""
        works = enumerate(self._works)
        return remaining_of([work.costs for k, work in works if k not in self.failed])

    def _compute(self, number: int, poll, report, *rest) -> tuple | None:
        """Compute one task on this rank; nothing if its campaign has failed here."""
        k, task = self._place(number)
        if self._at != k:
            # results of another campaign must not wait until this rank returns to it
            self._guarded(self._at, self._works[self._at].flush)
            self._at = k
        if k in self.failed:
            return None
        compute = self._works[k].compute
        return self._guarded(k, lambda: compute(task, poll, lambda v: report((k, v)), *rest))

    def _guarded(self, k: int, action: Callable):
        """Run an action of a campaign; if there are others, an error ends only this one."""
        if k in self.failed:
            return None
        try:
            return action()
        except (Stop, LauncherLostError):
            raise
        except Exception as error:
            if len(self._works) == 1:
                raise
            if isinstance(error, StoreError | WriteError):
                self.failed[k] = str(error)
            elif isinstance(error, OSError):
                self.failed[k] = f"{self._works[k].output}: {error}"
            else:
                self.failed[k] = f"{self._works[k].output}: {traceback.format_exc().rstrip()}"
            return None

    def _on_report(self, rank: int, value) -> None:
        k, report = value
        self._guarded(k, lambda: self._display.advance(self._works[k].block_done(rank, report)))

    def _tick(self) -> None:
        """Update the display, and now and then write the master's load."""
        self._display.tick()
        if time.monotonic() < self._due:
            return
        self._due = time.monotonic() + MASTER_NOTES
        for k, work in enumerate(self._works):
            self._guarded(k, partial(work.journal.note, "master", **vars(self._traffic)))

    def _flush(self) -> None:
        for k, work in enumerate(self._works):
            self._guarded(k, work.flush)

    def _end(self, seconds: float) -> None:
        """Gather what failed, write the last records and say what is to be said (collective)."""
        # every rank has committed what it computed
        self._comm.barrier()
        if self._comm.rank == 0:
            unfinished = {self._place(number)[0] for number in self._left}
            self.complete = [
                k not in unfinished and bool(self._guarded(k, work.is_complete))
                for k, work in enumerate(self._works)
            ]
        self._agree()
        self.complete = self._comm.bcast(self.complete)
        self._display.close()
        for k, work in enumerate(self._works):
            reason = "complete" if self.complete[k] else self._flag.reason or "stopped"
            if k in self.failed:
                with contextlib.suppress(WriteError):
                    work.end("failed", seconds, self._traffic, self._display)
            else:
                self._guarded(k, partial(work.end, reason, seconds, self._traffic, self._display))
