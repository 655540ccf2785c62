"""Study of responses to ground-motion records: records x scales, each run from rest.

A task is a record; a block holds some of its scales. With several structures (``[vary]``) a task is
a record of one of them. No run depends on another (`responses`).

A stored response is computed again plainly, without the rules that spare work: the whole response
of the structure as the job gives it, at the scale of the run. How far two ways may differ is
measured: by how much the peaks change where the scale changes a little, over that change. The
record may not be at hand where a file is examined; then nothing is compared.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Block, Poll, Rows, Timed
from hpcsweep.studies.ground_motion import describe, keys, scales, variables
from hpcsweep.studies.ground_motion.keys import RecordGrid
from hpcsweep.studies.ground_motion.responses import KEPT, SKIP_RULES, respond
from hpcsweep.studies.invariants import Broken
from hpcsweep.studies.keys import Tables
from hpcsweep.studies.recompute import is_equal
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.study import RunAgain
from hpcsweep.studies.variable import Coordinate, Variable, real
from hpcsweep.studies.variables import named, numbered, states, storey_heights

AT_MOST = 1.0 + 1e-9
"""Relative size that exceeds another by rounding."""
NUDGE = 1e-9
"""Relative change of the scale by which the conditioning of a response is measured."""
ROUNDING = 1e-12
"""Relative difference of two ways where the conditioning is 1."""
COMPARED = ("length", "acceleration", "force", "impulse")
"""Quantities of the peaks that are compared."""
TOGETHER = {"residual_drift": "storey_drift", "residual": "displacement"}
"""Peaks that are compared with the size of another: where a storey does not yield, or a motion has
decayed, they are 0, to rounding of that."""


@dataclass(frozen=True, eq=False)
class Records(RecordGrid):
    """Records at scales, a record a task; see `RecordGrid` and `hpcsweep.studies.study.Study`."""

    kind: ClassVar[str] = "records"
    summary: ClassVar[str] = "responses to ground-motion records, each at several scales, from rest"
    keys: ClassVar[Tables] = {"records": keys.KEYS, "output": keys.OUTPUT}
    without: ClassVar[tuple[str, ...]] = ("sweep", "forcing", "output")
    skip_rules: ClassVar[tuple[str, ...]] = SKIP_RULES
    default_block: ClassVar[int] = 25
    run_dims: ClassVar[tuple[str, ...]] = variables.RUN
    by_frame: ClassVar[bool] = True
    directions: ClassVar[tuple[str, ...]] = ()  # type: ignore[misc]
    content: ClassVar[str] = "responses"
    status_variables: ClassVar[tuple[str, ...]] = ("skip_rule",)
    starts_at_rest: ClassVar[bool] = True
    recurs: ClassVar[bool] = False
    lines, warnings = describe.lines, describe.warnings

    @classmethod
    def read(cls, values, **common) -> "Records":
        """Read records and scales; see `RunGrid.read`."""
        structure, settings = common["structure"], common["settings"]
        if not structure.force_per_length.any():
            structure = common["structure"] = structure.without_contacts()
        if settings.solver != "flow":
            raise values.error("solver.method", settings.solver, "must be 'flow' for records")
        groups = [key for key in keys.OUTPUT if key.name in variables.GROUPS]
        default = {key.name: key.default for key in groups}
        default["base_shear"] = not LINEAR.of(structure)
        flags = {name: values.get(f"output.{name}", flag) for name, flag in default.items()}
        wanted = frozenset(name for name in flags if values.flag(f"output.{name}", flags[name]))
        common["settings"] = replace(settings, metrics=wanted)
        measure, scale = scales.read_scale(values)
        suite, paths = keys.read_found(values, structure)
        tail = keys.read_tail(values, suite, structure)
        names = [facts.name for facts in suite]
        made = cls(
            suite=suite,
            source=keys.read_source(values, paths),
            measure=measure,
            scale=scale,
            tail=tail,
            storey_height=structure.names.storey_heights,
            gravity=scales.read_gravity(values),
            history=keys.read_history(values, suite, tail),
            floors=variables.read_floor_spectra(values, suite, structure),
            columns=tuple(scales.read_columns(values, names)),
            **common,
        )
        given = [variable for variable, _ in made.given]
        held = [*made.dimensions, *(each.name for each in [*given, *made.variables])]
        for name, _ in made.columns:
            if held.count(name) > 1:
                raise values.error("records.columns", name, "is a name of something else in a file")
        return made

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some records; none where all share their instants."""
        numbers = tuple(range(self.n_frames)[frames])
        if self.history:
            return {}
        columns = tuple((name, column[frames]) for name, column in self.columns)
        return {"suite": self.suite[frames], "numbers": numbers, "columns": columns}

    @property
    def n_frames(self) -> int:
        """Records."""
        return len(self.suite)

    @property
    def n_along(self) -> int:
        """Scales."""
        return self.scale.size

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a run, see `Part.of_run`."""
        asked = self.history > 0.0, bool(self.floors.periods)
        return variables.response_variables(self.structure, self.settings, *asked)

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        return {
            **variables.place_coordinates(self.structure, self.settings),
            "record": named([facts.name for facts in self.suite], "ground-motion record"),
            "scale": Coordinate(self.scale.astype("<f8"), self.measure.quantity, str(self.measure)),
            "state": states(self.structure, 2 * self.structure.n_floors),
            "block": numbered(self.n_blocks, "block of scales"),
            **self.instants,
            **self.floors.dimensions,
        }

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        facts = [
            (variable, np.array([getattr(facts, variable.name) for facts in self.suite]))
            for variable in variables.FACTS
        ]
        facts += [
            (real(name, ("record",), "1", "as records.columns has it", None), np.array(column))
            for name, column in self.columns
        ]
        return [*facts, (variables.FACTOR, self.factor), *storey_heights(self.structure)]

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute the runs of a record at some of its scales."""
        return self.responses.rows(self.record(frame), self.factor[frame, places], poll)

    def relations(self, _block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        complete, skip_rule = rows["outcome"] == Outcome.COMPLETE, rows["skip_rule"]
        linear = skip_rule == SkipRule.LINEAR
        end = np.abs(rows["final_state"][:, : rows["displacement"].shape[1]])
        within = (end <= rows["displacement"] * AT_MOST).all(axis=1)
        touched = (rows["impacts"] > 0).any(axis=1) if "impacts" in rows else np.array(False)
        fallen = np.isfinite(rows.get("collapse_time", np.full(linear.shape, np.nan)))
        return {
            "skip_rule is none or linear": ~np.isin(skip_rule, (SkipRule.NONE, SkipRule.LINEAR)),
            "a linear run is complete": linear & ~complete,
            "a linear run has no impacts": linear & touched,
            "a run has a time of its collapse": fallen != (rows.get("collapsed", fallen) > 0),
            "a linear run has not collapsed": linear & fallen,
            "the last displacement is at most the largest": complete & ~within,
        }

    def run_again(self, block: Block, row: int, run: dict, start: np.ndarray) -> RunAgain:
        """Compute a complete stored response again, plainly; see the module."""
        return response_again(self, block, row, run)

    def time_runs(self, share: float, along: float, n_runs: int, poll: Poll = None) -> Timed:
        """Time a few runs of a record, with their share of what all of its runs begin with."""
        record = int(share * len(self.suite))
        at = int(along * (max(self.scale.size - n_runs, 0) + 1))
        factors = self.factor[record, at : at + n_runs]
        samples = self.record(record)
        KEPT.clear()  # nothing is spared by earlier samples
        times = [time.perf_counter()]
        for compute in (self.responses.prepare, self.responses.free):
            compute(samples)
            times.append(time.perf_counter())
        self.responses.rows(samples, factors, poll)
        tables, free, seconds = np.diff([*times, time.perf_counter()]).tolist()
        seconds += factors.size / self.n_along * (free + tables / self.n_frames)
        return (record, (at + 0.5 * factors.size) / self.scale.size), factors.size, seconds

    def describe_task(self, task: int) -> str:
        """Describe a task by its record."""
        return self.suite[task].name

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return nothing: a response does not repeat."""
        return []

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count the runs spared by the rule ``linear``."""
        linear = done & (runs["skip_rule"] == SkipRule.LINEAR)
        return {"runs_below_contact": int(linear.sum())}

    def tally(self) -> describe.ResponseTally:
        """Return a tally of runs for ``summary``."""
        return describe.ResponseTally(self)

    def kernels(self, n_ranks: float | None = None) -> list[Any]:
        """Return the kernels that its runs call."""
        from hpcsweep.solvers.flow.record_map import kernels_of

        return kernels_of(self.structure, "energy" in self.settings.metrics)


def response_again(study: RecordGrid, block: Block, row: int, run: Rows) -> RunAgain:
    """Compute one complete response again.

    Parameters
    ----------
    study : RecordGrid
    block : Block
    row : int
        Of the block.
    run : dict of str to ndarray
        The run's variables.
    """
    record, at = block.run(row)
    factor = float(study.factor[record, at])
    again = RunAgain(at=run_name(study.describe((record, at))), solver=study.settings.solver)
    try:
        samples = study.record(record)
    except ValueError as error:
        again.compared = f"nothing: the record is not at hand: {error}"
        return again
    structure, tail = study.structure, study.tail
    peaks, _ = variables.peaks_of(structure, study.settings)
    kinds: dict[str, list[Variable]] = {}
    for peak in peaks:
        if peak.units in COMPARED:
            kinds.setdefault(TOGETHER.get(peak.name, peak.name), []).append(peak)

    def by_kind(values: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        return [np.concatenate([values[peak.name] for peak in kind]) for kind in kinds.values()]

    computed: list[list[np.ndarray]] = []
    for scale in (factor, factor * (1.0 + NUDGE)):
        response = respond(structure, samples, scale, tail, study.settings)
        if response.outcome is not Outcome.COMPLETE:
            again.problem = f"computed again it ends with {response.outcome.name}"
            return again
        computed.append(by_kind({peak.name: peak.of(response) for peak in peaks}))
    again.compared = "peaks, computed plainly"
    again.difference = _apart(by_kind(run), computed[0])
    again.allowed = ROUNDING * max(_apart(*computed) / NUDGE, 1.0)
    if not again.difference <= again.allowed:
        again.problem = (
            f"computed plainly its peaks differ by {again.difference:.2g} of the largest, allowed "
            f"are {again.allowed:.2g}"
        )
    result = study.compute_run(block, row, study.initial_state)
    again.whole_run = "equal" if is_equal(run, result) else "same" if not again.problem else "other"
    return again


def _apart(left: list[np.ndarray], right: list[np.ndarray]) -> float:
    """Return the largest difference of two sets of peaks, each over the largest of its kind."""
    worst = 0.0
    for a, b in zip(left, right, strict=True):
        size = max(float(np.abs(b).max(initial=0.0)), float(np.abs(a).max(initial=0.0)))
        far = float(np.abs(a - b).max(initial=0.0))
        worst = max(worst, far / size if size > 0 else 0.0)
    return worst if math.isfinite(worst) else math.inf
