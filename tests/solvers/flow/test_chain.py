"""Several states at once, each over a period, against one motion after the other."""

import numpy as np
import pytest

from hpcsweep import Building, Structure, adjacent
from hpcsweep.model.observed import IMPACT
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome

LOW = Building(mass=[2e5, 1e5], storey_stiffness=3e7, name="A")
TALL = Building(mass=[2e5, 2e5, 1e5], storey_stiffness=2e7, name="B")
PAIR = adjacent([LOW, TALL], gap=0.02, stiffness=1e9)


@pytest.mark.parametrize(
    ("structure", "omega", "amplitude"), [(Structure(3), 0.445, 0.1), (PAIR, 5.0, 2.0)]
)
def test_states_at_once_are_those_one_by_one(structure, omega, amplitude):
    solver = FlowMap(structure, omega)
    states = solver.points(np.zeros(2 * structure.n_floors), amplitude, 5)[0]
    images, matrices = solver.images(states, amplitude, tangents=True)
    without, none = solver.images(states, amplitude)
    assert len(none) == 0
    for z, image, matrix in zip(states, images, matrices, strict=True):
        end, tangent = solver.monodromy(z, amplitude, 1)
        assert np.array_equal(image, end)
        assert np.array_equal(matrix, tangent)
    ends = np.array([solver.advance(z, amplitude, 1).state for z in states])
    assert np.array_equal(without, ends)


@pytest.mark.parametrize(
    ("structure", "omega", "amplitude"), [(Structure(3), 0.445, 0.1), (PAIR, 5.0, 2.0)]
)
def test_what_they_gather_is_that_of_one_motion(structure, omega, amplitude):
    solver = FlowMap(structure, omega)
    start = solver.points(np.zeros(2 * structure.n_floors), amplitude, 50)[0][-1]
    whole = solver.observe(start, amplitude, 6, measures=IMPACT)
    seen = solver.observe_each(np.vstack((start, whole.points[:-1])), amplitude, measures=IMPACT)
    assert np.array_equal(seen.points, whole.points)
    assert seen.contact == whole.contact > 0
    assert seen.peak_drift == whole.peak_drift
    np.testing.assert_allclose(seen.measures.impulse, whole.measures.impulse, rtol=1e-12)


def test_a_failure_names_the_state():
    solver = FlowMap(Structure(3), 0.445)
    states = np.zeros((2, 6))
    states[1, 0] = np.nan
    with pytest.raises(ArithmeticError, match="of state 2"):
        solver.images(states, 0.1)
    assert solver.observe_each(states, 0.1).outcome is not Outcome.COMPLETE
