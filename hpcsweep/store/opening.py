"""Open campaign files: metadata are checked before anything is believed.

All readers use `open_layout`. HDF5 reacts to a damaged byte with errors of any kind, or with a size
beyond any memory; here each becomes one line that says what is wrong and what to do.
"""

import contextlib
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

import h5py

from hpcsweep.job import JobError, parse_job
from hpcsweep.job.paths import path_of
from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.store.contents import CHECKSUM, file_problems, metadata_checksum
from hpcsweep.store.layout import FORMAT, LAYOUT_VERSION, DamagedError, Layout, StoreError, refusing
from hpcsweep.store.rows import open_for_reading

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
    if str(attributes.get("format")) != FORMAT:
        raise StoreError(f"{path}: an HDF5 file, but no results of hpcsweep; it is left as it is")
    version = attributes.get("layout_version", -1)
    if str(version) != str(LAYOUT_VERSION):
        wrote = attributes.get("hpcsweep_version", "of unknown version")
        raise StoreError(
            f"{path}: has layout version {version}, which hpcsweep {wrote} reads; this one reads "
            f"version {LAYOUT_VERSION}"
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
    try:
        text, name = attributes["job"], attributes["name"]
        job = parse_job(text, f"{path} (job)", name, is_stored=True)
    except (KeyError, TypeError, JobError) as error:
        what = "it is missing" if isinstance(error, KeyError | TypeError) else error
        raise DamagedError(path, f"its job cannot be read: {what}") from None
    if job.fingerprint != attributes.get("fingerprint"):
        raise DamagedError(path, f"its job and its fingerprint do not agree; {REMEDY}")
    return Layout(job)


def layout_problems(path: Path, layout: Layout) -> list[str]:
    """Compare everything but the results with the job and with the checksum.

    Returns
    -------
    list of str
        One line for each difference; empty for a sound file.
    """
    with reading(path) as file:
        problems = file_problems(file, layout)
        if not problems and metadata_checksum(file) != file.attrs.get(CHECKSUM):
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
