"""What is particular to the solver bdf: its tolerances, steps and failures."""

import math

import numpy as np
import pytest
from reference import OMEGA, reference_points, reference_window

from hpcsweep import bdf
from hpcsweep.bdf import BdfMap
from hpcsweep.outcome import Outcome
from hpcsweep.structure import Structure

IMPACTING = Structure(3, 1000.0, 1e4, 0.05)


@pytest.mark.parametrize("amplitude", [0.01, 0.06, 0.25])
def test_error_falls_with_the_tolerance(amplitude):
    exact = reference_points(IMPACTING, amplitude, OMEGA, np.zeros(6), 2)
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9):
        points, _ = BdfMap(IMPACTING, OMEGA, rtol).points(np.zeros(6), amplitude, 2)
        errors.append(np.abs(points - exact).max())
        assert errors[-1] <= 1e3 * rtol
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < 0.2 * errors[1]


def test_a_thin_layer_is_not_stepped_over():
    # crossing the layer without a step in it costs 5,000 times the tolerance in this case
    exact = reference_points(IMPACTING, 0.25, OMEGA, np.zeros(6), 1)
    points, _ = BdfMap(IMPACTING, OMEGA, 1e-9).points(np.zeros(6), 0.25, 1)
    assert np.abs(points - exact).max() < 1e-6


def test_steps_are_limited_near_the_stop_only():
    solver = BdfMap(Structure(1, 1000.0, math.inf, 0.0), 1.0, 1e-6)

    def limit(u, v):
        return solver._step_limit(0.0, np.array([u, v]), lambda _tau, z: np.array([z[1], 0.0]))

    # under the acceleration bound 1: 2 g / (v + sqrt(v^2 + 2 g))
    assert limit(0.5, 0.0) == pytest.approx(1.0, rel=1e-2)
    assert limit(0.5, 3.0) == pytest.approx(1 / (3 + math.sqrt(10)), rel=1e-2)
    assert limit(0.5, -3.0) == limit(0.5, 0.0)
    assert limit(1.5, -3.0) == limit(0.5, 3.0)
    assert limit(1.0, 0.3) == solver.least_limit


def test_poll_is_called_every_period():
    calls = []
    BdfMap(IMPACTING, OMEGA, 1e-4).points(np.zeros(6), 0.01, 3, poll=lambda: calls.append(1))
    assert len(calls) == 3


def test_drift_and_contact_come_from_interpolants():
    # at a loose tolerance step ends are far from the peaks: they must still be found
    structure = Structure(1, 1000.0, math.inf, 0.0)
    state = np.array([0.0, 0.99])
    seen = BdfMap(structure, 1.0, 1e-6).observe(state, 0.0, 1)
    assert seen.contact == 0
    assert seen.peak_drift == pytest.approx(0.99, abs=1e-5)
    assert BdfMap(structure, 1.0, 1e-6).observe(1.02 * state, 0.0, 1).contact == 1


def test_modal_norms_converge():
    state = reference_points(IMPACTING, 0.06, OMEGA, np.zeros(6), 2)[-1]
    exact = reference_window(IMPACTING, 0.06, OMEGA, state, 1)[2]
    for rtol, limit in ((1e-6, 1e-4), (1e-9, 1e-6)):
        seen = BdfMap(IMPACTING, OMEGA, rtol).observe(state, 0.06, 1, modal_norm=True)
        assert np.abs(seen.modal_norm - exact).max() < limit


def test_gives_up_as_an_outcome(monkeypatch):
    class Stuck(bdf.BDF):
        def _step_impl(self):
            return False, self.TOO_SMALL_STEP

    monkeypatch.setattr(bdf, "BDF", Stuck)
    done = BdfMap(IMPACTING, OMEGA, 1e-6).advance(np.zeros(6), 0.06, 2)
    assert done.outcome is Outcome.SOLVER_FAILED
    assert done.n_periods == 0


def test_tolerances_scipy_refuses_are_raised():
    solver = BdfMap(Structure(1), 1.0, 1e-16)
    assert solver.rtol == bdf.SMALLEST_RTOL
    points, outcome = solver.points(np.zeros(2), 0.0, 1)
    assert outcome is Outcome.COMPLETE
    assert not points.any()
