"""Choose a Slurm request from a prediction of the makespan and of the memory of a rank.

A guess is costly: on 64 ranks the 48 frames of `jobs/paper/gaps.toml` would leave 71 % of the
ranks' time unused, on 16 ranks 2 %.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from hpcsweep.parallel.simulation import Prediction

EFFICIENCY = 0.8
"""Least share of the ranks' time that is work: beyond, ranks wait more than they compute."""
STEPS = 3
"""Halvings of the interval between two powers of two: ranks are found to an eighth of it."""
TIME_MARGIN = 1.5
"""Margin of the makespan: another processor, a busy file system, a sample of a few seconds."""
START_SECONDS = 600.0
"""For the kernels that are compiled on a node's first run, the pilot, and the signal before the
time limit (`slurm/once.sh`: 300 s)."""
TIME_STEP = 300.0
"""Times are whole multiples of this (s)."""
MEMORY_MARGIN = 1.25
MEMORY_STEP = 100 * 2**20
"""Memory is a whole multiple of this (bytes)."""


@dataclass(frozen=True)
class Request:
    """Resources of a batch job.

    Attributes
    ----------
    n_tasks : int
    seconds : float
        Time limit.
    memory : int
        Bytes of each task.
    """

    n_tasks: int
    seconds: float
    memory: int


def useful_ranks(predict: Callable[[int], Prediction], most: int) -> Prediction:
    """Find the largest number of ranks that keeps the efficiency, to an eighth of its octave.

    Parameters
    ----------
    predict : callable (n_ranks)
    most : int
        A power of two; no more ranks are tried.
    """
    best = predict(1)
    while 2 * best.n_ranks <= most:
        more = predict(2 * best.n_ranks)
        if more.efficiency < EFFICIENCY:
            break
        best = more
    else:
        return best
    beyond = more.n_ranks
    for _ in range(STEPS):
        middle = predict((best.n_ranks + beyond) // 2)
        if middle.n_ranks == best.n_ranks:
            break
        if middle.efficiency >= EFFICIENCY:
            best = middle
        else:
            beyond = middle.n_ranks
    return best


def request(prediction: Prediction, memory: float) -> Request:
    """Return the resources that a prediction needs, with margins.

    Parameters
    ----------
    prediction : Prediction
    memory : float
        Bytes of the largest rank.
    """
    seconds = TIME_MARGIN * prediction.makespan + START_SECONDS
    return Request(
        prediction.n_ranks,
        TIME_STEP * math.ceil(seconds / TIME_STEP),
        MEMORY_STEP * math.ceil(MEMORY_MARGIN * memory / MEMORY_STEP),
    )


def as_lines(resources: Request) -> list[str]:
    """Format a request as the lines of a batch script."""
    return [
        f"#SBATCH --ntasks={resources.n_tasks}",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={_time(resources.seconds)}",
        f"#SBATCH --mem-per-cpu={resources.memory // 2**20}M",
    ]


def _time(seconds: float) -> str:
    """Format a time for Slurm: [days-]hours:minutes:seconds."""
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return f"{f'{days}-' if days else ''}{hours:02d}:{minutes:02d}:{rest:02d}"
