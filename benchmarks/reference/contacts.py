"""A search for contacts that `flow` does not see.

`bash benchmarks/run.sh contacts [--tries N] [--seed S] [--general]` starts motions in which one
to three contacts, free or beside others that are closed, come to rest at some time within 1e-3 to
1e-13 gaps of the stop. The Taylor reference, whose steps are searched for their highest points one
by one, says whether each contact touched; `flow` has to say the same and to end in the same state.
`--general` takes random structures of any kind (`general`), in units of theirs.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math
from collections import Counter
from dataclasses import dataclass, replace

import numba
import numpy as np
from accuracy import Case
from general import (
    GeneralCase,
    backwards,
    earlier,
    highest_frequency,
    log_uniform,
    put,
    somewhere,
)
from general import random_structure as random_general_structure
from reference import ORDER, PART_OF_RADIUS, horner, majorant, period, system

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver

ROOM = 20_000
"""Steps of the reference in one period that can be looked at."""
SAMPLES = 33
UNDECIDED = 1e-14
"""Peaks this close to the stop (over the largest |u|) are lost in rounding: either is right."""
PER_STRUCTURE = 50
SHORTEST = 5.0
"""Largest ratio of a natural frequency of a general structure to the forcing's."""


@numba.njit(error_model="numpy")
def highest(count, sizes, past, peaks):
    """Highest x of every contact over all steps: samples, and the tops between them."""
    n = peaks.shape[0]
    peaks[:] = -np.inf
    slope = np.empty(ORDER)
    for k in range(count):
        h = sizes[k]
        for i in range(n):
            c = past[k, i]
            if c[0] + majorant(c, h) < peaks[i]:
                continue
            for p in range(1, ORDER + 1):
                slope[p - 1] = p * c[p]
            for j in range(SAMPLES):
                left = h * j / SAMPLES
                right = h * (j + 1) / SAMPLES
                peaks[i] = max(peaks[i], horner(c, left), horner(c, right))
                if horner(slope, left) > 0 and horner(slope, right) < 0:
                    for _ in range(60):
                        middle = 0.5 * (left + right)
                        if horner(slope, middle) > 0:
                            left = middle
                        else:
                            right = middle
                    peaks[i] = max(peaks[i], horner(c, left))


@dataclass(frozen=True)
class Try:
    """One try: distances past the stop by the reference, what `flow` saw, and its error."""

    case: Case | GeneralCase
    peaks: np.ndarray
    largest: float
    contact: int
    error: float
    outcome: Outcome = Outcome.COMPLETE

    def contacts_wrong(self) -> list[int]:
        """Return the numbers of the contacts on which `flow` is wrong beyond rounding."""
        if self.outcome is not Outcome.COMPLETE:
            return list(self.case.structure.contact_numbers)
        return [
            number
            for number, peak in zip(self.case.structure.contact_numbers, self.peaks, strict=True)
            if bool(self.contact >> (number - 1) & 1) != (peak >= 0)
            and abs(peak) > UNDECIDED * max(1.0, self.largest)
        ]


def random_structure(rng):
    """Draw stop, structure and forcing: short periods, hard stops, sharp or infinitely so."""
    n = int(rng.integers(1, 7))
    rho = math.inf if rng.random() < 0.6 else log_uniform(rng, 1e4, 1e8)
    omega = log_uniform(rng, 1.0, 6.0)
    return Case(
        "contact", log_uniform(rng, 1.0, 1e5), rho, log_uniform(rng, 0.002, 0.3), omega, 0.0,
        (0.0,) * (2 * n),
    )  # fmt: skip


def random_try(rng, case):
    """Draw a motion of `case` with one to three floors at rest near the stop at some time."""
    n = len(case.state) // 2
    u, v = rng.uniform(-0.5, 0.9, n), rng.uniform(-0.5, 0.5, n)
    floors = rng.choice(n, size=min(n, int(rng.choice([1, 1, 1, 2, 3]))), replace=False)
    for floor in floors:
        u[floor] = 1.0 + log_uniform(rng, 1e-13, 1e-3) * rng.choice([1, 1, 1, -1])
        v[floor] = 0.0
    others = [i for i in range(n) if i not in floors]
    closed = [i for i in others if rng.random() < 0.2]
    for floor in closed:
        u[floor] = 1.0 + log_uniform(rng, 1e-4, 1e-1)
    case = replace(case, amplitude=log_uniform(rng, 1e-2, 1.0))
    limit = min(2 * math.pi / case.omega, 1.0 / math.sqrt(case.beta) if closed else 3.0)
    tau = float(rng.uniform(0.0, limit))
    z = np.concatenate((u, v))
    start = backwards(case.structure, case.amplitude, case.omega, z, tau, closed)
    return replace(case, state=tuple(start.tolist()))


