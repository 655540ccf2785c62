"""What figures and the explorer show of a study of attractors as of one with a motion a run.

Attractors that sweeps miss are found from a study of attractors and a sweep along the same paths: a
run of the sweep is taken to end on the attractor nearest to its last points, in the mean over these
points. The sweep misses an attractor on which no run ends.
"""

import contextlib
import itertools
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass, Shakedown
from hpcsweep.dynamics.known import matched
from hpcsweep.figures.style import PlotError
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames, StoreError
from hpcsweep.studies.attractors.attractors import AttractorGrid
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

DIMENSION, IDENTITY = "attractor", "identity"
"""Dimension of several motions a run, and variable of `identities`."""
STORED = ("attractor_id", "n_points", "poincare")
"""From which they are."""
LAST = 16
"""Points of a run that are compared."""
SAME = 1e-9
"""Relative difference of frequencies and amplitudes that count as equal."""


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
    new = itertools.count(1)
    before: list[list[tuple[int, np.ndarray]]] = [[] for _ in range(study.n_along)]
    for frame in np.argsort(study.frames, kind="stable").tolist():
        sets = {name: x[0] for name, x in frames.read(frame, STORED).items()}
        ids = sets["attractor_id"]
        units = units_along(study, frame)
        now = [_clouds(sets, k, units[k]) for k in range(len(ids))]
        votes: Counter[tuple[int, int]] = Counter()
        for older, newer in zip(before, now, strict=True):
            there, here = ([points for _, points in each] for each in (older, newer))
            pairs = matched(there, here, study.match_distance)
            votes.update((older[i][0], newer[j][0]) for i, j in pairs)
        names = continued(votes)
        for number in range(1, int(ids.max(initial=0)) + 1):
            names[number] = names.get(number) or next(new)
        by_frame[frame] = np.array([0, *(names[k + 1] for k in range(len(names)))])[ids]
        before = [[(names[number], points) for number, points in each] for each in now]
    return np.array([by_frame[frame] for frame in range(study.n_frames)])


def _clouds(sets: Mapping[str, np.ndarray], k: int, units: np.ndarray) -> list[tuple[int, Any]]:
    """Return identity and points, in units of the state, of each attractor at place k."""
    ids, points, counts = (sets[name][k] for name in ("attractor_id", "poincare", "n_points"))
    return [(int(ids[a]), points[a, : counts[a]] / units) for a in np.flatnonzero(ids)]


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


def missed_attractors(attractors: "Frames", sweep: Path) -> np.ndarray:
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


def _common(attractors: "Frames", runs: "Frames", sweep: Path) -> list[tuple[int, np.ndarray]]:
    """Return the sweep's frame, and the places along it, for each frame of the attractors."""
    points, swept = as_kind(attractors.study, RunGrid), as_kind(runs.study, RunGrid)
    if swept.structure != points.structure:
        raise StoreError(f"{sweep}: is of another structure than {attractors.path}")

    def nearest(there: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        return np.abs(there[:, None] - wanted).argmin(axis=0)

    rows, along = [], points.run_dims[-1]
    for frame, at in enumerate(nearest(swept.frames, points.frames).tolist()):
        place = nearest(swept.along_of(at), points.along_of(frame))
        is_same = swept.run_dims == points.run_dims
        for each in ("along_of", "omegas_of", "amplitudes_of"):
            there, wanted = getattr(swept, each)(at)[place], getattr(points, each)(frame)
            is_same &= np.allclose(there, wanted, rtol=SAME, atol=0)
        if not is_same:
            problem = f"does not hold, along {along}, all points of {attractors.path}"
            raise StoreError(f"{sweep}: {problem}")
        rows.append((at, place))
    return rows


def _of_frame(
    attractors: "Frames", runs: "Frames", frame: int, at: int, place: np.ndarray
) -> np.ndarray:
    units = units_along(as_kind(attractors.study, RunGrid), frame)
    names = ("attractor_id", "n_points", "poincare", "outcome")
    sets = {name: values[0] for name, values in attractors.read(frame, names).items()}
    wanted = ("final_state", "outcome", *(("poincare", "n_points") if "poincare" in runs else ()))
    ends = {name: values[:, place] for name, values in runs.read(at, wanted).items()}
    missed = np.full(place.size, -1)
    for k in np.flatnonzero(sets["outcome"] == Outcome.COMPLETE).tolist():
        done = ends["outcome"][:, k] == Outcome.COMPLETE
        if not done.all():
            continue
        clouds = [cloud for _, cloud in _clouds(sets, k, units[k])]
        reached = set()
        for d in range(len(done)):
            points = ends["final_state"][d, k][None]
            if "poincare" in ends:
                points = ends["poincare"][d, k, : ends["n_points"][d, k]][-LAST:]
            apart = (np.abs((points / units[k])[:, None] - cloud).max(axis=2) for cloud in clouds)
            far = [each.min(axis=1).mean() for each in apart]  # from the nearest points of a cloud
            reached.add(int(np.argmin(far)) if far else -1)
        missed[k] = len(clouds) - len(reached - {-1})
    return missed
