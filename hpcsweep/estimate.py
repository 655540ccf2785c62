"""What a job will cost, from a timed sample, before it is run."""

import time
from pathlib import Path

import numpy as np

from hpcsweep import sweep
from hpcsweep.job import Job
from hpcsweep.store import file_size

SAMPLE_SECONDS = 5.0
"""Time given to the sample."""
RUNS_PER_SAMPLE = 3
RANKS = (1, 2, 4, 16, 64, 256, 1024, 4096)


def estimate(job: Job, output: Path, seconds: float = SAMPLE_SECONDS) -> str:
    """Time runs of a stratified sample of frames and amplitudes and extrapolate.

    Returns
    -------
    str
        Lines for a person: runs, bytes, core-hours with their standard error, time on N ranks.
    """
    n_frames, n_amplitudes = job.omega.size, job.amplitude.size
    sweep.warm_up(job.settings)
    rng = np.random.default_rng(1)
    costs, begun = [], time.perf_counter()
    while time.perf_counter() - begun < seconds and len(costs) < 4 * n_frames * n_amplitudes:
        share = (len(costs) * 0.6180339887498949) % 1.0
        frame = int(share * n_frames)
        first = int(rng.integers(max(n_amplitudes - RUNS_PER_SAMPLE, 1)))
        path = job.amplitude[first : first + RUNS_PER_SAMPLE + 1]
        # one run to arrive on the attractor, not timed
        arrived = sweep.sweep_block(
            job.structure, float(job.omega[frame]), path[:1], job.initial_state, job.settings
        )
        start = time.perf_counter()
        path = path[1:] if path.size > 1 else path
        sweep.sweep_block(
            job.structure,
            float(job.omega[frame]),
            path,
            np.nan_to_num(arrived["final_state"][-1]),
            job.settings,
        )
        costs.append((time.perf_counter() - start) / path.size)
    mean = float(np.mean(costs))
    error = float(np.std(costs) / np.sqrt(len(costs)))
    total = mean * job.n_runs
    dearest = float(np.max(costs)) * n_amplitudes * len(job.directions)
    dearest = min(dearest, total) if n_frames > 1 else total
    lines = [
        f"{job.name}: {n_frames} frames x {n_amplitudes} amplitudes x "
        f"{len(job.directions)} directions = {job.n_runs} runs, solver {job.settings.solver}",
        f"file:       {output}, {file_size(job) / 1e6:.4g} MB",
        f"one run:    {1e3 * mean:.4g} ms +- {1e3 * error:.2g} ms (mean of {len(costs)} samples)",
        f"in all:     {total / 3600:.3g} core-hours ({total:.3g} s)",
    ]
    for ranks in RANKS:
        # one frame is one task: no run is shorter than its dearest frame
        lines.append(f"on {ranks:4d} ranks: about {max(total / ranks, dearest):.3g} s")
        if total / ranks <= dearest:
            lines.append(
                f"            more ranks do not help: the dearest frame takes {dearest:.3g} s"
            )
            break
    return "\n".join(lines)
