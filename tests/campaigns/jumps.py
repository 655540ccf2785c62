"""Jumps to orbits along paths, against the motion itself: jumps.py JOB.toml ...

Frames of a job are run up and down by themselves. Runs that `newton` has settled are carried on
from where they began by plain periods alone. The orbit is claimed to be the one the motion goes to,
and its last point the one at which the plain procedure ends, so that a whole number of turns later
the motion must be at that point: to `THERE`, or if its multiplier is near 1 as much nearer than
`EARLY` periods after the start as it says. The exit code is 1 if a motion is elsewhere.
"""

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hpcsweep.job import load_job
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.runs import frame_runs
from hpcsweep.studies.shortcut import Shortcut

THERE = 1e-8
"""Distance in units of the state: a residual of 1e-11 is 1e-9 of it at a multiplier of 0.99."""
EARLY, LATE = 600, 1200
"""Forcing periods after which the motion is looked at, and up to a turn more."""
SLOWER = 3.0
"""Factor by which it may be farther than the multiplier says: an approach has several rates."""


@dataclass
class Jump:
    """One run that was settled by a jump."""

    omega: float
    amplitude: float
    period: int
    multiplier: float
    early: float = math.nan
    late: float = math.nan
    """Distance from the orbit's point, in units of the state."""

    @property
    def is_there(self) -> bool:
        """Whether the motion is on the orbit."""
        return self.late <= THERE

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is not, and does not come nearer as the multiplier says."""
        left = self.early * self.multiplier ** ((LATE - EARLY) / self.period)
        return not (self.is_there or self.late <= SLOWER * left)


def follow_plainly(study, omega: float, start, jump: Jump, last) -> Jump:
    """Carry a run on from where it began, and look where it is; `last` is the orbit's point."""
    settings, units = study.settings, study.structure.state_units
    solver = make_solver(settings.solver, study.structure, omega, settings.rtol)
    plain = settings.transient_cycles + settings.sampling_cycles
    early, late = (n + (plain - n) % jump.period for n in (EARLY, LATE))
    points, _ = solver.points(start, jump.amplitude, late)
    jump.early, jump.late = (
        float((np.abs(points[n - 1] - last) / units).max()) for n in (early, late)
    )
    return jump


def jumps_of(study, frame: int, every: int) -> list[Jump]:
    """Run one frame of a study of sweeps, and follow every so many of its jumps."""
    omega = float(study.omega[frame])
    runs = frame_runs(study.structure, omega, study.settings)
    state = np.zeros(2 * study.structure.n_floors)
    found = []
    for amplitudes in (study.amplitude, study.amplitude[::-1]):
        rows = runs.follow(amplitudes, state)
        starts = np.vstack((state, rows["final_state"]))
        for k in np.flatnonzero(rows["shortcut"] == Shortcut.NEWTON)[::every].tolist():
            period = int(rows["orbit_period"][k])
            growth = float(rows["lyapunov"][k]) * period * 2 * math.pi / omega
            jump = Jump(omega, float(amplitudes[k]), period, math.exp(growth))
            last = rows["final_state"][k]
            found.append(follow_plainly(study, omega, starts[k], jump, last))
        state = rows["final_state"][-1]
    return found


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("jobs", nargs="+", type=Path, metavar="JOB.toml")
    parser.add_argument("--frames", type=int, default=27, help="every so many (default: 27)")
    parser.add_argument("--first", type=int, default=17, help="the first one (default: 17)")
    parser.add_argument("--runs", type=int, default=9, help="every so many jumps (default: 9)")
    given = parser.parse_args()
    elsewhere = 0
    for job in given.jobs:
        study = load_job(job).study
        jumps = [
            jump
            for frame in range(given.first, study.omega.size, given.frames)
            for jump in jumps_of(study, frame, given.runs)
        ]
        lost = [jump for jump in jumps if jump.is_elsewhere]
        there = sum(jump.is_there for jump in jumps)
        slow = len(jumps) - there - len(lost)
        print(f"{job.name}: {len(jumps)} jumps, {there} motions on their orbits, {slow} nearer")
        for jump in lost:
            print(
                f"  elsewhere: Omega = {jump.omega:.6g}, A = {jump.amplitude:.6g}, "
                f"P{jump.period}, multiplier {jump.multiplier:.6f}: {jump.early:.1e} after "
                f"{EARLY} periods, {jump.late:.1e} after {LATE}"
            )
        elsewhere += len(lost)
    sys.exit(1 if elsewhere else 0)


if __name__ == "__main__":
    main()
