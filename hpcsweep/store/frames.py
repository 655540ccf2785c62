"""One frame at a time: for files that do not fit in memory."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hpcsweep.store.commit import Blocks
from hpcsweep.store.layout import RUN, StoreError, coordinates, run_variables
from hpcsweep.store.reader import MISSING, job_of


class Frames:
    """Reads single frames of a campaign file, believing only blocks whose checksum holds.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    job : Job
        The job the file was made for.

    Raises
    ------
    StoreError
        If it is not a campaign file.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.job = job_of(self.path)
        self._variables = {variable.name for variable in run_variables(self.job)}
        self._blocks = Blocks(self.path, self.job)

    def __contains__(self, variable: str) -> bool:
        return variable in self._variables

    def __iter__(self) -> Iterator[str]:
        """Go through the names of the variables of a run."""
        return iter(sorted(self._variables))

    def close(self) -> None:
        """Close the file."""
        self._blocks.close()

    def read(self, frame: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Read variables of one frame, first axes (direction, amplitude).

        Runs without valid commit hold what `open_results` gives them: 0 or NaN.

        Raises
        ------
        StoreError
            If the file does not hold one of the variables.
        """
        for name in names:
            if name not in self:
                raise StoreError(
                    f"{self.path}: holds no {name}: set output.{name} = true in the job"
                )
        job = self.job
        found: dict[str, np.ndarray] = {}
        for (direction, block), valid in self._blocks.valid(frame).items():
            rows = self._blocks.read(direction, frame, block) if valid or not found else None
            if not found:
                shape = (len(job.directions), job.amplitude.size)
                for name in names:
                    empty = MISSING.get(name, np.nan)
                    found[name] = np.full((*shape, *rows[name].shape[1:]), empty, rows[name].dtype)
            if valid:
                low, high = self._blocks.rows(direction, block)
                for name in names:
                    found[name][direction, low:high] = rows[name]
        return found

    def dataset(self, frame: int):
        """Read one frame as an xarray.Dataset.

        Returns
        -------
        xarray.Dataset
            As of `open_results`, with dimension `frame` of size 1; of the attributes only
            `job` and `name`.
        """
        import xarray

        job = self.job
        variables = run_variables(job)
        found = self.read(frame, tuple(variable.name for variable in variables))
        return xarray.Dataset(
            {
                "omega": (("frame",), job.omega[[frame]]),
                **{
                    v.name: ((*RUN, *v.dims[len(RUN) :]), found[v.name][:, None]) for v in variables
                },
            },
            coords={
                "direction": list(job.directions),
                "frame": [frame],
                "amplitude": job.amplitude,
            },
            attrs={"job": job.text, "name": job.name},
        )

    def gather(
        self,
        names: Sequence[str],
        frames: Sequence[int] | None = None,
        direction: str | None = None,
        derive: Mapping[str, Callable] | None = None,
    ):
        """Gather a few variables of many frames, with one whole frame in memory at a time.

        Parameters
        ----------
        names : sequence of str
            Variables that are kept; those the file does not hold are left out.
        frames : sequence of int, optional
            Default all.
        direction : str, optional
            Keep only this one of the job's directions.
        derive : mapping of str to callable, optional
            New variables: functions of a frame's dataset (all its variables and directions) to an
            array of axes (direction, frame, amplitude).

        Returns
        -------
        xarray.Dataset
            As of `dataset`, with all `frames`.
        """
        import xarray

        job = self.job
        frames = range(job.omega.size) if frames is None else frames
        kept = [v for v in run_variables(job) if v.name in names]
        axes = {v.name: (*RUN, *v.dims[len(RUN) :]) for v in kept}
        axes |= dict.fromkeys(derive or {}, RUN)
        chosen = slice(None)
        if direction is not None:
            place = job.directions.index(direction)
            chosen = slice(place, place + 1)
        arrays: dict[str, np.ndarray] = {}
        for place, frame in enumerate(frames):
            one = self.dataset(int(frame))
            found = {v.name: one[v.name].values for v in kept}
            found |= {name: function(one) for name, function in (derive or {}).items()}
            for name, values in found.items():
                values = values[chosen]
                if name not in arrays:
                    shape = (values.shape[0], len(frames), *values.shape[2:])
                    arrays[name] = np.empty(shape, values.dtype)
                arrays[name][:, place] = values[:, 0]
        return xarray.Dataset(
            {
                "omega": (("frame",), job.omega[list(frames)]),
                **{name: (axes[name], values) for name, values in arrays.items()},
            },
            coords={
                "direction": list(job.directions)[chosen],
                "frame": list(frames),
                "amplitude": job.amplitude,
                "state": coordinates(job)["state"][0].astype(str),
            },
            attrs={"job": job.text, "name": job.name},
        )
