"""Merge the files of the parts of a job into that of the whole: the bits of a run of the whole."""

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from hpcsweep.job.split import Whole, whole_of
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store.commit import Blocks, open_campaign
from hpcsweep.store.contents import CHECKSUM, OPTIONAL, PROVENANCE
from hpcsweep.store.create import create
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import Layout, StoreError
from hpcsweep.store.lock import Lock
from hpcsweep.store.opening import check_file, check_place, open_layout


def merge(paths: Sequence[Path], output: Path) -> int:
    """Write the file of a job from those of all of its parts; return its runs.

    Blocks are written as computed: with checksums of the whole job, and only if those of the part
    hold.

    Raises
    ------
    StoreError, JobError
        If they are not the parts of one job, each once and complete. Nothing is written then.
    """
    check_place(output)
    if output.exists():
        raise StoreError(f"{output}: exists already; it is left as it is")
    layouts, wholes = [open_layout(path) for path in paths], []
    for path, layout in zip(paths, layouts, strict=True):
        wholes.append(whole_of(layout.text, str(path), layout.name))
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
            create(output, whole, _provenance([check_file(paths[i]) for i in order]))
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
    first, place = wholes[0], dict[int, int]()
    for i, (path, whole) in enumerate(zip(paths, wholes, strict=True)):
        if whole.job.fingerprint != first.job.fingerprint:
            raise StoreError(f"{path}: is of another job than {paths[0]}")
        if whole.n != first.n:
            raise StoreError(f"{path}: is one of {whole.n} parts, {paths[0]} one of {first.n}")
        if whole.k in place:
            raise StoreError(
                f"{path}: is part {whole.k} of {whole.n}, as {paths[place[whole.k]]} is"
            )
        place[whole.k] = i
    missing = [str(k) for k in range(1, first.n + 1) if k not in place]
    if missing:
        parts = f"part{'s' * (len(missing) > 1)} {', '.join(missing)} of {first.n}"
        raise StoreError(f"{paths[0]}: {parts} {'are' if len(missing) > 1 else 'is'} not given")
    return [place[k] for k in range(1, first.n + 1)]


def _provenance(parts: Sequence[Mapping]) -> dict[str, str | int]:
    """Return where the results come from: what differs between parts, a line each."""
    merged: dict[str, str | int] = {}
    for name in (*PROVENANCE, *OPTIONAL):
        values = list(dict.fromkeys(part[name] for part in parts if name in part))
        if values and name != CHECKSUM:
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
