"""Synthetic ground motions have the spectrum that theory says, and are the same everywhere."""

import hashlib
import math

import numpy as np
import pytest
from together import together

from hpcsweep import intensity, synthetic_records
from hpcsweep.earthquakes import synthetic
from hpcsweep.earthquakes.intensity import ground_motion
from hpcsweep.earthquakes.synthetic import SOILS, Soil


def spectral_density(
    omega: np.ndarray, dt: float = 0.01, rms: float = 1.0, soil: str | Soil = "firm"
) -> np.ndarray:
    """Return the two-sided power spectral density S of the stationary motion.

    Its integral over omega from -pi / dt to pi / dt is the variance, rms^2.

    Parameters
    ----------
    omega : ndarray, any shape
        Frequencies, radians per time.
    dt, rms, soil
        As of `synthetic_records`.
    """
    filters = synthetic._filters(synthetic._soil(soil), dt)
    back = np.exp(-1j * np.asarray(omega) * dt)
    response = np.ones_like(back)
    for b0, b1, b2, a1, a2 in filters:
        response = response * (b0 + back * (b1 + back * b2)) / (1.0 + back * (a1 + back * a2))
    return (rms / synthetic._deviation(filters)) ** 2 * dt / (2.0 * math.pi) * np.abs(response) ** 2


def test_records_are_the_same_to_the_last_bit_everywhere():
    record = synthetic_records(2, seed=5)[1]
    digest = hashlib.sha256(record.acceleration.astype("<f8").tobytes()).hexdigest()
    assert digest[:16] == "89f128dd04580150"
    assert (record.name, record.n_samples, record.dt) == ("synthetic-5-2", 3001, 0.01)


def test_a_record_does_not_depend_on_the_size_of_its_suite():
    assert synthetic_records(3, seed=5)[:2] == synthetic_records(2, seed=5)
    assert synthetic_records(1, seed=6)[0] != synthetic_records(1, seed=5)[0]
    with_numbers = synthetic_records(1, seed=5, soil=tuple(SOILS["soft"]))
    assert with_numbers == synthetic_records(1, seed=5, soil="soft")


@together("soil", SOILS)
def test_the_density_is_the_formula_of_kanai_tajimi_and_clough_penzien(soil):
    dt = 1e-3
    ground = SOILS[soil]
    omega = np.geomspace(0.1, 100, 50)

    def shape(w):
        r, f = w / ground.frequency, w / ground.highpass_frequency
        z, y = ground.damping, ground.highpass_damping
        resonance = (1 + (2 * z * r) ** 2) / ((1 - r**2) ** 2 + (2 * z * r) ** 2)
        return resonance * f**4 / ((1 - f**2) ** 2 + (2 * y * f) ** 2)

    found = spectral_density(omega, dt, rms=2.0, soil=soil)
    np.testing.assert_allclose(found / found[-1], shape(omega) / shape(omega[-1]), rtol=6e-3)
    # its integral is the variance
    half = np.linspace(0, math.pi / dt, 200_001)
    assert 2 * np.trapezoid(spectral_density(half, dt, 2.0, soil), half) == pytest.approx(4.0)


def test_a_suite_has_that_density():
    n, dt, duration, rms = 400, 0.02, 20.0, 1.5
    suite = synthetic_records(n, 1, dt, duration, rms)
    steps = round(duration / dt)
    sums = np.sum(synthetic._envelope(steps, 0.1, 0.4) ** 2)
    transforms = dt * np.fft.rfft([record.acceleration for record in suite], axis=1)
    omega = 2 * math.pi * np.fft.rfftfreq(steps + 1, dt)
    expected = 2 * math.pi * spectral_density(omega, dt, rms) * dt * sums
    bands = np.array_split(np.arange(4, len(omega) - 1), 20)  # from 1.2 rad/s on
    ratios = np.mean(np.abs(transforms) ** 2, axis=0) / np.where(expected > 0, expected, 1)
    found = np.array([ratios[band].mean() for band in bands])
    # of a band of 25 frequencies, of which the envelope leaves 10 independent
    assert np.abs(found - 1).max() < 4 / math.sqrt(10 * n)
    assert abs(found.mean() - 1) < 0.01


def test_its_deviation_is_rms_where_the_envelope_is_one():
    suite = synthetic_records(200, 2, rms=0.7)
    strong = np.array([record.acceleration[500:1500] for record in suite])
    assert strong.std() == pytest.approx(0.7, rel=0.02)
    assert abs(strong.mean()) < 0.01
    # peaks of normal noise, not of uniform numbers
    kurtosis = np.mean(strong**4) / np.mean(strong**2) ** 2
    assert kurtosis == pytest.approx(3.0, abs=0.1)


@together("soil", SOILS)
def test_the_ground_comes_to_rest(soil):
    for record in synthetic_records(5, 3, soil=soil):
        velocity, displacement = ground_motion(record)
        found = intensity(record)
        assert abs(velocity[-1]) < 1e-12 * found.pgv
        assert abs(displacement[-1]) < 1e-12 * found.pgd
        assert np.abs(record.acceleration[[0, -1]]).max() < 1e-2 * record.peak


def test_the_baseline_is_small(monkeypatch):
    corrected = synthetic_records(20, 4)
    monkeypatch.setattr(synthetic, "_at_rest", lambda a: a)
    for record, plain in zip(corrected, synthetic_records(20, 4), strict=True):
        added = np.abs(record.acceleration - plain.acceleration).max()
        assert 0 < added < 0.01 * record.peak


@together(
    "given, message",
    [
        ({"n": 0}, "n must be a whole number from 1 to 1000, is 0"),
        ({"seed": -1}, "seed must be a whole number from 0 to"),
        ({"dt": 0.0}, r"dt must be finite and positive, is 0\.0"),
        ({"duration": 0.5}, "duration / dt must be a whole number from 100 to 499999, is 50"),
        ({"duration": 1e300}, "duration / dt must be a whole number from 100 to 499999"),
        ({"rms": -1.0}, r"rms must be finite and positive, is -1\.0"),
        ({"soil": "rock"}, "soil must be one of firm, medium, soft, is 'rock'"),
        ({"soil": Soil(1.0, 0.0, 1.0, 1.0)}, r"soil.damping must be finite and positive, is 0\.0"),
        ({"rise": 0.0}, r"rise must be from 0\.001 to 0\.8, is 0\.0"),
        ({"rise": 0.3, "strong": 0.6}, r"strong must be from 0 to 0.8 - rise, 0\.5, is 0\.6"),
    ],
)
def test_what_makes_no_suite_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        synthetic_records(**{"n": 1, **given})
