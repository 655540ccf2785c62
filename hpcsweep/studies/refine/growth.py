"""How a refined map grows: what campaigns and files, which know no maps, ask of one.

The points of a map are counted through ``commit``, where each is a block. Besides its runs it has
variables of its own: the source of each point's value, inferred values, the audit.

A known curve is a polyline over the last two axes of the grid, at one index of each axis before. A
box lies between neighbouring points of every axis. The lines of the grid cut a piece of a polyline
in parts, each inside one box, which that of its middle tells. Boxes are closed: a part along a line
of the grid lies in the boxes on both sides, and an index of the axes before in those below and
above.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.part import Part
from hpcsweep.studies.refine import audit
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.rounds import RefinementRounds, n_least
from hpcsweep.studies.refinement import Refinement, Source
from hpcsweep.studies.study import ROWS, Study, as_kind
from hpcsweep.studies.variable import Coordinate, Variable, code
from hpcsweep.studies.variables import named, numbered

AT_ONCE = 64
"""Points of a task, at most; where a point takes long one is."""


class KnownCurve(NamedTuple):
    """A known curve.

    Attributes
    ----------
    at : tuple of int
        Index of each axis before the last two.
    points : ndarray, shape (k, 2)
        Its polyline, values of the last two axes.
    """

    at: tuple[int, ...]
    points: np.ndarray


def crossed_boxes(
    shape: tuple[int, ...], axes: Sequence[np.ndarray], curves: Iterable[KnownCurve]
) -> np.ndarray:
    """Return which boxes of a grid are crossed, one fewer along each axis than points.

    Parameters
    ----------
    shape : tuple of int
        Number of points of every axis.
    axes : sequence of ndarray
        Ascending values of the last two axes.
    curves : iterable of Curve
    """
    crossed = np.zeros([n - 1 for n in shape], bool)
    for curve in curves:
        before: list[list[int]] = [
            [box for box in (index - 1, index) if 0 <= box < n - 1]
            for index, n in zip(curve.at, shape, strict=False)
        ]
        inner = _boxes(axes, _middles(axes, curve.points))
        for outer in product(*before):
            crossed[outer][inner] = True
    return crossed


def _middles(axes: Sequence[np.ndarray], line: np.ndarray) -> np.ndarray:
    """Return the middle of every part of a polyline, shape (m, 2)."""
    middles = [line[:1]]
    for start, end in pairwise(line):
        cuts = [np.array([0.0, 1.0])]
        for axis, first, last in zip(axes, start, end, strict=True):
            between = axis[(axis > min(first, last)) & (axis < max(first, last))]
            if between.size:
                cuts.append((between - first) / (last - first))
        share = np.unique(np.concatenate(cuts))
        middles.append(start + 0.5 * (share[:-1] + share[1:])[:, None] * (end - start))
    return np.concatenate(middles)


def _boxes(axes: Sequence[np.ndarray], points: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the indices of the boxes in which points lie, as many arrays as axes."""
    pairs = list(zip(axes, points.T, strict=True))
    below, above = (
        np.stack([np.searchsorted(axis, x, side) - 1 for axis, x in pairs], axis=1)
        for side in ("left", "right")
    )
    corners = [np.stack(at, axis=1) for at in product(*zip(below.T, above.T, strict=True))]
    boxes = np.unique(np.concatenate(corners), axis=0)
    last = [axis.size - 2 for axis in axes]
    return tuple(boxes[np.all((boxes >= 0) & (boxes <= last), axis=1)].T)


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
            "look": numbered(audit.MAX_LOOKS, "look of the audit", first=1),
            "quantity": named(audit.Look._fields, "what a look tells"),
        }

    @property
    def variables(self) -> list[Variable]:
        """Variables besides those of the runs, checksums last."""
        runs, study = self.study.run_dims, self.study
        meaning = "1 computed, 2 inferred from its cell, 3 computed for the audit, 0 not known yet"
        level = "level of the cell from which it is inferred, negative if its points differ, "
        crossed = "1 where a known curve crosses the box of the grid that begins at the point"
        derived = [
            code(audit.SOURCE, runs, Source, meaning),
            Variable(audit.CELL, runs, "<i1", "1", level + "0 of computed points"),
        ]
        if self.refinement.curves:
            derived.append(code(audit.CROSSED, runs, audit.Crossed, crossed))
        computed = {variable.name: variable for variable in study.variables}
        for name in self.refinement.variables:
            words = f"{name} of inferred points, 0 of others"
            label = replace(
                computed[name], name=audit.inferred_name(name), dims=runs, long_name=words
            )
            derived.append(label)
        return [
            *derived,
            *getattr(study, "listed_variables", []),
            Variable(
                audit.AUDIT, ("look", "quantity"), "<f8", "1", "looks of the audit, the last counts"
            ),
            Variable(
                audit.INFERRED, runs[:-1], "<u8", "1", "checksum of what is inferred of a frame"
            ),
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
        values = {audit.SOURCE: np.where(level != 0, np.int8(Source.INFERRED), rounds.source)}
        values[audit.CELL] = level
        codes = np.zeros((len(labels.codes) + 1, 1 + len(self.refinement.variables)), np.uint64)
        codes[1:] = labels.codes
        for column, name in enumerate(self.refinement.variables, 1):
            values[audit.inferred_name(name)] = codes[code, column]
        if rounds.crossed is not None:
            values[audit.CROSSED] = np.pad(rounds.crossed, [(0, 1)] * rounds.crossed.ndim).ravel()
        looks = np.full((audit.MAX_LOOKS, len(audit.Look._fields)), np.nan)
        looks[: len(rounds.looks)] = rounds.looks
        listed: Rows = getattr(self.study, "listed_values", dict)()
        n = self.study.n_frames
        values |= {name: np.broadcast_to(v, (n, *v.shape)) for name, v in listed.items()}
        return {**values, audit.AUDIT: looks}

    def describe(self, crossed: np.ndarray | None) -> tuple[int, tuple[str, str]]:
        """Return how many points of the map are computed at least, and a row that tells it."""
        least = n_least(self.shape, self.refinement, crossed)
        curves = ", those that curves cross" if self.refinement.curves else ""
        return least, (
            "refined",
            f"the coarsest cells{curves} and the first draw of the audit are {least} points "
            f"({100 * least / self.study.n_runs:.2g} %), the least; all points are the most",
        )
