"""Jumps to orbits along paths, against the motion itself: jumps.py JOB.toml ...

Frames of a job are run up and down by themselves. Runs that `newton` has settled are carried on
from where they began by plain periods alone. The orbit is claimed to be the one the motion goes to,
and its last point the one at which the window procedure ends, so that a whole number of turns later
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
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.sweep.runs import frame_runs

THERE = 1e-8
"""Distance in units of the state at which a motion is on its orbit."""
EARLY, LATE = 600, 1200
"""Forcing periods after which the motion is looked at, and up to a turn more."""
SLOWER = 3.0
"""Factor by which it may be farther than the multiplier says: an approach has several rates."""


@dataclass(frozen=True)
class Jump:
    """A run that ended with a jump."""

    omega: float
    amplitude: float
    period: int
    multiplier: float
    early: float
    late: float
    """Distance of the motion from the orbit's point, in units of the state."""

    @property
    def is_there(self) -> bool:
        """Whether the motion is on the orbit."""
        return self.late <= THERE

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is not, and does not come nearer as the multiplier says."""
        left = self.early * self.multiplier ** ((LATE - EARLY) / self.period)
        return not (self.is_there or self.late <= SLOWER * left)


def distances(runs, start, amplitude: float, period: int, last) -> list[float]:
    """Carry a run on from where it began; say how far it is from the orbit's point `last`."""
    settings = runs.settings
    plain = settings.transient_cycles + settings.sampling_cycles
    early, late = (n + (plain - n) % period for n in (EARLY, LATE))
    points, _ = runs.solver.points(start, amplitude, late)
    apart = np.abs(points[[early - 1, late - 1]] - last) / runs.structure.state_units
    return apart.max(axis=1).tolist()


def jumps_of(study, frame: int, every: int) -> list[Jump]:
    """Run one frame of a study of sweeps, and follow every so many of its jumps."""
    omega = float(study.omega[frame])
    runs = frame_runs(study.structure, omega, study.settings)
    state = np.zeros(2 * study.structure.n_floors)
    found = []
    for amplitudes in (study.amplitude, study.amplitude[::-1]):
        rows = runs.follow(amplitudes, state)
        starts = np.vstack((state, rows["final_state"]))
        for k in np.flatnonzero(rows["skip_rule"] == SkipRule.NEWTON)[::every].tolist():
            amplitude, period = float(amplitudes[k]), int(rows["orbit_period"][k])
            growth = float(rows["lyapunov"][k]) * period * 2 * math.pi / omega
            apart = distances(runs, starts[k], amplitude, period, rows["final_state"][k])
            found.append(Jump(omega, amplitude, period, math.exp(growth), *apart))
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
