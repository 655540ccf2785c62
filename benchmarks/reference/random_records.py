"""Random structures under random records against the Taylor reference, with and without dashpots.

`bash benchmarks/run.sh random_records [--cases N] [--seed S]` prints the error of the state at the
end of a record, over the size of the motion and its conditioning, in a table in Markdown. A second
table has the error of the peaks of drifts, displacements, absolute accelerations and, without
dashpots, forces: relative to the largest of their kind, over the conditioning or, if that is
greater, the change of the peaks by a small change of the start.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math

import numpy as np
from dashpots import Case, case_of, differences, random_case, scaled
from measures import CHANGE, largest, slope_of
from reference import reference_record, system
from scipy.special import expit
from stability.random_structures import log_uniform, random_structure

from hpcsweep.model.record import Record
from hpcsweep.solvers.response import response

KINDS = ("sharp", "smooth", "with dashpots")
"""Contacts of a case; half of them have dashpots."""


def draw(rng, kind: str) -> Case:
    """Draw a structure of a kind, a forcing frequency that tells the length, and a state."""
    if kind == "with dashpots":
        return random_case(rng)
    rho = math.inf if kind == "sharp" else log_uniform(rng, 1e2, 1e5)
    return case_of(rng, random_structure(rng, rho, half=1.0))


def random_record(rng, case: Case) -> Record:
    """Draw 5 to 100 samples, over half a period of the forcing."""
    n_samples = int(log_uniform(rng, 5.0, 100.0))
    samples = case.amplitude * rng.standard_normal(n_samples)
    return Record(samples, math.pi / case.omega / n_samples)


def reference_peaks(case: Case, record: Record, state: np.ndarray) -> list[np.ndarray]:
    """Return the peaks of drifts, displacements, accelerations and, without dashpots, forces."""
    structure, samples, dt = case.structure, np.array(record.acceleration), record.dt
    _, steps = reference_record(structure, samples, dt, 1.0, state)
    parts, n = system(structure, 1.0, 1.0)[2], structure.n_floors
    starts, sizes = (np.array([step[k] for step in steps]) for k in (0, 1))
    c = np.array([step[2] for step in steps])
    c = c * sizes[:, None, None] ** np.arange(c.shape[-1])
    past = parts.reach @ c[:, :n]
    past[..., 0] -= parts.gap
    u = c[:, :n].copy()
    u[..., 0] += parts.offset
    own = slope_of(c[:, n:]) / sizes[:, None, None]
    middle = starts + 0.5 * sizes
    j = np.minimum((middle / dt).astype(int), len(samples) - 2)
    slope = (samples[j + 1] - samples[j]) / dt
    ground = parts.forcing * structure.shakes  # forces on a structure whose base rests: |u''|
    own[..., 0] -= (samples[j] + slope * (starts - j * dt))[:, None] * ground
    own[..., 1] -= (slope * sizes)[:, None] * ground
    peaks = [np.maximum(largest(one), largest(-one)) for one in (structure.drift_rows @ u, u, own)]
    if parts.drag.any():
        return peaks
    most = np.maximum(largest(past), 0.0)
    share = expit(parts.rho * most) if parts.rho < math.inf else 1.0
    return [*peaks, parts.kappa * most * share]


def apart(case: Case, one: list[np.ndarray], other: list[np.ndarray]) -> float:
    """Return the largest difference of peaks over the largest of their kind."""
    structure = case.structure
    length, rate = structure.length_unit, structure.frequency_unit
    units = (length, length, length * rate**2, length * structure.force_per_length.max())
    return max(
        float(np.abs(a - b).max(initial=0.0) / b.max(initial=unit))
        for a, b, unit in zip(one, other, units[: len(other)], strict=True)
    )


def errors(case: Case, record: Record) -> tuple[float, float]:
    """Return the errors of end and peaks, over the conditioning."""

    def end_of(start):
        return reference_record(case.structure, record.acceleration, record.dt, 1.0, start)[0]

    exact, growth = end_of(case.state), differences(end_of, case)
    peaks = reference_peaks(case, record, case.state)
    push = CHANGE * case.structure.state_units * (-1.0) ** np.arange(case.state.size)
    steep = apart(case, reference_peaks(case, record, case.state + push), peaks) / CHANGE
    seen = response(case.structure, record, state=case.state)
    own = [seen.drift, seen.displacement, seen.floor_acceleration, seen.force][: len(peaks)]
    conditioning = max(1.0, np.abs(growth).max(), steep)
    ends = scaled(seen.final_state, exact, case, growth)
    return ends, apart(case, own, peaks) / conditioning


def measure(number: int, seed: int) -> dict[str, list[tuple[float, float]]]:
    """Return the errors by the kind of contacts."""
    rng = np.random.default_rng(seed)
    found: dict = {kind: [] for kind in KINDS}
    for place in range(number):
        kind = KINDS[(0, 2, 1, 2)[place % 4]]
        case = draw(rng, kind)
        found[kind].append(errors(case, random_record(rng, case)))
    return found


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    found = measure(asked.cases, asked.seed)
    for place, what in enumerate(("state at the end", "peaks")):
        print(f"| {what} | cases | half | 99 % | all |\n|---|---:|---:|---:|---:|")
        for kind, values in found.items():
            own = np.quantile([one[place] for one in values], (0.5, 0.99, 1.0))
            cells = " | ".join(f"{one:.1e}" for one in own)
            print(f"| {kind} | {len(values)} | {cells} |")


if __name__ == "__main__":
    main()
