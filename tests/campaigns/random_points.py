"""Random points of the study computed by two versions of the package, and compared.

    random_points.py --points 10000 --seed 1 -o before.npz      with the one
    random_points.py --points 10000 --seed 1 -o after.npz       with the other
    random_points.py --compare before.npz after.npz

Motions that wander before they settle may settle on another attractor for a difference in the last
digit. How many do is told by one version alone, from rest and from a state `--nudge` off it.

Points are drawn from the map of the whole study, half of them with each damping; each is a run from
rest and, where that has contact, one more at an amplitude that is 1e-3 of it larger, from where the
first ended: the step of a sweep. Runs that differ in class, period or contact set, or whose orbit
differs by more than `ORBIT`, are listed.
"""

import argparse
import sys

import numpy as np
from tools import JOBS

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.job import load_job
from hpcsweep.studies.runs import FrameRuns

ORBIT = 1e-9
NEXT = 1.001
KEPT = ("motion", "orbit_period", "contact", "outcome", "lyapunov", "drift", "cycles")


def drawn(n_points: int, seed: int, nudge: float) -> dict[str, np.ndarray]:
    """Compute the runs, two a point."""
    studies = [load_job(JOBS / f"bluecrystal{name}.toml").study for name in ("", "-described")]
    random = np.random.default_rng(seed)
    rows: dict[str, list] = {name: [] for name in (*KEPT, "points", "at")}
    for k in range(n_points):
        study = studies[k % 2]
        omega = float(random.uniform(study.omega[0], study.omega[-1]))
        amplitude = float(random.uniform(study.amplitude[0], study.amplitude[-1]))
        frame = FrameRuns(study.structure, omega, study.settings)
        found = frame.follow([amplitude, NEXT * amplitude], study.initial_state + nudge)
        for row in range(2):
            for name in KEPT:
                rows[name].append(found[name][row])
            points = np.full((study.settings.max_orbit_period, study.initial_state.size), np.nan)
            period = int(found["orbit_period"][row])
            points[:period] = found["poincare"][row, :period]
            rows["points"].append(points)
            rows["at"].append((k % 2, omega, amplitude, row))
    return {name: np.array(values) for name, values in rows.items()}


def nearest(left: np.ndarray, right: np.ndarray) -> float:
    """Distance of two orbits of one period, over all shifts."""
    left, right = (points[~np.isnan(points[:, 0])] for points in (left, right))
    shifted = (np.roll(right, shift, axis=0) for shift in range(len(right)))
    return min((float(np.abs(left - one).max()) for one in shifted), default=0.0)


def compare(before: dict, after: dict) -> int:
    """List the runs that differ; return their number."""
    if not np.array_equal(before["at"], after["at"]):
        sys.exit("random_points: the files hold other points")
    different, worst = 0, 0.0
    for k, (damping, omega, amplitude, row) in enumerate(before["at"]):
        same = all(before[name][k] == after[name][k] for name in ("motion", "outcome"))
        same = same and before["orbit_period"][k] == after["orbit_period"][k]
        distance = 0.0
        if same and before["orbit_period"][k]:
            distance = nearest(before["points"][k], after["points"][k])
            same = distance <= ORBIT and before["contact"][k] == after["contact"][k]
        if same:
            worst = max(worst, distance)
            continue
        different += 1
        told = [
            f"{CLASS_NAMES[MotionClass(one['motion'][k])]} P{one['orbit_period'][k]} "
            f"C{one['contact'][k]:b} exponent {one['lyapunov'][k]:.4g}"
            for one in (before, after)
        ]
        print(
            f"{('printed', 'described')[int(damping)]} Omega {omega:.6f} A {amplitude:.6f} "
            f"run {int(row)}: {told[0]} | {told[1]} | {distance:.1e}"
        )
    runs = len(before["at"])
    print(f"{runs} runs, {different} differ; orbits of the others by {worst:.1e} at most")
    print(f"forcing periods {before['cycles'].sum()} and {after['cycles'].sum()}")
    return different


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--nudge", type=float, default=0.0, help="added to the initial state")
    parser.add_argument("-o", "--output", default="points.npz")
    parser.add_argument("--compare", nargs=2, metavar=("BEFORE", "AFTER"))
    given = parser.parse_args()
    if given.compare:
        before, after = (dict(np.load(name)) for name in given.compare)
        sys.exit(1 if compare(before, after) else 0)
    np.savez_compressed(given.output, **drawn(given.points, given.seed, given.nudge))


if __name__ == "__main__":
    main()
