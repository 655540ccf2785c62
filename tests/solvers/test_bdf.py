"""What is particular to the solver bdf: its tolerances, steps and failures."""

import math

import numpy as np
import pytest
from reference import OMEGA, reference_points, reference_window

from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.stopping import Stop
from hpcsweep.solvers import bdf
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.step_tally import StepTally

IMPACTING = Structure(3, 1000.0, 1e4, 0.05)


@pytest.mark.slow
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
    # a step over the layer costs 5,000 times the tolerance here
    exact = reference_points(IMPACTING, 0.25, OMEGA, np.zeros(6), 1)
    points, _ = BdfMap(IMPACTING, OMEGA, 1e-9).points(np.zeros(6), 0.25, 1)
    assert np.abs(points - exact).max() < 1e-6


def steps_of(rho, rtol):
    return bdf.BdfSteps(kernel_model(Structure(1, 1000.0, rho, 0.0), 1.0), rtol)


def test_steps_inside_a_layer_have_its_length_scale():
    def limit(rtol, u):
        solver = steps_of(1e4, rtol)
        return solver._step_limit(0.0, np.array([u, 0.3]), lambda _tau, z: np.array([z[1], 0.0]))

    for u in (1 - 4e-4, 1.0, 1 + 4e-4):
        assert limit(1e-6, u) == pytest.approx(1e-4 / 0.3, rel=1e-2)
    # v changes by beta pi^2 / (6 rho^2) / 0.3 = 5e-5: no layer for a tolerance above that
    assert limit(1e-3, 1.0) == steps_of(1e4, 1e-3).least_limit


def test_steps_are_limited_near_the_stop_only():
    solver = steps_of(math.inf, 1e-6)

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


@pytest.mark.parametrize(("peak", "contact"), [(1 - 1e-9, 0), (1 + 1e-9, 1)])
def test_drift_and_contact_come_from_extrema_between_step_ends(peak, contact):
    tally = StepTally(kernel_model(Structure(2), 1.0), modal_norm=False)

    def interpolant(t):
        # the first floor swings, the second mirrors it: drift 2 |u_1| between them
        u, v = peak * np.sin(t), peak * np.cos(t)
        return np.array([u, -u, v, -v])

    tally.add(interpolant, 0.3, 2.5, None)
    assert tally.contact == contact
    assert tally.peak_drift == pytest.approx(2 * peak, abs=1e-11)


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
    assert solver.rtol == bdf.MIN_RTOL
    points, outcome = solver.points(np.zeros(2), 0.0, 1)
    assert outcome is Outcome.COMPLETE
    assert not points.any()


def test_a_tangent_that_cannot_be_integrated_is_no_growth(monkeypatch):
    solver = BdfMap(Structure(damping_ratio=0.05), 0.5, 1e-6)
    period = BdfMap._period

    def failing(self, *arguments, columns=0, **more):
        if columns:
            return arguments[0], Outcome.SOLVER_FAILED
        return period(self, *arguments, **more)

    monkeypatch.setattr(BdfMap, "_period", failing)
    seen = solver.grow(np.zeros(6), 0.02, 2)
    assert seen.outcome is Outcome.SOLVER_FAILED
    assert len(seen.logarithms) == 0
    assert math.isnan(seen.growth)


def test_bdf_can_be_stopped_inside_a_long_forcing_period():
    structure = Structure(n_floors=2, stiffness_ratio=300.0, sharpness=4e3, damping_ratio=0.05)
    bdf = BdfMap(structure, 0.01, 1e-9)
    calls = []

    def poll():
        calls.append(None)
        if len(calls) == 3:
            raise Stop

    with pytest.raises(Stop):
        bdf.advance(np.zeros(4), 0.5, 1, poll=poll)
