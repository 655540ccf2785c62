"""Copy whole campaign files: the parts of a job into the file of the whole, one into a smaller one.

A merged file has the bits of a run of the whole. A packed one has the same datasets, chunked and
compressed, and is verified equal.
"""

import math
import os
import shutil
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.job.paths import followed, path_of
from hpcsweep.job.split import Whole, whole_of
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import contents
from hpcsweep.store.commit import Blocks, open_campaign
from hpcsweep.store.inferred import Inferred
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import Layout, StoreError, refusing
from hpcsweep.store.lock import Lock
from hpcsweep.store.opening import check_file, check_new, check_own, open_layout, reading
from hpcsweep.store.rows import is_packed, open_for_reading

COMPRESSION = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
"""What every HDF5 library can read."""
LIBRARY = ("v110", "v110")
"""Oldest version of HDF5 that can read a packed file: its chunk indices are smaller than before."""


def merge(paths: Sequence[Path], output: Path) -> int:
    """Write the file of a job from those of all of its parts; return its runs.

    Blocks are written as computed: with checksums of the whole job, and only if those of the part
    hold.

    Raises
    ------
    StoreError, JobError
        If they are not the parts of one job, each once and complete. Nothing is written then.
    """
    check_new(output)
    layouts = [open_layout(path) for path in paths]
    for path, layout in zip(paths, layouts, strict=True):
        check_own(path, layout, "merges")
    wholes = [whole_of(x.text, str(path), x.name) for path, x in zip(paths, layouts, strict=True)]
    order = _order(paths, wholes)
    whole, study = Layout(wholes[0].job), wholes[0].job.study
    frame = study.commit.dims.index(study.run_dims[-2])
    lock = Lock(output)
    lock.acquire(1)
    try:
        with ExitStack() as stack:
            parts = [stack.enter_context(Blocks(paths[i], layouts[i])) for i in order]
            for i, part in zip(order, parts, strict=True):
                if not part.have_checksum().all():
                    raise StoreError(f"{paths[i]}: is not complete; run its job again")
            contents.create(
                output, whole, _provenance([check_file(paths[i]) for i in order], whole)
            )
            campaign = open_campaign(output, whole, Serial())
            stack.callback(campaign.close)
            for task in range(study.n_tasks):
                state = study.initial_state
                for block in study.path(task):
                    at = list(block.place)
                    at[frame], k = divmod(at[frame], len(parts))
                    rows = parts[k].believed(parts[k].study.block(tuple(at)), state)
                    if rows is None:
                        raise StoreError(f"{paths[order[k]]}: damaged; run its job again")
                    state = campaign.write_block(block, state, rows)
        _merge_journals([paths[i] for i in order], output, frame)
    except BaseException:
        output.unlink(missing_ok=True)
        raise
    finally:
        lock.release(remove=True)
    return study.n_runs


def _order(paths: Sequence[Path], wholes: Sequence[Whole]) -> list[int]:
    """Return the places of the parts in their order."""
    first, counts = wholes[0], Counter(whole.k for whole in wholes)
    for path, whole in zip(paths, wholes, strict=True):
        if (whole.job.fingerprint, whole.n) != (first.job.fingerprint, first.n):
            raise StoreError(f"{path}: is of another job, or number of parts, than {paths[0]}")
    for k in range(1, first.n + 1):
        if counts[k] != 1:
            said = f"part {k} of {first.n} is given {counts[k]} times, must be given once"
            raise StoreError(f"{paths[0]}: {said}")
    return sorted(range(first.n), key=lambda i: wholes[i].k)


def _provenance(parts: Sequence[Mapping], whole: Layout) -> dict[str, str | int]:
    """Return where the results come from: what differs between parts, a line each."""
    merged: dict[str, str | int] = {}
    for name in parts[0].keys() - whole.attributes.keys() - {contents.CHECKSUM}:
        values = list(dict.fromkeys(part[name] for part in parts if name in part))
        numbers = isinstance(values[0], int | np.integer)
        merged[name] = int(max(values)) if numbers else "\n".join(map(str, values))
    now = time.strftime("%Y-%m-%dT%H:%M:%S%z")
    merged["history"] = f"{merged['history']}\n{now}: merged of {len(parts)} parts"
    return merged


def _merge_journals(parts: Sequence[Path], output: Path, frame: int) -> None:
    """Write the histories of all parts as one, with the places of the whole."""
    records = []
    for k, path in enumerate(parts):
        for record in Journal(path).read():
            if record["kind"] == "block":
                record["place"][frame] = record["place"][frame] * len(parts) + k
            if record["kind"] != "pilot":
                records.append(record)
    journal = Journal(output)
    journal.begin()
    journal.take(records)


