"""Transient chaos: what share of a file's chaotic runs outlives so many more forcing periods.

Chaos may end: a chaotic saddle holds a motion for a time whose distribution falls exponentially
(Lai and Tél, Transient Chaos, 2011, 1.2), and no finite window tells it from an attractor. Of all
chaotic runs of a file some are drawn, each integrated on from the end of its run, and classified
again.
"""

import math
from contextlib import closing
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass, classify
from hpcsweep.dynamics.classify_motion import classify_motion
from hpcsweep.dynamics.lifetime import Survival
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.model.arguments import count
from hpcsweep.solvers.solver import SOLVERS, make_solver
from hpcsweep.store.frames import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

Run = tuple[tuple[int, ...], int, tuple[int, ...]]
"""Place of its part, frame, and the others of its indices: direction, amplitude, attractor."""
HELD = {
    "motions": (MOTION, "final_state"),
    "attractors": ("motion", "point"),
    "basins": ("motion", "point"),
}
"""Variables of the class of a motion and of its state, by what a file holds."""
PERIODS = 10_000
CONFIDENCE = 0.95


def outliving(path: str | Path, samples: int, periods: int = PERIODS, seed: int = 0) -> dict:
    """Estimate the share of chaotic runs that are chaotic after so many more forcing periods.

    Parameters
    ----------
    path : str or Path
        Results file of sweeps, points, attractors or basins.
    samples : int
        Number of chaotic runs to draw; all if there are fewer.
    periods : int
        Forcing periods by which each is continued.
    seed : int
        Seed of the draw.

    Returns
    -------
    dict
        ``chaotic`` runs of the file, ``samples`` drawn, ``periods``, how many of those ``outlive``
        them, have ``ended`` in another motion or are ``undecided``, and the ``share`` that outlives
        of those that are decided (None without any), with its interval ``low``, ``high`` of 95 %
        confidence (Clopper and Pearson), and the mean ``lifetime`` in forcing periods with its
        interval (`hpcsweep.dynamics.lifetime`; None where it is infinite).

    Raises
    ------
    StoreError
        If it is not a campaign file, or holds other things than runs.
    """
    samples, periods = count("samples", samples, 1), count("periods", periods, 1)
    with closing(Frames(path, tuple(HELD))) as frames:
        runs = [
            (place, frame, at)
            for place in frames.places
            for frame in _chosen(frames, place)
            for at in map(tuple, np.argwhere(_chaotic(frames, frame)).tolist())
        ]
        drawn = np.random.default_rng(count("seed", seed)).permutation(len(runs))[:samples]
        later = [_later(frames, runs[at], periods) for at in np.sort(drawn)]
    kinds = [kind for kind, _ in later]
    outlive = kinds.count(MotionClass.CHAOTIC)
    undecided = sum(kind in (MotionClass.UNDECIDED, MotionClass.FAILED) for kind in kinds)
    decided = len(kinds) - undecided
    low, high = share_interval(outlive, decided, CONFIDENCE) if decided else (0.0, 1.0)
    survival = Survival(decided - outlive, sum(cycles for _, cycles in later))
    return {
        "chaotic": len(runs),
        "samples": len(kinds),
        "periods": periods,
        "outlive": outlive,
        "ended": decided - outlive,
        "undecided": undecided,
        "share": outlive / decided if decided else None,
        "low": low,
        "high": high,
        "lifetime": [
            value if math.isfinite(value) else None for value in survival.lifetime(CONFIDENCE)
        ],
    }


def _chosen(frames: Frames, place: tuple[int, ...]) -> range:
    """Choose a part of a file, and return the numbers of its frames."""
    frames.choose(place)
    # every row of a map of basins lists the same attractors
    return range(1 if frames.study.holds == "basins" else frames.study.n_frames)


def _chaotic(frames: Frames, frame: int) -> np.ndarray:
    """Return which motions of a frame are chaotic, shape (direction, amplitude, ...)."""
    name, _ = HELD[frames.study.holds]
    if name in frames:
        return frames.read(frame, (name,))[name] == MotionClass.CHAOTIC
    study = frames.study
    found = classify(frames.dataset(frame), study.settings, study.units_at)
    return found[:, 0] == MotionClass.CHAOTIC


def _later(frames: Frames, run: Run, periods: int) -> tuple[MotionClass, int]:
    """Return the class of a motion that is followed on, and how many of the periods it took."""
    place, frame, at = run
    frames.choose(place)
    study = as_kind(frames.study, RunGrid)
    _, name = HELD[study.holds]
    state = frames.read(frame, (name,))[name][at]
    omega, amplitude = (float(of(frame)[at[1]]) for of in (study.omegas_of, study.amplitudes_of))
    structure = study.structure_at(at[1]).measured_at(omega, amplitude)
    solver = make_solver("flow", structure, omega, study.settings.rtol)
    most = periods + SOLVERS["flow"].classify_cycles
    motion = classify_motion(solver, state, amplitude, study.settings, most, outlived=periods)
    return motion.kind, min(motion.cycles, periods)
