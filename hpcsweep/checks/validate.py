"""Whether a results file is sound: checksums, promises, and runs computed again.

Three kinds of evidence, from cheap to dear:

1. the layout and every committed block: its checksum, which covers the state it starts from, so
   that a frame's blocks form one path, and what its numbers promise of each other (`promises`);
2. where a checksum fails, the block is computed again: if that fits the checksum, the bytes that
   differ are exactly the damaged ones;
3. a random sample of runs is computed again, with the other solver among them (`resample`).
"""

import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.checks.invariants import broken_promises
from hpcsweep.checks.recompute import RunAgain, compute_again
from hpcsweep.job import Job
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import DamagedError, is_packed, job_of, layout_problems
from hpcsweep.store.commit import Blocks, path_blocks
from hpcsweep.studies import amplitude_sweep as sweep

LISTED = 20
"""Problems that are described one by one; the rest is counted."""
MOST_DRAWS = 10_000
"""Runs drawn in search of complete ones."""
LOCATING_SECONDS = 60.0
"""Time given to computing damaged blocks again, to tell which bytes are damaged."""


@dataclass
class Report:
    """What was found; `sound` is the verdict.

    Attributes
    ----------
    blocks, committed : int
        Blocks of the job, and those that have a checksum; the others are not there yet.
    problems : list of str
        At most `LISTED`; `n_problems` counts all.
    sample : list of RunAgain
    """

    file: str
    packed: bool = False
    solver: str = ""
    blocks: int = 0
    committed: int = 0
    n_problems: int = 0
    problems: list[str] = field(default_factory=list)
    sample: list[RunAgain] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with what is in the file."""
        return self.n_problems == 0

    def add(self, problem: str) -> None:
        """Count a problem, and describe it if it is among the first."""
        self.n_problems += 1
        if len(self.problems) < LISTED:
            self.problems.append(problem)


class _OutOfTime(Exception):
    """Raised out of a block that takes too long to compute again."""


def validate(path: str | Path, samples: int = 20, seed: int = 0) -> Report:
    """Examine a results file, live or not, without disturbing its writers.

    Parameters
    ----------
    path : str or Path
    samples : int
        Runs to compute again; 0 for none.
    seed : int
        Of the choice of these runs.

    Returns
    -------
    Report

    Raises
    ------
    StoreError
        If it is not a campaign file that this version can read.
    """
    path = Path(path)
    report = Report(str(path))
    try:
        job = job_of(path)
        report.solver = job.settings.solver
        for problem in layout_problems(path, job):
            report.add(problem)
        if not report.sound:
            return report
        report.packed = is_packed(path)
        blocks = Blocks(path, job)
    except DamagedError as error:
        report.add(str(error).removeprefix(f"{path}: "))
        return report
    try:
        valid = _check_blocks(blocks, report)
        for run, rows in _choose(blocks, valid, samples, np.random.default_rng(seed)):
            again = compute_again(job, *run, *rows)
            report.sample.append(again)
            if again.problem:
                report.add(
                    f"{_place(job, run[0], run[1])}, A = {again.amplitude:.6g}: {again.problem}"
                )
    finally:
        blocks.close()
    return report


def _place(job: Job, direction: int, frame: int) -> str:
    return f"frame {frame} (Omega = {job.omega[frame]:.6g}), {job.directions[direction]}"


def _check_blocks(blocks: Blocks, report: Report) -> list[tuple[int, int, int]]:
    """Verify every committed block; return the places of the sound ones."""
    job, valid = blocks.job, []
    time_left = LOCATING_SECONDS
    for frame in range(job.omega.size):
        start = job.initial_state
        for direction, block in path_blocks(job):
            report.blocks += 1
            low, high = blocks.rows(direction, block)
            last = -1 if direction == 0 else 0
            try:
                rows = blocks.read(direction, frame, block)
            except DamagedError as error:
                report.add(f"{_place(job, direction, frame)}, block {block}: {error}")
                rows = {"final_state": np.full((high - low, job.initial_state.size), math.nan)}
                start = rows["final_state"][last]
                continue
            stored = blocks.committed(direction, frame, block)
            if stored:
                report.committed += 1
                if stored == blocks.checksum(direction, frame, block, start, rows):
                    valid.append((direction, frame, block))
                else:
                    begun = time.monotonic()
                    rows = _describe_damage(
                        blocks, direction, frame, block, start, rows, report, begun + time_left
                    )
                    time_left -= time.monotonic() - begun
                for row, problem in broken_promises(job, job.amplitude[low:high], rows):
                    report.add(
                        f"{_place(job, direction, frame)}, A = {job.amplitude[low + row]:.6g}: "
                        f"{problem}"
                    )
            start = np.array(rows["final_state"][last])
    return valid


def _describe_damage(blocks, direction, frame, block, start, rows, report, deadline) -> dict:
    """Say which bytes of a damaged block are wrong; return its true rows if they are known."""
    job = blocks.job
    low, high = blocks.rows(direction, block)
    what = (
        f"{_place(job, direction, frame)}, block {block} (A = {job.amplitude[low]:.6g} to "
        f"{job.amplitude[high - 1]:.6g}): checksum does not hold"
    )
    true = _compute_block(job, direction, frame, low, high, start, deadline)
    stored = blocks.committed(direction, frame, block)
    if true is None or blocks.checksum(direction, frame, block, start, true) != stored:
        if true is not None and all(_same(true[name], rows[name]) for name in blocks.variables):
            report.add(f"{what}; computed again, all its variables are right: commit is damaged")
            return true
        where = ", ".join(
            f"{name} {first} to {first + size - 1}"
            for name, (first, size) in blocks.places(direction, frame, block).items()
        )
        report.add(
            f"{what}; one or more of its bytes, or the block before"
            + (f" ({where})" if where else "")
        )
        return rows
    places = blocks.places(direction, frame, block)
    for name in blocks.variables:
        wrong = np.flatnonzero(
            np.ascontiguousarray(true[name]).view(np.uint8).ravel()
            != np.ascontiguousarray(rows[name]).view(np.uint8).ravel()
        )
        if wrong.size:
            row = int(wrong[0]) // (rows[name].nbytes // (high - low))
            byte = f", byte {places[name][0] + int(wrong[0])} of the file" if places else ""
            report.add(
                f"{what}; computed again, it does: {wrong.size} damaged byte(s) in {name}, first "
                f"in A = {job.amplitude[low + row]:.6g}{byte}"
            )
    return true


def _same(left: np.ndarray, right: np.ndarray) -> bool:
    return left.tobytes() == right.tobytes()


def _compute_block(job, direction, frame, low, high, start, deadline) -> dict | None:
    """Compute a block as `run` did, rows ascending; None if it takes too long."""

    def poll():
        if time.monotonic() > deadline:
            raise _OutOfTime

    if not np.all(np.isfinite(start)):
        return None
    order = slice(None) if direction == 0 else slice(None, None, -1)
    try:
        result = sweep.sweep_block(
            job.structure,
            float(job.omega[frame]),
            job.amplitude[low:high][order],
            start,
            job.settings,
            poll,
        )
    except _OutOfTime:
        return None
    return {name: np.ascontiguousarray(values[order]) for name, values in result.items()}


def _choose(blocks: Blocks, valid, samples: int, rng):
    """Choose complete runs of valid blocks at random, each at most once.

    Yields
    ------
    run : tuple
        Direction, frame, amplitude (a value).
    rows : tuple
        The run's variables and the state it started from.
    """
    job = blocks.job
    sizes = np.array([np.diff(blocks.rows(d, b))[0] for d, _, b in valid], int)
    total = int(sizes.sum())
    ends = np.cumsum(sizes)
    seen: set[int] = set()
    chosen = 0
    while chosen < samples and len(seen) < min(total, MOST_DRAWS):
        number = int(rng.integers(total))
        if number in seen:
            continue
        seen.add(number)
        which = int(np.searchsorted(ends, number, side="right"))
        direction, frame, block = valid[which]
        row = int(number - (ends[which] - sizes[which]))
        rows = blocks.read(direction, frame, block)
        if rows["outcome"][row] != Outcome.COMPLETE:
            continue
        chosen += 1
        low, _ = blocks.rows(direction, block)
        run = {name: values[row] for name, values in rows.items()}
        amplitude = float(job.amplitude[low + row])
        yield (direction, frame, amplitude), (run, _start_of(blocks, direction, frame, low + row))


def _start_of(blocks: Blocks, direction: int, frame: int, index: int) -> np.ndarray:
    """Read the state a run started from: where the run before it on the path ended."""
    job = blocks.job
    top = job.amplitude.size - 1
    if direction == 0 and index == 0:
        return job.initial_state
    if direction == 0:
        place = (0, frame, index - 1)
    else:
        place = (0, frame, top) if index == top else (1, frame, index + 1)
    return blocks.final_state(*place)
