"""Verify, before the first run, what the file of a campaign already holds."""

import array
import contextlib
import time
from collections.abc import Callable

import numpy as np

from hpcsweep.parallel import farm
from hpcsweep.parallel.mpi import on_master
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store.commit import Blocks
from hpcsweep.store.layout import StoreError

SCAN_NOTES = 10.0
"""Seconds between two messages about the progress of verification."""
POLL_BLOCKS = 64
"""Blocks verified between two polls."""


class Scan:
    """Contents of the file: verified by all ranks, each its share, and known on rank 0.

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

    def __init__(self, comm, blocks: Blocks, flag: StopFlag, say: Callable[[str], None]):
        self._flag, self._say = flag, say if comm.rank == 0 else lambda text: None
        self._begun = self._reported = time.monotonic()
        self._n_polls = 0
        study = blocks.study
        begun = self._tasks_begun(comm, blocks)
        self.todo: list[int] = []
        self.done_runs = 0
        done = array.array("q")
        finished = True
        try:
            self._poll()
            mine = begun[comm.rank :: comm.size]
            for number, task in enumerate(mine):
                self._poll(number, len(mine))
                done += self._verify(blocks, task)
        except farm.Stop:
            finished = False
        n_axes = len(study.commit.dims)
        places = np.array(done, np.int64).reshape(-1, n_axes)
        gathered = comm.gather((self.todo, self.done_runs, places, finished))
        if gathered is not None:
            left = np.ones(study.n_tasks, bool)
            left[begun] = False
            left[[task for part in gathered for task in part[0]]] = True
            self.todo = np.flatnonzero(left).tolist()
            self.done_runs = sum(part[1] for part in gathered)
            places = np.concatenate([part[2] for part in gathered])
            finished = all(part[3] for part in gathered)
        self.done = places
        self.finished = comm.bcast(finished)

    def _tasks_begun(self, comm, blocks: Blocks) -> list[int]:
        """Return the tasks of which the file holds a part: no other needs verifying (collective).

        Raises
        ------
        OSError, StoreError
            On every rank, if the file cannot be read.
        """

        def begun() -> list[int]:
            with contextlib.suppress(farm.Stop):
                return blocks.begun(self._poll)
            return []

        return on_master(comm, begun, OSError, StoreError)

    def _verify(self, blocks: Blocks, task: int) -> array.array:
        """Verify a task; return the indices of its valid blocks in a row."""
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
        self._n_polls += 1
        if self._n_polls % POLL_BLOCKS == 0:
            self._poll()

    def _poll(self, task: int = 0, n_tasks: int = 0) -> None:
        """Raise `Stop` if requested; report progress from time to time."""
        if self._flag.is_set():
            raise farm.Stop
        now = time.monotonic()
        if now - self._reported > SCAN_NOTES:
            self._reported = now
            where = f", {100 * task / n_tasks:.0f} % of its tasks" if n_tasks else ""
            self._say(f"verifying what is in the file: {now - self._begun:.0f} s{where}")
