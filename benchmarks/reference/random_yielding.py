"""Random structures whose sliders slip under random records, against a reference.

`bash benchmarks/run.sh random_yielding [--cases N] [--seed S] [--smooth]` draws structures of 1 to
8 coordinates with up to 6 sliders and 4 contacts; in half of them weights take a part of each
storey, so that they soften, and all end where a coordinate leaves its limit. A table in Markdown
has the errors of the state at the end, of the lasting elongations, of their paths and of the time
of a collapse, over the size of the motion and its conditioning (the change of the reference's end
by a small change of the record); below it are the numbers of collapses, and of the cases in which a
slider has slipped another number of times or another structure has collapsed. With `--smooth` all
have contacts, of a sharpness from 10 to 10,000, and the table has the balance of energies, too.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
from typing import NamedTuple

import numpy as np
from yielding import SmoothYielding, Yielding

from hpcsweep.model.matrices import Contact
from hpcsweep.model.record import Record
from hpcsweep.model.slider import Slider
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.response import response

CHANGE = 1e-8
"""Relative, of the record, by which the conditioning is measured."""


NAMES = "state at the end", "lasting elongations", "their paths", "time of collapse", "energies"


class Case(NamedTuple):
    """A structure by its matrices, and a record."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    contacts: list[Contact]
    sliders: list[Slider]
    record: Record
    limit: float
    sharpness: float = np.inf


def random_case(rng, smooth: bool = False) -> Case:
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
    if rng.random() < 0.5:  # weights over heights
        spent = (steps.T * (springs * rng.uniform(0.0, 0.15, n))) @ steps
        held = sum(one.stiffness * np.outer(one.direction, one.direction) for one in sliders)
        if np.linalg.eigvalsh(elastic - spent + held)[0] > 0.01:
            elastic -= spent
    contacts = []
    for _ in range(int(rng.integers(1 if smooth else 0, 5))):
        d = np.eye(n)[int(rng.integers(n))] * rng.choice((-1.0, 1.0))
        contacts.append(Contact(d, float(rng.uniform(0.1, 1.0)), float(rng.uniform(5.0, 200.0))))
    samples = rng.standard_normal(int(rng.integers(10, 40))) * rng.uniform(0.5, 6.0)
    damping = rng.uniform(0.0, 0.1) * initial
    record = Record(samples, rng.uniform(0.05, 0.3))
    limit = max(float(rng.uniform(0.5, 5.0)), 0.61)  # above the elongations of all sliders
    given = mass, elastic, damping, contacts, sliders, record, limit
    return Case(*given, float(10.0 ** rng.uniform(1.0, 4.0))) if smooth else Case(*given)


def reference_of(case: Case, factor: float = 1.0) -> tuple[Yielding, np.ndarray]:
    """Return the reference after its run, and the end."""
    limits = [(row, case.limit) for row in np.eye(len(case.mass))]
    given = case.mass, case.stiffness, case.damping, case.contacts, case.sliders, limits
    smooth = case.sharpness < np.inf
    found = SmoothYielding(case.sharpness, *given) if smooth else Yielding(*given)
    return found, found.run(factor * np.array(case.record.acceleration), case.record.dt)


def errors(case: Case) -> tuple[float, ...]:
    """Return the errors of `NAMES`, and whether it collapses, and whether the counts differ."""
    structure = Structure.from_matrices(
        *(case.mass, case.stiffness, case.contacts),
        damping=case.damping,
        sliders=case.sliders,
        collapse_drift=case.limit,
        sharpness=case.sharpness,
    )
    smooth = case.sharpness < np.inf
    seen = response(structure, case.record, energy=smooth)
    exact, end = reference_of(case)
    _, moved = reference_of(case, 1.0 + CHANGE)
    size = max(1.0, np.abs(end).max())
    unit = size * max(1.0, np.abs(moved - end).max() / size / CHANGE)
    return (
        np.abs(seen.final_state - end).max() / unit,
        np.abs(seen.plastic - exact.plastic).max() / unit,
        np.abs(seen.plastic_path - exact.path).max() / unit,
        0.0 if np.isnan(exact.collapse) else abs(seen.collapse_time - exact.collapse) / unit,
        abs(seen.energy.balance) if seen.energy else 0.0,
        seen.collapsed,
        (seen.excursions != exact.excursions).any() or seen.collapsed == np.isnan(exact.collapse),
    )


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--smooth", action="store_true")
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    found = np.array([errors(random_case(rng, asked.smooth)) for _ in range(asked.cases)])
    print(f"| {asked.cases} cases | half | 99 % | all |\n|---|---:|---:|---:|")
    for name, values in zip(NAMES if asked.smooth else NAMES[:-1], found.T, strict=False):
        cells = " | ".join(f"{one:.1e}" for one in np.quantile(values, (0.5, 0.99, 1.0)))
        print(f"| {name} | {cells} |")
    print(f"\ncollapses: {int(found[:, 5].sum())}; other slips or ends: {int(found[:, 6].sum())}")


if __name__ == "__main__":
    main()
