"""Gather the data of the explorer from a results file, one frame at a time."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MOTION, MotionClass
from hpcsweep.figures import labels, style
from hpcsweep.figures.attractors import DIMENSION, attractor_classes
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.inferred import filled, filled_classes, inferred
from hpcsweep.figures.overlay import Drawn, Overlay
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.counted import counted
from hpcsweep.solvers.offers import PAGES
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames, Grid
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.path_grid import FORCING
from hpcsweep.studies.study import as_kind

POINT_BUDGET = 30_000_000
"""Most displacements of the orbit diagrams in a page, unless the points of a run are set."""

INFERRED = len(Outcome)
"""Code, among those of outcomes, of points that are inferred from their cells."""
MAX_CELLS = 20_000_000
"""Places of the map."""
OF_ATTRACTORS = ("share", "number")
"""Values that only attractors have."""
MAX_PLACES = 10
"""Storeys, floors or contacts whose measures are shown, the first."""


@dataclass
class PageData:
    """Data of a page. A run has index (frame, direction, amplitude); frames ascend in Omega.

    Attributes
    ----------
    name : str
    structure : Structure
    omega : ndarray, shape (n_frames,)
    amplitude : ndarray, shape (n_amplitudes,)
        Of a sweep along another parameter the values of its frames and along these.
    directions : tuple of str
    words : tuple of str
        The directions in words.
    runs : dict of str to ndarray, shape (n_frames, n_directions, n_amplitudes)
        Unsigned codes `motion`, `period`, `outcome`, `cycles`, and `contact` where the file has it;
        float32 `drift`, `lyapunov`, ``modal_norm_1``, ... of the lowest `MAX_MODES` modes,
        ``storey_drift_1``, ... and all other measures of the first `MAX_PLACES`, as far as the file
        has them; `counts`, the stroboscopic points kept of each run, 0 everywhere if the file has
        none; `speed`, with a further axis of the floors, their velocities at the first point, NaN
        where there is none.
    points : ndarray of float32, shape (sum of counts, n)
        Displacements of the floors at the points kept, runs in the order of their index. Of a
        periodic run the point with the largest displacement of the top floor comes first.
    thinned : dict of str to int
        What was left out, for the page to report.
    labels : dict of str to tuple of str
        Of the values that are measures: label, place and unit.
    """

    name: str
    structure: Structure
    omega: np.ndarray
    amplitude: np.ndarray
    directions: tuple[str, ...]
    words: tuple[str, ...]
    runs: dict[str, np.ndarray]
    points: np.ndarray
    thinned: dict[str, int] = field(default_factory=dict)
    labels: dict[str, tuple[str, str, str]] = field(default_factory=dict)
    each: str = "direction"
    """Meaning of the runs of a place: one ``direction`` each, or one ``attractor``."""
    branches: list[list[Drawn]] = field(default_factory=list)
    """Of each frame, if any are shown."""
    dims: tuple[str, str] = ("omega", "amplitude")
    """What `omega` and `amplitude` are the values of."""
    quantity: str = "acceleration"
    """What has the unit of the second."""
    steps: dict[str, list] = field(default_factory=dict)
    """Of a sweep along another parameter: `omega` and `amplitude` of each frame and step, lists,
    and `structures`, one a step, or none."""
    change: np.ndarray | None = None
    """S, (n, n), where other coordinates S u are shown than floors ..."""
    names: tuple[str, ...] = ()
    """... and what they are called."""

    def in_rows(self, words: Sequence[str]) -> "PageData":
        """Return the data with each row that a word names in place of one of its floors."""
        change, names = np.eye(self.structure.n_floors), [*self.structure.floor_names]
        for word in words:
            (coordinate,) = coordinates(self.structure, [word])
            sizes = np.where([name in words for name in names], 0.0, np.abs(coordinate.row))
            place = int(np.flatnonzero(sizes == sizes.max())[-1])
            change[place], names[place] = coordinate.row, word
        if np.linalg.matrix_rank(change) < len(change):
            raise style.PlotError(f"--row {words[-1]}: follows from the others")
        return replace(
            self,
            change=change,
            names=tuple(names),
            points=(self.points @ change.T).astype(self.points.dtype),
            runs=self.runs | {"speed": (self.runs["speed"] @ change.T).astype(np.float32)},
            branches=[
                [one._replace(points=one.points @ np.kron(np.eye(2), change.T)) for one in frame]
                for frame in self.branches
            ],
        )


def gather(
    frames: Frames,
    most_points: int | None = None,
    frame_step: int = 1,
    amplitude_step: int = 1,
    by_share: bool = False,
    branches: Path | None = None,
) -> PageData:
    """Read a results file, one frame in memory at a time; of attractors the slots are its runs.

    Parameters
    ----------
    frames : Frames
        Of motions or attractors.
    most_points : int, optional
        Points kept of a run; by default as many as `POINT_BUDGET` allows for the whole study.
    frame_step, amplitude_step : int
        Steps between the frames and amplitudes to keep.
    by_share : bool
        Whether attractors are shown by falling share at each point.
    branches : Path, optional
        Branches along its paths.

    Raises
    ------
    StoreError, PlotError
        If its points are too many, or the file of branches does not fit.
    """
    study, grid, path = as_kind(frames.study, RunGrid), Grid(frames), frames.path
    style.demand(PAGES, study.structure, f"{path}: explore", "orbit")
    rows = range(0, grid.rows.size, frame_step)
    if len(rows) * grid.along.size > MAX_CELLS:
        size = f"{grid.rows.size} frequencies and {grid.along.size} amplitudes"
        most = f"more than {MAX_CELLS} places"
        raise style.PlotError(f"{path}: its points lie on a grid of {size}, {most}")
    if by_share and study.content != "attractors":
        raise style.PlotError(f"{path}: --by-share: holds no attractors")
    n, several = study.structure.n_floors, DIMENSION in study.dimensions
    stored = study.settings.stored_points
    limit = stored if most_points is None else most_points
    if most_points is None and "n_points" in frames:
        counts = frames.gather(["n_points"])["n_points"].values
        share = n / (frame_step * amplitude_step)
        while limit > 1 and share * np.minimum(counts, limit).sum() > POINT_BUDGET:
            limit //= 2
    runs, points = [], []
    for row in counted(rows, len(rows), "reading frame"):
        chosen = grid.dataset(row).isel({study.run_dims[-1]: slice(None, None, amplitude_step)})
        if several:
            chosen = as_runs(chosen, by_share)
        numbers, words = _values(chosen, study.structure)
        kept, u, v = _points(chosen, n, limit)
        runs.append({**_codes(chosen), **numbers, "counts": kept, "speed": v})
        points.append(u)
    stacked = {name: np.stack([frame[name] for frame in runs]) for name in runs[0]}
    directions, spoken = study.directions, tuple(study.words[name] for name in study.directions)
    if several:
        stacked, directions = _taken(stacked)
        spoken = tuple(f"attractor {name}{' by share' * by_share}" for name in directions)
    return PageData(
        name=", ".join(filter(None, (frames.job.name, frames.part))),
        structure=study.structure,
        omega=grid.rows[::frame_step],
        amplitude=grid.along[::amplitude_step],
        dims=(study.run_dims[-2], study.run_dims[-1]),
        quantity=[*study.grid.values()][-1].units,
        steps=_steps(study, frame_step, amplitude_step),
        directions=directions,
        words=spoken,
        each=DIMENSION if several else "direction",
        runs=stacked,
        labels=words,
        points=np.concatenate(points),
        branches=_branches_of(branches, study, grid.rows[::frame_step]) if branches else [],
        thinned={
            "points": min(limit, stored),
            "of_points": min(limit, stored) if several else study.settings.sampling_cycles,
            "frame_step": frame_step,
            "amplitude_step": amplitude_step,
        },
    )


def _taken(runs: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the runs of slots without the last ones, which are always empty; number the slots."""
    used = np.flatnonzero((runs["motion"] != MotionClass.NOT_COMPUTED).any(axis=(0, 2)))
    n = int(used.max(initial=0)) + 1
    return {name: values[:, :n] for name, values in runs.items()}, tuple(map(str, range(1, n + 1)))


