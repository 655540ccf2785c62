"""Orbits of structures that yield: exact, with multipliers transverse to their families."""

import cmath
import math

import numpy as np
import pytest

import hpcsweep
from hpcsweep.solvers.solver import make_solver

OMEGA = 0.7


def oscillator(hardening):
    """Return a mass 1 on a spring of initial stiffness 1 that yields at 1, c = 0.2."""
    slider = hpcsweep.Slider((1.0,), 1.0 - hardening, 1.0 - hardening)
    return hpcsweep.Structure.from_matrices(
        [1.0], [[hardening]], [], damping=[[0.2]], sliders=[slider]
    )


def settled(structure, amplitude, start):
    solver = make_solver("flow", structure, OMEGA, 1e-9, yields=True)
    return solver.settle(np.array(start), amplitude, 2000, 8, 1e-6, 1e-6).state


def test_a_motion_that_has_shaken_down_has_the_multipliers_of_the_elastic_one():
    structure = oscillator(0.05)
    state = settled(structure, 0.1, settled(structure, 0.9, [0.0] * 3))
    assert abs(state[2]) > 0.5
    found = hpcsweep.orbit(structure, 0.1, OMEGA, state, 1)
    exact = cmath.exp(complex(-0.1, math.sqrt(0.99)) * 2 * math.pi / OMEGA)
    assert found.families == 1
    np.testing.assert_allclose(found.multipliers, [exact, exact.conjugate()], rtol=1e-8)
    # it is the nearest of its family: p has hardly moved, and the motion about it is the linear one
    alone = hpcsweep.orbit(structure, 0.1, OMEGA, settled(structure, 0.1, [0.0] * 3), 1).points[0]
    np.testing.assert_allclose(found.points[0, 2], state[2], atol=1e-5)
    shift = 0.95 * found.points[0, 2], 0.0, found.points[0, 2]
    np.testing.assert_allclose(found.points[0], alone + shift, atol=1e-10)


@pytest.mark.parametrize(
    ("hardening", "amplitude", "families"), [(0.05, 0.9, 0), (0.05, 1.3, 0), (0.0, 0.9, 1)]
)
def test_a_small_difference_dies_out_as_the_largest_multiplier_says(hardening, amplitude, families):
    structure = oscillator(hardening)
    found = hpcsweep.orbit(structure, amplitude, OMEGA, settled(structure, amplitude, [0.0] * 3), 1)
    assert found.families == families
    assert len(found.multipliers) == 3 - families
    assert found.stable
    # what slips forgets its p
    assert abs(found.multipliers[-1]) < 1e-7
    assert found.residual < 1e-12
    start = found.points[0] - np.array([1e-4, 1e-4, 0.0])
    solver = make_solver("flow", structure, OMEGA, 1e-9, yields=True)
    points = structure.without_drift(solver.points(start, amplitude, 8)[0])
    turns = np.linalg.norm(np.diff(points, axis=0), axis=1)
    last = 7 if hardening else 4  # before differences are rounding
    assert turns[last - 1] / turns[last - 2] == pytest.approx(abs(found.multipliers[0]), rel=1e-3)


@pytest.mark.parametrize("plastic", [0.0, 0.01])
def test_there_is_no_tangent_where_a_slider_comes_to_its_strength_and_turns(plastic):
    """To both sides of a motion about p = 0 at once, to one side of another."""
    structure, gain = oscillator(0.05), 1.0 / complex(1.0 - OMEGA**2, 0.2 * OMEGA)
    solver = make_solver("flow", structure, OMEGA, 1e-9, yields=True)
    touching = (1.0 - 0.05 * plastic) / abs(gain)  # about 0.95 p, so that elongations are -0.05 p
    for amplitude in (touching, (1.0 - 1e-5) * touching):
        u, v = -amplitude * gain.imag, -OMEGA * amplitude * gain.real
        start = [u + 0.95 * plastic, v, plastic]
        if amplitude == touching:
            with pytest.raises(ArithmeticError, match="there is no tangent map"):
                solver.monodromy(start, amplitude, 1)
        else:
            end, matrix = solver.monodromy(start, amplitude, 1)
            np.testing.assert_allclose(end, start, atol=1e-13)
            assert matrix[2].round(9).tolist() == [0.0, 0.0, 1.0]
