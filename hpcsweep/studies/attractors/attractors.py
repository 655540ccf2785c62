"""Study of all attractors over forcing amplitude and frequency, with shares of a box of states.

A frame is a path, of ascending amplitudes or along another parameter (`Steps`). At
each place the attractors of the previous one are continued: a point of each is a seed, whose motion
is classified first. Then the starts are classified (`hpcsweep.dynamics.attractors`), and the
attractors are matched to those of the previous place by the distance of their points
(`hpcsweep.dynamics.known`), in the units of the present one: near ones keep their identity, others
get a new one. Seeds do not count for shares; an attractor that only a seed reached has share 0 with
the interval of no hit in all starts.

A place inherits from the previous one its identities, its stored points and the largest identity so
far: variables of the file, so that a path resumes where it was cut. Everything else depends only on
the structure, A, Omega and the job.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors import search
from hpcsweep.studies.attractors.tally import AttractorTally
from hpcsweep.studies.attractors.variables import SLOTS, attractor_variables
from hpcsweep.studies.blocks import Block, Poll, Rows, joined
from hpcsweep.studies.grid import UP, RunGrid
from hpcsweep.studies.invariants import Broken
from hpcsweep.studies.keys import OMEGA, Tables
from hpcsweep.studies.path_grid import ALONG, Followed, PathGrid
from hpcsweep.studies.points import POINTS, PointGrid
from hpcsweep.studies.refinement import REFINE, read_refinement
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import numbered


@dataclass(frozen=True, eq=False)
class AttractorGrid(search.SearchLimits, RunGrid):
    """Attractors of the points of a grid; see `RunGrid`."""

    kind: ClassVar[str] = "attractors"
    summary: ClassVar[str] = (
        "at each amplitude, or place of another path, all attractors that starts of a box reach, "
        "and their shares"
    )
    run_noun: ClassVar[str] = "point"
    words: ClassVar[dict[str, str]] = {UP: "continued up"}
    direction_name: ClassVar[str] = "direction in which attractors are continued"
    keys: ClassVar[Tables] = {"study": (*search.KEYS, POINTS, REFINE), "sweep": (*OMEGA, ALONG)}
    carried: ClassVar[tuple[str, ...]] = ("attractor_id", "n_points", "poincare", "last_id")
    content: ClassVar[str] = "attractors"
    point_dim: ClassVar[str] = "cycle"
    slots: ClassVar[Mapping[str, str]] = SLOTS
    status_variables: ClassVar[tuple[str, ...]] = ("n_attractors", *search.COUNTS)

    @classmethod
    def read(cls, values, followed: Followed | None = None, **common) -> "AttractorGrid":
        """Read starts, box and limits of a job; see `RunGrid.read`."""
        structure, settings = common["structure"], common["settings"]
        if values.get("output.poincare", True) is not True:
            raise values.error("output.poincare", False, "must be true: attractors are continued")
        limits = search.read_search(values, followed.structures if followed else (structure,))
        metrics = frozenset(settings.metrics) | {"poincare", "lyapunov"}
        common["settings"] = replace(settings, metrics=metrics, classify_cycles=None)
        refine = read_refinement(values, common["settings"], common["block_size"], ("number",))
        common |= {"directions": (UP,), **limits}
        if refine is not None or values.has("study.points"):
            if (along := values.get("sweep.along", ALONG.default)) != ALONG.default:
                limit = "goes with neither study.points nor study.refine: their points are no path"
                raise values.error("sweep.along", along, limit)
            return AttractorPoints.of(values, refine=refine, **common)
        return Attractors(**Attractors.read_grid(values, followed), **common)

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:  # type: ignore[override]
        """Component and range of the starts; only those of the first floor where all are equal."""
        n, ranges = self.structure.n_floors, {}
        for kind, first in (("displacement", 0), ("velocity", n)):
            spans = self.box[first : first + n]
            for k in range(1 if len(set(spans)) == 1 else n):
                name = kind if len(set(spans)) == 1 else f"{kind} {k + 1}"
                ranges[name] = (first + k, *spans[k])
        return ranges

    @property
    def starting_states(self) -> np.ndarray:
        """The farthest corner of the box, and the initial state."""
        corner = self.structure.slipped(np.abs(np.array(self.box)).max(axis=1))
        return np.stack((corner, self.initial_state))

    @property
    def polls_per_run(self) -> int:  # type: ignore[override]
        """Return the number of starts of a point."""
        return self.starts

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a point, see `Part.of_run`."""
        return attractor_variables(self.settings, self.structure)

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        return {
            **super().coordinates,
            "attractor": numbered(self.max_attractors, "attractor, by falling share"),
        }

    def runs_of(self, structure: Structure, omega: float) -> Any:
        """Return what finds the attractors of one structure at one frequency."""
        # imported here: reading results needs no kernels
        from hpcsweep.studies.attractors.runs import AttractorRuns

        return AttractorRuns(structure, omega, self.settings, self)

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the attractors of a point, from which the next one starts."""
        points = np.nan_to_num(rows["poincare"][row])
        ids, counts = rows["attractor_id"][row], rows["n_points"][row]
        each = np.column_stack((ids, counts, points.reshape(len(points), -1)))
        return np.concatenate(([float(rows["last_id"][row])], each.ravel()))

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the attractors of a point as motions in which runs ended."""
        return search.attractors_as_runs(self.of_run, run)

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count attractors, and the starts that reached no stored one."""
        good = done & (runs["outcome"] == Outcome.COMPLETE)
        number = runs["n_attractors"][good]
        return {
            "attractors_per_point": float(number.mean()) if number.size else None,
            "points_with_several": int((number > 1).sum()),
            "most_attractors": int(number.max(initial=0)),
            **search.count_starts(done, runs, self.starts),
        }

    def tally(self) -> AttractorTally:
        """Return a tally of points for ``summary``."""
        return AttractorTally(self)

    def relations(self, _block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        from hpcsweep.studies.attractors.invariants import broken_relations

        return broken_relations(self, rows)


@dataclass(frozen=True, eq=False)
class Attractors(PathGrid, AttractorGrid):
    """Attractors along paths, a frame a task."""

    carries: ClassVar[str] = "attractors are continued, and keep their identity,"


@dataclass(frozen=True, eq=False)
class AttractorPoints(PointGrid, AttractorGrid):
    """Attractors of points on their own: of a list, or those of a refined map of their number.

    Nothing is continued from the amplitude before: the seed at every point is the initial state,
    and attractors are numbered at each point anew. So a point depends on the job alone, whichever
    others are computed.
    """

    words: ClassVar[dict[str, str]] = {UP: "each point on its own"}
    grid_fields: ClassVar[tuple[str, ...]] = (*PointGrid.grid_fields, "directions")

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Find the attractors of amplitudes, each from the same state."""
        runs = self.runs_of(self.moving, float(self.omega[frame]))
        amplitudes = self.amplitudes_of(frame)
        return joined([runs.follow(amplitudes[[k]], state, poll) for k in places.tolist()])
