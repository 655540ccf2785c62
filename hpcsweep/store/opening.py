"""Open campaign files: metadata are checked before anything is believed.

All readers use `open_layout`. HDF5 reacts to a damaged byte with errors of any kind, or with a size
beyond any memory; here each becomes one line that says what is wrong and what to do.
"""

import contextlib
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from hpcsweep.job import Job, JobError, parse_job
from hpcsweep.job.paths import path_of
from hpcsweep.model.arguments import shown
from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.store import contents
from hpcsweep.store import layout as layouts
from hpcsweep.store.commit import Blocks
from hpcsweep.store.contents import CHECKSUM, scales_of
from hpcsweep.store.inferred import Inferred
from hpcsweep.store.layout import DamagedError, Layout, StoreError, refusing
from hpcsweep.store.rows import open_for_reading
from hpcsweep.store.written import WrittenLayout
from hpcsweep.studies.refine.audit import AUDIT

if TYPE_CHECKING:
    import xarray

SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEAP = re.compile(rb"GCOL\x01\0\0\0(.{8})", re.DOTALL)
"""Head of a heap of strings and references; HDF5 trusts its size, which has no checksum."""
MAX_HEAP = 2**24
ENDS = 2**18
"""Bytes at either end of a file, within which all its heaps lie."""
LONGEST_SUFFIX = ".journal"
"""Endings of the files beside a results file."""
REMEDY = "put a whole copy in its place, or move it away and run its job again"


@contextlib.contextmanager
def reading(path: Path) -> Iterator[h5py.File]:
    """Open a file; turn any error, on opening or inside the ``with``, into one line.

    Raises
    ------
    StoreError
        If it is not an HDF5 file; a `DamagedError` if it is one but cannot be read.
    """
    _check_kind(path)
    try:
        with open_for_reading(path) as file:
            yield file
    except StoreError:
        raise
    except Exception as error:  # HDF5 raises errors of any kind on damaged bytes
        cut = re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", str(error))
        if cut and int(cut[2]) < 2**60 and int(cut[1]) == path.stat().st_size:
            raise DamagedError(
                path,
                f"cut short, {cut[1]} of {cut[2]} bytes are left, without their checksums; "
                f"{REMEDY}",
            ) from None
        what = on_one_line(error) or type(error).__name__
        raise DamagedError(path, f"damaged ({what[:120]}); {REMEDY}") from None


def _check_kind(path: Path) -> None:
    """Check that it is a readable file with the signature of HDF5."""
    with refusing(path, "read"):
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if path.is_dir() else "no regular file"
            raise StoreError(f"{path}: cannot be read: it is {kind}")
        with path.open("rb") as file:
            begin = file.read(ENDS)
            # a heap may lie across the middle of a short file: both ends are then one
            if ENDS < status.st_size <= 2 * ENDS:
                begin += file.read(ENDS)
            file.seek(max(status.st_size - ENDS, 0))
            end = file.read(ENDS) if status.st_size > 2 * ENDS else b""
    if not begin.startswith(SIGNATURE):
        raise StoreError(f"{path}: not an HDF5 file, or damaged; it is left as it is")
    for part in (begin, end):
        for heap in HEAP.finditer(part):
            if int.from_bytes(heap[1], "little") > MAX_HEAP:
                raise DamagedError(path, f"damaged (a heap of strings has no size); {REMEDY}")
            if _is_endless(part[heap.start() :]):
                raise DamagedError(path, f"damaged (a heap of strings has no end); {REMEDY}")


