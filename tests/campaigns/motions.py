"""Decided motions against labels of another route: motions.py --each N --seed S --jobs J.

Runs at random places of the map of Figure 6 as described are decided; up to N of each class are
labelled again, from where their windows ended, by means that share no code with the decision: the
Taylor reference (`hpcsweep.solvers.reference`) integrates the motion and, beside it, one that
starts `BESIDE` away and is drawn back to that distance after each period (Benettin's exponent).

periodic p
    After `TRANSIENT` periods the points return after p periods, p <= `LONGEST`, to `CLOSED`, or
    they come nearer to it over the window (`SLOW`).
chaotic
    The mean logarithm of the growth exceeds three of its standard errors over `BATCHES` batches,
    and `LEAST` a period.
quasi-periodic
    Neither, and the mean is within three standard errors and `LEAST` of 0.
"""

import argparse
import json
import math
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
from tools import JOBS

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.job import load_job
from hpcsweep.solvers.reference import reference_points
from hpcsweep.studies.runs import FrameRuns

TRANSIENT, WINDOW = 3000, 1000
LONGEST = 250
CLOSED = 1e-10
"""After so many periods orbits with multipliers up to 0.992 are there; `SLOW` decides on others."""
SLOW = 0.9
"""Ratio of the return distances of both halves of the window below which an orbit is approached."""
BESIDE = 1e-7
BATCHES = 12
LEAST = 1e-3
JOB = "figure6-described.toml"


def labelled(case: tuple) -> tuple[str, int]:
    """Label one motion: its class and period."""
    structure, omega, amplitude, state = case
    z = reference_points(structure, amplitude, omega, np.array(state), TRANSIENT)[-1]
    points = np.empty((WINDOW, z.size))
    offset = np.full(z.size, BESIDE / math.sqrt(z.size))
    logarithms = np.empty(WINDOW)
    for k in range(WINDOW):
        other = reference_points(structure, amplitude, omega, z + offset, 1)[0]
        z = points[k] = reference_points(structure, amplitude, omega, z, 1)[0]
        length = max(float(np.linalg.norm(other - z)), 1e-300)
        logarithms[k] = math.log(length / BESIDE)
        offset = (other - z) * (BESIDE / length)
    half = WINDOW // 2

    def halves(period: int) -> tuple[float, float]:
        apart = np.abs(points[period:] - points[:-period]).max(axis=1)
        return float(apart[:half].max()), float(apart[half:].max())

    for period in range(1, LONGEST + 1):
        if halves(period)[1] <= CLOSED:
            # the points a divisor apart may still be on their way to each other
            shorter = [d for d in range(1, period) if period % d == 0]
            near = (d for d in shorter if halves(d)[1] < SLOW * halves(d)[0])
            return "periodic", next(near, period)
    kept = logarithms[WINDOW // 10 :]
    batches = kept[: len(kept) // BATCHES * BATCHES].reshape(BATCHES, -1).mean(axis=1)
    mean, error = batches.mean(), batches.std(ddof=1) / math.sqrt(BATCHES)
    if mean > max(3 * error, LEAST):
        return "chaotic", 0
    for period in range(1, LONGEST + 1):
        first, last = halves(period)
        if last <= 1e-2 and last < SLOW * first:
            return "periodic", period
    return "quasi-periodic" if abs(mean) < 3 * error + LEAST else "not told", 0


def drawn(each: int, seed: int) -> list[tuple]:
    """Draw decided runs: (class, period, case), up to `each` of a class."""
    study = load_job(JOBS / JOB).study
    random = np.random.default_rng(seed)
    wanted = (
        MotionClass.PERIODIC,
        MotionClass.LONG_PERIOD,
        MotionClass.QUASI_PERIODIC,
        MotionClass.CHAOTIC,
    )
    found: dict[MotionClass, list] = {kind: [] for kind in wanted}
    settings = replace(
        study.settings,
        metrics=frozenset({"poincare", "contact"}),
        skip=frozenset({"linear", "converged", "newton"}),
        decide_cycles=50_000,
        max_points=None,
    )
    for _ in range(200):
        omega = float(random.uniform(0.4, 0.8))
        amplitudes = np.sort(random.uniform(0.01, 0.35, 30))
        runs = FrameRuns(study.structure, omega, settings).follow(amplitudes, study.initial_state)
        for k in random.permutation(len(amplitudes)):
            kind = MotionClass(int(runs["motion"][k]))
            plain = kind is MotionClass.PERIODIC and runs["decided_cycles"][k] == 0
            if kind in found and len(found[kind]) < each and not plain:
                case = (study.structure, omega, float(amplitudes[k]), runs["final_state"][k])
                points = runs["poincare"][k][: int(runs["n_points"][k])]
                found[kind].append((kind, int(runs["orbit_period"][k]), case, points))
        if all(len(cases) == each for cases in found.values()):
            break
    return [one for cases in found.values() for one in cases]


def main() -> None:
    """Print the table of both routes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json")
    options = parser.parse_args()
    cases = drawn(options.each, options.seed)
    table: Counter = Counter()
    other = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for (kind, period, case, _), (label, p) in zip(
            cases, pool.map(labelled, [case for _, _, case, _ in cases]), strict=True
        ):
            table[CLASS_NAMES[kind], label] += 1
            own = CLASS_NAMES[kind].replace("long period", "periodic")
            if own != label or (period and p != period):
                other.append((CLASS_NAMES[kind], period, label, p, *case[1:3]))
                print("other:", *other[-1], flush=True)
    labels = ("periodic", "quasi-periodic", "chaotic", "not told")
    print("| decided | " + " | ".join(labels) + " |\n|---|" + "---:|" * len(labels))
    for kind in dict.fromkeys(kind for kind, _ in table):
        print(f"| {kind} | " + " | ".join(str(table[kind, label]) for label in labels) + " |")
    if options.json:
        with open(options.json, "w") as file:  # noqa: PTH123
            json.dump(
                {"table": [[*key, count] for key, count in table.items()], "other": other}, file
            )


if __name__ == "__main__":
    main()
