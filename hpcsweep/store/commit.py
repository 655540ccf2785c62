"""Commit blocks of results: a block is valid where its checksum holds.

The checksum of a block is a 64-bit BLAKE2b of the job's fingerprint, the block's place, the state
it starts from and all its bytes. Its 8 bytes are written at once, after the block's data have
reached the disk; a block cut off by a crash therefore has none, or a wrong one. Because it covers
the start state, the valid blocks of a task form a chain.

To spare the disk, checksums wait until `SYNC_INTERVAL` has passed since the last flush: then the
data are flushed once and all waiting checksums are written. A kill loses at most the work of one
interval.
"""

import hashlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.store.layout import Layout
from hpcsweep.store.rows import ContiguousRows, PackedRows, Transport, is_packed, open_transport
from hpcsweep.studies.blocks import Block, Place, Rows

CODES = {"outcome": (1, max(Outcome)), "skip_rule": (0, max(SkipRule))}
"""Least and largest value of results that are codes."""
SYNC_INTERVAL = 2.0
"""Seconds between flushes to disk."""


class Blocks:
    """Read and verify the blocks of a campaign file; safe beside running writers.

    Parameters
    ----------
    path : Path
    layout : Layout
    rows : Transport, optional
        Where the file is already open.
    """

    def __init__(self, path: Path, layout: Layout, rows: Transport | None = None):
        self.layout = layout
        self.study = layout.study
        self.variables = [variable.name for variable in layout.variables]
        self._seed = bytes.fromhex(layout.fingerprint)
        self._rows: ContiguousRows | PackedRows = rows or (
            PackedRows(path) if is_packed(path) else ContiguousRows(path)
        )
        self.read_rows = self._rows.read

    def __enter__(self) -> "Blocks":
        return self

    def __exit__(self, *_exception) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._rows.close()

    def read(self, block: Block) -> Rows:
        """Read a block, its rows in file order."""
        return {name: self.read_rows(name, block.first, block.n_runs) for name in self.variables}

    def places(self, block: Block) -> dict[str, tuple[int, int]]:
        """Return the first byte and the number of bytes of a block in each variable of the file.

        Empty if the file is packed.
        """
        if not isinstance(self._rows, ContiguousRows):
            return {}
        extent = self._rows.extent
        return {name: extent(name, block.first, block.n_runs)[:2] for name in self.variables}

    def committed(self, block: Block) -> int:
        """Read the stored checksum of a block, 0 if it has none."""
        return int(self.read_rows("commit", block.place, 1)[0])

    def end_state(self, run: tuple[int, ...]) -> np.ndarray:
        """Read the state that the next run starts from."""
        rows = {name: self.read_rows(name, run, 1) for name in self.study.carried}
        return self.study.end_state(rows, 0)

    def start_of(self, block: Block, row: int) -> np.ndarray:
        """Read the state that a run started from: where the previous run on the path ended."""
        before = self.study.predecessor(block, row)
        return self.study.initial_state if before is None else self.end_state(before)

    def have_checksum(self) -> np.ndarray:
        """Return which blocks have a checksum, valid or not; shape of ``commit``."""
        return self.whole("commit") != 0

    def begun(self) -> list[int]:
        """Return the tasks that have a block with a checksum, ascending."""
        committed = self.have_checksum()
        tasks = self.study.task_of(*np.ogrid[tuple(map(slice, committed.shape))])
        return np.unique(np.broadcast_to(tasks, committed.shape)[committed]).tolist()

    def whole(self, variable: str) -> np.ndarray:
        """Read a whole variable of the runs, or ``commit``, whether committed or not."""
        kept = [*self.layout.variables, self.layout.commit]
        shape = self.layout.shape(next(each for each in kept if each.name == variable))
        return np.array([self.read_rows(variable, (k, 0), shape[1]) for k in range(shape[0])])

    def checksum(self, block: Block, start: np.ndarray, rows: dict) -> int:
        """Compute the checksum of a block that starts from state `start`; never 0."""
        held = (rows[name] for name in self.variables)
        return self.checksum_of(block.place, np.ascontiguousarray(start, "<f8"), *held)

    def checksum_of(self, place: Place, *arrays: np.ndarray) -> int:
        """Compute the checksum of arrays at a place of the file; never 0."""
        digest = hashlib.blake2b(self._seed, digest_size=8)
        digest.update(np.array(place, "<i8").tobytes())
        for values in arrays:
            digest.update(np.ascontiguousarray(values).data)
        return int.from_bytes(digest.digest(), "little") | 1

    def believed(self, block: Block, start: np.ndarray | None = None) -> Rows | None:
        """Read a block; None if its checksum does not hold for a start state, or the stored one.

        Nor if any of its codes has no meaning.
        """
        stored = self.committed(block)
        if not stored:
            return None
        rows = self.read(block)
        start = self.start_of(block, block.begin) if start is None else start
        holds = stored == self.checksum(block, start, rows) and all(
            least <= int(rows[name].min()) and int(rows[name].max()) <= most
            for name, (least, most) in CODES.items()
            if name in rows
        )
        return rows if holds else None

    def end_of(self, block: Block, start: np.ndarray) -> np.ndarray | None:
        """Return the state at the end of a block that starts from a state; None if not valid."""
        rows = self.believed(block, start)
        return None if rows is None else np.array(self.study.end_state(rows, block.end))

    def verify(
        self, task: int, poll: Callable[[], None] = lambda: None
    ) -> Iterator[tuple[Block, bool]]:
        """Iterate over a task's blocks in path order, without reading those without a checksum.

        Each is judged by the state at the end of the one before: as computed from its rows if it is
        valid, else as it is in the file, so that blocks after an invalid one may still be valid.

        Parameters
        ----------
        task : int
        poll : callable
            Called for each block.

        Yields
        ------
        block : Block
        valid : bool
        """
        before: Block | None = None
        state: np.ndarray | None = self.study.initial_state
        for block in self.study.path(task):
            poll()
            end = None
            if self.committed(block):
                if state is None and before is not None:
                    state = self.end_state(before.run(before.end))
                end = self.end_of(block, self.study.initial_state if state is None else state)
            yield block, end is not None
            before, state = block, end

    def valid_runs(self) -> np.ndarray:
        """Return for each run whether it belongs to a valid block."""
        mask = np.zeros([self.layout.sizes[dim] for dim in self.study.run_dims], bool)
        for task in self.begun():
            for block, good in self.verify(task):
                if good:
                    mask[block.runs] = True
        return mask


