"""Multilinear springs, friction that slips with less, belts, gyroscopic matrices."""

import elements
import numpy as np
import pytest
from together import together

import hpcsweep
from hpcsweep import Slider, Spring, Structure
from hpcsweep.job import JobError, parse_job
from hpcsweep.solvers.solver import make_solver

TABLE = [(0.0, 0.0), (1.0, 2.0), (2.0, 2.5), (3.0, 6.5)]


@pytest.mark.slow
def test_each_moves_as_between_its_events():
    """A share of `bash benchmarks/run.sh elements`."""
    for kind in elements.KINDS:
        for seed in range(3):
            made = elements.case(kind, seed)
            away = np.abs(elements.exact(*made) - elements.reference(made)).max()
            assert away < 1e-10, (kind, seed)


def test_a_table_is_a_spring_and_contacts():
    def force(structure, d):
        pushed = structure.contact_forces(np.array([[d, 0.0]])) @ structure.directions
        return float((structure.stiffness_matrix @ [d] + pushed)[0, 0])

    lopsided = [(-2.0, -1.0), (-1.0, -0.7), (0.0, 0.0), (0.5, 0.1), (1.0, 2.0)]
    for table, whole in ((TABLE, [(-d, -f) for d, f in TABLE[:0:-1]] + TABLE), (lopsided,) * 2):
        structure = Structure.from_matrices([1.0], [[0.3]], [], springs=[Spring((1.0,), table)])
        for d in np.linspace(whole[0][0], whole[-1][0], 41):
            expected = 0.3 * d + np.interp(d, *np.transpose(whole))
            assert force(structure, d) == pytest.approx(expected, abs=1e-13)


def test_energy_of_friction_that_slips_with_less_is_balanced():
    slider = Slider((1.0,), 5.0, 0.3, kinetic=0.1)
    structure = Structure.from_matrices([1.0], [[1.0]], [], damping=[[0.1]], sliders=[slider])
    record = hpcsweep.Record(np.sin(0.9 * np.arange(0.0, 30.0, 0.02)), dt=0.02)
    found = hpcsweep.response(structure, record, energy=True)
    assert found.excursions[0] > 5
    assert abs(found.energy.balance) < 1e-12


def test_the_free_motion_of_a_gyroscope_is_that_which_is_integrated():
    skew = np.array([[0.2, 0.9], [-0.9, 0.1]])
    structure = Structure.from_matrices([1.0, 2.0], np.diag([1.0, 3.0]), [], damping=skew)
    solver = make_solver("flow", structure, 0.8, 1e-9)
    from hpcsweep.solvers.linear import LinearOrbit

    state = LinearOrbit(structure, 0.8).state(0.7)
    np.testing.assert_allclose(solver.advance(state, 0.7, 10).state, state, rtol=0, atol=1e-13)


REFUSED = [
    (lambda: Spring((0.0,), TABLE), "spring.direction must not be 0"),
    (lambda: Spring((1.0,), TABLE[::-1]), "spring.table must have at least 2 points whose"),
    (lambda: Spring((1.0,), TABLE[1:]), r"spring.table must begin at \(0, 0\), or pass through"),
    (lambda: Slider((1.0,), 1.0, 1.0, kinetic=2.0), "slider.kinetic must be above 0, and at"),
    (lambda: of([Spring((1.0,), [(0, 0), (1, 1), (2, 0)])]), "spring.table must not leave a stiff"),
    (lambda: of([Spring((1.0,), TABLE)], sharpness=9.0), "springs need sharpness = inf"),
    (lambda: of([1]), "springs must be a list of Spring"),
    (lambda: parse_job(JOB.replace("[0, 0], ", ""), "", "x"), r"spring\[0\].table must begin at"),
]
JOB = """
[structure]
matrices = {mass = [1.0], stiffness = [[0.5]]}
[[structure.spring]]
direction = [1.0]
table = [[0, 0], [1, 2], [2, 2.5], [3, 6.5]]
[sweep]
omega = 1.0
amplitude = [0.1]
"""


def of(springs, **more):
    return Structure.from_matrices([1.0], [[0.5]], [], springs=springs, **more)


@together("make, words", REFUSED)
def test_what_cannot_be_is_refused(make, words):
    with pytest.raises((ValueError, JobError), match=words):
        make()


def test_a_job_reads_springs():
    structure = parse_job(JOB, "", "x").structure
    assert structure.contacts == of([Spring((1.0,), TABLE)]).contacts
