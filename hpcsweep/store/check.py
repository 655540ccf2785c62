"""Whether a file keeps what the layout promises, apart from what is in its blocks."""

import itertools
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.job import Job
from hpcsweep.store.layout import COMMIT, OMEGA, coordinates, dimensions, run_variables
from hpcsweep.store.offsets import open_for_reading

PROVENANCE = ("hpcsweep_version", "git_commit", "libraries", "mpi", "hosts", "ranks", "created")
"""Attributes that tell where the results come from."""


def layout_problems(path: Path, job: Job) -> list[str]:
    """Compare attributes, coordinates and the variables' form with the layout of the job's file.

    Returns
    -------
    list of str
        What is not as promised, one line each; empty for a sound file.
    """
    with open_for_reading(path) as file:
        problems = _attribute_problems(file, job)
        expected = coordinates(job)
        for name, (values, units, _) in expected.items():
            problems += _coordinate_problems(file, name, values, units)
        size = dimensions(job)
        variables = [OMEGA, *run_variables(job), COMMIT]
        for variable in variables:
            problems += _variable_problems(file, variable, size)
        known = set(expected) | {variable.name for variable in variables}
        problems += [f"{name}: not part of the layout" for name in file if name not in known]
        if not problems:
            if not np.array_equal(file["omega"][...], job.omega):
                problems.append("omega: not the frequencies of the job")
            problems += _storage_problems(file, [variable.name for variable in variables], path)
    return problems


def _attribute_problems(file: h5py.File, job: Job) -> list[str]:
    problems = [f"attribute {key}: missing" for key in PROVENANCE if key not in file.attrs]
    for key, value in (("solver", job.settings.solver), ("rtol", job.settings.rtol)):
        if file.attrs.get(key) != value:
            problems.append(f"attribute {key}: is {file.attrs.get(key)!r}, the job says {value!r}")
    return problems


def _coordinate_problems(file, name: str, values: np.ndarray, units: str) -> list[str]:
    if name not in file:
        return [f"{name}: missing"]
    scale = file[name]
    if not isinstance(scale, h5py.Dataset) or not scale.is_scale:
        return [f"{name}: not a dimension scale"]
    problems = _note_problems(scale, name, units)
    if values.dtype == object:
        if h5py.check_string_dtype(scale.dtype) is None:
            return [*problems, f"{name}: its type is {scale.dtype}, not string"]
        stored = scale.asstr()[...]
    else:
        if scale.dtype != values.dtype:
            problems.append(f"{name}: its type is {scale.dtype}, not {values.dtype}")
        stored = scale[...]
    if not np.array_equal(stored, values):
        problems.append(f"{name}: its values are not those of the job")
    return problems


def _variable_problems(file, variable, size: dict[str, int]) -> list[str]:
    name = variable.name
    if name not in file:
        return [f"{name}: missing"]
    data = file[name]
    problems = _note_problems(data, name, variable.units)
    if data.dtype != np.dtype(variable.dtype):
        problems.append(f"{name}: its type is {data.dtype}, not {np.dtype(variable.dtype)}")
    shape = tuple(size[dim] for dim in variable.dims)
    if data.shape != shape:
        return [*problems, f"{name}: its shape is {data.shape}, not {shape}"]
    for axis, dim in enumerate(variable.dims):
        attached = [scale.name.lstrip("/") for scale in data.dims[axis].values()]
        if attached != [dim]:
            problems.append(f"{name}: axis {axis} has the scales {attached}, not {dim}")
    return problems


def _note_problems(data, name: str, units: str) -> list[str]:
    problems = []
    if data.attrs.get("units") != units:
        problems.append(f"{name}: its units are {data.attrs.get('units')!r}, not {units!r}")
    if not data.attrs.get("long_name"):
        problems.append(f"{name}: has no long_name")
    return problems


def _storage_problems(file, names: list[str], path: Path) -> list[str]:
    """Plain: every variable one run of bytes inside the file, none over another. Packed: chunks."""
    names = [name for name in names if name != OMEGA.name]
    chunked = [name for name in names if file[name].chunks is not None]
    if chunked:
        return [
            f"{name}: contiguous in a packed file" for name in names if file[name].chunks is None
        ]
    places = []
    for name in names:
        offset = file[name].id.get_offset()
        if offset is None:
            return [f"{name}: has no place in the file"]
        places.append((offset, offset + file[name].nbytes, name))
    places.sort()
    problems = [
        f"{left[2]}, {right[2]}: overlap in the file"
        for left, right in itertools.pairwise(places)
        if left[1] > right[0]
    ]
    if places[-1][1] > path.stat().st_size:
        problems.append(f"{places[-1][2]}: reaches beyond the end of the file")
    return problems
