"""Random points of the study computed by two versions of the package, and compared.

    random_points.py --points 10000 --seed 1 -o before.npz      with the one
    random_points.py --points 10000 --seed 1 -o after.npz       with the other
    random_points.py --compare before.npz after.npz
    random_points.py --explain before.npz after.npz

Motions that wander before they settle may settle on another attractor for a difference in the last
digit. How many do is known from one version alone, from rest and from a state `--nudge` off it. Of
the runs that differ `--explain` tells which are so: this version computes each from `TRIES` states
that are off rest by up to `--nudge` (`OFF` if none is given), and finds both motions among them, or
the other one at least, or not. The exit code is 1 if a difference is left unexplained.

Points are drawn from the map of the whole study, half of them with each damping; each is a run from
rest and, where that has contact, one more at an amplitude that is 1e-3 of it larger, from where the
first ended: the step of a sweep. Runs that differ in class, period or contact set, or whose orbit
differs by more than `ORBIT`, are listed.
"""

import argparse
import sys
from collections import Counter
from functools import cache

import numpy as np
from tools import PAPER

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.job import load_job
from hpcsweep.studies.sweep.runs import FrameRuns

ORBIT = 1e-9
NEXT = 1.001
TRIES = 200
OFF = 1e-10
"""As much as a change of a solver may move a passage of a contact (gaps, gaps omega_0)."""
BOTH = "both motions found from beside rest"
FOUND = {
    (True, True): BOTH,
    (True, False): "the motion before alone",
    (False, True): "the motion after alone",
    (False, False): "neither motion",
}
KEPT = ("motion", "orbit_period", "contact", "outcome", "lyapunov", "drift", "cycles")


@cache
def study(damping: int):
    """Return the whole study, as printed or as described."""
    return load_job(PAPER / f"bluecrystal{('', '-described')[damping]}.toml").study


def computed(cases) -> dict[str, np.ndarray]:
    """Compute two runs of each case: damping, Omega, A, and what is added to rest."""
    rows: dict[str, list] = {name: [] for name in (*KEPT, "points", "at")}
    for damping, omega, amplitude, offset in cases:
        own = study(damping)
        frame = FrameRuns(own.structure, omega, own.settings)
        found = frame.follow([amplitude, NEXT * amplitude], own.initial_state + offset)
        for row in range(2):
            for name in KEPT:
                rows[name].append(found[name][row])
            points = np.full((own.settings.max_orbit_period, own.initial_state.size), np.nan)
            period = int(found["orbit_period"][row])
            points[:period] = found["poincare"][row, :period]
            rows["points"].append(points)
            rows["at"].append((damping, omega, amplitude, row))
    return {name: np.array(values) for name, values in rows.items()}


def drawn(n_points: int, seed: int, nudge: float):
    """Draw the cases."""
    random = np.random.default_rng(seed)
    for k in range(n_points):
        own = study(k % 2)
        omega = float(random.uniform(own.omega[0], own.omega[-1]))
        yield k % 2, omega, float(random.uniform(own.amplitude[0], own.amplitude[-1])), nudge


@cache
def beside_rest(damping: int, omega: float, amplitude: float, nudge: float):
    """Compute the runs of a point from `TRIES` states."""
    size = study(damping).initial_state.size
    offsets = np.random.default_rng(0).uniform(-nudge, nudge, (TRIES, size))
    return computed((damping, omega, amplitude, offset) for offset in offsets)


def nearest(left: np.ndarray, right: np.ndarray) -> float:
    """Distance of two orbits of one period, over all shifts."""
    left, right = (points[~np.isnan(points[:, 0])] for points in (left, right))
    shifted = (np.roll(right, shift, axis=0) for shift in range(len(right)))
    return min((float(np.abs(left - one).max()) for one in shifted), default=0.0)


def agree(one: dict, k: int, other: dict, j: int) -> tuple[bool, float]:
    """Return whether two runs found one motion; give the distance of their orbits, 0 if none."""
    if any(one[name][k] != other[name][j] for name in ("motion", "outcome", "orbit_period")):
        return False, 0.0
    if not one["orbit_period"][k]:
        return True, 0.0
    distance = nearest(one["points"][k], other["points"][j])
    return distance <= ORBIT and one["contact"][k] == other["contact"][j], distance


def motion(one: dict, k: int) -> str:
    """Return the motion of a run in words."""
    motion, period = CLASS_NAMES[MotionClass(one["motion"][k])], one["orbit_period"][k]
    return f"{motion} P{period} C{one['contact'][k]:b} exponent {one['lyapunov'][k]:.4g}"


def compare(before: dict, after: dict, nudge: float = 0.0) -> int:
    """Return the runs that differ, with a nudge each with why; return how many stay unexplained."""
    if not np.array_equal(before["at"], after["at"]):
        sys.exit("random_points: the files hold other points")
    worst, kinds = 0.0, Counter()
    for k, (damping, omega, amplitude, row) in enumerate(before["at"]):
        same, distance = agree(before, k, after, k)
        if same:
            worst = max(worst, distance)
            continue
        kind, counts = reason(before, after, k, nudge) if nudge else ("differ", "")
        kinds[kind] += 1
        print(
            f"{('printed', 'described')[int(damping)]} Omega {omega:.6f} A {amplitude:.6f} "
            f"run {int(row)}: {motion(before, k)} | {motion(after, k)} | {distance:.1e}{counts}",
            flush=True,
        )
    print(f"{len(before['at'])} runs, orbits of those that agree by {worst:.1e} at most")
    for kind, count in kinds.most_common():
        print(f"{count} {kind}")
    print(f"forcing periods {before['cycles'].sum()} and {after['cycles'].sum()}")
    return kinds.total() - kinds[BOTH]


def reason(before: dict, after: dict, k: int, nudge: float) -> tuple[str, str]:
    """Explain by runs from near rest why a run differs: what they find, and how often."""
    damping, omega, amplitude, row = before["at"][k]
    tries = beside_rest(int(damping), omega, amplitude, nudge)
    own = range(int(row), 2 * TRIES, 2)
    first, second = (sum(agree(one, k, tries, j)[0] for j in own) for one in (before, after))
    return FOUND[first > 0, second > 0], f" | {first} and {second} of {TRIES}"


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
    parser.add_argument("--explain", nargs=2, metavar=("BEFORE", "AFTER"))
    given = parser.parse_args()
    files = given.compare or given.explain
    if files:
        before, after = (dict(np.load(name)) for name in files)
        nudge = (given.nudge or OFF) if given.explain else 0.0
        sys.exit(1 if compare(before, after, nudge) else 0)
    np.savez_compressed(given.output, **computed(drawn(given.points, given.seed, given.nudge)))


if __name__ == "__main__":
    main()
