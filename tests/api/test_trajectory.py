"""A motion in continuous time: against the stroboscopic points, the equation, the contact law."""

import math

import numpy as np
import pytest
from reference import reference_steps, system
from together import together

from hpcsweep import Building, Structure, adjacent, stroboscopic_points, trajectory

SI = {"mass": (2e5, 1e5), "storey_stiffness": (3e7, 2e7), "gap": 0.02, "gap_left": 0.03}


@pytest.mark.parametrize("sharpness", [2e3, float("inf")])
def test_it_passes_the_points_and_obeys_the_equation(sharpness):
    structure = Structure(2, 20.0, sharpness, 0.03, **SI)
    amplitude, omega, z = 3.0, 7.0, np.array([0.01, 0.0, 0.1, -0.1])
    motion = trajectory(structure, amplitude, omega, z, n_periods=3, samples=50)
    states = np.concatenate((motion.displacement.values, motion.velocity.values)).T
    np.testing.assert_array_equal(states[0], z)
    points = stroboscopic_points(structure, amplitude, omega, z, 3)
    np.testing.assert_allclose(states[[50, 100, 150]], points, atol=1e-8)
    assert motion.sizes == {"floor": 2, "time": 151, "contact": 4}
    u, v, force = motion.displacement.values, motion.velocity.values, motion.contact_force.values
    # the sigmoid spring pulls a little before it pushes: at most 0.28 kappa / rho
    assert (force >= -0.28 * structure.contact_stiffness[:, None] / sharpness).all()
    assert force.max() > 0
    # M u'' + C u' + K u + sum_k d_k F_k = b A sin(Omega t)
    left = structure.mass_matrix @ motion.acceleration.values
    left += structure.damping_matrix @ v + structure.stiffness_matrix @ u
    left += structure.directions.T @ force
    right = np.outer(structure.forcing_vector, amplitude * np.sin(omega * motion.time.values))
    assert np.abs(left - right).max() < 1e-9 * np.abs(structure.stiffness_matrix @ u).max() + 1e-3


@together(
    "given",
    [
        {"sharpness": math.inf},
        {"sharpness": 1e3},
        {"sharpness": math.inf, "restitution": 0.5},
    ],
)
def test_its_samples_are_on_the_path_of_the_reference(given):
    structure, z = Structure(2, 40.0, damping_ratio=0.05, gap=0.5, **given), np.zeros(4)
    motion = trajectory(structure, 0.6, 0.7, z, n_periods=3, samples=37)
    assert motion.contact_force.values.max() > 1.0
    begin, found, offset = 0.0, [], system(structure, 0.6, 0.7)[2].offset
    for h, c in reference_steps(structure, 0.6, 0.7, z, 3):
        own = motion.displacement.sel(time=slice(begin, begin + h))
        path = [np.polyval(row[::-1], own.time.values - begin) for row in c[:2]]
        found.append(np.abs(np.array(path) + offset[:2, None] - own.values).max(initial=0.0))
        begin += h
    assert begin == pytest.approx(motion.time.values[-1], rel=1e-12)
    assert max(found) < 1e-11


def test_its_units_are_those_of_the_structure():
    motion = trajectory(Structure(2), 0.1, 0.6, [0.0] * 4)
    units = [motion[name].attrs["units"] for name in ("displacement", "velocity", "time")]
    assert units == ["gaps", "gaps omega_0", "1/omega_0"]
    for wrong in ({"n_periods": 0}, {"samples": 1}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            trajectory(Structure(2), 0.1, 0.6, [0.0] * 4, **wrong)


def test_contacts_of_buildings_have_their_names():
    buildings = [Building([1.0] * n, 1.0, name=name) for n, name in ((2, "A"), (3, "B"))]
    structure = adjacent(buildings, [0.5, 0.2], 100.0)
    motion = trajectory(structure, 0.5, 0.5, [0.0] * 10, n_periods=1)
    assert motion.contact.values.tolist() == ["A1-B1", "A2-B2"]
