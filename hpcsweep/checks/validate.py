"""Validate a results file: checksums, invariants, and recomputed runs.

Three kinds of evidence, from cheap to costly:

1. the layout and every committed block: its checksum, which covers its start state, so that a
   task's blocks form one path, and the invariants of its numbers (`Study.check`);
2. where a checksum fails, the block is recomputed: if that fits the checksum, the bytes that
   differ are exactly the damaged ones;
3. a random sample of runs is recomputed, also with the other solver (`recompute`).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hpcsweep.job.paths import path_of
from hpcsweep.model import arguments
from hpcsweep.parallel.counted import counted
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import DamagedError, is_packed, layout_problems, read_layout, with_inputs
from hpcsweep.store.commit import Blocks
from hpcsweep.store.inferred import Inferred, is_complete
from hpcsweep.studies.blocks import Block, Place
from hpcsweep.studies.refine.audit import AUDIT, CROSSED, INFERRED
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.study import RunAgain, Study

LISTED = 20
"""Problems that are described one by one; the rest is counted."""
MAX_DRAWS = 10_000
"""Runs drawn in search of complete ones."""


@dataclass
class Findings:
    """Findings of a validation; `sound` is the verdict.

    Attributes
    ----------
    blocks, committed : int
        Blocks of the job, and those that have a checksum; the others are not computed yet.
    complete : bool
        Whether the file holds all of its job; see `hpcsweep.store.inferred.is_complete`.
    problems : list of str
        At most `LISTED`; `n_problems` counts all.
    means_other_runs : bool
        Whether the job of an earlier version does to this one, which then computes none again.
    sample : list of RunAgain
    """

    file: str
    packed: bool = False
    solver: str = ""
    blocks: int = 0
    committed: int = 0
    complete: bool = False
    n_problems: int = 0
    problems: list[str] = field(default_factory=list)
    means_other_runs: bool = False
    sample: list[RunAgain] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Whether no problem was found in the file."""
        return self.n_problems == 0

    def add(self, problem: str) -> None:
        """Count a problem, and list it if it is among the first."""
        self.n_problems += 1
        if len(self.problems) < LISTED:
            self.problems.append(problem)


def validate(path: str | Path, samples: int = 20, seed: int = 0) -> Findings:
    """Validate a results file, live or not, without disturbing its writers.

    Parameters
    ----------
    path : str or Path
    samples : int
        Number of runs to recompute; 0 for none.
    seed : int
        Seed of the choice of these runs.

    Returns
    -------
    Report

    Raises
    ------
    StoreError
        If it is not a campaign file that this version can read.
    """
    path = path_of("path", path)
    samples, seed = arguments.count("samples", samples), arguments.count("seed", seed)
    report = Findings(str(path))
    try:
        layout = read_layout(path)
        layout.study = study = with_inputs(layout.job).study
        report.solver = study.settings.solver
        for problem in layout_problems(path, layout):
            report.add(problem)
        if not report.sound:
            return report
        report.packed = is_packed(path)
        blocks = Blocks(path, layout)
    except DamagedError as error:
        report.add(error.problem)
        return report
    with blocks:
        valid = _Checker(blocks, report).check()
        report.complete = is_complete(blocks)
        for frame, problem in inferred_problems(blocks) if layout.derived else ():
            report.add(f"{_place(study, study.block((*frame, 0)))}: {problem}")
        report.means_other_runs = layout.fingerprint != layout.job.fingerprint
        samples *= not report.means_other_runs
        chosen = _choose(blocks, valid, samples, np.random.default_rng(seed))
        for block, row, rows in counted(chosen, samples, "computing again run"):
            run = {name: values[row] for name, values in rows.items()}
            again = study.run_again(block, row, run, blocks.start_of(block, row))
            report.sample.append(again)
            if again.problem:
                where = f"{_place(study, block)}, {_along(study, block, row)}"
                report.add(f"{where}: {again.problem}")
    return report


def _place(study: Study, block: Block) -> str:
    """Return the frame and the direction of a block, or its record, in words."""
    described = study.describe(block.first)
    del described[study.run_dims[-1]]
    if "direction" not in study.run_dims:
        return run_name(described)
    frame = block.first[study.run_dims.index("direction") + 1]
    where = "".join(f"{axis.name} = {described[axis.name]}, " for axis in study.axes)
    name = "amplitude" if study.run_dims[-2] == "amplitude" else "omega"
    value = f" ({run_name({name: described[name]})})" if name in described else ""
    return f"{where}frame {frame}{value}, {described['direction']}"


def _along(study: Study, block: Block, row: int) -> str:
    """Return a row of a block in words, along the last axis of the runs."""
    last = study.run_dims[-1]
    return run_name({last: study.describe(block.run(row))[last]})