def random_general(rng):
    """Draw a general structure and a frequency, as `random_structure`."""
    sharpness = math.inf if rng.random() < 0.6 else log_uniform(rng, 1e4, 1e8)
    structure = random_general_structure(rng, sharpness)
    omega = log_uniform(rng, 1.0, 6.0) * float(rng.choice(structure.frequencies))
    omega = max(omega, highest_frequency(structure) / SHORTEST)
    return GeneralCase("contact", 0, structure, omega, 0.0, ())


def random_general_try(rng, case):
    """Draw a motion of a general case with one to three contacts at rest near their stops."""
    structure = case.structure
    _, amplitude, z = somewhere(rng, structure)
    n_contacts = len(structure.contacts)
    number = min(n_contacts, int(rng.choice([1, 1, 1, 2, 3])))
    chosen = rng.choice(n_contacts, size=number, replace=False)
    near = [log_uniform(rng, 1e-13, 1e-3) * float(rng.choice([1, 1, 1, -1])) for _ in chosen]
    wanted = [(k, x * structure.length_unit, 0.0) for k, x in zip(chosen, near, strict=True)]
    z = put(structure, z, wanted)
    z = earlier(rng, structure, amplitude, case.omega, z, chosen)
    return replace(case, amplitude=amplitude, state=tuple(z.tolist()))


def tries(number, seed=0, general=False):
    """Return `number` tries."""
    rng = np.random.default_rng(seed)
    sizes, starts, series = np.empty(ROOM), np.empty(ROOM), None
    for k in range(number):
        if k % PER_STRUCTURE == 0:
            case = random_general(rng) if general else random_structure(rng)
            structure = case.structure
            units = np.array(structure.state_units)
            solver = make_solver("flow", structure, case.omega, 1e-9)
            series = np.empty((ROOM, units.size, ORDER + 1))
            peaks = np.empty(len(structure.contacts))
        one = random_general_try(rng, case) if general else random_try(rng, case)
        z = np.array(one.state)
        arguments = system(structure, one.amplitude, one.omega)
        count = period(z, *arguments, PART_OF_RADIUS, starts, sizes, series)
        if count > ROOM:
            raise ArithmeticError(f"the reference needs {count} steps for {one}")
        parts = arguments[2]
        u = series[:count, : len(z) // 2]
        past = np.einsum("ki,sip->skp", parts.reach, u)
        past[:, :, 0] -= parts.gap
        highest(count, sizes, past, peaks)
        seen = solver.observe(np.array(one.state), one.amplitude, 1)
        size = np.abs(series[:count, :, 0] / units).max(axis=0).max()
        largest = float(size + np.abs(parts.offset / units[0]).max())
        error = math.inf
        if seen.outcome is Outcome.COMPLETE:
            error = float(np.abs((seen.points[0] - z) / units).max()) / max(largest, 1.0)
        yield Try(one, peaks / units[0], largest, seen.contact, error, seen.outcome)


def summary(number, seed=0, general=False):
    """Count what was tried, by decade of the smallest peak past the stop; collect the wrong."""
    decades, wrong, worst, undecided = Counter(), [], None, 0
    for one in tries(number, seed, general):
        over = [peak for peak in one.peaks if 0 <= peak < 1e-3]
        for peak in over:
            decades[max(-16, math.floor(math.log10(max(peak, 1e-16))))] += 1
        undecided += any(abs(peak) <= UNDECIDED * max(1.0, one.largest) for peak in one.peaks)
        if one.contacts_wrong():
            wrong.append(one)
        if worst is None or one.error > worst.error:
            worst = one
    return decades, wrong, worst, undecided


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--general", action="store_true", help="random structures of any kind")
    options = parser.parse_args()
    decades, wrong, worst, undecided = summary(options.tries, options.seed, options.general)
    print(f"{options.tries} tries; contacts that pass the stop by less than 1e-3, by decade:")
    print("  " + ", ".join(f"1e{decade}: {decades[decade]}" for decade in sorted(decades)))
    print(f"contacts missed or invented: {len(wrong)}; within rounding of the stop: {undecided}")
    for one in wrong[:20]:
        reported = one.contacts_wrong(), one.peaks.tolist(), bin(one.contact), one.outcome.name
        print("  ", *reported, one.case)
    print(f"largest error of the end state: {worst.error:.1e} ({worst.case})")


if __name__ == "__main__":
    main()
