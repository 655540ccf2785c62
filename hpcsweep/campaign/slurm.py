"""Choose a Slurm request from the time that the work takes and the memory of a rank."""

import math

from hpcsweep.parallel.schedule import DEDICATED_MASTER

START_SECONDS = 600.0
"""For the kernels that are compiled on a node's first run, the pilot, and the signal before the
time limit (`slurm/once.sh`: 300 s)."""
TIME_STEP = 300.0
"""Times are whole multiples of this (s)."""
MEMORY_MARGIN = 1.25
MEMORY_STEP = 100 * 2**20
"""Memory is a whole multiple of this (bytes)."""


def lines(n_computing: int, work: float, memory: float) -> list[str]:
    """Return the lines of a batch script for ranks that compute, and a master beside many of them.

    Parameters
    ----------
    n_computing : int
        At most the ranks that are of use.
    work : float
        Most processor time (s) of all tasks.
    memory : float
        Bytes of the largest rank.
    """
    seconds = TIME_STEP * math.ceil((work / n_computing + START_SECONDS) / TIME_STEP)
    bytes_of_each = MEMORY_STEP * math.ceil(MEMORY_MARGIN * memory / MEMORY_STEP)
    return [
        f"#SBATCH --ntasks={n_computing + (n_computing > DEDICATED_MASTER)}",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={_time(seconds)}",
        f"#SBATCH --mem-per-cpu={bytes_of_each // 2**20}M",
    ]


def _time(seconds: float) -> str:
    """Format a time for Slurm: [days-]hours:minutes:seconds."""
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return f"{f'{days}-' if days else ''}{hours:02d}:{minutes:02d}:{rest:02d}"
