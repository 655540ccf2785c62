"""What of the file is believed: blocks whose checksum holds.

The checksum of a block is a 64-bit BLAKE2b of the job's fingerprint, the block's place, the state
it starts from and every byte of it. It is written, in one piece of 8 bytes, after the block's data
have reached the disk; a block cut off by a crash therefore has none, or one that does not fit.
Because the start state is part of it, the valid blocks of a frame form a chain.

To spare the disk, checksums wait until `SYNC_INTERVAL` has passed since the last flush: then the
data are flushed once and all waiting checksums are written. A kill loses at most that much work.
"""

import hashlib
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hpcsweep.job import Job
from hpcsweep.store.layout import (
    FORMAT,
    LAYOUT_VERSION,
    DamagedError,
    StoreError,
    block_rows,
    n_blocks,
    run_variables,
)
from hpcsweep.store.offsets import is_packed, open_for_reading, open_rows
from hpcsweep.store.transport import Transport, open_transport

SYNC_INTERVAL = 2.0
"""Seconds between flushes to disk."""


def check_file(path: Path) -> dict:
    """Read the attributes of a campaign file.

    Raises
    ------
    StoreError
        If it is not a campaign file, or of a layout this version does not know. A `DamagedError`
        if it has been cut short: it is not lengthened again, because ``commit`` is at its end,
        so that nothing of the rest could be believed.
    """
    try:
        with open_for_reading(path) as file:
            attributes = dict(file.attrs)
    except (OSError, RuntimeError) as error:
        if isinstance(error, PermissionError | FileNotFoundError | IsADirectoryError):
            # what h5py says of it is long, and may take several lines
            raise StoreError(f"{path}: cannot be read: {os.strerror(error.errno)}") from None
        cut = re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", str(error))
        if cut:
            raise DamagedError(
                f"{path}: cut short, {cut[1]} of {cut[2]} bytes are left, without their checksums; "
                "put a whole copy in its place, or move it away and run the job again"
            ) from None
        raise StoreError(f"{path}: not an HDF5 file, or damaged; it is left as it is") from None
    if attributes.get("format") != FORMAT:
        raise StoreError(f"{path}: an HDF5 file, but no results of hpcsweep; it is left as it is")
    version = int(attributes.get("layout_version", -1))
    if version != LAYOUT_VERSION:
        raise StoreError(
            f"{path}: has layout version {version}, this program reads version {LAYOUT_VERSION}"
        )
    return attributes


def check_writable(path: Path) -> None:
    """Make sure that a campaign file can be gone on with.

    Raises
    ------
    StoreError
        If it is packed.
    """
    if is_packed(path):
        raise StoreError(
            f"{path}: is packed, and a packed file cannot be gone on with; give another file with "
            "-o (hpcsweep status tells what is in this one)"
        )


def path_blocks(job: Job) -> list[tuple[int, int]]:
    """List (direction, block) of a frame in the order in which they are computed."""
    blocks = n_blocks(job.amplitude.size, job.block)
    return [(d, b) for d in range(len(job.directions)) for b in range(blocks)]


