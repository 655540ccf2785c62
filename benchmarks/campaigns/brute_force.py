"""Shares of attractors and basins against brute force: starts followed until they repeat.

    bash benchmarks/run.sh brute_force [--starts 1000] [--periods 200000] [--only N] [--reference]

Ten oscillators that hardly reach their stop, a building with an orbit of period 102, and two masses
between three stops, at which transients without period are long. Independent random starts are
followed for up to 200,000 forcing periods, or until they repeat to rounding: no rule, no skip, no
classification. The search and the basins of a slice, for five seeds each, must give every orbit a
share whose interval meets that of brute force; what brute force says to end must get none; and no
share of motions without period may grow with the number of starts. With --reference 50 starts of
the first oscillator are followed by the Taylor reference, too. Prints a table in Markdown; the exit
code is 1 if something disagrees.
"""

import hpcsweep.commands.one_thread  # isort: skip  (before numpy is loaded)
import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from reference import reference_points
from tools import made

import hpcsweep
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.dynamics.starts import box_of, usual_reach
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

WINDOW, LONGEST = 400, 128
"""Periods of which the repetition is judged, and the longest orbit that is recognised."""
ROUNDING = 1e-11
"""Largest difference of points a period apart on an orbit, in units of the state."""
SAME = 1e-6
SEEDS = range(5)
STARTS = (20, 100, 459)
CONFIDENCE = 0.95


TWO_MASSES = (
    ((1.0, 1.2, 1.1), (40.0, 40.0, 60.0), 0.01, 0.3, 0.9, 0.8),
    ((1.2521, 1.1009, 0.8413), (20.871, 42.247, 39.435), 0.02, 0.4854, 0.7945, 0.75784),
    ((0.7283, 0.7029, 0.8501), (34.083, 78.420, 51.835), 0.02, 0.321, 0.4303, 1.29614),
)
"""Gaps and stiffnesses of three stops, damping ratio, second harmonic, A and Omega."""


class Point(NamedTuple):
    """A structure and its forcing."""

    name: str
    structure: Structure
    amplitude: float
    omega: float


def points() -> list[Point]:
    """Return what is tried."""
    rng = np.random.default_rng(49)
    floor = Structure(1, 29.0, math.inf, 0.01, gap=1.26)
    found = []
    for number in range(1, 11):
        omega, part = float(rng.uniform(0.79, 0.815)), float(rng.uniform(0.95, 1.02))
        amplitude = part * float(floor.grazing_amplitude(omega))
        found.append(Point(f"floor {number}, {part:.3f} of grazing", floor, amplitude, omega))
    damping = (0.1262, 0.0161, 0.0077)
    long = Structure(3, 1000.0, 1e4, damping)
    found.append(Point("P102", long, 0.15828173505911847, 0.514371538944225))
    for gaps, stiffnesses, damping, second, amplitude, omega in TWO_MASSES:
        rows = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
        contacts = [hpcsweep.Contact(*each) for each in zip(rows, gaps, stiffnesses, strict=True)]
        masses = Structure.from_matrices(
            [1.0, 1.0],
            [[2.0, -1.0], [-1.0, 1.0]],
            contacts,
            damping_ratio=damping,
            harmonics=[(1, 1.0, 0.0), (2, second, 0.5)],
        )
        found.append(Point(f"two masses, A = {amplitude}", masses, amplitude, omega))
    return found


def orbit_at(advance: Callable, state: np.ndarray, units: np.ndarray) -> np.ndarray | None:
    """Return the points of the orbit on which a motion is, None if it is on none.

    It must repeat to rounding over the whole `WINDOW`.
    """
    seen = advance(state, WINDOW) / units
    limit = ROUNDING * max(1.0, np.abs(seen).max())

    def repeats(period: int, within: float) -> bool:
        if np.abs(seen[-1] - seen[-1 - period]).max() > within:
            return False
        return bool(np.abs(seen[period:] - seen[:-period]).max() <= within)

    for period in range(1, LONGEST + 1):
        if repeats(period, limit):
            # an approach from alternate sides closes after two turns first
            parts = (part for part in range(1, period + 1) if period % part == 0)
            return seen[-next(part for part in parts if repeats(part, SAME)) :]
    return None


