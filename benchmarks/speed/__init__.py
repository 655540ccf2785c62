"""Benchmarks of `bash benchmarks/run.sh bench`, one module a question.

`work_precision`
    Run time against error, of our solvers and their `peers`.
`ratios`
    `flow` against the specified solver and a compiled peer, on the same motions.
`profile`
    Solver calls of the runs of frames, their counts and times.
`scaling`
    Run time against ranks and against floors.
`startup`
    Seconds of a tiny job on a cold and on a warm cache.
`skips`
    The rules that spare periods, against the window procedure.

Every number is paired: alternatives are measured on the same machine in one run, in turn, and the
turns are repeated. Solvers are timed by the process's own CPU time, which other programs on the
machine disturb least.
"""

import time
from collections.abc import Callable

PARTS = ("work-precision", "ratio", "profile", "floors", "ranks", "startup", "skips")
"""Names of the measurements, in the order in which they are done."""


def cpu_seconds(function: Callable, least: float = 2e-3) -> float:
    """Return the CPU seconds a call, over many calls where one is too short for the clock."""
    begun = time.process_time()
    function()
    once = time.process_time() - begun
    calls = int(least / max(once, 1e-6))
    if calls < 2:
        return once
    begun = time.process_time()
    for _ in range(calls):
        function()
    return (time.process_time() - begun) / calls
