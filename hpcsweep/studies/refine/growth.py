"""How a refined map grows: what campaigns and files, which know no maps, ask of one.

The points of a map are counted through ``commit``, where each is a block. Besides its runs it has
variables of its own: the source of each point's value, inferred values, the audit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.part import Part
from hpcsweep.studies.refine.audit import (
    AUDIT,
    CELL,
    CROSSED,
    INFERRED,
    MAX_LOOKS,
    SOURCE,
    Crossed,
    Look,
    inferred_name,
)
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.crossing import KnownCurve, crossed_boxes
from hpcsweep.studies.refine.rounds import RefinementRounds, n_least
from hpcsweep.studies.refinement import Refinement, Source
from hpcsweep.studies.study import ROWS, Study, as_kind
from hpcsweep.studies.variable import Coordinate, Variable, code
from hpcsweep.studies.variables import named, numbered

AT_ONCE = 64
"""Points of a task, at most; where a point takes long one is."""


@dataclass(frozen=True)
class MapGrowth:
    """Growth of a study's map, round by round.

    Attributes
    ----------
    study : Study
        The whole: with the axes of its job.
    refinement : Refinement
    """

    study: Study
    refinement: Refinement

    def problem(self) -> str:
        """Return why the points of the map have no neighbours and cannot be refined, or ''."""
        varied = self.study.axes
        if varied and "attractor" in self.refinement.on:
            key = f"vary.{varied[0].key}"
            return f"study.refine: does not go with {key}: each slice numbers its attractors anew"
        axes: dict = {f"vary.{axis.key}": axis.values for axis in varied} | self.study.map_axes
        for key, values in axes.items():
            numbers = np.asarray(values)
            finite = numbers.dtype.kind in "if" and bool(np.isfinite(numbers).all())
            finite &= key != f"vary.{ROWS}"  # structures of no order
            if not finite or numbers.size < 2 or np.any(np.diff(numbers) <= 0):
                return f"study.refine: {key} must have two finite numbers or more, which ascend"
        return ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points of every axis: varied keys, frames, runs of a frame."""
        sizes = self.study.dimensions
        return tuple(sizes[dim] for dim in self.study.run_dims if dim != "direction")

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Dimensions of refined maps alone."""
        return {
            "look": numbered(MAX_LOOKS, "look of the audit", first=1),
            "quantity": named(Look._fields, "what a look tells"),
        }

    @property
    def variables(self) -> list[Variable]:
        """Variables besides those of the runs, checksums last."""
        runs, study = self.study.run_dims, self.study
        meaning = "1 computed, 2 inferred from its cell, 3 computed for the audit, 0 not known yet"
        level = "level of the cell from which it is inferred, negative if its points differ, "
        crossed = "1 where a known curve crosses the box of the grid that begins at the point"
        derived = [
            code(SOURCE, runs, Source, meaning),
            Variable(CELL, runs, "<i1", "1", level + "0 of computed points"),
        ]
        if self.refinement.curves:
            derived.append(code(CROSSED, runs, Crossed, crossed))
        computed = {variable.name: variable for variable in study.variables}
        for name in self.refinement.variables:
            words = f"{name} of inferred points, 0 of others"
            label = replace(computed[name], name=inferred_name(name), dims=runs, long_name=words)
            derived.append(label)
        return [
            *derived,
            *getattr(study, "listed_variables", []),
            Variable(
                AUDIT, ("look", "quantity"), "<f8", "1", "looks of the audit, the last counts"
            ),
            Variable(INFERRED, runs[:-1], "<u8", "1", "checksum of what is inferred of a frame"),
        ]

    @property
    def at_once(self) -> int:
        """Most runs of a task."""
        solver = SOLVERS[self.study.settings.solver]
        return AT_ONCE if solver.follows_orbits and self.study.polls_per_run == 1 else 1

    def compute(self, blocks: Sequence[Block], state: np.ndarray, poll: Poll) -> list[Rows]:
        """Compute points of a frame, each a block, from a state."""
        parts = [self.study.part_of(block) for block in blocks]
        part, (_, frame, _) = as_kind(parts[0][0], Part), parts[0][1].first
        places = np.array([inner.first[-1] for _, inner in parts])
        runs = part.runs_at(frame, places, state, poll)
        return [{name: rows[k : k + 1] for name, rows in runs.items()} for k in range(len(blocks))]

    def crossed(self, curves: Iterable[KnownCurve]) -> np.ndarray:
        """Return which boxes of the map curves cross; see `crossed_boxes`."""
        return crossed_boxes(self.shape, [*self.study.map_axes.values()], curves)

    def begin(self, crossed: np.ndarray | None) -> RefinementRounds:
        """Return the rounds of a map whose boxes `crossed` known curves cross."""
        return RefinementRounds(self.shape, self.refinement, Labels(self.study.n_runs), crossed)

    def values(self, rounds: RefinementRounds) -> Rows:
        """Return the `variables` of a complete map, without the checksums.

        Returns
        -------
        dict of str to ndarray
            Of shape (n_points,), the audit as in the file; what the study lists for each frame, the
            same for all of them, of shape (n_frames, ...).
        """
        level, code = rounds.inferred()
        labels = rounds.labels
        values = {SOURCE: np.where(level != 0, np.int8(Source.INFERRED), rounds.source)}
        values[CELL] = level
        codes = np.zeros((len(labels.codes) + 1, 1 + len(self.refinement.variables)), np.uint64)
        codes[1:] = labels.codes
        for column, name in enumerate(self.refinement.variables, 1):
            values[inferred_name(name)] = codes[code, column]
        if rounds.crossed is not None:
            values[CROSSED] = np.pad(rounds.crossed, [(0, 1)] * rounds.crossed.ndim).ravel()
        audit = np.full((MAX_LOOKS, len(Look._fields)), np.nan)
        audit[: len(rounds.looks)] = rounds.looks
        listed: Rows = getattr(self.study, "listed_values", dict)()
        n = self.study.n_frames
        values |= {name: np.broadcast_to(v, (n, *v.shape)) for name, v in listed.items()}
        return {**values, AUDIT: audit}

    def describe(self, crossed: np.ndarray | None) -> tuple[int, tuple[str, str]]:
        """Return how many points of the map are computed at least, and a row that tells it."""
        least = n_least(self.shape, self.refinement, crossed)
        curves = ", those that curves cross" if self.refinement.curves else ""
        return least, (
            "refined",
            f"the coarsest cells{curves} and the first draw of the audit are {least} points "
            f"({100 * least / self.study.n_runs:.2g} %), the least; all points are the most",
        )