def end_of(advance: Callable, state: np.ndarray, units: np.ndarray, periods: int):
    """Follow a start until it repeats; return its orbit, None after all periods."""
    done, stretch = 0, WINDOW
    while done < periods:
        orbit = orbit_at(advance, state, units)
        if orbit is not None:
            return orbit
        state = advance(state, stretch)[-1]
        done += stretch
        stretch = min(2 * stretch, periods - done)
    return None


def brute_force(point: Point, states: np.ndarray, periods: int, advance: Callable):
    """Follow all starts; return the orbits, and for each start the number of its own, or -1."""
    units = point.structure.state_units
    orbits: list[np.ndarray] = []
    labels = np.full(len(states), -1)
    for at, state in enumerate(states):
        own = end_of(advance, state, units, periods)
        if own is None:
            continue
        for number, known in enumerate(orbits):
            if np.abs(own - known[0]).max(axis=1).min() < SAME:
                labels[at] = number
                break
        else:
            labels[at] = len(orbits)
            orbits.append(own)
    return orbits, labels


class Shares(NamedTuple):
    """Hits of each orbit, and of motions without one, of a number of starts."""

    hits: np.ndarray
    other: int
    starts: int

    def meets(self, more: "Shares") -> list[bool]:
        """Return whether the intervals of the two meet, for each orbit and what has none."""
        pairs = zip([*self.hits, self.other], [*more.hits, more.other], strict=True)
        found = []
        for own, theirs in pairs:
            low, high = share_interval(int(own), self.starts, CONFIDENCE)
            least, most = share_interval(int(theirs), more.starts, CONFIDENCE)
            found.append(low <= most and least <= high)
        return found


def searched(point: Point, orbits, seed: int, starts: int) -> Shares:
    """Return the shares that the search gives."""
    units = point.structure.state_units
    found = hpcsweep.attractors(
        point.structure, point.amplitude, point.omega, seed=seed, starts=starts
    )
    return _sorted(
        orbits, [(one.points / units, one.orbit_period, one.hits) for one in found], starts
    )


def sliced(point: Point, orbits, seed: int, folder: Path) -> Shares:
    """Return the shares of a slice that is the whole box: of one floor."""
    given = point.structure
    text = f"""
[study]
kind = "basins"
horizontal = {{from = -1.25, to = 1.25, count = 21}}
vertical = {{from = -1.25, to = 1.25, count = 21}}
seed = {seed}
[structure]
n_floors = 1
stiffness_ratio = {given.stiffness_ratio}
sharpness = inf
gap = {given.gap}
damping_ratio = {given.damping_ratio}
[sweep]
omega = {point.omega!r}
amplitude = {point.amplitude!r}
"""
    results = hpcsweep.open_results(made(text, folder / f"{seed}.h5"))
    units = point.structure.state_units
    numbers, hits = results.attractor_id.values.ravel(), results.hits.values.ravel()
    periods = results.orbit_period.values.ravel()
    states = results.point.values.reshape(-1, units.size) / units
    parts = [
        (states[first : first + 1], int(periods[first]), int(hits[numbers == number].sum()))
        for number, first in zip(*np.unique(numbers, return_index=True), strict=True)
        if number > 0
    ]
    return _sorted(orbits, parts, int(results.sizes["row"] * results.sizes["column"]))


def _sorted(orbits, found, starts: int) -> Shares:
    """Give what is found to the orbits of brute force; what is none of them has no orbit."""
    hits, named = np.zeros(len(orbits), int), 0
    for states, period, own in found:
        for number, known in enumerate(orbits if period else []):
            if period == len(known) and np.abs(states[0] - known).max(axis=1).min() < 1e3 * SAME:
                hits[number] += own
                named += own
                break
    return Shares(hits, starts - named, starts)


def box_states(point: Point, starts: int, seed: int) -> np.ndarray:
    """Draw independent starts of the box of the search."""
    box = box_of(None, usual_reach(point.structure))
    rng = np.random.default_rng(seed)
    return box[:, 0] + rng.random((starts, len(box))) * (box[:, 1] - box[:, 0])


