"""What rows of displacements do over forcing periods: `FlowMap.rows_of` and `output.rows`."""

import math

import numpy as np
import pytest
import what_rows_do

import hpcsweep
from hpcsweep.job import JobError, parse_job
from hpcsweep.solvers.solver import make_solver

ROWS = np.array([[1.0, 0.0], [1.0, -1.0], [0.3, 0.7]])
MASS, STIFFNESS, FORCING = np.diag([2.0, 1.5]), np.array([[5.0, -1.0], [-1.0, 3.0]]), [1.0, -0.4]
DAMPING, A, OMEGA, ORDERS = 0.04 * STIFFNESS, 1.3, 1.1, 3


def rows_of(structure, state, omega=OMEGA, amplitude=A):
    """Return points of a motion and what its rows do in the period after each."""
    solver = make_solver("flow", structure, omega, 1e-11, yields=True)
    points = solver.points(state, amplitude, 5)[0]
    return points, solver.rows_of(points[-2:-1], amplitude, ROWS, ORDERS)


def structure(*contacts, **more):
    return hpcsweep.Structure.from_matrices(
        MASS, STIFFNESS, contacts, damping=DAMPING, forcing=FORCING, sharpness=math.inf, **more
    )


def test_rows_of_a_linear_motion_are_those_of_its_closed_form():
    free = structure()
    impedance = STIFFNESS - OMEGA**2 * MASS + 1j * OMEGA * DAMPING
    steady = A * np.linalg.solve(impedance, FORCING)  # u = Im(steady exp(i Omega tau))
    start = np.concatenate((steady.imag, OMEGA * steady.real))
    seen, of_rows = rows_of(free, start)[1], ROWS @ steady
    size, nothing = np.abs(of_rows), np.zeros((3, ORDERS - 1))
    assert np.allclose((seen.high, seen.low), (size, -size), rtol=1e-12)
    assert np.allclose(seen.rms, size / math.sqrt(2), rtol=1e-12)
    assert np.allclose(seen.amplitude, np.column_stack((size, nothing)), atol=1e-13)
    assert np.allclose(seen.phase[:, 0], np.angle(of_rows), rtol=1e-12)
    assert np.abs(seen.mean).max() < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("kind", what_rows_do.KINDS)
def test_rows_are_those_of_an_independent_integration(kind):
    """A share of `bash benchmarks/run.sh what_rows_do`."""
    for seed in range(4):
        errors, _ = what_rows_do.compare(kind, seed)
        assert max(errors) < 1e-10, seed


def test_rows_of_a_smooth_stop_are_those_of_a_sharp_one_within_its_layer():
    seen = []
    for sharpness in (1e5, math.inf):
        made = hpcsweep.Structure(2, sharpness=sharpness, stiffness_ratio=50.0)
        solver = make_solver("flow", made, 0.6, 1e-10)
        seen.append(solver.rows_of(np.zeros((1, 4)), 0.5, ROWS, ORDERS))
    assert seen[1].high[0] > 1.0
    for smooth, sharp in zip(*(one[:5] for one in seen), strict=True):
        assert np.abs(smooth - sharp).max() < 1e-3


JOB = """
[structure]
n_floors = 1
sharpness = inf
gap_left = 1.0
[sweep]
omega = [0.5]
amplitude = [0.1, 0.9]
[output]
rows = ["1", "contact:2"]
harmonics = 2
"""


def test_a_sweep_stores_what_rows_do_whether_a_run_touches_or_not():
    study = parse_job(JOB, "rows.toml", "rows").study
    rows = study.runs_of(study.structure, 0.5).follow(study.amplitude, study.initial_state)
    low, high = rows["row_low"][:, 0], rows["row_high"][:, 0]
    assert high[0] < 1.0 < high[1]
    assert np.array_equal(rows["row_range"][:, 0], 0.5 * (high - low))
    assert np.array_equal(rows["row_high"][:, 1], -low)  # the stop on the left


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("contact:2", "contact:9"), "output.rows = 'contact:9': must be one of 1, 1L"),
        (("contact:2", "7"), "output.rows = '7': must be a floor, 1 to 1"),
        (("harmonics = 2", "harmonics = 17"), "output.harmonics"),
        (("[sweep]", '[solver]\nmethod = "bdf"\n[sweep]'), "must be empty with solver.method bdf"),
    ],
)
def test_rows_that_are_none_are_refused_on_one_line(change, message):
    with pytest.raises(JobError) as caught:
        parse_job(JOB.replace(*change), "rows.toml", "rows")
    assert message in str(caught.value)
