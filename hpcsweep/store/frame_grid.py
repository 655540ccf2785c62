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
        self.omega = np.unique(study.omega)
        each = [study.amplitudes_of(frame) for frame in range(study.omega.size)]
        self.amplitude = np.unique(np.concatenate(each))

    def dataset(self, row: int):
        """Read one row as `Frames.dataset` reads a frame."""
        found = np.flatnonzero(self._study.omega == self.omega[row]).tolist()
        parts = [self._frames.dataset(frame) for frame in found]
        missing = {variable.name: variable.missing for variable in self._frames.variables}
        whole = parts[0].reindex(amplitude=self.amplitude, fill_value=missing)
        for part in parts[1:]:
            for name in missing:
                whole[name].loc[{"amplitude": part["amplitude"]}] = part[name]
        return whole
