"""Runs that skip rules finish, many in one call, against the same runs one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from together import together

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED
from hpcsweep.dynamics.orbit import smallest_period
from hpcsweep.dynamics.stability import floquet_multipliers, orbit_exponent
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.orbit.batch import new_orbits
from hpcsweep.solvers.flow.step.algebra import spectral_radius
from hpcsweep.solvers.polling import Polling
from hpcsweep.solvers.records import Followed
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.quantities import METRICS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep import runs as sweep_runs
from hpcsweep.studies.sweep.batch import Batch
from hpcsweep.studies.sweep.classification import more_variables
from hpcsweep.studies.sweep.runs import FrameRuns
from hpcsweep.studies.variables import EXPONENTS, NOT_TESTED, store

SETTINGS = SweepSettings(
    metrics=frozenset(METRICS), classify_cycles=2000, max_points=40, spectrum_cycles=20
)
STRUCTURES = {
    "uniform": (Structure(3), 0.445, np.linspace(0.004, 0.24, 60)),
    "described": (
        Structure(3, damping_ratio=(0.1262, 0.0161, 0.0077)),
        0.445,
        np.linspace(0.03, 0.15, 60),
    ),
    "units": (
        Structure(
            2,
            sharpness=1e7,
            gap=(1e-3, 2e-3),
            mass=(3e4, 2e4),
            storey_stiffness=(4e6, 3e6),
        ),
        6.0,
        np.linspace(2e-3, 0.06, 40),
    ),
    "pounding": (
        Structure.from_matrices(
            [[1.0, 0.0], [0.0, 0.7]],
            [[2.0, -1.0], [-1.0, 1.5]],
            [Contact((1.0, -1.0), 0.05, 100.0)],
            damping_ratio=(0.05, 0.05),
        ),
        0.9,
        np.linspace(0.005, 0.2, 40),
    ),
}


def runs(name: str, **changed) -> FrameRuns:
    structure, omega, _ = STRUCTURES[name]
    return FrameRuns(structure, omega, replace(SETTINGS, **changed))


class OneByOne(Batch):
    """The rules as they are defined, a run a call, by the solver's own methods and numpy."""

    def into(self, result, first, amplitudes, state, follow, poll):
        settings, solver, amplitude = self._settings, self._solver, float(amplitudes[first])
        row = {name: array[first : first + 1] for name, array in result.items()}
        same = settings.period_tolerance
        free = self._free.window(state, amplitude)
        if free is not None:
            orbit = self._free.orbit
            seen = replace(free, measures=orbit.measures(amplitude))
            exponent = orbit.lyapunov_exponent
            end = self._done(row, amplitude, SkipRule.LINEAR, seen, 0, exponent)
            return Followed(ONE, None, end if follow else state, None)
        end = solver.settle(
            state,
            amplitude,
            settings.transient_cycles,
            settings.max_orbit_period,
            *(SETTLED, same, NEAR),
        )
        if not end.period:
            return Followed(NONE, None, state, end)
        seen = solver.observe(state=end.state, amplitude=amplitude, n_periods=end.period,
                              modal_norm=True, measures=settings.measures)  # fmt: skip
        # the window procedure's last point is the end of its periods, whatever the orbit is
        whole = settings.transient_cycles + settings.sampling_cycles
        shift = (whole - end.n_periods - end.period) % end.period
        seen = replace(seen, points=np.roll(seen.points, -shift, axis=0))
        period = smallest_period(seen.points / solver.structure.state_units, same)
        cycles = end.n_periods + end.n_newton + end.period
        rule = SkipRule.NEWTON
        if np.isnan(end.multiplier):
            rule = SkipRule.CONVERGED
            exponent = orbit_exponent(solver, seen.points[-1], amplitude, period)
        else:
            exponent = math.log(end.multiplier) / (2 * math.pi * end.period / solver.omega)
        end = self._done(row, amplitude, rule, seen, cycles, exponent, period)
        return Followed(ONE, None, end if follow else state, None)

    def _done(self, row, amplitude, rule, seen, cycles, exponent, period=1):
        kind = MotionClass.PERIODIC if seen.contact else MotionClass.NO_CONTACT
        points, solver = seen.points[-period:], self._solver
        result = vars(seen) | dict.fromkeys(EXPONENTS, exponent)
        result |= {"points": points, "n_points": period, "final_state": points[-1]}
        result |= {"orbit_period": period, "cycles": cycles, "motion": kind}
        result["window_period"] = NOT_TESTED
        result |= more_variables(solver, amplitude, points, period, self._settings, None)
        store(row, solver.structure, solver.omega, amplitude, result)
        row["skip_rule"][:] = rule
        return points[-1].copy()


