"""`stress`: its verdicts, and the bounded run."""

import json
import math
import os
import time

import numpy as np
import pytest
import stress
from stability.cases import Case, made
from stability.hard_structures import hard_structures
from stability.runs import _inconsistent, answer, as_json, energy
from stability.watchdog import Lost, each
from together import together

from hpcsweep.model.contact import contact_force
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation


def behave(item):
    """Work for the watchdog: by name."""
    if item == "hang":
        time.sleep(60)
    if item == "raise":
        raise ValueError("as asked")
    if item == "die":
        os._exit(3)
    return None if item is None else item.upper()


@pytest.mark.slow
def test_a_hang_an_error_and_a_death_are_told_and_the_rest_goes_on():
    items = ["a", "raise", "b", "hang", "c", "die", "d"]
    found = dict(each(behave, items, lambda item: 1.0 if item == "hang" else 60.0))
    assert [found[name] for name in "abcd"] == ["A", "B", "C", "D"]
    assert found["raise"] == Lost("ValueError: as asked")
    assert found["hang"] == Lost("hang: no answer in 1 s")
    assert found["die"].reason.startswith("its process died")


@pytest.mark.parametrize("rho", [0.0, 5.0, 300.0, math.inf])
def test_energy_is_the_potential_of_the_contact_force(rho):
    structure = Structure(1, 40.0, rho, 0.0)
    for u in (0.2, 0.999, 1.0, 1.001, 1.7):
        d = 1e-5
        up, down = (energy(structure, np.array([u + s * d, 0.0])) for s in (1, -1))
        x = u - 1
        switch = (
            0.5 if rho == 0 else float(x > 0) if rho == math.inf else 1 / (1 + math.exp(-rho * x))
        )
        assert (up - down) / (2 * d) == pytest.approx(u + 40.0 * switch * x, abs=1e-3)


@pytest.mark.parametrize("rho", [0.0, 5.0, 300.0, math.inf])
def test_energy_of_any_structure_is_that_of_its_forces(rho):
    """K u and the pushes of the contacts, by the law, are the gradient of the energy."""
    contacts = [Contact((1.0, -1.0), 0.1, 30.0), Contact((-0.5, 0.2), -0.2, 7.0)]
    stiffness = np.array([[2.0, -0.5], [-0.5, 1.0]])
    structure = Structure.from_matrices([2.0, 3.0], stiffness, contacts, sharpness=rho)
    u, v = np.array([0.3, 0.15]), np.array([0.4, -0.7])
    force = stiffness @ u
    for contact in contacts:
        d = np.array(contact.direction)
        x = float(d @ u - contact.gap)
        force += d * contact_force(x, contact.stiffness, rho)
    step = 1e-6 * np.eye(4)
    z = np.concatenate((u, v))
    slope = [(energy(structure, z + e) - energy(structure, z - e)) / 2e-6 for e in step]
    assert slope == pytest.approx([*force, 2.0 * v[0], 3.0 * v[1]], abs=1e-7)


def test_hard_structures_are_what_they_say():
    for rho in (1e4, math.inf):
        every = list(hard_structures(rho))
        found = dict(every)
        assert len(found) == len(every)
        structures = {name: made(given) for name, given in found.items()}
        assert all(structure.contacts for structure in structures.values())
        assert len(structures["64 contacts on a row"].contacts) == 64
        assert len(structures["16 harmonics"].harmonics) == 16
        masses = np.diag(structures["both from 1e-6 to 1e6"].mass_matrix)
        assert masses.max() / masses.min() == pytest.approx(1e12)
        assert structures["directions of length 1e-08"].length_unit < 1e-8


def test_a_contact_set_may_be_larger_than_the_floors_are_many():
    one = Structure(1, gap=0.5, gap_left=0.5)
    assert _inconsistent(one, seen(points=np.zeros((2, 2)), contact=3), 2) == ""
    assert "beyond" in _inconsistent(one, seen(points=np.zeros((2, 2)), contact=4), 2)


def seen(**changes):
    good = {
        "points": np.zeros((2, 4)), "contact": 1, "peak_drift": 0.1,
        "modal_norm": np.array([0.5, 0.5]), "outcome": Outcome.COMPLETE,
    }  # fmt: skip
    return Observation(**{**good, **changes})


@together(
    "changes, said",
    [
        ({}, ""),
        ({"points": np.full((2, 4), math.nan)}, "not finite"),
        ({"points": np.zeros((1, 4))}, "complete, but 1 of 2"),
        ({"points": np.zeros((1, 4)), "outcome": Outcome.STEP_LIMIT}, ""),
        ({"outcome": Outcome.NON_FINITE}, "failed, but all"),
        ({"contact": 4}, "beyond the last contact"),
        ({"peak_drift": math.nan}, "drift"),
        ({"modal_norm": np.array([0.5, math.nan])}, "modal norms"),
    ],
)
def test_what_counts_as_a_failure(changes, said):
    problem = _inconsistent(Structure(2), seen(**changes), 2)
    assert (said in problem) if said else problem == ""


def test_a_named_outcome_passes_and_a_wrong_state_does_not(monkeypatch):
    huge = Case("run", "state", "huge", {"n_floors": 1}, state=(1e200, 0.0))
    assert answer(huge).passed
    assert answer(huge).outcome == "NON_FINITE"
    case = Case("reference", "x", "x", {"n_floors": 1}, 1.0, 0.5)
    assert answer(case).passed
    monkeypatch.setattr(
        "stability.runs.reference_points", lambda *arguments: np.full((1, 2), 0.123)
    )
    assert not answer(case).passed


def test_a_solver_may_give_up_huge_states_only(monkeypatch):
    class GivesUp:
        counts = np.zeros(4)

        def observe(self, state, *arguments, **options):
            return seen(points=np.zeros((0, state.size)), outcome=Outcome.SOLVER_FAILED)

        def points(self, state, *arguments):
            return np.zeros((0, state.size)), Outcome.SOLVER_FAILED

    monkeypatch.setattr("stability.runs.make_solver", lambda *arguments: GivesUp())
    case = Case("random", "x", "x", n_periods=8)
    found = answer(case)
    assert not found.passed
    assert "gave up" in found.remark
    monkeypatch.setattr(
        "stability.random_runs.random_state", lambda rng, s: np.full(2 * s.n_floors, 1e9)
    )
    assert answer(case).passed


def test_json_has_no_infinities():
    row = {"structure": {"sharpness": math.inf}, "passed": True, "state": (0.0, 1.0)}
    text = json.dumps(as_json([row]), allow_nan=False)
    assert json.loads(text)["cases"][0]["structure"]["sharpness"] == "inf"


@pytest.mark.slow
def test_the_bounded_run(capsys):
    code = stress.main(["--quick", "--json"])
    told = capsys.readouterr().out
    assert code == 0, told
    report = json.loads(told)
    assert report["failed"] == 0
    groups = {row["group"] for row in report["cases"]}
    plain = {"structure", "forcing", "at rest", "grazing orbit", "energy", "random runs"}
    assert groups >= plain | {"any structure"}
    assert any("bdf" in row["asked"] for row in report["cases"])