def _steps(study: RunGrid, frame_step: int, step: int) -> dict[str, list]:
    """Return what drives each run, of sweeps along other parameters than the amplitude."""
    if study.run_dims[-2:] == ("omega", "amplitude"):
        return {}
    order = np.argsort(study.frames, kind="stable")[::frame_step].tolist()
    return {
        "omega": [study.omegas_of(frame)[::step].tolist() for frame in order],
        "amplitude": [study.amplitudes_of(frame)[::step].tolist() for frame in order],
        "structures": [*study.structures[::step]] if len(study.structures) > 1 else [],
    }


def _branches_of(path: Path, study: RunGrid, values: np.ndarray) -> list[list[Drawn]]:
    """Read the branches of a file along the frames of some values, none where it has no line."""
    if study.run_dims[-1] not in FORCING:
        raise style.PlotError(
            f"--branches {path}: the page shows those along {' or '.join(FORCING)}, not "
            f"{study.run_dims[-1]}"
        )
    order = [int(np.flatnonzero(study.frames == value)[0]) for value in values]
    with contextlib.closing(Overlay(path, study)) as overlay:
        overlay.need(order)
        return [overlay.at(frame) for frame in order]


def _codes(frame) -> dict[str, np.ndarray]:
    motion = frame[MOTION].values if MOTION in frame else style.classes_of(frame)
    motion, period = filled_classes(frame, motion)
    outcome = np.where(inferred(frame), INFERRED, frame["outcome"].values)
    codes = {
        "motion": motion[:, 0].astype(np.uint8),
        "period": period[:, 0].astype(np.uint32),
        "outcome": outcome[:, 0].astype(np.uint8),
        "cycles": frame["cycles"].values[:, 0].astype(np.uint32),
    }
    if "contact" in frame:
        codes["contact"] = filled(frame, "contact")[:, 0]
    return codes


