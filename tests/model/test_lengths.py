"""The lengths by which motions are measured, and the contacts that they can reach."""

import math
from dataclasses import replace

import numpy as np
import pytest
from together import together

from hpcsweep import Contact, Structure, stroboscopic_points
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.job import parse_job
from hpcsweep.model.reach import reach_of_motions
from hpcsweep.studies.quantities import METRICS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns

SETTINGS = SweepSettings(metrics=frozenset(METRICS), classify_cycles=20_000)
JOB = """
[structure]
n_floors = 2
gap = {gap}
stiffness_ratio = {ratio}
[sweep]
omega = 0.7
amplitude = {{from = 0.05, to = 0.6, count = 12}}
directions = ["up"]
[output]
lyapunov = true
"""


def run(gap, ratio="1000.0") -> dict[str, np.ndarray]:
    study = parse_job(JOB.format(gap=gap, ratio=ratio), "job", "job").study
    return study.compute(study.path(0)[0], study.initial_state)


def test_a_contact_that_cannot_be_reached_changes_no_bit():
    alone = run("[inf, 1.0]")
    assert (alone["motion"] == MotionClass.CHAOTIC).sum() > 3
    for gap in ("1e3", "1e6", "1e9"):
        for ratio in ("1000.0", "[1e6, 1000.0]"):
            both = run(f"[{gap}, 1.0]", ratio)
            for name, values in alone.items():
                np.testing.assert_array_equal(both[name], values, err_msg=f"{name} {gap} {ratio}")


def test_a_contact_that_is_not_reached_changes_no_class():
    alone, both = run("[inf, 1.0]"), run("[100.0, 1.0]")
    for name in ("motion", "orbit_period", "contact"):
        np.testing.assert_array_equal(both[name], alone[name])


def bilinear(sharpness: float = math.inf) -> Structure:
    contact = Contact((1.0,), 0.0, 3.0)
    return Structure.from_matrices(
        [1.0], [[1.0]], [contact], damping_ratio=0.02, sharpness=sharpness
    )


def test_the_motions_of_a_bilinear_structure_are_proportional_to_the_amplitude():
    amplitudes = 10.0 ** np.arange(-10, 11)
    together = FrameRuns(bilinear(), 2.6, SETTINGS).each(amplitudes, np.zeros(2))
    periods = together["orbit_period"]
    assert periods[0] > 1
    assert set(periods.tolist()) == {periods[0]}
    points = np.sort(together["poincare"][:, : periods[0]], axis=1) / amplitudes[:, None, None]
    np.testing.assert_allclose(points, np.broadcast_to(points[10], points.shape), rtol=1e-12)
    np.testing.assert_allclose(together["drift"], together["drift"][10], rtol=1e-12)


@together("size", [1e-10, 1e-6, 1.0, 1e6])
def test_with_a_smooth_stop_what_is_measured_by_is_the_motion_too(size):
    """Scaled by s, with rho / s, all motions are the same."""
    points = [
        stroboscopic_points(bilinear(100.0 / s), 0.3 * s, 2.6, np.zeros(2), 30) / s
        for s in (1.0, size)
    ]
    np.testing.assert_allclose(points[1], points[0], rtol=0, atol=1e-11 * np.abs(points[0]).max())


def test_lengths_are_gaps_within_reach_or_else_of_the_linear_response():
    building = Structure()
    np.testing.assert_array_equal(building.lengths(0.445, [0.01, 0.1, 0.35, -0.35]), 1.0)
    assert Structure(gap=[1.0, 1.0, 1e9]).lengths(0.445, 0.1) == 1.0
    for structure in (bilinear(), building):
        small = structure.lengths(0.445, np.array([1e-9, 2e-9, 1e-12]))
        assert small[1] == 2 * small[0]
        assert 0.1 < small[2] / small[0] * 1e3 < 10
    assert bilinear().lengths(2.6, 0.0) == 1.0
    twice = Structure(gap=2.0).measured_by(8.0)
    assert twice.length_unit == 8.0
    assert twice.state_units[0] == 8.0
    assert twice.gap == 2.0


