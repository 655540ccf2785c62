"""Results files that a job reads: motions that runs start from, curves that a map must not miss.

A map's file has the checksum of the curves, in the attribute `CURVES`, from its creation on: it
is resumed with the same ones only. A complete map has the boxes that they cross, and needs the
files of the curves no more.
"""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from hpcsweep.job import Job
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store.contents import CURVES
from hpcsweep.store.frames import Frames
from hpcsweep.store.layout import Layout, StoreError
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.refine.growth import KnownCurve
from hpcsweep.studies.seeds import Seed, Seeds, Where
from hpcsweep.studies.study import Study, as_kind

SEED_KINDS = ("motions", "attractors")
"""What files of seeds may hold."""
NAMES = ("outcome", "curve_of_step", "curve_omega", "curve_amplitude")


class Inputs:
    """Results files that the study of a file reads; most read none.

    Parameters
    ----------
    layout : Layout

    Attributes
    ----------
    growth : MapGrowth or None
    curves : list of Curve
        Known curves over Omega and A.

    Raises
    ------
    StoreError
        If a file cannot be read, is not complete, or holds no curves of the structure.
    """

    def __init__(self, layout: Layout):
        self._study, self.growth = layout.study, layout.growth
        self.paths = self.growth.refinement.curves if self.growth else ()
        self.curves = [line for path in self.paths for line in _curves_of(Path(path), self._study)]

    @property
    def attributes(self) -> dict[str, str | int]:
        """Attributes of the map's file: the checksum of the curves."""
        if not self.paths:
            return {}
        digest = hashlib.blake2b(digest_size=16)
        for curve in self.curves:
            digest.update(np.array([*curve.at, len(curve.points)], "<i8").tobytes())
            digest.update(np.ascontiguousarray(curve.points, "<f8").tobytes())
        return {CURVES: digest.hexdigest()}

    def crossed(self) -> np.ndarray | None:
        """Return which boxes of the grid the curves cross; None if the job names no files.

        Raises
        ------
        StoreError
            If they cross none.
        """
        if not self.growth or not self.paths:
            return None
        crossed = self.growth.crossed(self.curves)
        if not crossed.any():
            raise StoreError(f"{', '.join(self.paths)}: no curve crosses the map")
        return crossed

    def need(self) -> None:
        """Make sure, before a job begins, that the files hold what its runs need.

        Raises
        ------
        StoreError
        """
        if problem := self._study.missing_inputs():
            raise StoreError(problem)
        self.crossed()

    def check(self, output: Path, attributes: Mapping) -> None:
        """Make sure that the curves are those that a map's file was made with.

        Raises
        ------
        StoreError
        """
        if self.attributes.get(CURVES) != attributes.get(CURVES):
            raise StoreError(
                f"{', '.join(self.paths)}: holds other curves than when {output} was begun; give "
                "another file with -o"
            )


def _curves_of(path: Path, study: Study) -> Iterator[KnownCurve]:
    """Read the curves of a file that are of the structure of the map, or of one of its parts."""
    with closing(Frames(path, "branches", None)) as frames:
        if not getattr(frames.study, "curves", ()):
            raise StoreError(f"{path}: holds no curves; branches.curves names those to follow")
        parts = list(np.ndindex(*(len(axis.values) for axis in study.axes)))
        structures = [study.part(place).structure for place in parts]
        fits_any = False
        for place in frames.places:
            frames.choose(place)
            structure = frames.study.structure
            fit = [at for at, other in zip(parts, structures, strict=True) if other == structure]
            if fit:
                fits_any = True
                lines = list(_polylines(path, frames))
                yield from (KnownCurve(at, line) for at in fit for line in lines)
        if not fits_any:
            raise StoreError(f"{path}: is of another structure than the map")


def _polylines(path: Path, frames: Frames) -> Iterator[np.ndarray]:
    """Return the curves of the part chosen: points (Omega, A), shape (k, 2)."""
    for line in range(frames.study.n_frames):
        rows = {name: values[0, 0] for name, values in frames.read(line, NAMES).items()}
        if not rows["outcome"]:
            raise StoreError(f"{path}: is not complete; run its job again to resume it")
        number = rows["curve_of_step"]
        for curve in np.unique(number[number > 0]).tolist():
            steps = number == curve
            yield np.stack((rows["curve_omega"][steps], rows["curve_amplitude"][steps]), axis=1)


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
            _choose_part(frames, where)
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


def _choose_part(frames: Frames, where: Where) -> None:
    """Choose the part of a file that is of the structure."""
    if frames.whole.study.content not in SEED_KINDS:
        raise StoreError(
            f"{frames.path}: holds {frames.whole.study.content}; seeds are motions of sweeps and "
            "points, or attractors"
        )
    for place in frames.places:
        frames.choose(place)
        if where.structure in as_kind(frames.study, RunGrid).structures:
            return
    raise StoreError(f"{frames.path}: is of another structure than the job")


def _motions(frames: Frames, where: Where) -> Iterator[tuple[float, float, dict]]:
    """Go through the motions of the part chosen: direction by direction within a frame."""
    study = as_kind(frames.study, RunGrid)
    names = tuple(variable.name for variable in frames.variables)
    for frame in range(study.n_frames):
        omega, amplitude = study.omegas_of(frame), study.amplitudes_of(frame)
        inside = where.holds(omega, amplitude)
        if len(study.structures) > 1:
            inside &= [structure == where.structure for structure in study.structures]
        if not inside.any():
            continue
        rows = frames.read(frame, names)
        for direction, at in np.ndindex(len(study.directions), amplitude.size):
            if inside[at] and rows["outcome"][direction, at] == Outcome.COMPLETE:
                run = {name: values[direction, at] for name, values in rows.items()}
                for motion in study.motions(run):
                    yield float(omega[at]), float(amplitude[at]), motion


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
