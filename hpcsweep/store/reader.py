"""Open the results for people: the job they are of, and an xarray.Dataset."""

from pathlib import Path

import numpy as np

from hpcsweep.job import Job, JobError, parse_job
from hpcsweep.store.commit import Blocks, check_file
from hpcsweep.store.layout import DamagedError, Layout
from hpcsweep.store.offsets import open_for_reading


def job_of(path: str | Path) -> Job:
    """Give the job a campaign file was made for.

    Raises
    ------
    StoreError
        If the file is not a campaign file. A `DamagedError` if its job is not the one it says.
    """
    path = Path(path)
    attributes = check_file(path)
    try:
        job = parse_job(attributes["job"], f"{path} (job)", attributes["name"])
    except (KeyError, JobError) as error:
        raise DamagedError(f"{path}: its job cannot be read: {error}") from None
    if job.fingerprint != attributes.get("fingerprint"):
        raise DamagedError(f"{path}: its job and its fingerprint do not agree")
    return job


def open_results(path: str | Path):
    """Read a campaign file, believing only what is committed and whose checksum holds.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    xarray.Dataset
        Variables and dimensions as in the file. Runs without valid commit have outcome 0
        (``Outcome.NOT_COMPUTED``), zero counts and NaN elsewhere. The attributes are those of the
        file.

    Raises
    ------
    StoreError
        If the file is not a campaign file.
    """
    import xarray

    path = Path(path)
    job = job_of(path)
    arrays, attributes = {}, {}
    with open_for_reading(path) as file:
        for name, data in file.items():
            try:
                values = data[...]
            except OSError:
                raise DamagedError(f"{path}: variable {name} cannot be unpacked") from None
            if values.dtype == object:
                values = np.array(data.asstr()[...], dtype=str)
            dims = (
                tuple(dim[0].name.lstrip("/") for dim in data.dims)
                if not data.is_scale
                else (name,)
            )
            notes = {key: data.attrs[key] for key in ("units", "long_name")}
            arrays[name] = (dims, values, notes)
        attributes = dict(file.attrs)
    layout = Layout(job)
    with Blocks(path, layout) as blocks:
        missing = ~blocks.valid_runs()
    for variable in layout.variables:
        arrays[variable.name][1][missing] = variable.missing
    return xarray.Dataset(arrays, attrs=attributes)