NONE, ONE = new_orbits(0, 1, 1), new_orbits(1, 1, 1)


@pytest.mark.slow
@pytest.mark.parametrize("follow", [True, False], ids=["follow", "each"])
@pytest.mark.parametrize("name", STRUCTURES)
def test_many_in_one_call_are_what_they_are_one_by_one(name, follow):
    structure, _, amplitudes = STRUCTURES[name]
    state = np.zeros(2 * structure.n_floors)
    together, alone = runs(name), runs(name)
    alone._batch = OneByOne(alone.solver, alone.settings, alone._free)
    many = (together.follow if follow else together.each)(amplitudes, state)
    single = (alone.follow if follow else alone.each)(amplitudes, state)
    rules = set(many["skip_rule"].tolist())
    assert SkipRule.NEWTON in rules
    assert SkipRule.LINEAR in rules or not follow
    # chaos amplifies the rounding by which states are taken to the kernels
    tame = np.isfinite(many["lyapunov"]) & (many["lyapunov"] < 0)
    if follow and not tame.all():
        tame[int(np.argmin(tame)) :] = False
    assert tame.sum() >= 15
    for key in many:
        if many[key].dtype.kind == "f":
            units = 1.0
            if key in ("final_state", "poincare"):
                units = structure.state_units
            left, right = many[key][tame] / units, single[key][tame] / units
            assert np.array_equal(np.isnan(left), np.isnan(right)), key
            assert np.nanmax(np.abs(left - right)) < 1e-9, key
        else:
            assert np.array_equal(many[key][tame], single[key][tame]), key


@pytest.mark.slow
@pytest.mark.parametrize("name", ["described", "units"])
def test_however_the_work_is_cut_it_is_the_same_to_the_last_bit(name, monkeypatch):
    structure, _, amplitudes = STRUCTURES[name]
    state = np.zeros(2 * structure.n_floors)
    polls = []
    whole = runs(name).follow(amplitudes, state)
    monkeypatch.setattr(Polling, "_learn", lambda *_: None)  # one period at a time
    monkeypatch.setattr(sweep_runs, "_few", FrameRuns)  # made anew
    pieces = runs(name).follow(amplitudes, state, lambda: polls.append(0))
    half = runs(name)
    first = half.follow(amplitudes[:17], state)
    second = half.follow(amplitudes[17:], first["final_state"][-1])
    for key in whole:
        assert np.array_equal(whole[key], pieces[key], equal_nan=True), key
        joined = np.concatenate((first[key], second[key]))
        assert np.array_equal(whole[key], joined, equal_nan=True), key
    assert len(polls) > whole["cycles"].sum() / 2


def test_a_poll_that_raises_leaves_and_the_next_call_is_not_disturbed():
    structure, _, amplitudes = STRUCTURES["described"]
    state = np.zeros(2 * structure.n_floors)
    frame, calls = runs("described"), []

    def poll():
        calls.append(0)
        if len(calls) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        frame.follow(amplitudes, state, poll)
    again, fresh = frame.follow(amplitudes, state), runs("described").follow(amplitudes, state)
    for key in fresh:
        assert np.array_equal(again[key], fresh[key], equal_nan=True), key


@together("size", [1, 2, 3, 6, 7, 20, 64])
def test_spectral_radius_is_that_of_the_library(size):
    random = np.random.default_rng(size)
    whole = random.normal(size=(size, size))
    cases = [
        whole,
        np.triu(whole),
        np.linalg.qr(whole)[0],  # all of modulus 1
        np.roll(np.eye(size), 1, axis=0),  # usual shifts go round in a circle
        whole * 10.0 ** random.uniform(-4, 4, (size, 1)),
        1e-300 * whole,
        1e200 * whole,
        np.zeros((size, size)),
        np.eye(size),
    ]
    for case in cases:
        expected = np.abs(floquet_multipliers(case)[0])
        assert spectral_radius(case.copy()) == pytest.approx(expected, rel=1e-12, abs=0)
    for bad in (np.nan, np.inf):
        case = whole.copy()
        case[-1, 0] = bad
        assert spectral_radius(case) == np.inf
