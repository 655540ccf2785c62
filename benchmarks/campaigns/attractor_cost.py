"""Cost of all attractors against a straightforward search: attractor_cost.py [--ranks 1 2 3 4].

Each point's `STARTS` starts are decided by `hpcsweep.attractors`. The straightforward way carries
each start through `PLAIN` forcing periods and takes what the last half repeats for its motion; here
by our own flow map, by a compiled DOP853 (the tableau of scipy's) and by `bdf`. The slow ones do so
for the first few starts alone, and their cost is that of one start times `STARTS`. All is processor
time of one process.

With --ranks the same small study is run on so many ranks, in turn, and its processor time reported.
"""

import argparse
import json
import math
import resource
import tempfile
import time
from pathlib import Path

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as tableau
from tools import DESCRIBED, JOBS, hpcsweep

from hpcsweep import attractors
from hpcsweep.dynamics.orbit import orbit_period
from hpcsweep.dynamics.starts import box_of, starting_states
from hpcsweep.model.equations import MODEL, right_hand_side
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.solver import make_solver

POINTS = (
    ("P2 and P1", 0.05, 0.12, 0.445),
    ("three orbits", 0.05, 0.2188, 0.445),
    ("two orbits and chaos", DESCRIBED, 0.128, 0.445),
)
STARTS, PLAIN, TOLERANCE, NEAR = 459, 200, 1e-4, 1e-3
"""Starts, forcing periods, and distances within which points repeat and are an attractor's."""
FEW = {"flow": STARTS, "DOP853": 20, "bdf": 2}
"""Starts that each straightforward way is given."""
STUDY = (
    "sweep.omega={from = 0.4, to = 0.6, count = 24}",
    "sweep.amplitude={from = 0.02, to = 0.25, count = 12}",
    "study.max_cycles=2000",
)
A, B, C, E3, E5 = (
    np.ascontiguousarray(tableau.A[:12, :12]),
    tableau.B,
    tableau.C[:12],
    tableau.E3,
    tableau.E5,
)


@numba.njit
def dop853(z, end, rtol, amplitude, packed, steps):
    """Integrate from 0 to `end`; False if it takes more than so many steps."""
    size = z.size
    stages = np.empty((13, size))
    t, h = 0.0, end / 200.0
    right_hand_side(t, z, amplitude, packed, stages[0])
    for _ in range(steps):
        if t >= end:
            return True
        h = min(h, end - t)
        for s in range(1, 12):
            trial = z.copy()
            for j in range(s):
                trial += h * A[s, j] * stages[j]
            right_hand_side(t + C[s] * h, trial, amplitude, packed, stages[s])
        new = z.copy()
        for j in range(12):
            new += h * B[j] * stages[j]
        right_hand_side(t + h, new, amplitude, packed, stages[12])
        third, fifth = 0.0, 0.0
        for i in range(size):
            scale = rtol + rtol * max(abs(z[i]), abs(new[i]))
            e3, e5 = 0.0, 0.0
            for j in range(13):
                e3 += E3[j] * stages[j, i]
                e5 += E5[j] * stages[j, i]
            third += (e3 / scale) ** 2
            fifth += (e5 / scale) ** 2
        error = 0.0
        if fifth > 0.0 or third > 0.0:
            error = h * fifth / math.sqrt((fifth + 0.01 * third) * size)
        factor = 10.0 if error == 0.0 else min(10.0, max(0.2, 0.9 * error**-0.125))
        if error < 1.0:
            t += h
            z[:] = new
            stages[0] = stages[12]
        else:
            factor = min(factor, 1.0)
        h *= factor
    return False


def by_dop853(structure, omega: float, amplitude: float):
    """Return what carries a state through forcing periods: (start, number) -> points."""
    model = kernel_model(structure, omega)
    frame, packed = Units(structure, model), MODEL.pack(model)
    scaled, period = amplitude / frame.amplitude_unit, 2 * math.pi / model.omega

    def points(start: np.ndarray, number: int) -> np.ndarray:
        z, found = frame.into(start), []
        for _ in range(number):
            assert dop853(z, period, 1e-9, scaled, packed, 100_000)
            found.append(z.copy())
        return frame.out_of(np.array(found))

    points.model = model  # its packed form holds the addresses of its arrays
    return points


