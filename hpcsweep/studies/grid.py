"""Base of studies over direction, frame (forcing frequency) and forcing amplitude.

Runs are independent, each block a task of its own, or form paths (`hpcsweep.studies.path_grid`).
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies import variables
from hpcsweep.studies.blocks import Block, Place, Poll, Rows, Say, Timed
from hpcsweep.studies.invariants import Broken, broken_relations
from hpcsweep.studies.part import Part
from hpcsweep.studies.recompute import compute_again
from hpcsweep.studies.report import MAX_FRAMES, Driven, doubts, ranges, starting_range
from hpcsweep.studies.settings import SKIP_RULES, SweepSettings
from hpcsweep.studies.study import Lines, RunAgain
from hpcsweep.studies.tally import RunTally
from hpcsweep.studies.variable import Coordinate, Variable

UP, DOWN = "up", "down"


@dataclass(frozen=True, eq=False)
class RunGrid(Part):
    """Runs over direction, frame and amplitude; see `hpcsweep.studies.study.Study`.

    Attributes
    ----------
    structure : Structure
    omega : ndarray, shape (n_frames,)
        Forcing frequency of each frame.
    amplitude : ndarray, shape (n_along,)
        Ascending.
    initial_state : ndarray, shape (2n,)
        State from which the first run of every task starts.
    settings : SweepSettings
    block_size : int
        Amplitudes that are committed to the file together.
    directions : tuple of str
        Values of the first dimension of a run.
    """

    structure: Structure
    omega: np.ndarray
    amplitude: np.ndarray
    initial_state: np.ndarray
    settings: SweepSettings
    block_size: int
    directions: tuple[str, ...]

    words: ClassVar[dict[str, str]]  # each direction in words
    direction_name: ClassVar[str]
    """Long name of the first dimension."""
    skip_rules: ClassVar[tuple[str, ...]] = SKIP_RULES
    run_dims: ClassVar[tuple[str, ...]] = variables.RUN
    always: ClassVar[frozenset[str]] = frozenset()  # metrics that its runs compute unasked
    content: ClassVar[str] = "motions"
    point_dim: ClassVar[str] = "point"
    """Dimension of the stroboscopic points."""
    status_variables: ClassVar[tuple[str, ...]] = ("orbit_period", "skip_rule")

    path_steps: ClassVar[Sequence[Driven]] = ()
    """Steps along paths that lead elsewhere than along the amplitude; of many frames some."""
    ties: ClassVar[tuple[str, ...]] = ()
    """Formulas of frequency and amplitude."""
    carried: ClassVar[tuple[str, ...]] = ("final_state",)

    @cached_property
    def moving(self) -> Structure:
        """The structure without the contacts that no run can reach; results are the same."""
        largest = float(np.abs(self.amplitude).max(initial=0.0))
        return self.structure.within_reach(largest, self.starting_states)

    @property
    def starting_states(self) -> np.ndarray:
        """States at least as far out as those from which runs start, shape (m, 2n)."""
        return self.initial_state[None]

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return self.frames.size

    @property
    def n_along(self) -> int:
        """Number of runs of one frame and direction."""
        return self.along_of(0).size

    @property
    def frames(self) -> np.ndarray:
        """Values of the dimension of the frames: their frequencies."""
        return self.omega

    def amplitudes_of(self, _frame: int) -> np.ndarray:
        """Return the amplitudes of the runs of a frame, shape (n_along,)."""
        return self.amplitude

    def along_of(self, frame: int) -> np.ndarray:
        """Return the values of the last dimension of the runs of a frame, ascending."""
        return self.amplitudes_of(frame)

    def omegas_of(self, frame: int) -> np.ndarray:
        """Return the frequencies of the runs of a frame, shape (n_along,)."""
        return np.full(self.n_along, self.omega[frame])

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a run, see `Part.of_run`."""
        return variables.run_variables(self.settings, self.structure)

    @property
    def grid(self) -> dict[str, Coordinate]:
        """Values of the dimensions of the frames, and of the runs of a frame."""
        return {
            "omega": Coordinate(self.omega.astype("<f8"), *variables.OMEGA),
            "amplitude": Coordinate(self.amplitude.astype("<f8"), *variables.AMPLITUDE),
        }

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        return {
            **variables.measure_coordinates(self.structure, self.settings),
            **variables.slider_names(self.structure),
            "direction": variables.named(self.directions, self.direction_name),
            **self.grid,
            self.point_dim: variables.numbered(self.settings.stored_points, "stroboscopic point"),
            "state": variables.states(self.structure),
            "mode": variables.numbered(
                self.structure.n_floors, "mode of the free structure", first=1
            ),
            "block": variables.numbered(self.n_blocks, "block of amplitudes"),
        }

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        return variables.storey_heights(self.structure) if "storey" in self.coordinates else []

    def runs_of(self, structure: Structure, omega: float) -> Any:
        """Return what computes runs of one structure at one frequency, from an `end_state`."""
        raise NotImplementedError

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute runs at amplitudes of a frame; see `Part.runs_at`."""
        runs = self.runs_of(self.moving, float(self.omega[frame]))
        return runs.each(self.amplitudes_of(frame)[places], state, poll)

    def time_runs(self, share: float, along: float, n_runs: int, poll: Poll = None) -> Timed:
        """Time a few runs of a frame, after an untimed one that reaches the attractor."""
        frame = int(share * self.n_frames)
        at = int(along * (max(self.n_along - n_runs - 1, 0) + 1))
        places = np.arange(at, min(at + n_runs + 1, self.n_along))
        arrived = self.end_state(self.runs_at(frame, places[:1], self.initial_state, poll), -1)
        state = arrived if np.isfinite(arrived).all() else self.initial_state
        places = places[1:] if places.size > 1 else places
        middle = (at + 0.5 * places.size) / self.n_along
        begun = time.perf_counter()
        self.runs_at(frame, places, state, poll)
        return (frame, middle), places.size, time.perf_counter() - begun

    def relations(self, block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        _, frame, low = block.first
        along = slice(low, low + block.n_runs)
        omegas, amplitudes = self.omegas_of(frame)[along], self.amplitudes_of(frame)[along]
        if (omegas == omegas[0]).all() and len(self.structures) == 1:
            units = self.structure.units_at(float(omegas[0]), amplitudes)
        else:
            steps = zip(omegas.tolist(), amplitudes.tolist(), strict=True)
            units = np.array([self.units_at(*step, at) for at, step in enumerate(steps, low)])
        return broken_relations(self.settings, amplitudes, rows, units)

    def run_again(self, block: Block, row: int, run: dict, start: np.ndarray) -> RunAgain:
        """Compute a complete stored run again, another way; see `hpcsweep.studies.recompute`."""
        by_flow = self
        if self.settings.solver != "flow":
            settings = replace(self.settings, solver="flow", rtol=SOLVERS["flow"].tight)
            by_flow = replace(self, settings=settings)
        return compute_again(self, block, row, run, by_flow.compute_run(block, row, start))

    @property
    def map_axes(self) -> dict[str, np.ndarray]:  # type: ignore[override]
        """Values of the axes of a map that may be refined, by key of the job."""
        return {"sweep.omega": self.omega, "sweep.amplitude": self.amplitude}

    @property
    def covered(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and amplitudes of the motions, ascending or their range."""
        frames = range(min(self.n_frames, MAX_FRAMES))
        return self.omega, np.unique(np.concatenate([self.amplitudes_of(k) for k in frames]))

    def lines(self) -> Lines:
        """Tell the ranges of frequency and amplitude, of first contact, and of the starts."""
        yield from ranges(self.structure, *self.covered, self.path_steps)
        yield from (("starts", text) for text in starting_range(self))

    def warnings(self) -> Iterator[str]:
        """Return one line for each thing that looks like a mistake in what drives the structure."""
        continues = self.by_frame and "final_state" in self.carried
        continues &= self.run_dims[-1] == "amplitude"
        return doubts(self.structure, *self.covered, continues)

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the one motion of a run."""
        return [run]

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count runs by skip rule, and runs without an orbit."""
        complete, of = done & (runs["outcome"] == Outcome.COMPLETE), self.settings
        return {
            "periods_per_run_window": of.transient_cycles + of.sampling_cycles,
            "runs_spared": {
                rule.name.lower(): int((done & (runs["skip_rule"] == rule)).sum())
                for rule in SkipRule
                if rule is not SkipRule.NONE
            },
            "no_period_found": int((complete & (runs["orbit_period"] == 0)).sum()),
        }

    def tally(self) -> Any:
        """Return a tally of runs for ``summary``."""
        return RunTally(self)

    def describe(self, run: Place) -> dict[str, Any]:
        """Describe a run: ``direction``, ``omega``, ``amplitude``."""
        direction, frame, at = run
        omega, amplitude = float(self.omegas_of(frame)[at]), float(self.amplitudes_of(frame)[at])
        return {"direction": self.directions[direction], "omega": omega, "amplitude": amplitude}

    def describe_task(self, task: int) -> str:
        """Describe a task by its frequency and amplitudes."""
        (block,) = self.path(task)
        first, last = self.describe(block.first), self.describe(block.run(block.n_runs - 1))
        more = f" to {last['amplitude']:.6g}" if block.n_runs > 1 else ""
        return f"Omega = {first['omega']:.6g}, A = {first['amplitude']:.6g}{more}"

    def _specialises(self, n_ranks: float | None) -> bool:
        from hpcsweep.studies.compilation import worth_specialising

        return len(self.structures) == 1 and worth_specialising(self, n_ranks)

    def kernels(self, n_ranks: float | None = None) -> list[Any]:
        """Return the kernels that its runs call; see `Part.kernels`."""
        from hpcsweep.studies.compilation import needed

        settings = replace(self.settings, metrics=self.settings.metrics | self.always)
        special = self._specialises(n_ranks)
        each = (needed(settings, structure, special) for structure in self.structures)
        return list(dict.fromkeys(chain.from_iterable(each)))

    def warm_up(self, say: Say = None, n_ranks: float | None = None) -> None:
        """Compile its `kernels`, or load them from disk, and use those for its structure."""
        super().warm_up(say, n_ranks)
        if self._specialises(n_ranks):
            from hpcsweep.solvers.flow.specialised import use

            use(self.structure)
