"""Intensity measures against closed forms and quadrature."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from hpcsweep import Record, intensity, read_record, spectrum
from hpcsweep.earthquakes.intensity import (
    Measure,
    ground_motion,
    significant_duration,
)


def test_a_triangle_has_its_closed_forms():
    # a = 1 - t on [0, 2]: v = t - t^2/2, largest 1/2 at t = 1; d = t^2/2 - t^3/6, largest at 2
    record = Record([1.0, -1.0], 2.0)
    found = intensity(record, gravity=math.pi / 2)
    assert (found.pga, found.pgv) == (1.0, 0.5)
    assert found.pgd == pytest.approx(2 / 3, rel=1e-15)
    assert found.arias == pytest.approx(2 / 3, rel=1e-15)
    # int a^2 = (1 - (1 - t)^3) / 3 is 5 and 95 % of 2/3 at 1 -+ 0.9^(1/3)
    assert found.duration == pytest.approx(2 * 0.9 ** (1 / 3), rel=1e-14)


def test_the_ground_turns_between_samples():
    # a = 3 - 2 t, v = 3 t - t^2 = 0 at t = 3: d = 3 t^2/2 - t^3/3 = 4.5 there, 0 at 4.5
    record = Record([3.0, -6.0], 4.5)
    assert intensity(record).pgd == pytest.approx(4.5, rel=1e-15)
    assert intensity(record).pgv == pytest.approx(6.75, rel=1e-15)


def test_measures_of_a_recorded_motion_agree_with_quadrature(recorded):
    record = read_record(recorded["RSN753_LOMAP_CLS000-hor1"])
    times = np.linspace(0, record.duration, 20 * (record.n_samples - 1) + 1)
    fine = np.interp(times, record.times, record.acceleration)
    velocity = cumulative_trapezoid(fine, times, initial=0)
    displacement = cumulative_trapezoid(velocity, times, initial=0)
    energy = cumulative_trapezoid(fine**2, times, initial=0)
    found = intensity(record)
    assert found.pga == record.peak
    assert found.pgv == pytest.approx(np.abs(velocity).max(), rel=1e-5)
    assert found.pgd == pytest.approx(np.abs(displacement).max(), rel=1e-5)
    assert found.arias == pytest.approx(math.pi / 2 / 9.80665 * energy[-1], rel=1e-4)
    between = np.interp([0.05, 0.95], energy / energy[-1], times)
    assert found.duration == pytest.approx(np.ptp(between), rel=1e-4)
    at_samples = ground_motion(record)
    np.testing.assert_allclose(at_samples[0], velocity[::20], atol=1e-6 * found.pgv)
    np.testing.assert_allclose(at_samples[1], displacement[::20], atol=1e-6 * found.pgd)


def test_the_duration_is_between_5_and_95_percent_of_the_energy():
    assert significant_duration(Record(np.ones(11), 0.1)) == pytest.approx(0.9, rel=1e-13)
    assert significant_duration(Record([0.0, 0.0], 1.0)) == 0.0


def test_spectral_accelerations_are_those_of_the_spectrum():
    record = Record(np.random.default_rng(2).standard_normal(100), 0.02)
    periods = [0.2, 0.5, 1.1]
    values = spectrum(record, periods, 0.03).acceleration
    for measure, expected in (
        (Measure("sa", (0.5,), 0.03), values[1]),
        (Measure("avgsa", tuple(periods), 0.03), np.prod(values) ** (1 / 3)),
    ):
        (found,) = measure.of(np.array([measure.ordinates(record)]))
        assert found == pytest.approx(expected, rel=1e-14)


def test_measures_scale_with_the_record():
    record = Record(np.random.default_rng(3).standard_normal(100), 0.02)
    one, two = intensity(record), intensity(record.scaled(2.0))
    np.testing.assert_allclose(np.divide(two, one), [2, 2, 2, 4, 1], rtol=1e-14)


def test_a_gravity_and_a_record_are_needed():
    with pytest.raises(ValueError, match=r"gravity must be finite and positive, is 0\.0"):
        intensity(Record([0.0, 1.0], 1.0), 0.0)
    with pytest.raises(ValueError, match="record must be a Record, is None"):
        intensity(None)