def compare(point: Point, options, number: int) -> bool:
    """Compare one point, print its row; return whether all agree."""
    solver = FlowMap(point.structure, point.omega)

    def advance(state, n_periods):
        return solver.points(state, point.amplitude, n_periods)[0]

    begun = time.process_time()
    states = box_states(point, options.starts, number)
    orbits, labels = brute_force(point, states, options.periods, advance)
    cost = time.process_time() - begun
    hits = np.bincount(labels[labels >= 0], minlength=len(orbits))
    many = Shares(hits, int((labels < 0).sum()), options.starts)
    agree, others = True, []
    for seed in SEEDS:
        own = searched(point, orbits, seed, STARTS[-1])
        agree &= all(own.meets(many))
        others.append(own.other / own.starts)
    grown = [searched(point, orbits, 0, starts) for starts in STARTS]
    shares = [own.other / own.starts for own in grown]
    agree &= all(own.meets(many)[-1] for own in grown)
    told = [
        f"P{len(orbit)} {hit / options.starts:.3f}" for orbit, hit in zip(orbits, hits, strict=True)
    ]
    cells = (
        point.name,
        ", ".join(told) or "-",
        f"{many.other / options.starts:.3f}",
        f"{min(others):.3f} to {max(others):.3f}",
        " ".join(f"{share:.3f}" for share in shares),
        f"{cost:.0f} s",
        "yes" if agree else "NO",
    )
    print(f"| {' | '.join(cells)} |", flush=True)
    return agree


def compare_basins(point: Point, options) -> bool:
    """Compare the basins of the box of one floor."""
    solver = FlowMap(point.structure, point.omega)

    def advance(state, n_periods):
        return solver.points(state, point.amplitude, n_periods)[0]

    values = np.linspace(-1.25, 1.25, 21)
    states = np.array([(u, v) for v in values for u in values])
    orbits, labels = brute_force(point, states, options.periods, advance)
    hits = np.bincount(labels[labels >= 0], minlength=len(orbits))
    agree = True
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            own = sliced(point, orbits, seed, Path(folder))
            # the same starts: each must go where brute force says
            off = np.abs(own.hits - hits).sum() + abs(own.other - (labels < 0).sum())
            agree &= off == 0
    print(
        f"| basins of {point.name} | {len(states)} | {'equal' if agree else 'OTHER'} |", flush=True
    )
    return agree


def compare_with_reference(point: Point, options) -> bool:
    """Follow 50 starts by the reference: each must end on the orbit that `flow` says."""

    def reference(state, n_periods):
        return np.array(
            reference_points(point.structure, point.amplitude, point.omega, state, n_periods)
        )

    solver = FlowMap(point.structure, point.omega)
    states = box_states(point, 50, 7)
    found = brute_force(point, states, options.periods, reference)
    own = brute_force(
        point, states, options.periods, lambda z, n: solver.points(z, point.amplitude, n)[0]
    )
    alike = [sorted(len(orbit) for orbit in orbits) for orbits, _ in (found, own)]
    off = int((_periods(*found) != _periods(*own)).sum())
    print(f"reference: orbits {alike[0]}, flow {alike[1]}; {off} of {len(states)} starts differ")
    return alike[0] == alike[1] and off <= len(states) // 10


def _periods(orbits, labels) -> np.ndarray:
    """Return the period of the orbit of each start, 0 without one."""
    return np.array([len(orbits[label]) if label >= 0 else 0 for label in labels])


def main(arguments: list[str] | None = None) -> int:
    """Compare all points, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--periods", type=int, default=200_000)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the points, from 1")
    parser.add_argument("--reference", action="store_true")
    options = parser.parse_args(arguments)
    heads = (
        "point",
        "orbits, by brute force",
        "without",
        "searched",
        "20, 100, 459",
        "cost",
        "agree",
    )
    print(f"| {' | '.join(heads)} |")
    print("|---|---|---:|---:|---:|---:|---|")
    agree = True
    for number, point in enumerate(points(), 1):
        if options.only and number not in options.only:
            continue
        agree &= compare(point, options, number)
        if point.structure.n_floors == 1:
            agree &= compare_basins(point, options)
        if number == 1 and options.reference:
            agree &= compare_with_reference(point, options)
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
