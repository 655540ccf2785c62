"""Open results: their job, and an xarray.Dataset."""

from pathlib import Path

import numpy as np

from hpcsweep.job import Job
from hpcsweep.job.paths import path_of
from hpcsweep.model.arguments import shown
from hpcsweep.store.commit import Blocks
from hpcsweep.store.contents import CHECKSUM, notes_of, parts_of, scales_of
from hpcsweep.store.inferred import Inferred
from hpcsweep.store.layout import flags_of
from hpcsweep.store.opening import open_layout, reading
from hpcsweep.studies.refine.audit import AUDIT


def job_of(path: str | Path) -> Job:
    """Return the job of a campaign file.

    Raises
    ------
    StoreError
        If the file is not a campaign file. A `DamagedError` if it differs from its job.
    """
    return open_layout(path).job


def open_results(path: str | Path):
    """Read a campaign file: only committed results whose checksum holds.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    xarray.Dataset
        Variables and dimensions as in the file. Runs without valid commit have outcome 0
        (``Outcome.NOT_COMPUTED``), zero counts and NaN elsewhere. Each has its unit in the
        attribute ``units``. The attributes are those of the file, without the checksum of its
        metadata.

    Raises
    ------
    StoreError
        If the file is not a campaign file.

    Examples
    --------
    >>> results = hpcsweep.open_results("study.h5")  # of `hpcsweep run study.toml -o study.h5`
    >>> results.outcome.dims
    ('direction', 'omega', 'amplitude')
    """
    import xarray

    path = path_of("path", path)
    layout = open_layout(path)
    arrays = {}
    with reading(path) as file:
        for name, data in file.items():
            dims = (name,) if data.is_scale else tuple(names[0] for names in scales_of(data))
            arrays[name] = (dims, _read(data), notes_of(data))
        attributes = {key: value for key, value in file.attrs.items() if key != CHECKSUM}
    with Blocks(path, layout) as blocks:
        missing = ~blocks.valid_runs()
        if layout.derived:
            inferred = Inferred(blocks)
            for place in inferred.unknown():
                for variable in inferred.variables:
                    arrays[variable.name][1][place] = variable.missing
            if inferred.look() is None:
                arrays[AUDIT][1][...] = np.nan
    for variable in (*layout.variables, *layout.derived):
        arrays[variable.name][2].update(flags_of(variable, layout.study.structure))
    for place in map(tuple, np.argwhere(missing.any(axis=-1))):  # a frame at a time
        for variable in layout.variables:
            arrays[variable.name][1][place][missing[place]] = variable.missing
    steps = [name for name in ("omega", "amplitude") if name in arrays]
    return xarray.Dataset(arrays, attrs=attributes).set_coords(steps)


def meanings(variable):
    """Return the meanings of numbers of results as words: a motion, an outcome, a set of contacts.

    Parameters
    ----------
    variable : xarray.DataArray
        From `open_results`, whole or a part: `motion`, `outcome`, `skip_rule`, `contact`, e.g.
        Words mean themselves.

    Returns
    -------
    xarray.DataArray
        Of str, with the same dimensions and coordinates, in the words of summaries and figures,
        e.g. "quasi-periodic" or "no contact"; for a set of contacts the names of its members,
        "A2-B2,A3-B3", or "none".

    Raises
    ------
    ValueError
        If its numbers are not flags (the attribute ``flag_meanings`` of the CF conventions).

    Examples
    --------
    >>> results = hpcsweep.open_results("study.h5")  # of `hpcsweep run study.toml -o study.h5`
    >>> sorted(set(hpcsweep.meanings(results.outcome).values.ravel().tolist()))
    ['complete']
    """
    notes = getattr(variable, "attrs", None)
    if notes is None:
        raise ValueError(f"variable must be one of results, is {shown(variable)}")
    if variable.dtype.kind in "UO":
        return variable
    if "flag_meanings" not in notes:
        raise ValueError(f"{variable.name}: has no flag_meanings: its numbers mean themselves")
    words = notes["flag_meanings"].split()
    numbers, place = np.unique(variable.values, return_inverse=True)
    if "flag_masks" in notes:
        masks = np.atleast_1d(notes["flag_masks"])
        sets = (
            [word for word, mask in zip(words, masks, strict=True) if n & mask] for n in numbers
        )
        said = [",".join(members) or "none" for members in sets]
    else:
        word_of = dict(zip(np.atleast_1d(notes["flag_values"]).tolist(), words, strict=True))
        said = [word_of[number].replace("_", " ") for number in numbers.tolist()]
    return variable.copy(data=np.array(said, dtype=str)[place].reshape(variable.shape))


def _read(data) -> np.ndarray:
    """Read a dataset in parts, since HDF5 ignores Ctrl-C within a read."""
    if data.dtype == object:
        return np.array(data.asstr()[...], dtype=str)
    values = np.empty(data.shape, data.dtype)
    for part in parts_of(data):
        data.read_direct(values, part, part)
    return values