def _values(frame, structure) -> tuple[dict[str, np.ndarray], dict[str, tuple[str, str, str]]]:
    """Return the numbers of each run, and label, place and unit of those that are measures."""
    values = {
        name: frame[name].values[:, 0].astype(np.float32)
        for name in ("drift", "lyapunov", *OF_ATTRACTORS)
        if name in frame
    }
    if "modal_norm" in frame:
        norms = frame["modal_norm"].values[:, 0].astype(np.float32)
        shown = min(norms.shape[-1], labels.MAX_MODES)
        values |= {f"modal_norm_{i + 1}": norms[..., i] for i in range(shown)}
    words = {}
    for name in labels.held_measures(frame):
        measure = labels.measure_of(frame, structure, name)
        sizes = frame[name].values[:, 0] * measure.factor
        for i, place in enumerate(measure.places[:MAX_PLACES]):
            values[f"{name}_{i + 1}"] = sizes[..., i].astype(np.float32)
            words[f"{name}_{i + 1}"] = measure.label, place, measure.unit
    return values, words


def _points(frame, n: int, limit: int):
    """Choose the points of one frame's runs.

    Returns
    -------
    counts : ndarray of int, shape (n_directions, n_amplitudes)
    points : ndarray of float32, shape (sum of counts, n)
    speed : ndarray of float32, shape (n_directions, n_amplitudes, n)
    """
    shape = frame["outcome"].values[:, 0].shape
    speed = np.full((*shape, n), np.nan, np.float32)
    if "poincare" not in frame:
        return np.zeros(shape, int), np.empty((0, n), np.float32), speed
    stored = frame["poincare"].values[:, 0]
    n_points = frame["n_points"].values[:, 0].astype(int)
    period = frame["orbit_period"].values[:, 0]
    place = np.arange(stored.shape[2])
    # a phase that varies continuously with amplitude: easier on the eye and to compress
    top = np.where(place < n_points[..., None], stored[..., n - 1], -np.inf)
    whole = (period > 0) & (n_points == period)
    first = np.where(whole, np.argmax(top, axis=-1), 0)
    counts = np.minimum(n_points, limit)
    keep = place < counts[..., None]
    order = (first[..., None] + place) % np.maximum(n_points, 1)[..., None]
    chosen = np.take_along_axis(stored, order[..., None], axis=2)
    speed[n_points > 0] = chosen[n_points > 0, 0, n:]
    return counts, chosen[keep][:, :n].astype(np.float32), speed


def as_runs(frame, by_share: bool = False):
    """Return the attractors of a frame, slot by slot, as the runs of directions.

    Parameters
    ----------
    frame : xarray.Dataset
        One frame of a study of attractors.
    by_share : bool
        Whether slots are by falling share, so that an attractor keeps none.

    Returns
    -------
    xarray.Dataset
        Dimensions (direction, frame, along, ...): a direction is a slot, which an attractor keeps
        along the path. Where a slot has no attractor the motion is not computed.
    """
    runs = frame.isel(direction=0, drop=True).rename({DIMENSION: "direction"})
    fixed, along = runs["outcome"].dims
    order = runs["attractor_id"].isel({fixed: 0}).transpose(along, "direction").values
    order = np.argsort(order == 0, axis=1, kind="stable") if by_share else slots(order)
    each = (along, np.arange(len(order)))
    runs = runs.isel({"direction": ((along, "direction"), order), along: each})
    held = runs["attractor_id"] > 0
    for name in ("outcome", "cycles"):
        runs[name] = runs[name].where(held, runs[name].dtype.type(0))
    runs["number"] = runs["n_attractors"].where(held)
    runs["share"] = runs["share"].where(held)
    runs[MOTION] = runs["attractor_id"].dims, attractor_classes(runs)
    return runs.transpose("direction", fixed, along, ...)


def slots(identity: np.ndarray) -> np.ndarray:
    """Return which attractor each slot has at each amplitude: the one that it had before.

    A new one takes a slot that no other had at the amplitude before, if there is one.

    Parameters
    ----------
    identity : ndarray of int, shape (n_amplitudes, K)
        Identity of each attractor along the amplitudes, 0 for none.

    Returns
    -------
    ndarray of int, shape (n_amplitudes, K)
        Indices of attractors, and of empty places, a permutation at each amplitude.
    """
    order = np.empty_like(identity)
    before = np.zeros(identity.shape[1], identity.dtype)
    for taken, row in zip(order, identity, strict=True):
        places = {number: place for place, number in enumerate(row.tolist()) if number}
        taken[:] = [places.get(number, -1) for number in before.tolist()]
        new = [place for place in np.flatnonzero(row) if place not in taken]
        free = sorted(np.flatnonzero(taken < 0), key=lambda slot: before[slot] != 0)
        taken[free] = [*new, *np.setdiff1d(np.arange(row.size), [*taken, *new])]
        before = row[taken]
    return order
