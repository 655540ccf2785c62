"""Replay a job's costs on real ranks with tasks that sleep, to check a prediction.

Sleeping ranks need no core: more ranks than cores behave as if each had its own. This verifies the
simulation: 48 frames of `jobs/paper/gaps.toml` on 8 ranks and two busy cores took 1.006 of the
predicted makespan.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hpcsweep.parallel import farm
from hpcsweep.parallel.simulation import ExactCosts
from hpcsweep.parallel.stopping import StopFlag

SLICE = 2e-3
"""Seconds between two polls for messages."""
EMPTY_TASKS = 2000
"""Empty tasks per rank that time the messages."""


@dataclass(frozen=True)
class Messages:
    """Speed of the master.

    Attributes
    ----------
    n_messages : int
    per_second : float
        By the wall clock: what these ranks could send.
    capacity : float
        By the time the master spent on them: what it could have handled.
    """

    n_messages: int
    per_second: float
    capacity: float


def time_messages(comm) -> Messages | None:
    """Time the master's messages with empty tasks (collective); return None except on rank 0."""
    traffic = farm.Traffic()

    def compute(task, poll, report) -> None:
        report(task)

    if comm.size == 1:
        return None
    comm.barrier()
    begun = time.perf_counter()
    with StopFlag() as flag:
        tasks = range(EMPTY_TASKS * (comm.size - 1))
        farm.run(comm, tasks, compute, flag, traffic=traffic, computing_master=False)
    elapsed = time.perf_counter() - begun
    if comm.rank != 0 or not traffic.messages:
        return None
    return Messages(traffic.messages, traffic.messages / elapsed, traffic.capacity or 0.0)


def replay(
    comm, blocks: Sequence[np.ndarray] | None, computing_master: bool | None = None
) -> tuple[float, farm.Traffic]:
    """Sleep through all blocks on all ranks, as the farm schedules them (collective).

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    blocks : sequence of ndarray
        Cost (s) of the blocks of each task; used on rank 0.
    computing_master : bool, optional
        As `farm.run`.

    Returns
    -------
    makespan : float
        Seconds, on rank 0.
    traffic : farm.Traffic
    """
    blocks = comm.bcast(blocks)
    known, traffic = ExactCosts(blocks), farm.Traffic()
    ended = [0.0]

    def compute(task, poll, report, first=0) -> int | None:
        for position in range(first, len(blocks[task])):
            due = time.monotonic() + blocks[task][position]
            while (rest := due - time.monotonic()) > 0:
                time.sleep(min(rest, SLICE))
                poll()
            last = position + 1 == len(blocks[task])
            if report((task, position)) and not last:
                return position + 1
        return None

    def on_report(_rank, value) -> None:
        task, position = value
        known.done(task, position, 0.0)
        ended[0] = time.monotonic()

    comm.barrier()
    begun = time.monotonic()
    with StopFlag() as flag:
        farm.run(
            comm,
            range(len(blocks)),
            compute,
            flag,
            on_report,
            known.left,
            traffic=traffic,
            computing_master=computing_master,
        )
    return ended[0] - begun, traffic