def by(solver, amplitude: float):
    """Return the same of a solver."""
    return lambda start, number: solver.points(start, amplitude, number)[0]


def plain_label(points: np.ndarray, found: list, units: np.ndarray) -> int:
    """Find the attractor that the last half of a start's points says it is on; -1 for none."""
    window = points[PLAIN // 2 :]
    period = orbit_period(window / units, 16, TOLERANCE)
    for place, one in enumerate(found):
        near = np.abs((one.points - window[-1]) / units).max(axis=1).min() <= NEAR
        if one.orbit_period == period and (near or not period):
            return place
    return -1


def at_points() -> None:
    """Print a row for each point and way."""
    attractors(Structure(), 0.12, 0.445, starts=8)
    print("| point | way | starts | periods a start | ms a start | s a point | ratio | labels |")
    print("|---|---|---:|---:|---:|---:|---:|---|")
    for name, damping, amplitude, omega in POINTS:
        structure = Structure(damping_ratio=damping)
        units = structure.state_units
        begun = time.process_time()
        found = attractors(structure, amplitude, omega, starts=STARTS)
        own = time.process_time() - begun
        shares = ", ".join(f"{one.hits / STARTS:.3f}" for one in found)
        print(
            f"| {name} | hpcsweep.attractors | {STARTS} | | {1e3 * own / STARTS:.3g} | {own:.3g} "
            f"| 1 | {shares} |",
            flush=True,
        )
        starts = starting_states(box_of(None, units), STARTS, 0, omega, amplitude)
        ways = {
            "flow": by(make_solver("flow", structure, omega, 1e-9), amplitude),
            "DOP853": by_dop853(structure, omega, amplitude),
            "bdf": by(make_solver("bdf", structure, omega, 1e-6), amplitude),
        }
        for way, points in ways.items():
            points(starts[0], 1)
            labels, begun = [], time.process_time()
            for start in starts[: FEW[way]]:
                labels.append(plain_label(points(start, PLAIN), found, units))
            each = (time.process_time() - begun) / FEW[way]
            open_ones = labels.count(-1) / len(labels)
            if way == "flow":
                reported = ", ".join(f"{labels.count(k) / STARTS:.3f}" for k in range(len(found)))
                reported += f"; none {open_ones:.3f}"
            else:
                reported = f"of {FEW[way]} starts: none {open_ones:.2f}"
            print(
                f"| {name} | {PLAIN} periods by {way} | {FEW[way]} | {PLAIN} | {1e3 * each:.3g} | "
                f"{each * STARTS:.3g} | {each * STARTS / own:.3g} | {reported} |",
                flush=True,
            )


def over_ranks(numbers: list[int]) -> None:
    """Print a row for each number of ranks: processor time of all, and of the work alone."""
    given = [word for setting in STUDY for word in ("--set", setting)]
    job = JOBS / "attractors/attractors-map.toml"
    print("\n| ranks | s of all processes | s of the work | wall s |\n|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        for ranks in numbers:
            path = Path(folder) / f"{ranks}.h5"
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            begun = time.perf_counter()
            done = hpcsweep(ranks, "run", job, *given, "-o", path)
            wall = time.perf_counter() - begun
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            assert done.returncode == 0, done.stderr
            spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            state = json.loads(hpcsweep(0, "status", path, "--json").stdout)
            print(
                f"| {ranks} | {spent:.1f} | {state['core_seconds']:.1f} | {wall:.1f} |", flush=True
            )


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ranks", type=int, nargs="*", default=[])
    options = parser.parse_args()
    at_points()
    if options.ranks:
        over_ranks(options.ranks)


if __name__ == "__main__":
    main()
