"""Measure the wall time of a tiny job: with nothing compiled, and afterwards."""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from speed.scaling import reason, run_command

JOB = """
[sweep]
omega = 0.445
amplitude = {from = 0.02, to = 0.1, count = 5}
"""
LIBRARIES = "import numba, scipy.linalg, h5py"


def startup(repeats: int = 3, say: Callable = lambda text: None) -> dict:
    """Time `hpcsweep run` on a job of five runs.

    Returns
    -------
    dict
        Seconds by the clock: ``cold`` (once, kernels are compiled into an empty cache) and ``warm``
        (median of the repeats, from that cache); ``libraries`` is Python with its imports of numba,
        scipy and h5py alone, the lower bound of any program that uses them. Or ``failed``: the
        message of the command.
    """
    with tempfile.TemporaryDirectory() as folder:
        job, cache = Path(folder) / "tiny.toml", Path(folder) / "cache"
        job.write_text(JOB)
        times, libraries = [], []
        for turn in range(1 + repeats):
            say(f"start {turn + 1} of {1 + repeats}")
            output = Path(folder) / f"{turn}.h5"
            command = [sys.executable, "-m", "hpcsweep", "run", job, "-o", output]
            try:
                times.append(run_command(command, NUMBA_CACHE_DIR=str(cache)))
                libraries.append(run_command([sys.executable, "-c", LIBRARIES]))
            except subprocess.SubprocessError as error:
                return {"failed": reason(error)}
    return {
        "cold": times[0],
        "warm": float(np.median(times[1:])),
        "libraries": float(np.median(libraries[1:])),
    }


def as_text(result: dict) -> str:
    """Format the seconds on one line."""
    if "failed" in result:
        return f"start-up: not measured: {result['failed']}"
    return (
        f"start-up of `hpcsweep run` on five runs: cold {result['cold']:.3g} s (kernels compiled), "
        f"warm {result['warm']:.3g} s, of which importing numba, scipy and h5py "
        f"{result['libraries']:.3g} s"
    )
