"""What a study would take if every forcing period cost no more than a plain one: JOB.toml ...

Frames of a job are run up and down by themselves. The forcing periods that each call of the solver
integrates are integrated once more, from where it began, and nothing is gathered of them: no
tangent vector or map, no norms, no drift, no watch for an orbit. Those of runs that skip rules
finish start from the orbit in the middle of a call. What the time exceeds that of these periods is
what the rules cost besides; the rest can only be had by fewer periods, or by cheaper ones.
"""

import argparse
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
from speed.profile import CALLS, Watched, periods_of

from hpcsweep.job import load_job
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.sweep.runs import FrameRuns

Part = tuple[np.ndarray, float, int]
"""State, amplitude, forcing periods."""


class Repeating(Watched):
    """A solver that does the periods of each call once more."""

    def __init__(self, solver):
        super().__init__(solver)
        self.counted = True
        self.plain: dict[str, float] = defaultdict(float)

    def done(self, name: str, result, arguments) -> None:
        """Do the periods of a call once more."""
        begun = time.process_time_ns()
        for part in parts(name, result, arguments):
            self._solver.advance(*part)
        self.plain[name] += 1e-9 * (time.process_time_ns() - begun)


def parts(name: str, result, arguments) -> list[Part]:
    """Return the parts that a call has integrated."""
    if name != "follow_orbits":
        found = [(arguments[0], float(arguments[1]), periods_of(name, result, arguments))]
    else:
        found, amplitudes, left = [], arguments[0], result.open
        orbits = result.orbits
        n_periods = int(orbits.cycles.sum())
        if n_periods:
            done = np.flatnonzero(orbits.cycles)
            middle = done[done.size // 2]
            found.append((orbits.points[middle, 0], float(amplitudes[middle]), n_periods))
        if left is not None:
            amplitude = float(amplitudes[len(orbits.cycles)])
            found.append((result.state, amplitude, left.n_periods + left.n_newton))
    return [part for part in found if part[2] > 0]


def run_frame(study, omega: float) -> tuple[Repeating, float]:
    """Run a frame up and down; give its solver, and its seconds without what is repeated."""
    settings = study.settings
    solver = Repeating(make_solver(settings.solver, study.structure, omega, settings.rtol))
    runs = FrameRuns(study.structure, omega, settings, solver)
    state = np.zeros(2 * study.structure.n_floors)
    begun = time.process_time()
    for path in (study.amplitude, study.amplitude[::-1]):
        state = runs.follow(path, state)["final_state"][-1]
    return solver, time.process_time() - begun - sum(solver.plain.values())


def measure(study, frames: slice) -> str:
    """Run frames of a study; write the table."""
    done = [run_frame(study, float(omega)) for omega in study.omega[frames]]
    total = sum(spent for _, spent in done)

    def over_all(what: str, name: str) -> float:
        return sum(getattr(solver, what)[name] for solver, _ in done)

    rows = [[over_all(what, name) for what in ("periods", "seconds", "plain")] for name in CALLS]
    around = total - sum(seconds for _, seconds, _ in rows)
    least = sum(plain for _, _, plain in rows)
    return "\n".join(
        (
            "| call | periods | s | plain periods, s |\n|---|---:|---:|---:|",
            *(
                f"| `{name}` | {periods:,.0f} | {seconds:.2f} | {plain:.2f} |"
                for name, (periods, seconds, plain) in zip(CALLS, rows, strict=True)
            ),
            f"| around | | {around:.2f} | |\n| all | | {total:.2f} | {least:.2f} |",
            f"plain periods alone: {least / total:.2f} of the time",
        )
    )


def main() -> None:
    """Measure, and print a table for each job."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("jobs", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=25, help="frames, default 25")
    parser.add_argument("--first", type=int, default=7, help="first frame, default 7")
    arguments = parser.parse_args()
    for job in arguments.jobs:
        study, frames = load_job(job).study, slice(arguments.first, None, arguments.every)
        study.warm_up(n_ranks=0)
        print(
            f"{job.name}: {study.omega[frames].size} frames\n{measure(study, frames)}", flush=True
        )


if __name__ == "__main__":
    main()
