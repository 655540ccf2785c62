"""Transient chaos: what share of a file's chaotic runs outlives so many more forcing periods.

Chaos may end: a chaotic saddle holds a motion for a time whose distribution falls exponentially
(Lai and Tél, Transient Chaos, 2011, 1.2), and no finite window tells it from an attractor. Of all
chaotic runs of a file some are drawn, each integrated on from the end of its run, and classified
again.
"""

from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass, classify
from hpcsweep.dynamics.classify_motion import classify_motion
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.model.arguments import count
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import SOLVERS, make_solver
from hpcsweep.store.frames import Frames

Run = tuple[tuple[int, ...], int, int, int]
"""Place of its part, frame, direction and amplitude."""
PERIODS = 10_000
CONFIDENCE = 0.95


def outliving(path: str | Path, samples: int, periods: int = PERIODS, seed: int = 0) -> dict:
    """Estimate the share of chaotic runs that are chaotic after so many more forcing periods.

    Parameters
    ----------
    path : str or Path
        Results file of sweeps or points.
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
        confidence (Clopper and Pearson).

    Raises
    ------
    StoreError
        If it is not a campaign file, or holds other things than runs.
    """
    samples, periods = count("samples", samples, 1), count("periods", periods, 1)
    frames = Frames(path, "motions")
    try:
        runs = [
            (place, frame, direction, at)
            for place in frames.places
            for frame in _chosen(frames, place)
            for direction, at in np.argwhere(_chaotic(frames, frame)).tolist()
        ]
        drawn = np.random.default_rng(count("seed", seed)).permutation(len(runs))[:samples]
        kinds = [_later(frames, runs[at], periods) for at in np.sort(drawn)]
    finally:
        frames.close()
    outlive = kinds.count(MotionClass.CHAOTIC)
    undecided = sum(kind in (MotionClass.UNDECIDED, MotionClass.FAILED) for kind in kinds)
    decided = len(kinds) - undecided
    low, high = share_interval(outlive, decided, CONFIDENCE) if decided else (0.0, 1.0)
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
    }


def _chosen(frames: Frames, place: tuple[int, ...]) -> range:
    """Choose a part of a file, and return the numbers of its frames."""
    frames.choose(place)
    return range(frames.study.n_frames)


def _chaotic(frames: Frames, frame: int) -> np.ndarray:
    """Return which runs of a frame are chaotic, shape (direction, amplitude)."""
    if MOTION in frames:
        return frames.read(frame, (MOTION,))[MOTION] == MotionClass.CHAOTIC
    study = frames.study
    found = classify(frames.dataset(frame), study.settings, study.structure.units_at)
    return found[:, 0] == MotionClass.CHAOTIC


def _later(frames: Frames, run: Run, periods: int) -> MotionClass:
    """Return the class of the motion of a run after so many more forcing periods."""
    place, frame, direction, at = run
    frames.choose(place)
    study = frames.study
    state = frames.read(frame, ("final_state",))["final_state"][direction, at]
    omega, amplitude = float(study.omega[frame]), float(study.amplitudes_of(frame)[at])
    structure = study.structure.measured_at(omega, amplitude)
    solver = make_solver("flow", structure, omega, study.settings.rtol)
    end = solver.advance(state, amplitude, periods)
    if end.outcome is not Outcome.COMPLETE:
        return MotionClass.FAILED
    most = SOLVERS["flow"].classify_cycles
    return classify_motion(solver, end.state, amplitude, study.settings, most).kind
