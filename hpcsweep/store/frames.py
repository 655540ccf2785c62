"""Read a campaign file frame by frame: for files that do not fit into memory."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hpcsweep.job import Job
from hpcsweep.store.commit import Blocks
from hpcsweep.store.layout import RUN, run_variables
from hpcsweep.store.reader import MISSING


def read_frames(path: str | Path, job: Job, frames: np.ndarray) -> Iterator:
    """Read some frames, one at a time, believing only what is committed and holds its checksum.

    Parameters
    ----------
    path : str or Path
    job : Job
        The file's job, of `hpcsweep.store.job_of`.
    frames : ndarray of int
        Frame indices, in the order in which they are wanted.

    Yields
    ------
    xarray.Dataset
        As of `open_results`, with dimension `frame` of size 1; of the attributes only
        `job` and `name`.
    """
    import xarray

    blocks = Blocks(Path(path), job)
    variables = run_variables(job)
    try:
        for frame in map(int, frames):
            arrays = {}
            for (direction, block), good in blocks.valid(frame).items():
                low, high = blocks.rows(direction, block)
                for name, rows in blocks.read(direction, frame, block).items():
                    if name not in arrays:
                        shape = (len(job.directions), 1, job.amplitude.size, *rows.shape[1:])
                        missing = MISSING.get(name, np.nan)
                        arrays[name] = np.full(shape, missing, rows.dtype)
                    if good:
                        arrays[name][direction, 0, low:high] = rows
            yield xarray.Dataset(
                {
                    "omega": (("frame",), job.omega[[frame]]),
                    **{v.name: ((*RUN, *v.dims[len(RUN) :]), arrays[v.name]) for v in variables},
                },
                coords={
                    "direction": list(job.directions),
                    "frame": [frame],
                    "amplitude": job.amplitude,
                },
                attrs={"job": job.text, "name": job.name},
            )
    finally:
        blocks.close()