class Campaign:
    """Access of one rank to the file while a campaign runs."""

    def __init__(self, path: Path, layout: Layout, transport: Transport):
        self.blocks = Blocks(path, layout, transport)
        self.transport = transport
        self._pending: list[tuple[tuple[int, ...], int]] = []
        self._last_sync = time.monotonic()

    def write_block(self, block: Block, start: np.ndarray, rows: dict) -> np.ndarray:
        """Write one block, computed from state `start`, and queue its checksum.

        Parameters
        ----------
        block : Block
        start : ndarray, shape (2n,)
        rows : dict of str to ndarray
            Rows in file order.

        Returns
        -------
        ndarray, shape (2n,)
            State that the next block starts from.
        """
        for name in self.blocks.variables:
            self.transport.write(name, block.first, rows[name])
        self._pending.append((block.place, self.blocks.checksum(block, start, rows)))
        if time.monotonic() - self._last_sync >= SYNC_INTERVAL:
            self.flush()
        return np.array(self.blocks.study.end_state(rows, block.end))

    def flush(self) -> None:
        """Flush the data to disk, then the checksums that waited for them.

        Raises
        ------
        WriteError
            If the write fails, or the file is no longer under its name. It is not retried: a system
            that has reported lost data once may report success for the next flush.
        """
        pending, self._pending = self._pending, []
        self.transport.check_identity()
        if pending:
            self.transport.sync()
            for place, checksum in pending:
                self.transport.write("commit", place, np.array([checksum], "<u8"))
            self.transport.sync()
        self._last_sync = time.monotonic()

    def close(self) -> None:
        """Flush and close (collective)."""
        try:
            self.flush()
        finally:
            self.blocks.close()


def open_campaign(path: Path, layout: Layout, comm) -> Campaign:
    """Open the file for writing on every rank (collective)."""
    return Campaign(path, layout, open_transport(path, comm))