@together("sharpness", [math.inf, 1e3])
@together("seed", range(6))
def test_no_motion_goes_beyond_the_bound(seed, sharpness):
    chosen = np.random.default_rng(seed)
    n = int(chosen.integers(1, 4))
    structure = Structure(
        n,
        stiffness_ratio=float(chosen.choice([10.0, 1000.0])),
        sharpness=sharpness,
        damping_ratio=float(chosen.choice([0.01, 0.2])),
        gap_left=float(chosen.choice([1.0, math.inf])),
    )
    amplitude, z = float(chosen.uniform(0.1, 3.0)), chosen.normal(size=2 * n)
    omega = float(chosen.uniform(0.3, 2.0))
    points = stroboscopic_points(structure, amplitude, omega, z, 300)
    bound = reach_of_motions(structure, amplitude, z)
    reached = np.abs(points[:, :n] @ structure.directions.T).max(axis=0)
    assert np.all(reached <= bound)
    assert np.all(np.isfinite(bound))
    far = replace(structure, gap=[float(3 * bound.max())] * n, gap_left=math.inf)
    assert far.within_reach(amplitude, z).contacts == ()


def test_where_nothing_is_known_every_contact_stays():
    undamped = Structure(2, damping_ratio=0.0, gap=[1e9, 1.0])
    pressed = Structure(2, gap=[-0.1, 1e9])
    hardly_sharp = Structure(2, sharpness=1e-200, gap=[1e9, 1.0])  # its square is zero
    for structure in (undamped, pressed, hardly_sharp):
        assert structure.within_reach(0.1, np.zeros(4)) is structure
    left = Structure(3, gap=[1e9, 1.0, 1e9]).within_reach(0.1, np.zeros(6))
    assert left.contact_numbers == (2,)
    assert left.contact_bits(1) == 0b010


def in_units(seed: int, length: float, mass: float, time: float):
    """A random building, frequency and amplitudes, in units smaller by a factor."""
    chosen = np.random.default_rng(seed)
    n = int(chosen.integers(1, 4))
    structure = Structure(
        n,
        mass=(10 ** chosen.uniform(-0.5, 0.5, n) * mass).tolist(),
        storey_stiffness=(10 ** chosen.uniform(-0.3, 0.3, n) * mass / time**2).tolist(),
        gap=(10 ** chosen.uniform(-0.5, 0.5, n) * length).tolist(),
        gap_left=float(chosen.choice([math.inf, 1.0])) * length,
        sharpness=float(chosen.choice([1e3, 1e4, math.inf])) / length,
        stiffness_ratio=float(chosen.choice([30.0, 1000.0])),
        damping_ratio=chosen.uniform(0.01, 0.1, n).tolist(),
    )
    omega = float(chosen.uniform(0.3, 1.2)) / time
    amplitudes = chosen.uniform(0.05, 0.5) * np.linspace(0.5, 1.5, 8) * length / time**2
    return structure, omega, amplitudes


def swept(structure, omega, amplitudes, compared=None):
    state = np.zeros(2 * structure.n_floors)
    moving = structure.within_reach(amplitudes.max(), state)
    return FrameRuns(moving, omega, SETTINGS).follow(amplitudes[:compared], state)


@together("seed", [0, 2, 4, 6])
def test_units_of_length_mass_and_time_change_no_class_and_no_number(seed):
    check_units(seed)


@pytest.mark.slow
@together("seed", [1, 3, 7])
def test_of_more_structures_units_change_no_class_and_no_number(seed):
    check_units(seed)


def check_units(seed: int) -> None:
    """Compare up to the first chaotic run: how long chaos lasts is a matter of the last digit."""
    once = swept(*in_units(seed, 1.0, 1.0, 1.0))
    chaos = once["motion"] == MotionClass.CHAOTIC
    compared = int(np.argmax(chaos)) + 1 if chaos.any() else chaos.size
    once = {name: values[:compared] for name, values in once.items()}
    for powers in np.random.default_rng(seed).integers(-12, 13, (3, 3)).tolist():
        length, mass, time = (10.0**power for power in powers)
        again = swept(*in_units(seed, length, mass, time), compared)
        chaos = (once["motion"] == MotionClass.CHAOTIC) | (again["motion"] == MotionClass.CHAOTIC)
        until = int(np.argmax(chaos)) if chaos.any() else chaos.size
        for name in ("motion", "orbit_period", "contact", "outcome"):
            np.testing.assert_array_equal(again[name][:until], once[name][:until], err_msg=name)
        # orbits are approached to 1e-10, which multipliers near 1 magnify; modal norms are
        # integrated to 1e-5
        for name, scale, error in (
            ("drift", 1.0, 1e-8),
            ("modal_norm", 1.0, 1e-5),
            ("lyapunov", 1.0 / time, 1e-7),
        ):
            np.testing.assert_allclose(
                again[name][:until] / scale, once[name][:until], rtol=error, atol=error
            )
