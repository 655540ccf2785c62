"""The forcing as a sum of harmonics, and passages of contacts in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from reference import reference_points
from together import together

from hpcsweep.job import JobError, parse_job
from hpcsweep.model.forcing import Harmonics, fourier_series
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.report import doubts
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns

TERMS = (
    ((1, 1.0, 0.0),),
    ((1, 0.7, 0.3), (3, -0.2, 1.1)),
    ((2, 1.0, 0.5), (5, 0.3, -2.0), (7, 0.1, 0.0)),
    ((0, 0.5, math.pi / 2), (1, 1.0, 0.0)),
)


@together("terms", TERMS)
def test_a_forcing_repeats_and_stays_within_its_size(terms):
    forcing, omega = Harmonics(terms), 0.61
    tau = np.linspace(0.0, forcing.period(omega), 1001)
    value = sum(a * np.sin(h * omega * tau + phi) for h, a, phi in terms)
    assert value[-1] == pytest.approx(value[0], abs=1e-13)
    assert 0.5 * forcing.size < np.abs(value).max() <= forcing.size
    assert forcing.period(omega, 7) == pytest.approx(7 * 2 * math.pi / omega, rel=1e-15)


def test_the_solvers_have_the_forcing_of_the_structure():
    structure = Structure(2, harmonics=TERMS[1])
    assert structure.forcing == Harmonics(TERMS[1])
    model = kernel_model(structure, 0.61)
    assert model.period == structure.forcing.period(0.61)
    assert model.harmonics.tolist() == [list(term) for term in TERMS[1]]


@pytest.mark.parametrize("sharpness", [3e3, 1e4])
def test_passages_through_layers_in_closed_form_are_the_motion(sharpness):
    structure, amplitude, omega = Structure(3, 300.0, sharpness), 0.2, 0.445
    z = np.array([0.5, 0.8, 0.9, 0.4, 0.3, 0.6])
    usual = FlowMap(structure, omega)
    points, _ = usual.points(z, amplitude, 6)
    assert usual.counts[1] > 0
    reference = reference_points(structure, amplitude, omega, z, 6)
    assert np.abs(points - reference).max() < 1e-9 * (1.0 + np.abs(reference).max())


def test_a_mean_force_bends_the_structure_as_statics_has_it():
    """The mean of the steady motion is K^-1 b A a_0, and a stop is reached sooner by as much."""
    mean, structure = (0, -0.3, math.pi / 2), Structure(3, sharpness=math.inf)
    forced = Structure(3, sharpness=math.inf, harmonics=((1, 1.0, 0.0), mean))
    orders, responses = forced.steady_harmonics(0.61)
    static = np.linalg.solve(forced.stiffness_matrix, -0.3 * forced.forcing_vector)
    np.testing.assert_allclose(responses[1].imag, static, rtol=1e-12)
    assert orders.tolist() == [1.0, 0.0]
    reached = 1 / structure.grazing_amplitude(0.61)
    assert 1 / forced.grazing_amplitude(0.61) == pytest.approx(reached + static[2], rel=1e-12)


def test_the_rules_that_spare_periods_hold_with_a_mean_force():
    structure = Structure(2, 300.0, harmonics=((1, 1.0, 0.0), (0, -0.2, math.pi / 2)))
    settings = SweepSettings(transient_cycles=300, classify_cycles=0)
    amplitudes = np.linspace(0.005, 0.2, 12)
    spared = FrameRuns(structure, 0.6, settings).follow(amplitudes, np.zeros(4))
    whole = FrameRuns(structure, 0.6, replace(settings, skip=frozenset()))
    plain = whole.follow(amplitudes, np.zeros(4))
    assert {SkipRule.LINEAR, SkipRule.NEWTON} <= set(spared["skip_rule"].tolist())
    assert not plain["skip_rule"].any()
    periodic = plain["orbit_period"] > 0
    assert periodic.sum() > 8
    for name in ("orbit_period", "contact"):
        np.testing.assert_array_equal(spared[name][periodic], plain[name][periodic])
    for name in ("final_state", "drift", "modal_norm"):
        np.testing.assert_allclose(spared[name][periodic], plain[name][periodic], atol=2e-5)


@together("size", [3, 15, 16, 33])
def test_samples_of_a_series_give_it_back(size):
    """Orders up to below half the samples; what does not fit in is told as an error."""
    terms = ((0, 0.25, math.pi / 2), (1, 1.0, -0.4), (7, 0.5, 2.0))
    x = 2 * math.pi * np.arange(size) / size
    samples = sum(a * np.sin(h * x + phi) for h, a, phi in terms)
    found, error = fourier_series(samples, 8)
    again = sum(a * np.sin(h * x + phi) for h, a, phi in found)
    off = np.abs(again - samples).max() / np.abs(samples).max()
    assert error == pytest.approx(off, abs=1e-13)
    if size >= 15:
        assert error < 1e-13
        np.testing.assert_allclose(found, terms, rtol=1e-12)
    assert fourier_series(samples, 1)[1] > 0.1 or size == 3


def test_a_half_wave_of_a_job():
    """max(sin x, 0) = 1 / pi + sin(x) / 2 - 2 / pi sum_k cos(2 k x) / (4 k^2 - 1)."""
    samples = np.maximum(np.sin(2 * math.pi * np.arange(10_000) / 10_000), 0).tolist()
    text = f"[forcing]\nsamples = {samples}\nn_harmonics = 4\n[sweep]\nomega = 1\namplitude = 1"
    job = parse_job(text, "job.toml", "job")
    found = np.array(job.structure.harmonics)
    assert found[:, 0].tolist() == [0, 1, 2, 4]
    np.testing.assert_allclose(
        found[:, 1], [1 / math.pi, 0.5, 2 / 3 / math.pi, 2 / 15 / math.pi], rtol=1e-6
    )
    np.testing.assert_allclose(np.sin(found[:, 2]), [1, 0, -1, -1], atol=1e-9)
    assert list(doubts(job.structure, np.ones(1), np.ones(1), True)) == []
    # the rest of the series where it is largest, at x = 0
    left = 2 / math.pi * sum(1 / (4 * k * k - 1) for k in range(3, 10_000))
    assert job.notes == (
        f"forcing.samples: harmonics 0, 1, 2, 4 meet them to {100 * left:.2g} % of the largest",
    )


@together(
    "forcing, said",
    [
        ("samples = 3", "forcing.samples = 3: must be a list of 3 to 100000 numbers, finite"),
        ("samples = [1, 2]", "forcing.samples = [1, 2]: must be a list of 3 to 100000"),
        ("samples = [1, 1, 1]", "forcing.samples = [1, 1, 1]: must be a list of 3 to 100000"),
        (
            "samples = [1, inf, 1]",
            "must be a list of 3 to 100000 numbers, finite and not all equal",
        ),
        ("samples = [1, 2, 'a']", "forcing.samples = 'a': must be a number"),
        ("samples = [1, 2, 1e40]", "forcing.samples = 1e+40: must be 0 or of a size from 1e-30"),
        (
            "samples = [1, 2, 3]\nn_harmonics = 16",
            "n_harmonics = 16: must be a whole number from 1",
        ),
        ("n_harmonics = 3", "forcing.n_harmonics = 3: goes with samples"),
        (
            "samples = [1, 2, 3]\nharmonics = [{order = 1}]",
            "harmonics = [{'order': 1}]: does not go",
        ),
    ],
)
def test_samples_of_no_forcing_are_refused(forcing, said):
    with pytest.raises(JobError) as caught:
        parse_job(f"[forcing]\n{forcing}\n[sweep]\nomega = 1\namplitude = 1", "job.toml", "job")
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
