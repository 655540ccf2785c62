import math

import numpy as np
import pytest
from together import together

from hpcsweep.dynamics.classify import (
    CHAOS_GROWTH,
    MotionClass,
    class_shares,
    classify,
    classify_points,
    on_closed_curve,
)
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

CYCLES = 100
SETTINGS = SweepSettings(sampling_cycles=CYCLES)
GOLDEN = (math.sqrt(5) - 1) / 2


def torus(count=CYCLES, curves=1, decay=0.0):
    j = np.arange(count)
    angle = 2 * np.pi * GOLDEN * j
    loop = [np.cos(angle) + 0.2 * np.cos(2 * angle), 0.5 * np.sin(angle) + 0.1 * np.sin(3 * angle)]
    return np.stack(loop, axis=1) * np.exp(-decay * j)[:, None] + 5.0 * (j % curves)[:, None]


def henon(count=CYCLES):
    points = [(0.1, 0.1)]
    while len(points) < count + 50:
        x, y = points[-1]
        points.append((1 - 1.4 * x * x + y, 0.3 * x))
    return np.array(points[50:])


def repeating(period, count=CYCLES):
    orbit = np.random.default_rng(period).normal(size=(period, 2))
    return orbit[np.arange(count) % period]


def results(period, exponent, contact, outcome, points):
    """Two frames, Omega 0.5 and 2, with the same runs in both."""
    import xarray

    n = len(period)
    run = ("direction", "omega", "amplitude")

    def twice(values, dtype):
        return run, np.array([[values, values]], dtype)

    poincare = np.full((1, 2, n, CYCLES, 2), np.nan)
    counts = np.zeros((1, 2, n), int)
    for index, own in enumerate(points):
        poincare[0, :, index, : len(own)] = own
        counts[0, :, index] = len(own)
    return xarray.Dataset(
        {
            "orbit_period": twice(period, int),
            "lyapunov": twice(exponent, float),
            "contact": twice(contact, np.uint64),
            "outcome": twice(outcome, int),
            "n_points": (run, counts),
            "poincare": ((*run, "point", "state"), poincare),
            "omega": ("omega", [0.5, 2.0]),
            "amplitude": ("amplitude", np.linspace(0.1, 0.9, n)),
        },
    )


@pytest.fixture
def every_kind():
    """One run of each kind; the exponents are those of the frame Omega = 0.5."""
    time = CYCLES * 2 * math.pi / 0.5
    return results(
        period=[1, 4, 0, 0, 0, 0, 0, 0, 2],
        exponent=np.array([-20, -9, 12, -0.5, -5, -8, np.nan, np.nan, 2 * CYCLES]) / time,
        contact=[0, 1, 1, 1, 1, 1, 0, 0, 1],
        outcome=[1, 1, 1, 1, 1, 1, Outcome.STEP_LIMIT, Outcome.NOT_COMPUTED, 1],
        points=[
            repeating(1, 1),
            repeating(4, 4),
            henon(),
            torus(),
            repeating(30),
            torus(decay=0.05),
            np.empty((0, 2)),
            np.empty((0, 2)),
            repeating(2, 2),
        ],
    )


KINDS = [
    MotionClass.NO_CONTACT,
    MotionClass.PERIODIC,
    MotionClass.CHAOTIC,
    MotionClass.QUASI_PERIODIC,
    MotionClass.LONG_PERIOD,
    MotionClass.UNDECIDED,
    MotionClass.FAILED,
    MotionClass.NOT_COMPUTED,
    MotionClass.UNDECIDED,  # an orbit that repels
]


def test_every_kind_is_told(every_kind):
    classes = classify(every_kind, SETTINGS)
    assert classes.shape == (1, 2, 9)
    assert classes[0, 0].tolist() == KINDS


def test_chaos_is_a_matter_of_growth_over_the_window_not_of_the_exponent(every_kind):
    """At four times the frequency the window is a quarter as long: growth 3 decides nothing."""
    assert classify(every_kind, SETTINGS)[0, 0, 2] == MotionClass.CHAOTIC
    assert classify(every_kind, SETTINGS)[0, 1, 2] == MotionClass.UNDECIDED