def _is_endless(heap: bytes) -> bool:
    """Return whether HDF5 would loop forever in a heap, because free space in it has size 0.

    An object begins with an index, 0 for free space, and at byte 8 a size; that of free space
    includes its head.
    """
    at, end = 16, min(int.from_bytes(heap[8:16], "little"), len(heap))
    while at + 16 <= end:
        index = int.from_bytes(heap[at : at + 2], "little")
        size = int.from_bytes(heap[at + 8 : at + 16], "little")
        if index == 0 and size == 0:
            return True
        at += size if index == 0 else 16 + -(-size // 8) * 8
    return False


def check_place(path: Path) -> None:
    """Check that a results file may be created at a path, before anything is written.

    Raises
    ------
    StoreError
        If its folder does not exist, its name is too long, or something else is there.
    """
    with refusing(path, "used"):
        if not path.parent.is_dir():
            raise StoreError(f"{path}: folder {path.parent} does not exist")
        if path.is_dir():
            raise StoreError(f"{path}: is a folder")
        longest = os.pathconf(path.parent, "PC_NAME_MAX") - len(LONGEST_SUFFIX)
        if len(os.fsencode(path.name)) > longest:
            raise StoreError(f"{path}: its name is too long: {longest} bytes are the most")
        if path.is_symlink() and not path.exists():
            raise StoreError(f"{path}: is a link that leads nowhere")
        if path.exists() and not path.is_file():
            raise StoreError(f"{path}: is no regular file")


def check_new(path: Path) -> None:
    """Check that a file may be created at a path where there is none."""
    check_place(path)
    if path.exists():
        raise StoreError(f"{path}: exists already; it is left as it is")


def check_file(path: Path) -> dict:
    """Read the attributes of a campaign file.

    Raises
    ------
    StoreError
        If it is not a campaign file, or of a layout that this version does not know. A
        `DamagedError` if it was truncated: it is not extended again, because ``commit`` is at its
        end, and without it nothing can be verified.
    """
    with reading(path) as file:
        attributes = dict(file.attrs)
    if str(attributes.get("format")) != layouts.FORMAT:
        raise StoreError(f"{path}: an HDF5 file, but no results of hpcsweep; it is left as it is")
    version = attributes.get("layout_version", -1)
    read = range(layouts.OLDEST, layouts.LAYOUT_VERSION + 1)
    if str(version) not in map(str, read):
        wrote = attributes.get("hpcsweep_version", "of unknown version")
        raise StoreError(
            f"{path}: has layout version {version}, which hpcsweep {wrote} reads; this one reads "
            f"version {' and '.join(map(str, read))}"
        )
    return attributes


def read_layout(path: str | Path) -> Layout:
    """Return the layout of the job stored in a campaign file, without checking the rest.

    Raises
    ------
    StoreError
        If the file is not a campaign file. A `DamagedError` if job and fingerprint disagree.
    """
    path = path_of("path", path)
    attributes = check_file(path)
    is_own = attributes["layout_version"] == layouts.LAYOUT_VERSION
    try:
        text, name = attributes["job"], attributes["name"]
        # defaults may have changed since
        said = text if is_own else attributes["resolved_job"]
        job = replace(parse_job(said, f"{path} (job)", name, is_stored=True), text=text)
    except (KeyError, TypeError, JobError) as error:
        what = "it is missing" if isinstance(error, KeyError | TypeError) else error
        raise DamagedError(path, f"its job cannot be read: {what}") from None
    if not is_own:
        with reading(path) as file:
            return WrittenLayout(job, file)
    if job.fingerprint != attributes.get("fingerprint"):
        raise DamagedError(path, f"its job and its fingerprint do not agree; {REMEDY}")
    return Layout(job)


def check_own(path: Path, layout: Layout, does: str) -> None:
    """Raise a `StoreError` if a file is of an earlier layout, which this version only reads."""
    if not layout.is_own:
        version, wrote = (layout.attributes[key] for key in ("layout_version", "hpcsweep_version"))
        raise StoreError(
            f"{path}: has layout version {version}, which hpcsweep {wrote} {does}; this one reads "
            f"it, but {does} version {layouts.LAYOUT_VERSION} only"
        )


def layout_problems(path: Path, layout: Layout) -> list[str]:
    """Compare everything but the results with the job and with the checksum.

    Returns
    -------
    list of str
        One line for each difference; empty for a sound file.
    """
    with reading(path) as file:
        problems = contents.file_problems(file, layout)
        if not problems and contents.metadata_checksum(file) != file.attrs.get(CHECKSUM):
            problems.append(
                "attributes, coordinates or names: the checksum over them does not hold"
            )
    return problems


def open_layout(path: str | Path) -> Layout:
    """Check everything in a campaign file but its results; return its layout.

    Raises
    ------
    StoreError
        If it is not a campaign file. A `DamagedError` if it differs from its job.
    """
    path = path_of("path", path)
    layout = read_layout(path)
    check_layout(path, layout)
    return layout


def check_layout(path: Path, layout: Layout) -> None:
    """Raise a `DamagedError` if anything but the results differs from the job or the checksum."""
    if problems := layout_problems(path, layout):
        more = f" and {len(problems) - 1} more" if len(problems) > 1 else ""
        raise DamagedError(path, f"damaged ({problems[0]}{more}); {REMEDY}")


def job_of(path: str | Path) -> Job:
    """Return the job of a campaign file.

    Raises
    ------
    StoreError
        If the file is not a campaign file. A `DamagedError` if it differs from its job.
    """
    return open_layout(path).job


def open_results(path: str | Path) -> "xarray.Dataset":
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
            arrays[name] = (dims, _read(data), contents.notes_of(data))
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
    for part in contents.parts_of(data):
        data.read_direct(values, part, part)
    return values
