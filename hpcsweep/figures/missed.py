"""Find attractors that sweeps miss, from a study of attractors and a sweep along the same paths.

A run of the sweep is taken to end on the attractor nearest to its last points, in the mean over
these points. The sweep misses an attractor on which no run ends.
"""

import contextlib
from pathlib import Path

import numpy as np

from hpcsweep.figures.attractors import units_along
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames, StoreError
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.run_names import SYMBOLS
from hpcsweep.studies.study import as_kind

LAST = 16
"""Points of a run that are compared."""
SAME = 1e-9
"""Relative difference of frequencies and amplitudes that count as equal."""


def missed_attractors(attractors: Frames, sweep: Path) -> np.ndarray:
    """Count the attractors of each point on which no run of a sweep at this point ends.

    Parameters
    ----------
    found : Frames
        Results of a study of attractors.
    sweep : Path
        Results of a sweep along the same parameter, with its frames and places.

    Returns
    -------
    ndarray of int, shape (n_frames, n_amplitudes)
        -1 where either is not computed.

    Raises
    ------
    StoreError
        If the files are of other kinds or of different structures, or the sweep lacks a point.
    """
    with contextlib.closing(Frames(sweep, at=attractors.at)) as runs:
        rows = _common(attractors, runs, sweep)
        return np.array([_of_frame(attractors, runs, k, *rows[k]) for k in range(len(rows))])


def _common(attractors: Frames, runs: Frames, sweep: Path) -> list[tuple[int, np.ndarray]]:
    """Return the sweep's frame, and the places along it, for each frame of the attractors."""
    if runs.study.structure != attractors.study.structure:
        raise StoreError(f"{sweep}: is of another structure than {attractors.path}")
    points, swept = as_kind(attractors.study, RunGrid), as_kind(runs.study, RunGrid)
    if swept.run_dims != points.run_dims:
        other = f"not {points.run_dims[-1]} as {attractors.path}"
        raise StoreError(f"{sweep}: is along {swept.run_dims[-1]}, {other}")

    def places(there: np.ndarray, wanted: np.ndarray, what: str) -> np.ndarray:
        place = np.abs(there[:, None] - wanted).argmin(axis=0)
        wrong = np.abs(there[place] - wanted) > SAME * np.maximum(wanted, 1e-300)
        if wrong.any():
            problem = f"holds no {what} {float(wanted[wrong][0]):.12g}, as {attractors.path} does"
            raise StoreError(f"{sweep}: {problem}")
        return place

    fixed, along = points.run_dims[-2:]
    frames = places(swept.frames, points.frames, f"frame at {SYMBOLS.get(fixed, fixed)} =").tolist()
    rows = []
    for frame, at in enumerate(frames):
        place = places(swept.along_of(at), points.along_of(frame), along)
        for each in ("omegas_of", "amplitudes_of"):
            there = getattr(swept, each)(at)[place]
            if not np.allclose(there, getattr(points, each)(frame), rtol=SAME, atol=0):
                problem = f"its formulas are other ones than those of {attractors.path}"
                raise StoreError(f"{sweep}: {problem}")
        rows.append((at, place))
    return rows


def _of_frame(
    attractors: Frames, runs: Frames, frame: int, at: int, place: np.ndarray
) -> np.ndarray:
    study = as_kind(attractors.study, RunGrid)
    units = units_along(study, frame)
    names = ("attractor_id", "n_points", "poincare", "outcome")
    sets = {name: values[0] for name, values in attractors.read(frame, names).items()}
    wanted = ("final_state", "outcome", *(("poincare", "n_points") if "poincare" in runs else ()))
    ends = {name: values[:, place] for name, values in runs.read(at, wanted).items()}
    missed = np.full(place.size, -1)
    for k in np.flatnonzero(sets["outcome"] == Outcome.COMPLETE).tolist():
        done = ends["outcome"][:, k] == Outcome.COMPLETE
        if not done.all():
            continue
        held = np.flatnonzero(sets["attractor_id"][k])
        clouds = [sets["poincare"][k, a, : sets["n_points"][k, a]] / units[k] for a in held]
        reached = set()
        for d in range(len(done)):
            points = ends["final_state"][d, k][None]
            if "poincare" in ends:
                points = ends["poincare"][d, k, : ends["n_points"][d, k]][-LAST:]
            far = [_mean_distance(points / units[k], cloud) for cloud in clouds]
            reached.add(int(np.argmin(far)) if far else -1)
        missed[k] = held.size - len(reached - {-1})
    return missed


def _mean_distance(points: np.ndarray, cloud: np.ndarray) -> float:
    """Return the mean distance of points to the nearest of a cloud."""
    return float(np.abs(points[:, None] - cloud).max(axis=2).min(axis=1).mean())
