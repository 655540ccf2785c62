"""Check a file against its layout, apart from the contents of its blocks."""

import itertools
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.contents import CHECKSUM, notes_of, place_of, scales_of
from hpcsweep.store.layout import ATTRIBUTES, IF_KNOWN, Layout

PROVENANCE = (
    *("hpcsweep_version", "git_commit", "libraries", "mpi", "hosts", "ranks", "created"),
    "history",
)
"""Attributes of provenance."""
STRING = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
"""HDF5's form of a variable-length string in a dataset."""
LONGEST_NAME = 4096
CURVES = "curves_checksum"
"""Attribute of a refined map whose cells known curves cut (`hpcsweep.store.inputs`)."""
OPTIONAL = ("command", "processor", CHECKSUM, CURVES)
"""Optional attributes."""


def file_problems(file: h5py.File, layout: Layout, size: int) -> list[str]:
    """Compare attributes, coordinates and the form of variables with the layout of the job's file.

    Nothing is read before its size is known to be the layout's.

    Parameters
    ----------
    file : h5py.File
    layout : Layout
    size : int
        Bytes of the file.

    Returns
    -------
    list of str
        One line for each difference; empty for a sound file.
    """
    problems = _attribute_problems(file.attrs, layout)
    for name, (values, units, _) in layout.coordinates.items():
        problems += _coordinate_problems(file, name, values, units)
    if any(name not in file for name in layout.coordinates):
        return problems  # the variables' scales point nowhere
    for variable in layout.datasets:
        problems += _variable_problems(file, variable, layout)
    expected = set(layout.coordinates) | {variable.name for variable in layout.datasets}
    problems += [f"{name!s:.60}: not part of the layout" for name in file if name not in expected]
    if not problems:
        problems += [
            f"{variable.name}: its values are not those of the job"
            for variable, values in layout.given
            if not np.array_equal(
                file[variable.name][...], values, equal_nan=values.dtype.kind == "f"
            )
        ]
        names = [variable.name for variable in layout.stored]
        problems += _storage_problems([(name, file[name]) for name in names], size)
    return problems


def _attribute_problems(attributes: Mapping[str, object], layout: Layout) -> list[str]:
    needed = (*PROVENANCE, *ATTRIBUTES)
    problems = [f"attribute {key}: missing" for key in needed if key not in attributes]
    for key in ("solver", "rtol"):
        value = getattr(layout.study.settings, key)
        if attributes.get(key) != value:
            problems.append(f"attribute {key}: is {attributes.get(key)!r}, the job says {value!r}")
    allowed = {*needed, *IF_KNOWN, *OPTIONAL}
    problems += [f"attribute {key!s:.60}: not known" for key in attributes if key not in allowed]
    return problems


def _form_problems(file: h5py.File, name: str, what: str, form: tuple) -> list[str]:
    """Compare units, type and shape of a dataset, which must be a variable or a dimension scale."""
    if name not in file:
        return [f"{name}: missing"]
    data, (units, dtype, shape) = file[name], form
    if not isinstance(data, h5py.Dataset) or (what == "dimension scale" and not data.is_scale):
        return [f"{name}: not a {what}"]
    problems, notes = [], notes_of(data)
    if notes.get("units") != units:
        problems.append(f"{name}: its units are {notes.get('units')!r}, not {units!r}")
    if not notes.get("long_name"):
        problems.append(f"{name}: has no long_name")
    is_text = dtype.kind == "O"
    if h5py.check_string_dtype(data.dtype) is None if is_text else data.dtype != dtype:
        wanted = "string" if is_text else dtype
        problems.append(f"{name}: its type is {data.dtype}, not {wanted}")
    if data.shape != shape:
        problems.append(f"{name}: its shape is {data.shape}, not {shape}")
    return problems


def _coordinate_problems(file, name: str, values: np.ndarray, units: str) -> list[str]:
    form = units, values.dtype, values.shape
    if problems := _form_problems(file, name, "dimension scale", form):
        return problems
    scale = file[name]
    if values.dtype != object:
        # to the last bit: NaN equals NaN
        same = scale[...].tobytes() == values.tobytes()
    elif _lengths_are_sane(scale):
        same = [value.decode() for value in scale[...].flat] == values.ravel().tolist()
    else:
        return [f"{name}: its values have no length"]
    return [] if same else [f"{name}: its values are not those of the job"]


def _lengths_are_sane(scale: h5py.Dataset) -> bool:
    """Return whether the lengths of strings are possible: HDF5 allocates them before it checks.

    A damaged length of 2^32 - 1 costs 4.1 GB and 29 s until h5py reports an error.
    """
    offset = scale.id.get_offset()
    if offset is None:
        return False
    with Path(scale.file.filename).open("rb") as file:
        file.seek(offset)
        raw = file.read(STRING.itemsize * scale.size)
    if len(raw) < STRING.itemsize * scale.size:
        return False
    return bool(np.all(np.frombuffer(raw, STRING)["length"] <= LONGEST_NAME))


def _variable_problems(file, variable, layout: Layout) -> list[str]:
    name, shape = variable.name, layout.shape(variable)
    form = variable.units, np.dtype(variable.dtype), shape
    problems = _form_problems(file, name, "variable", form)
    data = file.get(name)
    if isinstance(data, h5py.Dataset) and data.shape == shape:
        for axis, (dim, attached) in enumerate(zip(variable.dims, scales_of(data), strict=True)):
            if attached != [dim]:
                problems.append(f"{name}: axis {axis} has the scales {attached}, not {dim}")
    return problems


def _storage_problems(datasets: list[tuple[str, h5py.Dataset]], size: int) -> list[str]:
    """Check storage: contiguous in a plain file, without overlap; in chunks in a packed file."""
    plain = [name for name, data in datasets if data.chunks is None]
    if len(plain) < len(datasets):
        return [f"{name}: contiguous in a packed file" for name in plain]
    places = []
    for name, data in datasets:
        place = place_of(data)
        if place is None:
            return [f"{name}: has no place in the file"]
        places.append((place, place + data.nbytes, name))
    places.sort()
    problems = [
        f"{left[2]}, {right[2]}: overlap in the file"
        for left, right in itertools.pairwise(places)
        if left[1] > right[0]
    ]
    if places[-1][1] > size:
        problems.append(f"{places[-1][2]}: reaches beyond the end of the file")
    return problems
