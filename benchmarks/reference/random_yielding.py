"""Random structures whose sliders slip under random records, against matrix exponentials.

`bash benchmarks/run.sh random_yielding [--cases N] [--seed S]` draws structures of 1 to 8
coordinates with up to 6 sliders and 4 contacts. A table in Markdown has the errors of the state at
the end, of the lasting elongations and of their paths, over the size of the motion and its
conditioning (the change of the reference's end by a small change of the record); below it are the
cases in which a slider has slipped another number of times.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
from typing import NamedTuple

import numpy as np
from yielding import Yielding

from hpcsweep.model.matrices import Contact, Slider
from hpcsweep.model.record import Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.response import response

CHANGE = 1e-8
"""Relative, of the record, by which the conditioning is measured."""


class Case(NamedTuple):
    """A structure by its matrices, and a record."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    contacts: list[Contact]
    sliders: list[Slider]
    record: Record


def random_case(rng) -> Case:
    """Draw a chain of masses with storeys that yield, or a full stiffness with sliders anywhere."""
    n = int(rng.integers(1, 9))
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    steps = np.eye(n) - np.eye(n, k=-1)
    springs = rng.uniform(1.0, 8.0, n)
    initial = (steps.T * springs) @ steps
    elastic, sliders = initial.copy(), []
    for j in range(int(rng.integers(1, 7))):
        i = int(rng.integers(n))
        if j == 0 or rng.random() < 0.7:
            row = steps[i]
        else:
            row = np.round(rng.normal(0.0, 1.0, n), 1)
            row[i] = 1.0
        share = float(rng.uniform(0.1, 0.6)) * springs[i]
        low = np.linalg.eigvalsh(elastic - share * np.outer(row, row))[0]
        spring = share
        if low > -0.02:  # it may soften: a small negative slope once all slip
            elastic -= share * np.outer(row, row)
        sliders.append(Slider(row, spring, spring * float(rng.uniform(0.05, 0.6))))
    contacts = []
    for _ in range(int(rng.integers(0, 5))):
        d = np.eye(n)[int(rng.integers(n))] * rng.choice((-1.0, 1.0))
        contacts.append(Contact(d, float(rng.uniform(0.1, 1.0)), float(rng.uniform(5.0, 200.0))))
    samples = rng.standard_normal(int(rng.integers(10, 40))) * rng.uniform(0.5, 6.0)
    damping = rng.uniform(0.0, 0.1) * initial
    return Case(mass, elastic, damping, contacts, sliders, Record(samples, rng.uniform(0.05, 0.3)))


def reference_of(case: Case, factor: float = 1.0) -> tuple[Yielding, np.ndarray]:
    """Return the reference after its run, and the end."""
    found = Yielding(case.mass, case.stiffness, case.damping, case.contacts, case.sliders)
    return found, found.run(factor * np.array(case.record.acceleration), case.record.dt)


def errors(case: Case) -> tuple[float, float, float, bool]:
    """Return the errors of state, lasting elongations and paths, and whether the counts differ."""
    given = case.mass, case.stiffness, case.contacts
    structure = Structure.from_matrices(*given, damping=case.damping, sliders=case.sliders)
    seen = response(structure, case.record)
    exact, end = reference_of(case)
    _, moved = reference_of(case, 1.0 + CHANGE)
    size = max(1.0, np.abs(end).max())
    unit = size * max(1.0, np.abs(moved - end).max() / size / CHANGE)
    return (
        np.abs(seen.final_state - end).max() / unit,
        np.abs(seen.plastic - exact.plastic).max() / unit,
        np.abs(seen.plastic_path - exact.path).max() / unit,
        bool((seen.excursions != exact.excursions).any()),
    )


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    found = np.array([errors(random_case(rng)) for _ in range(asked.cases)])
    print(f"| {asked.cases} cases | half | 99 % | all |\n|---|---:|---:|---:|")
    names = ("state at the end", "lasting elongations", "their paths")
    for name, values in zip(names, found.T, strict=False):
        cells = " | ".join(f"{one:.1e}" for one in np.quantile(values, (0.5, 0.99, 1.0)))
        print(f"| {name} | {cells} |")
    print(f"\nother numbers of slips: {int(found[:, 3].sum())}")


if __name__ == "__main__":
    main()
