"""What figures and the explorer show of a study of attractors as of one with a motion a run."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass, Shakedown
from hpcsweep.dynamics.known import matched
from hpcsweep.figures.style import PlotError
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.attractors import AttractorGrid
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

DIMENSION, IDENTITY = "attractor", "identity"
"""Dimension of several motions a run, and variable of `identities`."""
STORED = ("attractor_id", "n_points", "poincare")
"""From which they are."""


def attractor_classes(results) -> np.ndarray:
    """Return the motion class of each attractor, NOT_COMPUTED where a slot is empty.

    Returns
    -------
    ndarray of int8, in the shape of ``attractor_id``
    """
    held = results["attractor_id"].values > 0
    kind = np.where(held, results["motion"].values, MotionClass.NOT_COMPUTED)
    if "contact" in results:
        free = held & (results["contact"].values == 0)
        if "shakedown" in results:
            free &= results["shakedown"].values <= Shakedown.ELASTIC
        kind = np.where(free, MotionClass.NO_CONTACT, kind)
    return kind.astype(np.int8)


def dominant(results):
    """Return the attractor of the largest share of each point, as the motion of a run.

    Where no attractor was found it is undecided.
    """
    largest = results.isel({DIMENSION: 0})
    kind = attractor_classes(largest)
    none = (kind == MotionClass.NOT_COMPUTED) & (largest["outcome"].values == Outcome.COMPLETE)
    kind = np.where(none, np.int8(MotionClass.UNDECIDED), kind)
    return largest.assign({MOTION: (largest["outcome"].dims, kind)})


def identities(frames) -> np.ndarray:
    """Return identities of attractors over both parameters.

    An identity along the path of a frame, which the file holds, continues the one of the frame
    below whose attractors, place by place, it has most within `study.match_distance`, as the study
    matches those of neighbouring places; each continues one at most, and others are new. So all
    attractors of a point have different identities, and each keeps its own along its path. From
    frame to frame an identity says what most places say: round a cusp, where two attractors are one
    sheet, it has to jump somewhere.

    Parameters
    ----------
    frames : hpcsweep.store.Frames

    Returns
    -------
    ndarray of int, shape (n_frames, n_along, n_attractors)
        0 where there is no attractor.

    Raises
    ------
    PlotError
        If attractors have no identity along the amplitudes.
    """
    study = as_kind(frames.study, AttractorGrid)
    if not study.by_frame:
        text = "attractors of points on their own have no identity along a path"
        raise PlotError(f"--value {IDENTITY}: {text}")
    by_frame: dict[int, np.ndarray] = {}
    last = 0
    before: list[list[tuple[int, np.ndarray]]] = [[] for _ in range(study.n_along)]
    for frame in np.argsort(study.frames, kind="stable").tolist():
        sets = {name: x[0] for name, x in frames.read(frame, STORED).items()}
        ids = sets["attractor_id"]
        units = units_along(study, frame)
        now = [
            [
                (int(number), sets["poincare"][k, a, : sets["n_points"][k, a]] / units[k])
                for a, number in enumerate(ids[k])
                if number
            ]
            for k in range(len(ids))
        ]
        votes: Counter[tuple[int, int]] = Counter()
        for older, newer in zip(before, now, strict=True):
            there, here = ([points for _, points in each] for each in (older, newer))
            pairs = matched(there, here, study.match_distance)
            votes.update((older[i][0], newer[j][0]) for i, j in pairs)
        names = continued(votes)
        for number in range(1, int(ids.max(initial=0)) + 1):
            if number not in names:
                last += 1
                names[number] = last
        by_frame[frame] = np.array([0, *(names[k + 1] for k in range(len(names)))])[ids]
        before = [[(names[number], points) for number, points in each] for each in now]
    return np.array([by_frame[frame] for frame in range(study.n_frames)])


def units_along(study: RunGrid, frame: int) -> np.ndarray:
    """Return the units of states at each place of a frame, shape (n_along, 2n)."""
    forcing = zip(study.omegas_of(frame), study.amplitudes_of(frame), strict=True)
    return np.array([study.units_at(*driven, at) for at, driven in enumerate(forcing)])


def continued(votes: Mapping[tuple[int, int], int]) -> dict[int, int]:
    """Return which identity each new one continues: most votes first, each at most once.

    Parameters
    ----------
    votes : mapping of (int, int) to int
        Amplitudes at which an identity and a new one have matching attractors.
    """
    names: dict[int, int] = {}
    for (older, newer), _ in sorted(votes.items(), key=lambda vote: (-vote[1], vote[0])):
        if newer not in names and older not in names.values():
            names[newer] = older
    return names
