"""Repair what the job can tell: names, coordinates and attributes of a damaged campaign file.

Everything but the blocks follows from the job, so that it is made anew, in a file without blocks,
and its bytes are written over those of the damaged file. The blocks are where they were: their
checksums, whose seed is the job's fingerprint, prove that the file is of this job and that the
places are right. No byte of a block is touched; a repair that is interrupted is done again.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import h5py

from hpcsweep.store.commit import Blocks
from hpcsweep.store.contents import Contents
from hpcsweep.store.create import LIBRARY, fill, reason
from hpcsweep.store.layout import DamagedError, Layout, StoreError
from hpcsweep.store.metadata import CHECKSUM, metadata_checksum
from hpcsweep.store.offsets import ContiguousRows, Offsets, open_for_reading
from hpcsweep.store.opening import layout_problems, refuse_problems


def repair(path: Path, layout: Layout, provenance: dict[str, str | int]) -> str:
    """Write the metadata of a damaged file anew, under its lock.

    Parameters
    ----------
    path : Path
    layout : Layout
        Of the job that is run.
    provenance : dict
        Attributes that take the place of those of the file, if theirs are damaged too.

    Returns
    -------
    str
        What was done, for people.

    Raises
    ------
    StoreError
        If no block in it proves that it is a file of this job; it is left as it is.
    """
    model = path.with_name(path.name + ".new")
    try:
        with h5py.File(model, "w", libver=LIBRARY) as file:
            fill(file, layout, provenance)
        kept = _sound_attributes(path, model)
        if kept is not None:
            with h5py.File(model, "w", libver=LIBRARY) as file:
                fill(file, layout, kept)
        offsets = Offsets(model)
        if not _believed(path, layout, offsets):
            raise DamagedError(
                f"{path}: damaged, and no block in it proves to be of this job; it is left as it "
                "is: move it away and run again",
                repairable=False,
            )
        names = [variable.name for variable in layout.stored]
        _copy_metadata(model, path, sorted(offsets.extents(names)))
    except OSError as error:
        raise StoreError(f"{path}: cannot be repaired: {reason(error)}") from None
    finally:
        with contextlib.suppress(OSError):
            model.unlink()
    refuse_problems(path, layout_problems(path, layout))
    origin = "" if kept is not None else "; its attributes tell of this run, the old ones are lost"
    return f"{path}: damaged names, coordinates or attributes were written anew{origin}"


def _sound_attributes(path: Path, model: Path) -> dict | None:
    """Return the attributes of a damaged file if their checksum proves them right, else None."""
    try:
        with open_for_reading(path) as file:
            found = dict(file.attrs)
        with open_for_reading(model) as file:
            if metadata_checksum(Contents(file), found) == found[CHECKSUM]:
                return {key: value for key, value in found.items() if key != CHECKSUM}
    except Exception:  # of any kind, from damaged bytes: then they are not sound
        return None
    return None


def _believed(path: Path, layout: Layout, offsets: Offsets) -> bool:
    """Return whether a block of the file, at the places of the model, has a checksum that holds."""
    with Blocks(path, layout, ContiguousRows(path, offsets)) as blocks:
        try:
            return any(
                valid for task in range(layout.study.n_tasks) for _, valid in blocks.verify(task)
            )
        except DamagedError:  # shorter than the job's file
            return False


def _copy_metadata(model: Path, path: Path, extents: list[tuple[int, int]]) -> None:
    """Copy all bytes of the model that belong to no variable, and its length."""
    with model.open("rb") as source, path.open("r+b") as target:
        size = os.fstat(source.fileno()).st_size
        for first, last in _gaps(extents, size):
            source.seek(first)
            target.seek(first)
            target.write(source.read(last - first))
        target.truncate(size)
        target.flush()
        os.fsync(target.fileno())


def _gaps(extents: list[tuple[int, int]], size: int) -> Iterator[tuple[int, int]]:
    at = 0
    for first, last in extents:
        if first > at:
            yield at, first
        at = max(at, last)
    if size > at:
        yield at, size
