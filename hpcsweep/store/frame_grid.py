"""The frames of a file as one grid over the values along any of them."""

import numpy as np

from hpcsweep.store.frames import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind


class Grid:
    """The frames of a file over the values along any of them, amplitudes, say, in ascending order.

    Frames of one frequency are one row: a list of points becomes a grid with runs that are not
    computed. Where all frames have the same amplitudes nothing changes but their order.

    Parameters
    ----------
    frames : Frames

    Attributes
    ----------
    rows : ndarray, shape (n_rows,)
        Frequencies, or what else the frames have; ascending.
    along : ndarray, shape (n_along,)
        Amplitudes, or what else the sweeps are along; ascending.
    """

    def __init__(self, frames: Frames):
        self._study = study = as_kind(frames.study, RunGrid)
        self._frames = frames
        self.rows = np.unique(study.frames)
        each = [study.along_of(frame) for frame in range(study.n_frames)]
        self.along = np.unique(np.concatenate(each))

    def dataset(self, row: int):
        """Read one row as `Frames.dataset` reads a frame."""
        frames = np.flatnonzero(self._study.frames == self.rows[row]).tolist()
        parts = [self._frames.dataset(frame) for frame in frames]
        missing = {variable.name: variable.missing for variable in self._frames.variables}
        last = self._study.run_dims[-1]
        whole = parts[0].reindex({last: self.along}, fill_value=missing)
        for part in parts[1:]:
            for name in missing:
                whole[name].loc[{last: part[last]}] = part[name]
        return whole
