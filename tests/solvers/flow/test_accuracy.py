"""Accuracy of `flow` on motions chosen to be hard; the sizes come from the environment.

The full sizes of the claims: `ACCURACY_CASES=2000 ACCURACY_TRIES=100000 pytest -m slow
tests/solvers/flow/test_accuracy.py`, or `bash benchmarks/run.sh accuracy --certify` and
`bash benchmarks/run.sh contacts`, which print the numbers; with `--general` those of random
structures of any kind.
"""

import math
import os
from collections import Counter

import numpy as np
import pytest
from accuracy import EPSILON, KINDS, Case, certify, measure, random_cases, refer
from contacts import summary
from extended import monodromy_mp
from general import GENERAL_KINDS, random_general_case, random_general_cases
from reference import reference_monodromy
from tolerance import ALLOWED, FLOOR, regimes
from tolerance import measure as measure_tolerance

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver

N_CASES = int(os.environ.get("ACCURACY_CASES", "120"))
N_TRIES = int(os.environ.get("ACCURACY_TRIES", "4000"))
N_MATRICES = int(os.environ.get("ACCURACY_MATRICES", "40"))
LIMIT = 1e-10
ROUNDINGS = 100
"""Roundings, amplified by the conditioning of a case, that its error may hold besides."""
GENERAL_LIMIT = 1e-11
"""Error allowed a period of a general structure, over its conditioning."""
AMPLIFIED = 4e-12
"""Error allowed in one closed-form passage, which the rest of the period amplifies."""


@pytest.fixture(scope="module")
def measured():
    cases = random_cases(N_CASES, seed=1)
    return [(case, refer(case)) for case in cases]


@pytest.mark.slow
def test_the_cases_are_the_hard_ones(measured):
    happened = sum((Counter(set(reference.passages)) for _, reference in measured), Counter())
    assert {case.kind for case, _ in measured} == set(KINDS)
    for event, share in (
        ("turn in the layer", 0.3),
        ("below 1e-3 in the layer", 0.2),
        ("two contacts in the layer", 0.2),
        ("three contacts in the layer", 0.08),
        ("two changes within a step", 0.2),
    ):
        assert happened[event] >= share * N_CASES, event


@pytest.mark.slow
def test_map_of_one_period(measured):
    errors = [measure(case, reference) for case, reference in measured]
    plain = np.array([error.plain for error in errors])
    kappa = np.array([error.kappa for error in errors])
    assert np.quantile(plain, 0.5) < 1e-13
    assert np.quantile(plain, 0.9) < 1e-11
    # beyond the limit only what rounding, or a passage's own limit, amplified, explains
    excess = plain - np.maximum(LIMIT, (ROUNDINGS * EPSILON + AMPLIFIED) * kappa)
    assert excess.max() <= 0, measured[int(excess.argmax())][0]


@pytest.mark.slow
def test_the_worst_numbers_are_not_the_reference_s(measured):
    quick = [item for item in measured if item[0].omega > 0.3]
    quick.sort(key=lambda item: -measure(*item).scaled)
    for case, reference in quick[:2]:
        found = certify(case, reference)
        size = max(1.0, float(np.abs(reference.end).max()))
        allowed = max(1e-13, ROUNDINGS * EPSILON * reference.kappa) * size
        assert found["reference_error"] <= allowed, case


@pytest.mark.slow
def test_monodromy_of_hard_cases(measured):
    for case, reference in measured[:N_MATRICES]:
        state = np.array(case.state)
        solver = make_solver("flow", case.structure, case.omega, 1e-9)
        _, matrix = solver.monodromy(state, case.amplitude, 1)
        exact = reference_monodromy(case.structure, case.amplitude, case.omega, state, 1)[1]
        size = max(1.0, float(np.abs(exact).max()))
        # a tangent changes by rho per gap of its path inside a layer
        bend = max(1.0, min(case.rho, 1e6)) * reference.kappa
        error = float(np.abs(matrix - exact).max()) / size
        assert error <= max(1e-7, 1e-11 * bend), (case, error)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2])
def test_monodromy_against_extended_differences(n):
    structure = Structure(n, 300.0, 5e3, 0.03)
    start = np.array([0.8] * n + [0.9] * n)
    columns = [0, 2 * n - 1]
    _, matrix = make_solver("flow", structure, 1.3, 1e-9).monodromy(start, 0.4, 1)
    assert make_solver("flow", structure, 1.3, 1e-9).observe(start, 0.4, 1).contact
    exact = monodromy_mp(structure, 0.4, 1.3, start, columns)
    # a closed-form passage leaves up to 1e-12 in the state, more in its derivative
    assert np.abs(matrix[:, columns] - exact).max() <= 1e-9 * max(1.0, np.abs(exact).max())


@pytest.mark.slow
def test_no_contact_is_missed():
    decades, wrong, worst, undecided = summary(N_TRIES, seed=2)
    # the search has to have looked where it says it does
    for decade in range(-12, -3):
        assert decades[decade] >= N_TRIES // 100, decade
    assert undecided <= N_TRIES // 100
    assert wrong == []
    assert worst.error < 2e-9


@pytest.fixture(scope="module")
def general():
    return [(case, refer(case)) for case in random_general_cases(N_CASES, seed=4)]


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 74])
def test_contacts_that_push_each_other_inside_their_layers(number):
    # the softening of one that is switched on once hid the stiffness of the others
    kind = GENERAL_KINDS[number % len(GENERAL_KINDS)]
    case = random_general_case(np.random.default_rng([0, number]), kind, number)
    assert measure(case).scaled < 5e-13


@pytest.mark.slow
def test_general_structures(general):
    errors = [measure(case, reference).scaled for case, reference in general]
    worst = int(np.argmax(errors))
    assert errors[worst] <= GENERAL_LIMIT, general[worst][0]
    assert np.quantile(errors, 0.5) < 1e-14
    assert np.quantile(errors, 0.9) < 1e-12


@pytest.mark.slow
def test_the_general_cases_are_the_hard_ones(general):
    happened = sum((Counter(set(reference.passages)) for _, reference in general), Counter())
    assert {case.kind for case, _ in general} == set(GENERAL_KINDS)
    for event, share in (
        ("turn in the layer", 0.3),
        ("below 1e-3 in the layer", 0.15),
        ("two contacts in the layer", 0.15),
        ("three contacts in the layer", 0.05),
        ("two changes within a step", 0.2),
    ):
        assert happened[event] >= share * N_CASES, event


@pytest.mark.slow
def test_no_contact_of_a_general_structure_is_missed():
    decades, wrong, worst, undecided = summary(N_TRIES // 2, seed=2, general=True)
    for decade in range(-12, -3):
        assert decades[decade] >= N_TRIES // 400, decade
    assert undecided <= N_TRIES // 50
    assert wrong == []
    assert worst.error < 2e-9


@pytest.mark.slow
def test_conditioning_of_a_linear_case_in_closed_form():
    # undamped and free: the tangent map is a rotation in the energy norm
    case = Case("anywhere", 1000.0, math.inf, 0.0, 1.0, 0.0, (0.1, 0.0))
    found = refer(case)
    assert found.kappa == pytest.approx(math.sqrt(2), rel=1e-3)
    assert measure(case, found).plain < 1e-14


@pytest.mark.slow
def test_a_requested_tolerance_is_met():
    rows = measure_tolerance(requested=(1e-3, 1e-5, 1e-7, 1e-9, 1e-11), n_states=2)
    assert {row.regime for row in rows} == {regime.name for regime in regimes()}
    for row in rows:
        assert row.error <= ALLOWED[row.solver] * row.rtol + FLOOR[row.solver], row