class _Checker:
    """Checker of the committed blocks of a file."""

    def __init__(self, blocks: Blocks, report: Findings):
        self._blocks, self._report = blocks, report
        self._study = blocks.study

    def check(self) -> list[Block]:
        """Verify every committed block; return the sound ones."""
        valid: list[Block] = []
        self._report.blocks = math.prod(self._blocks.layout.shape(self._blocks.layout.commit))
        for task in self._blocks.begun():
            start = self._study.initial_state
            for block in self._study.path(task):
                rows, good = self._check_block(block, start)
                if good:
                    valid.append(block)
                start = np.full_like(start, np.nan)
                if rows:
                    start = np.array(self._study.end_state(rows, block.end))
        return valid

    def _check_block(self, block: Block, start: np.ndarray) -> tuple[dict, bool]:
        """Verify a block; return its rows, the true ones where they are known."""
        place = _place(self._study, block)
        try:
            rows = self._blocks.read(block)
        except DamagedError as error:
            self._report.add(f"{place}, block {block.place[-1]}: {error}")
            return {}, False
        stored = self._blocks.committed(block)
        if not stored:
            return rows, False
        self._report.committed += 1
        good = stored == self._blocks.checksum(block, start, rows)
        if not good:
            rows = self._describe_damage(block, start, rows)
        for row, problem in self._study.check(block, rows):
            self._report.add(f"{place}, {_along(self._study, block, row)}: {problem}")
        return rows, good

    def _describe_damage(self, block: Block, start: np.ndarray, rows: dict) -> dict:
        """Report the wrong bytes of a damaged block; return its true rows if they are known."""
        blocks, report = self._blocks, self._report
        first, last = (_along(self._study, block, k) for k in (0, block.n_runs - 1))
        what = (
            f"{_place(self._study, block)}, block {block.place[-1]} ({first} "
            f"to {last.rpartition(' ')[2]}): checksum does not hold"
        )
        # no more than can be listed, which may take long
        locate = report.n_problems < LISTED and np.isfinite(start).all()
        locate &= blocks.layout.is_own
        true = self._study.compute(block, start) if locate else None
        places = blocks.places(block)
        if true is None or blocks.checksum(block, start, true) != blocks.committed(block):
            if true is not None and all(
                true[name].tobytes() == rows[name].tobytes() for name in blocks.variables
            ):
                report.add(
                    f"{what}; computed again, all its variables are right: commit is damaged"
                )
                return true
            report.add(f"{what}; one or more of its bytes, or the block before")
            return rows
        for name in blocks.variables:
            wrong = np.flatnonzero(_raw(true[name]) != _raw(rows[name]))
            if wrong.size:
                row = int(wrong[0]) // (rows[name].nbytes // block.n_runs)
                byte = f", byte {places[name][0] + int(wrong[0])} of the file" if places else ""
                report.add(
                    f"{what}; computed again, it does: {wrong.size} damaged byte(s) in {name}, "
                    f"first in {_along(self._study, block, row)}{byte}"
                )
        return true


def _raw(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values).view(np.uint8).ravel()


def _choose(
    blocks: Blocks, valid: list[Block], samples: int, rng
) -> Iterator[tuple[Block, int, dict[str, np.ndarray]]]:
    """Choose complete runs of valid blocks at random, each at most once.

    Yields
    ------
    block : Block
    row : int
    rows : dict of str to ndarray
        Of the block.
    """
    ends = np.cumsum([block.n_runs for block in valid], dtype=int)
    total = int(ends[-1]) if valid else 0
    chosen = 0
    for number in rng.choice(total, min(total, MAX_DRAWS), replace=False).tolist():
        if chosen == samples:
            return
        block = valid[which := int(np.searchsorted(ends, number, side="right"))]
        row = number - (int(ends[which]) - block.n_runs)
        rows = blocks.read(block)
        if rows["outcome"][row] == Outcome.COMPLETE:
            chosen += 1
            yield block, row, rows


def inferred_problems(blocks: Blocks) -> list[tuple[Place, str]]:
    """Walk the rounds of a map again, from its committed points, and compare what is inferred.

    Parameters
    ----------
    blocks : Blocks
        Of a refined map.

    Returns
    -------
    list of (tuple of int, str)
        Place of a frame and what is wrong there. Nothing of a map that is not complete yet.
    """
    inferred, growth = Inferred(blocks), blocks.layout.growth
    assert growth is not None
    stored = np.array([blocks.read_rows(INFERRED, place, 1)[0] for place in inferred.places])
    if not stored.any():
        return []
    unknown = inferred.unknown()
    if unknown:
        return [(place, "what is inferred: its checksum does not hold") for place in unknown]
    boxes = None
    if growth.refinement.curves:
        frames = [inferred.frame(place) or {} for place in inferred.places]
        stored = np.array([rows[CROSSED] for rows in frames]).reshape(growth.shape)
        boxes = stored[(slice(-1),) * stored.ndim] != 0
    rounds = growth.begin(boxes)
    for place in inferred.places:
        rounds.labels.store(*inferred.labels(place))
    if rounds.next() is not None:
        return [(inferred.places[0], "points that the map was refined by are not committed")]
    values, audit = growth.values(rounds), inferred.audit()
    if not np.array_equal(values[AUDIT], audit, equal_nan=True):
        return [(inferred.places[0], "the audit is not that of the computed points")]
    problems = []
    for k, place in enumerate(inferred.places):
        rows = inferred.frame(place, audit) or {}
        for name, row in rows.items():
            expected = values[name].reshape(-1, *row.shape)[k]
            if expected.astype(row.dtype).tobytes() != row.tobytes():
                problems.append((place, f"{name} does not follow from the computed points"))
    return problems
