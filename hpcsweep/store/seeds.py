"""Periodic motions of results files, as the seeds of branches (`hpcsweep.studies.branches`)."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np

from hpcsweep.job import Job
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store.frames import Frames
from hpcsweep.store.layout import StoreError
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.seeds import Seed, Seeds, Where
from hpcsweep.studies.study import as_kind

KINDS = ("motions", "attractors")
"""What files may hold."""


def read_seeds(paths: tuple[str, ...], where: Where) -> Seeds:
    """Read the motions of results files within frequencies and amplitudes.

    Raises
    ------
    StoreError
        If a file is none, holds something else, or no motion of the structure.
    """
    periodic: dict[tuple, Seed] = {}
    others = 0
    for path in paths:
        with closing(Frames(path, None)) as frames:
            _choose(frames, where)
            for omega, amplitude, motion in _motions(frames, where):
                seed = _seed_of(omega, amplitude, motion)
                if seed is None:
                    others += 1
                else:
                    key = omega, amplitude, seed.period, seed.points[-1].tobytes()
                    periodic.setdefault(key, seed)
    return Seeds(list(periodic.values()), others)


def with_inputs(job: Job) -> Job:
    """Return a job whose runs may start from motions of results files."""
    return replace(job, study=job.study.with_reader(read_seeds))


def _choose(frames: Frames, where: Where) -> None:
    """Choose the part of a file that is of the structure."""
    if frames.whole.study.holds not in KINDS:
        raise StoreError(
            f"{frames.path}: holds {frames.whole.study.holds}; seeds are motions of sweeps and "
            "points, or attractors"
        )
    for place in frames.places:
        frames.choose(place)
        if frames.study.structure == where.structure:
            return
    raise StoreError(f"{frames.path}: is of another structure than the job")


def _motions(frames: Frames, where: Where) -> Iterator[tuple[float, float, dict]]:
    """Go through the motions of the part chosen: direction by direction within a frame."""
    study = as_kind(frames.study, RunGrid)
    names = tuple(variable.name for variable in frames.variables)
    for frame in range(study.n_frames):
        omega = float(study.omega[frame])
        amplitudes = study.amplitudes_of(frame)
        inside = (where.amplitude[0] <= amplitudes) & (amplitudes <= where.amplitude[1])
        if not (where.omega[0] <= omega <= where.omega[1] and inside.any()):
            continue
        rows = frames.read(frame, names)
        for direction, at in np.ndindex(len(study.directions), amplitudes.size):
            if inside[at] and rows["outcome"][direction, at] == Outcome.COMPLETE:
                run = {name: values[direction, at] for name, values in rows.items()}
                for motion in study.motions(run):
                    yield omega, float(amplitudes[at]), motion


def _seed_of(omega: float, amplitude: float, motion: dict) -> Seed | None:
    """Return a motion as a seed, None if it is no orbit."""
    period = int(motion["orbit_period"])
    if period < 1:
        return None
    stored = motion.get("poincare", motion["final_state"][None])
    count = int(motion.get("n_points", len(stored)))
    points = stored[max(count - period, 0) : count]
    if len(points) < period:
        points = points[-1:]
    return Seed(omega, amplitude, period, points.copy())