class Blocks:
    """Reads and verifies the blocks of a campaign file; safe beside running writers."""

    def __init__(self, path: Path, job: Job):
        self.job = job
        self.variables = [variable.name for variable in run_variables(job)]
        self._seed = bytes.fromhex(job.fingerprint)
        self._rows = open_rows(path)

    def close(self) -> None:
        """Close the file."""
        self._rows.close()

    def rows(self, direction: int, block: int) -> tuple[int, int]:
        """Return the amplitude indices of a block; see `layout.block_rows`."""
        return block_rows(direction, block, self.job.amplitude.size, self.job.block)

    def read(self, direction: int, frame: int, block: int) -> dict[str, np.ndarray]:
        """Read a block, rows in ascending amplitude."""
        low, high = self.rows(direction, block)
        return {
            name: self._rows.read(name, (direction, frame, low), high - low)
            for name in self.variables
        }

    def places(self, direction: int, frame: int, block: int) -> dict[str, tuple[int, int]]:
        """Give the first byte and the number of bytes of a block in each variable of the file.

        Empty if the file is packed.
        """
        if self._rows.offsets is None:
            return {}
        low, high = self.rows(direction, block)
        start = (direction, frame, low)
        return {
            name: self._rows.offsets.extent(name, start, high - low)[:2] for name in self.variables
        }

    def committed(self, direction: int, frame: int, block: int) -> int:
        """Read the stored checksum of a block, 0 if it has none."""
        return int(self._rows.read("commit", (direction, frame, block), 1)[0])

    def final_state(self, direction: int, frame: int, index: int) -> np.ndarray:
        """Read the state at the end of one run, shape (2n,)."""
        return self._rows.read("final_state", (direction, frame, index), 1)[0]

    def have_checksum(self) -> np.ndarray:
        """Tell which blocks have a checksum, valid or not; shape (direction, frame, block)."""
        directions, frames = len(self.job.directions), self.job.omega.size
        stored = [
            self._rows.read("commit", (direction, 0), frames) for direction in range(directions)
        ]
        return np.array(stored) != 0

    def whole(self, variable: str, direction: int, frame: int) -> np.ndarray:
        """Read a variable over all amplitudes of one sweep, committed or not."""
        place = (direction, frame, 0)
        return self._rows.read(variable, place, self.job.amplitude.size)

    def checksum(self, direction, frame, block, start: np.ndarray, rows: dict) -> int:
        """Compute the checksum of a block that starts from state `start`; never 0."""
        digest = hashlib.blake2b(self._seed, digest_size=8)
        digest.update(np.array([direction, frame, block], "<i8").tobytes())
        digest.update(np.ascontiguousarray(start, "<f8").tobytes())
        for name in self.variables:
            digest.update(np.ascontiguousarray(rows[name]).data)
        return int.from_bytes(digest.digest(), "little") | 1

    def chain(
        self, frame: int, first: int = 0, state: np.ndarray | None = None
    ) -> Iterator[tuple[int, int, np.ndarray, bool, np.ndarray | None]]:
        """Walk a frame's blocks in the order of the path.

        Parameters
        ----------
        frame : int
        first : int
            Position on the path of the block to begin with.
        state : ndarray, shape (2n,), optional
            The state that block starts from; needed if it is not the first.

        Yields
        ------
        direction, block : int
        start : ndarray, shape (2n,)
            State the block starts from, if the ones before are valid.
        valid : bool
            Whether the block's checksum holds.
        end : ndarray, shape (2n,), or None
            Its last state, if it is valid.

        The caller may send the end state of a block it has computed itself.
        """
        state = self.job.initial_state if state is None else state
        for direction, block in path_blocks(self.job)[first:]:
            stored = self.committed(direction, frame, block)
            end = None
            if stored:
                rows = self.read(direction, frame, block)
                if stored == self.checksum(direction, frame, block, state, rows):
                    end = rows["final_state"][-1 if direction == 0 else 0]
            computed = yield direction, block, state, end is not None, end
            if computed is not None:
                end = computed
            elif end is None:
                # go on from what the file says: a later block may be valid all the same
                last = self.read(direction, frame, block)["final_state"]
                end = last[-1 if direction == 0 else 0]
            state = np.array(end)

    def valid(self, frame: int) -> dict[tuple[int, int], bool]:
        """Tell for each (direction, block) of a frame whether its checksum holds."""
        return {(d, b): good for d, b, _, good, _ in self.chain(frame)}


class Campaign:
    """One rank's access to the file while a campaign runs."""

    def __init__(self, path: Path, job: Job, transport: Transport):
        self.blocks = Blocks(path, job)
        self.transport = transport
        self.written_bytes = 0
        self.write_seconds = 0.0
        self._pending: list[tuple[tuple[int, int, int], int]] = []
        self._last_sync = time.monotonic()

    def write_block(
        self, direction: int, frame: int, block: int, start: np.ndarray, result: dict
    ) -> np.ndarray:
        """Write one block, computed from state `start`, and queue its checksum.

        Parameters
        ----------
        result : dict of str to ndarray
            Rows in the order in which they were computed (a down sweep descends).

        Returns
        -------
        ndarray, shape (2n,)
            The state the next block starts from.
        """
        low, _ = self.blocks.rows(direction, block)
        order = slice(None) if direction == 0 else slice(None, None, -1)
        rows = {name: np.ascontiguousarray(result[name][order]) for name in self.blocks.variables}
        begun = time.perf_counter()
        for name, values in rows.items():
            self.transport.write(name, (direction, frame, low), values)
            self.written_bytes += values.nbytes
        self.write_seconds += time.perf_counter() - begun
        checksum = self.blocks.checksum(direction, frame, block, start, rows)
        self._pending.append(((direction, frame, block), checksum))
        if time.monotonic() - self._last_sync >= SYNC_INTERVAL:
            self.flush()
        return np.array(result["final_state"][-1])

    def flush(self) -> None:
        """Bring the data to disk, then the checksums that waited for them.

        Raises
        ------
        WriteError
            If the disk does not take them. They are not tried again: a system that has reported
            lost data once may call the next flush a success.
        """
        pending, self._pending = self._pending, []
        if pending:
            begun = time.perf_counter()
            self.transport.sync()
            for place, checksum in pending:
                self.transport.write("commit", place, np.array([checksum], "<u8"))
                self.written_bytes += 8
            self.transport.sync()
            self.write_seconds += time.perf_counter() - begun
        self._last_sync = time.monotonic()

    def close(self) -> None:
        """Flush and close (collective)."""
        self.flush()
        self.transport.close()
        self.blocks.close()


def open_campaign(path: Path, job: Job, comm) -> Campaign:
    """Open the file for writing on every rank (collective)."""
    return Campaign(path, job, open_transport(path, comm))
