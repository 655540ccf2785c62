"""The frames of a file as one grid over the amplitudes that any of them has."""

import numpy as np

from hpcsweep.store.frames import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind


class Grid:
    """The frames of a file over the amplitudes that any of them has, in ascending frequency.

    Frames of one frequency are one row: a list of points becomes a grid with runs that are not
    computed. Where all frames have the same amplitudes nothing changes but their order.

    Parameters
    ----------
    frames : Frames

    Attributes
    ----------
    omega : ndarray, shape (n_rows,)
        Ascending.
    amplitude : ndarray, shape (n_amplitudes,)
        Ascending.
    """

    def __init__(self, frames: Frames):
        self._study = study = as_kind(frames.study, RunGrid)
        self._frames = frames
        self._amplitudes = [study.amplitudes_of(frame) for frame in range(study.omega.size)]
        self.omega = np.unique(study.omega)
        self.amplitude = np.unique(np.concatenate(self._amplitudes))

    def dataset(self, row: int):
        """Read one row as `Frames.dataset` reads a frame."""
        import xarray

        found = np.flatnonzero(self._study.omega == self.omega[row]).tolist()
        if len(found) == 1 and self._amplitudes[found[0]].size == self.amplitude.size:
            return self._frames.dataset(found[0])
        parts = [self._frames.dataset(frame) for frame in found]
        places = [np.searchsorted(self.amplitude, self._amplitudes[frame]) for frame in found]
        arrays = {}
        for variable in self._frames.variables:
            first = parts[0][variable.name]
            shape = (*first.shape[:2], self.amplitude.size, *first.shape[3:])
            values = np.full(shape, variable.missing, first.dtype)
            for part, at in zip(parts, places, strict=True):
                values[:, :, at] = part[variable.name].values
            arrays[variable.name] = (variable.dims, values)
        own = parts[0]
        return xarray.Dataset(
            arrays,
            coords={
                "direction": own["direction"],
                "omega": own["omega"],
                "amplitude": self.amplitude,
                "state": own["state"],
            },
            attrs=own.attrs,
        )
