"""Repair what follows from the job: names, coordinates, attributes of a damaged campaign file.

Everything but the blocks follows from the job: it is written to a new file without blocks, and its
bytes are copied over those of the damaged file. The blocks stay where they are: their checksums,
whose seed is the job's fingerprint, show that the file belongs to this job and that the offsets are
right. No byte of a block is touched; an interrupted repair is repeated.
"""

import contextlib
import os
from pathlib import Path

import h5py

from hpcsweep.store.commit import Blocks
from hpcsweep.store.contents import CHECKSUM, metadata_checksum
from hpcsweep.store.create import LIBRARY, fill, reason
from hpcsweep.store.layout import DamagedError, Layout, StoreError
from hpcsweep.store.offsets import ContiguousRows, Offsets, open_for_reading
from hpcsweep.store.opening import layout_problems, refuse_problems


def repair(path: Path, layout: Layout, provenance: dict[str, str | int]) -> str:
    """Rewrite the metadata of a damaged file, under its lock.

    Parameters
    ----------
    path : Path
    layout : Layout
        Of the job that is run.
    provenance : dict
        Attributes that replace those of the file, if they are damaged too.

    Returns
    -------
    str
        A message that says what was done.

    Raises
    ------
    StoreError
        If no block in it shows that it belongs to this job; the file is unchanged.
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
    """Return the attributes of a damaged file if their checksum holds, else None."""
    try:
        with open_for_reading(path) as file:
            found = dict(file.attrs)
        with open_for_reading(model) as file:
            if metadata_checksum(file, found) == found[CHECKSUM]:
                return {key: value for key, value in found.items() if key != CHECKSUM}
    except Exception:  # of any kind, from damaged bytes
        return None
    return None


def _believed(path: Path, layout: Layout, offsets: Offsets) -> bool:
    """Return whether any block, at the offsets of the model, has a checksum that holds."""
    with Blocks(path, layout, ContiguousRows(path, offsets)) as blocks:
        try:
            return any(
                valid for task in range(layout.study.n_tasks) for _, valid in blocks.verify(task)
            )
        except DamagedError:  # shorter than the job's file
            return False


def _copy_metadata(model: Path, path: Path, extents: list[tuple[int, int]]) -> None:
    """Copy the model's bytes outside its variables, and its length."""
    with model.open("rb") as source, path.open("r+b") as target:
        size = os.fstat(source.fileno()).st_size
        at = 0
        for first, last in [*extents, (size, size)]:
            if first > at:
                source.seek(at)
                target.seek(at)
                target.write(source.read(first - at))
            at = max(at, last)
        target.truncate(size)
        target.flush()
        os.fsync(target.fileno())
