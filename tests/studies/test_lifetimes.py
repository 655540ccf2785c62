"""Runs of sweeps are called chaotic where chaos outlives a test, and periodic where an orbit is."""

import math

import numpy as np
import pytest
from together import together

from hpcsweep import orbit
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns, end_of

OSCILLATOR = Structure(1, 29.0, math.inf, damping_ratio=0.01, gap=1.26)
FOLD = 0.22123998868537
"""Of a P2 of Figure 3, at Omega = 0.445; its ghost is beyond it."""
NEAR_FOLD = np.array([-1.06494747, -0.97253925, -0.75349119, 0.10228275, -0.55425377, -0.16674925])


def test_chaos_below_grazing_that_ends_is_where_it_ends():
    """Of a dozen such windows of a sweep down the longest ends after some 30,000 periods."""
    omega, amplitudes = 0.8025, np.linspace(0.40, 0.50, 201)
    runs = FrameRuns(OSCILLATOR, omega, SweepSettings(classify_cycles=50_000))
    up = runs.follow(amplitudes, np.zeros(2))
    down = runs.follow(amplitudes[::-1], end_of(up, -1))
    below = amplitudes[::-1] < OSCILLATOR.grazing_amplitude(omega)
    windows = below & (down["window_class"] == MotionClass.CHAOTIC)
    assert windows.sum() > 5  # rounding has the last word
    assert set(down["motion"][below].tolist()) == {MotionClass.NO_CONTACT}
    assert set(down["orbit_period"][windows].tolist()) == {1}
    assert 5_000 < down["classification_cycles"][windows].max() < 50_000
    # nor is there hysteresis
    np.testing.assert_array_equal(up["motion"][::-1][below], down["motion"][below])


@together(
    "omega, first, before, most",
    [
        (0.773802, 0.27006, [0.2709, 0.27062, 0.27034], 8_000),  # below grazing
        (0.31277, 0.345, [0.34584, 0.34556, 0.34528], 8_000 // 160),
    ],
)
def test_neighbours_are_tested_together_wherever_blocks_are_cut(omega, first, before, most):
    """Chaos that a sweep follows from one amplitude to the next."""
    amplitudes = first - 0.00028 * np.arange(8)
    runs = FrameRuns(Structure(), omega, SweepSettings(classify_cycles=8_000))
    start = runs.follow(before, np.full(6, 0.1))
    whole = runs.follow(amplitudes, end_of(start, -1)[:6])
    assert set(whole["motion"].tolist()) == {MotionClass.CHAOTIC}
    followed, band = whole["classification_cycles"], whole["band_cycles"]
    assert followed[0] >= most
    below = most == 8_000
    asked = most - band[:-1] if below else band[:-1] // 4
    assert np.all(followed[1:] >= asked.clip(max(most // 64, 1), most))
    assert followed[-1] < 2_600
    np.testing.assert_array_equal(band, np.cumsum(followed).clip(None, most) if below else followed)
    for size in (1, 3):
        state, parts = end_of(start, -1)[:6], []
        for at in range(0, 8, size):
            parts.append(runs.follow(amplitudes[at : at + size], state))
            state = end_of(parts[-1], -1)
        for name, values in whole.items():
            np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), values)


def test_a_band_of_neighbours_refuses_what_its_first_run_does():
    """With a mean lifetime of L all outlive S_1, S_2, ... with probability exp(-sum S / L)."""
    runs = FrameRuns(OSCILLATOR, 0.8025, SweepSettings(classify_cycles=50_000))
    grazing = OSCILLATOR.grazing_amplitude(0.8025)
    for amplitude, first in ((0.5, 312), (0.9 * grazing, 50_000)):
        asked, before, above = [], 0, amplitude > grazing
        for _ in range(12):
            asked.append(runs._outlived(amplitude, True, before))
            before = asked[-1] if above else before + asked[-1]
        assert asked[:3] == ([312, 78, 19] if above else [50_000, 781, 781])
        assert asked[-1] == max(first // 64, 1)
        refused = first / -math.log(0.05)
        ended = np.random.default_rng(6).exponential(refused, (200_000, len(asked))) < asked
        assert np.mean(ended[:, 0]) == pytest.approx(0.95, abs=0.002)
        passed = math.exp(-sum(asked) / refused)
        assert np.mean(~ended.any(axis=1)) == pytest.approx(passed, abs=0.001)
        # after an end, and above grazing where less was followed, it begins anew
        assert runs._outlived(amplitude, True, 0) == first
        assert not above or runs._outlived(amplitude, True, asked[-1] - 1) == first


def test_chaos_of_a_band_counts_across_runs_without_chaos():
    """Below grazing each of these takes 1/32 of it away, and an end all; above both take all."""
    runs = FrameRuns(OSCILLATOR, 0.8025, SweepSettings(classify_cycles=50_000))
    chaos, other = MotionClass.CHAOTIC, MotionClass.PERIODIC
    rows = {
        "motion": np.array([chaos, other, chaos, other, other, chaos]),
        "window_class": np.array([chaos, other, chaos, other, chaos, chaos]),
        "classification_cycles": np.array([40_000, 0, 10_000, 0, 300, 100]),
        "band_cycles": np.zeros(6, int),
    }
    grazing = OSCILLATOR.grazing_amplitude(0.8025)
    for factor, expected in (
        (0.9, [40_000, 38_750, 48_750, 47_226, 0, 100]),
        (1.1, [40_000, 0, 10_000, 0, 0, 100]),
    ):
        assert runs._band(rows, np.full(6, factor * grazing), range(6), 0) == 100
        assert rows["band_cycles"].tolist() == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("skip", "transient"),
    [
        ("newton", 100),
        ("converged", 3000),
        pytest.param("newton", 3000, marks=pytest.mark.slow),
        pytest.param("converged", 100, marks=pytest.mark.slow),
    ],
)
def test_past_a_fold_no_skip_rule_finds_an_orbit(skip, transient):
    """1e-13 past it the ghost closes to 8e-13, and Newton's residual is within that of a jump."""
    before = orbit(Structure(), FOLD - 1e-11, 0.445, NEAR_FOLD, 2).points[0]
    saddle = orbit(Structure(), FOLD - 1e-5, 0.445, NEAR_FOLD, 2).points[0]
    node = orbit(Structure(), FOLD - 1e-5, 0.445, 2 * before - saddle, 2)
    assert node.stable
    beside = np.array([-1e-5, -1e-6, -1e-8, -1e-10, -1e-12, 1e-13, 1e-12, 1e-10, 1e-8, 1e-6])
    settings = SweepSettings(
        skip=frozenset({"converged", skip}), transient_cycles=transient, classify_cycles=3_000
    )
    found = FrameRuns(Structure(), 0.445, settings).follow(FOLD + beside, node.points[0])
    periods = found["orbit_period"].tolist()
    assert periods[:5] == [2, 2, 2, 2, 2]
    assert set(periods[5:]) <= {0, 1}
    assert MotionClass.LONG_PERIOD not in found["motion"]
    assert periods[-1] == 1
