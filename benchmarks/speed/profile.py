"""Profile a study: CPU time of histories by solver call, and counts.

Short stretches of each frame's upward path are run, spread over the amplitudes. A stretch starts
from rest; its first run, a long transient, is not counted. The counts do not depend on the machine;
times are the least of several turns.
"""

import time
from collections import defaultdict
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from hpcsweep.job import Job, parse_job
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind
from hpcsweep.studies.sweep.runs import FrameRuns

STUDY = """
[sweep]
omega = [0.21, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.79]
amplitude = {from = 0.00028, to = 0.35, count = 1250}
period_tolerance = 1e-6

[solver]
skip = "all"
"""
"""Frames of jobs/paper/bluecrystal.toml."""
STRETCHES, LENGTH = 10, 20
"""Of a frame's path: how many are run, and how many runs each has that count."""
CALLS = ("follow_orbits", "observe", "grow", "settle", "monodromy", "advance", "points")
COLUMNS = {
    "batches": ("follow_orbits", "advance"),
    "windows": ("observe",),
    "classified after": ("grow", "settle", "monodromy", "points"),
}
"""Of the table, and the calls that each sums: runs that skip rules finish, and transients of
others; their windows, and those of classified motions; what classifies them."""
COUNTS = ("linear steps", "passages", "layer steps", "layer visits", "tables")


@dataclass
class FrameProfile:
    """Solver calls of the runs of a frame; all numbers are a run.

    Attributes
    ----------
    omega : float
    n_runs : int
    microseconds : float
        Total of a run.
    spent : dict of str to float
        Microseconds in each call of the solver; the rest is outside of them.
    periods : dict of str to float
        Forcing periods in each call, including those of Newton's method.
    counts : dict of str to float
        Counts of `flow.state.shared.Shared`, over all calls.
    specialised : bool
        Whether the kernels are specialised to the structure.
    """

    omega: float
    n_runs: int
    microseconds: float = 0.0
    spent: dict[str, float] = field(default_factory=dict)
    periods: dict[str, float] = field(default_factory=dict)
    counts: dict[str, float] = field(default_factory=dict)
    specialised: bool = False


class Watched:
    """A solver whose calls are timed while they are `counted`."""

    def __init__(self, solver):
        self._solver = solver
        self.counted = False
        self.seconds: dict[str, float] = defaultdict(float)
        self.periods: dict[str, float] = defaultdict(float)

    def __getattr__(self, name):
        found = getattr(self._solver, name)
        if name not in CALLS or not self.counted:
            return found

        def timed(*arguments, **options):
            begun = time.process_time_ns()
            result = found(*arguments, **options)
            self.seconds[name] += 1e-9 * (time.process_time_ns() - begun)
            self.periods[name] += periods_of(name, result, arguments)
            self.done(name, result, arguments)
            return result

        return timed

    def done(self, name: str, result, arguments) -> None:
        """Record a timed call."""


def periods_of(name: str, result, arguments) -> int:
    """Return the number of forcing periods that a call has integrated."""
    if name == "monodromy":
        return arguments[2]
    if name == "points":
        return len(result[0])
    if name in ("observe", "grow"):
        return len(result.points)
    if name == "follow_orbits":
        left = result.open
        return int(result.orbits.cycles.sum()) + (left.n_periods + left.n_newton if left else 0)
    return result.n_periods + getattr(result, "n_newton", 0)


def _counts(solver) -> np.ndarray:
    """Return the counts of `flow`; 0 for a solver without counts."""
    return getattr(solver, "counts", np.zeros(len(COUNTS)))


def profile_frame(job: Job, frame: int) -> FrameProfile:
    """Run the stretches of one frame once."""
    study = as_kind(job.study, RunGrid)
    omega, settings = float(study.omega[frame]), study.settings
    solver: Any = make_solver(settings.solver, study.structure, omega, settings.rtol)
    watched = Watched(solver)
    runs = FrameRuns(study.structure, omega, settings, watched)
    rest = np.zeros(2 * study.structure.n_floors)
    last = study.amplitude.size - LENGTH - 1
    counts = np.zeros(len(COUNTS))
    seconds = 0.0
    n_runs = 0
    for first in np.linspace(0, last, STRETCHES).astype(int) if last > 0 else [0]:
        watched.counted = False
        state = runs.follow(study.amplitude[first : first + 1], rest)["final_state"][-1]
        watched.counted = True
        before = np.array(_counts(solver))
        stretch = study.amplitude[first + 1 : first + 1 + LENGTH]
        begun = time.process_time()
        runs.follow(stretch, state)
        seconds += time.process_time() - begun
        counts += _counts(solver) - before
        n_runs += len(stretch)

    def a_run(total: dict[str, float], unit: float) -> dict[str, float]:
        return {name: unit * total[name] / n_runs for name in CALLS if name in total}

    return FrameProfile(
        float(study.omega[frame]),
        n_runs,
        1e6 * seconds / n_runs,
        a_run(watched.seconds, 1e6),
        a_run(watched.periods, 1.0),
        {name: float(count) / n_runs for name, count in zip(COUNTS, counts, strict=True)},
        getattr(solver, "is_specialised", False),
    )


def profile(job: Job | None = None, turns: int = 3) -> list[FrameProfile]:
    """Profile the frames of a job, by default those of `STUDY`; times are the least."""
    job = job or parse_job(STUDY, "", "study")
    found: list[FrameProfile] = []
    for turn in range(turns):
        for frame in range(job.study.n_frames):
            new = profile_frame(job, frame)
            if turn == 0:
                found.append(new)
                continue
            old = found[frame]
            found[frame] = replace(
                old,
                microseconds=min(old.microseconds, new.microseconds),
                spent={name: min(old.spent[name], new.spent[name]) for name in old.spent},
            )
    return found


def as_json(rows: list[FrameProfile]) -> list[dict]:
    """Convert the profile to plain types."""
    return [asdict(row) for row in rows]


def as_text(rows: list[FrameProfile]) -> str:
    """Format the profile, a line a frame."""
    kernels = "specialised to the structure" if rows[0].specialised else "for any structure"
    lines = [
        f"a run on its path, CPU time in us, {rows[0].n_runs} runs a frame (in brackets: forcing "
        f"periods); kernels {kernels}:",
        f"  {'omega':>6s} {'us':>7s}"
        + "".join(f"  {title:16s}" for title in COLUMNS)
        + f" around {' '.join(f'{name:>12s}' for name in COUNTS)}",
    ]
    for row in rows:
        spent = "".join(
            f"  {sum(row.spent.get(name, 0.0) for name in names):7.1f}"
            f" ({sum(row.periods.get(name, 0.0) for name in names):6.1f})"
            for names in COLUMNS.values()
        )
        around = row.microseconds - sum(row.spent.values())
        counts = " ".join(f"{row.counts[name]:12.2f}" for name in COUNTS)
        lines.append(f"  {row.omega:6g} {row.microseconds:7.1f}{spent}  {around:7.1f} {counts}")
    return "\n".join(lines)