def test_what_a_file_does_not_hold_is_not_told(every_kind):
    bare = classify(every_kind.drop_vars("lyapunov"), SETTINGS)[0, 0]
    assert bare.tolist()[1:5] == [
        MotionClass.PERIODIC,
        MotionClass.UNDECIDED,
        MotionClass.UNDECIDED,
        MotionClass.LONG_PERIOD,
    ]
    assert classify(every_kind.drop_vars("contact"), SETTINGS)[0, 0, 0] == MotionClass.PERIODIC
    without_points = classify(every_kind.drop_vars(["poincare", "n_points"]), SETTINGS)[0, 0]
    assert without_points[2] == MotionClass.CHAOTIC
    assert without_points[3] == without_points[4] == MotionClass.UNDECIDED


def test_shares_are_of_the_runs_that_were_computed(every_kind):
    one = every_kind.isel(omega=[0])
    shares = class_shares(classify(one, SETTINGS))
    assert MotionClass.NOT_COMPUTED not in shares
    assert shares[MotionClass.UNDECIDED] == 2 / 8
    assert shares[MotionClass.CHAOTIC] == 1 / 8
    assert sum(shares.values()) == pytest.approx(1)
    assert class_shares(classify(one, SETTINGS)[..., :1])[MotionClass.NO_CONTACT] == 1
    nothing = class_shares(classify(one.assign(outcome=0 * one["outcome"]), SETTINGS))
    assert set(nothing.values()) == {0}


@together(
    "points, expected",
    [
        (torus(), True),
        (torus(curves=2), True),
        (torus(300, curves=3), True),
        (torus(300, curves=5), True),
        (torus(decay=0.01), False),
        (henon(), False),
        (np.random.default_rng(1).normal(size=(CYCLES, 6)), False),
        (repeating(26) + 1e-4 * torus(), False),
        (np.zeros((CYCLES, 2)), False),
        (torus(15), False),
    ],
)
def test_closed_curves(points, expected):
    assert on_closed_curve(points) is expected


def test_a_neutral_window_is_not_enough_and_a_curve_is_not_enough():
    assert classify_points(torus(), 0.5, 1e-6) == MotionClass.QUASI_PERIODIC
    assert classify_points(torus(), -4.0, 1e-6) == MotionClass.UNDECIDED
    assert classify_points(torus(), math.nan, 1e-6) == MotionClass.UNDECIDED
    assert classify_points(henon(), 0.5, 1e-6) == MotionClass.UNDECIDED


def test_a_torus_and_chaos_of_the_structure_itself():
    """The damping as described, Omega = 0.445: five curves round P5, and the paper's chaos."""
    omega = 0.445
    structure = Structure(damping_ratio=tuple(0.05 / (2 * Structure().frequencies ** 2)))
    solver = make_solver("flow", structure, omega, 1e-9)
    found = {}
    for amplitude in (0.1025, 0.09877):
        state = solver.advance(np.array(STATE), amplitude, 1000).state
        points, _ = solver.points(state, amplitude, 500)
        found[amplitude] = solver.observe(state, amplitude, 500, growth=True).growth, points
    growth, points = found[0.1025]
    assert classify_points(points, growth, 1e-6) == MotionClass.QUASI_PERIODIC
    # its points may lie close to a curve, too, for the motion contracts strongly across it: it is
    # the exponent that tells
    growth, _ = found[0.09877]
    assert growth > 3 * CHAOS_GROWTH


STATE = (0.47812, 0.317291, 0.446605, -0.93638, 0.063818, -0.081978)
"""Near both attractors, from a sweep up."""


def test_points_that_go_to_and_fro_are_on_no_curve():
    # a spectrum that only rises towards 1/2: to and fro, farthest in the middle of the window
    j = np.arange(20)
    to_and_fro = (-1.0) ** j * (1 + 5 * np.exp(-(((j - 9.5) / 2) ** 2)))
    assert on_closed_curve(np.column_stack((to_and_fro, 0.5 * to_and_fro))) is False