def pack(path: str | Path, output: str | Path | None = None) -> tuple[int, int]:
    """Write a packed copy of a campaign file, verify it, and only then move it into place.

    The checksums of all committed blocks are verified, then every dataset is read back from the
    copy and compared byte by byte, and so is every attribute.

    Parameters
    ----------
    path : str or Path
    output : str or Path, optional
        Must not exist. By default the packed file replaces `path`, whose job must be complete,
        because a packed file cannot be resumed.

    Returns
    -------
    before, after : int
        Bytes of the two files.

    Raises
    ------
    StoreError
        If there is nothing sound to pack, or the copy cannot be written; `path` is unchanged.
    """
    path = followed(path_of("path", path))
    target = path if output is None else path_of("output", output)
    layout = open_layout(path)
    if is_packed(path):
        raise StoreError(f"{path}: is packed already")
    if output is not None:
        check_new(target)
    lock = Lock(path)
    lock.acquire(1)
    try:
        _check_blocks(path, layout, whole=output is None)
        temporary = target.with_name(target.name + ".packing")
        with refusing(target, "written"), contents.removed_at_last(temporary):
            _copy(path, temporary, layout)
            _verify(path, temporary)
            before, after = path.stat().st_size, temporary.stat().st_size
            if output is not None and Journal(path).path.exists():
                shutil.copyfile(Journal(path).path, Journal(target).path)
            temporary.replace(target)
    finally:
        lock.release(remove=True)
    return before, after


def _check_blocks(path: Path, layout: Layout, whole: bool) -> None:
    """Make sure that all committed blocks have a checksum that holds, and that `whole` is whole."""
    n_committed = 0
    with Blocks(path, layout) as blocks:
        # in a complete map the points that are not committed are inferred
        inferred = layout.derived and not Inferred(blocks).unknown()
        for task in blocks.begun():
            for block, good in blocks.verify(task):
                if good:
                    n_committed += 1
                elif blocks.committed(block):
                    raise StoreError(
                        f"{path}: damaged (see hpcsweep validate); run its job again, then pack it"
                    )
    n_blocks = math.prod(layout.shape(layout.commit))
    if whole and not inferred and n_committed < n_blocks:
        raise StoreError(
            f"{path}: not complete ({n_blocks - n_committed} of {n_blocks} blocks are missing), "
            "and a packed file cannot be resumed; run it to its end, or pack a copy with -o"
        )


def _copy(path: Path, temporary: Path, layout: Layout) -> None:
    """Write the packed copy and flush it to disk; what cannot be written is not the source's.

    HDF5 may end the process where it cannot write what it still has when it closes a file: so the
    space for a part, and as much again, is reserved before.

    Raises
    ------
    OSError
        If the copy cannot be written.
    """
    contents.reserve(temporary, 0, 2 * contents.COPY_BYTES)
    with open_for_reading(path) as source, h5py.File(temporary, "w", libver=LIBRARY) as copy:
        contents.reserve(temporary, 0, 2 * contents.COPY_BYTES)
        # its checksum covers the offsets of the datasets, which differ here
        attributes = {k: v for k, v in source.attrs.items() if k != contents.CHECKSUM}
        contents.fill(copy, layout, attributes, _packed)
        for variable in layout.structures:
            copy[variable.name][...] = source[variable.name][...]
        for variable in layout.stored:
            data, packed = source[variable.name], copy[variable.name]
            for part in contents.parts_of(packed):
                contents.reserve(temporary, copy.id.get_filesize(), 2 * contents.COPY_BYTES)
                with refusing(path, "read"):
                    values = data[part]
                packed[part] = values
                copy.flush()
        size = copy.id.get_filesize()
    with temporary.open("r+b") as file:
        file.truncate(size)
        os.fsync(file)


def _packed(file: h5py.File, name: str, shape: tuple[int, ...], dtype) -> h5py.Dataset:
    """Create a compressed dataset."""
    chunks = contents.chunk_shape(shape, np.dtype(dtype).itemsize)
    return file.create_dataset(name, shape, dtype, chunks=chunks, **COMPRESSION)


def _verify(path: Path, temporary: Path) -> None:
    """Compare the copy with the file.

    Raises
    ------
    StoreError
        If anything differs.
    """
    with reading(path) as source, reading(temporary) as copy:
        different = [] if source.keys() == copy.keys() else ["the names of the datasets"]
        left, right = ({**file.attrs, contents.CHECKSUM: ""} for file in (source, copy))
        if left != right:
            different.append("the attributes")
        for name, data in source.items():
            packed = copy[name]
            parts = [()] if data.is_scale else contents.parts_of(packed)
            if data.dtype != packed.dtype or any(
                _bytes(data[part]) != _bytes(packed[part]) for part in parts
            ):
                different.append(name)
    if different:
        raise StoreError(f"{path}: the packed copy differs in {', '.join(different)}; not packed")


def _bytes(values: np.ndarray) -> bytes:
    return b"\0".join(values.flat) if values.dtype == object else values.tobytes()
