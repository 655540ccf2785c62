"""Exponents of chaotic attractors against their spectra: exponents.py ATTRACTORS [options].

Oscillators and frames of one to three floors with stops on one side or both are drawn at random,
and searched, until so many chaotic attractors are found. The largest exponent of each, measured
while its test of lifetimes was followed, is compared with that of `hpcsweep.lyapunov_spectrum` over
--periods from another state of it. Printed is what lies outside, and how many intervals hold the
value of the spectrum; 95 % must. Chaos of which this motion ends in an orbit, after it has outlived
its test, is counted apart.
"""

import argparse
import math
import sys
import time
from collections.abc import Iterator

import numpy as np

import hpcsweep
from hpcsweep.dynamics.attractor import Attractor
from hpcsweep.dynamics.classify import MotionClass

STARTS, HOLD = 8, 0.95
OFF = 1e-6
"""Of the state: rounding would follow the same motion for thousands of periods."""
LONGEST, SAME = 200, 1e-6
"""Longest orbit in which chaos is seen to end, and the distance at which points are one."""
TOLD = 10

Point = tuple[hpcsweep.Structure, float, float]
"""Structure, amplitude, frequency."""


def drawn(rng) -> Point:
    """Draw a structure with stops, an amplitude and a frequency."""
    stiffness, damping = 10 ** rng.uniform(1.0, 2.5), 10 ** rng.uniform(-2.3, -1.0)
    gaps = {"gap": float(rng.uniform(0.05, 1.5))}
    if rng.random() < 0.5:
        gaps["gap_left"] = float(rng.uniform(0.05, 1.5))
    floors = int(rng.integers(1, 4))
    structure = hpcsweep.Structure(floors, stiffness, math.inf, damping, **gaps)
    return structure, float(10 ** rng.uniform(-1.5, 0.5)), float(rng.uniform(0.3, 1.5))


def chaotic(seed: int, max_cycles: int) -> Iterator[tuple[Point, Attractor]]:
    """Yield chaotic attractors of random points."""
    rng = np.random.default_rng(seed)
    while True:
        point = drawn(rng)
        for one in hpcsweep.attractors(*point, starts=STARTS, max_cycles=max_cycles):
            if one.kind is MotionClass.CHAOTIC:
                yield point, one


def main(arguments: list[str] | None = None) -> int:
    """Compare, and print what is outside and the sum; 1 if too few intervals hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("attractors", type=int)
    parser.add_argument("--max-cycles", type=int, default=500, help="24 times as many are tested")
    parser.add_argument("--periods", type=int, default=100_000, help="of the spectrum")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    rng, holds, n_ended = np.random.default_rng(options.seed), 0, 0
    found: list[tuple[float, float, float]] = []
    begun = time.process_time()
    for (structure, *at), one in chaotic(options.seed, options.max_cycles):
        units = structure.state_units
        state = one.points[-1] + OFF * units * rng.normal(size=units.size)
        points = hpcsweep.stroboscopic_points(structure, *at, state, options.periods) / units
        if np.abs(points[-LONGEST:-1] - points[-1]).max(axis=1).min() < SAME:
            n_ended += 1
            continue
        given = {"error": 1e-9, "max_cycles": options.periods}
        exact = hpcsweep.lyapunov_spectrum(structure, *at, state, **given)
        value, half = float(exact.exponents[0]), one.lyapunov_high - one.lyapunov
        away = abs(value - one.lyapunov)
        holds += away <= half
        found.append((half / one.lyapunov, float(exact.errors[0]) / half, away / half))
        if away > half:
            print(
                f"{structure.n_floors} floors, {structure.stiffness_ratio:.4g}, A = {at[0]:.6g}, "
                f"Omega = {at[1]:.6g}: {one.lyapunov:.5g} [{one.lyapunov_low:.5g}, "
                f"{one.lyapunov_high:.5g}], spectrum {value:.5g} +- {exact.errors[0]:.2g}"
            )
        if len(found) % TOLD == 0 or len(found) == options.attractors:
            length, error, apart = np.median(found, axis=0)
            print(
                f"{holds} of {len(found)} intervals hold, {n_ended} more have ended; medians: half "
                f"an interval {length:.2g} of the exponent, the spectrum's error {error:.2g} and "
                f"the difference {apart:.2g} of that; {time.process_time() - begun:.0f} s",
                flush=True,
            )
        if len(found) == options.attractors:
            break
    return int(holds < HOLD * len(found))


if __name__ == "__main__":
    sys.exit(main())
