"""Random structures under random records against the Taylor reference, with and without dashpots.

`python tests/reference/random_records.py [--cases N] [--bdf N] [--seed S]` prints the error of the
state at the end of a record, over the size of the motion and its conditioning, in a table in
Markdown: of `flow` on N cases, of `bdf` on every so many of them.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import math

import numpy as np
from dashpots import Case, case_of, differences, random_case, scaled

from hpcsweep.checks.random_structures import log_uniform, random_structure
from hpcsweep.model.record import Record
from hpcsweep.solvers.reference import reference_record
from hpcsweep.solvers.response import response

KINDS = ("sharp", "smooth", "with dashpots")
"""Contacts of a case; half of them have dashpots."""
BDF_RTOL = 1e-9


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


def errors(case: Case, record: Record, solvers: dict[str, float]) -> list[float]:
    """Return the error of each solver at its tolerance, over the conditioning."""

    def end_of(start):
        return reference_record(case.structure, record.acceleration, record.dt, 1.0, start)[0]

    exact, growth = end_of(case.state), differences(end_of, case)
    return [
        scaled(
            response(case.structure, record, state=case.state, solver=name, rtol=rtol).final_state,
            exact,
            case,
            growth,
        )
        for name, rtol in solvers.items()
    ]


def measure(number: int, n_bdf: int, seed: int) -> dict[str, dict[str, list[float]]]:
    """Return the errors of each solver, by the kind of contacts."""
    rng = np.random.default_rng(seed)
    found: dict = {kind: {"flow": [], "bdf": []} for kind in KINDS}
    every = max(1, number // n_bdf) if n_bdf else number + 1
    for place in range(number):
        kind = KINDS[(0, 2, 1, 2)[place % 4]]
        solvers = {"flow": 1e-9}
        if place % every == every - 1:
            solvers["bdf"] = BDF_RTOL
        case = draw(rng, kind)
        for name, error in zip(
            solvers, errors(case, random_record(rng, case), solvers), strict=True
        ):
            found[kind][name].append(error)
    return found


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--bdf", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    print("| contacts | solver | cases | half | 99 % | all |\n|---|---|---:|---:|---:|---:|")
    for kind, solvers in measure(asked.cases, asked.bdf, asked.seed).items():
        for name, values in solvers.items():
            if values:
                cells = (f"{one:.1e}" for one in np.quantile(values, (0.5, 0.99, 1.0)))
                print(f"| {kind} | `{name}` | {len(values)} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
