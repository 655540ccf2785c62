"""The programs that the page of yielding is measured by: their own closed forms and orders."""

import newmark_yield
import numpy as np
import pytest
from newmark_yield import building, drifts_of, mapped, newmark_drifts
from sliding_block import slid

import hpcsweep


@pytest.mark.slow
def test_a_block_slides_as_newmark_says():
    """Under -a for t it slides v^2 (1 / g - 1 / a) / 2, v = a t, and as far back under +a."""
    a, t, g, dt = 3.0, 0.5, 1.0, 1e-4
    n = round(t / dt)
    pulse = np.r_[np.full(n, -a), np.zeros(15_000)]
    way = 0.5 * (a * t) ** 2 * (1.0 / g - 1.0 / a)
    # it ends within one sample
    assert slid(pulse, dt, g) == pytest.approx((way, way), rel=2e-4)
    x, path = slid(np.r_[pulse, -pulse], dt, g)
    assert x == pytest.approx(0.0, abs=2e-4 * way)
    assert path == pytest.approx(2.0 * way, rel=2e-4)
    assert slid(0.3 * pulse, dt, g) == (0.0, 0.0)  # 0.9 < g


def test_a_stiff_slider_tends_to_the_block():
    record = hpcsweep.synthetic_records(1, seed=1, duration=10.0)[0]
    x, path = slid(record.acceleration, record.dt, 1.0)
    errors = []
    for k in (1e4, 1e6, 1e8):
        slider = hpcsweep.Slider((1.0,), k, 1.0)
        structure = hpcsweep.Structure.from_matrices([1.0], [[0.0]], [], sliders=[slider])
        found = hpcsweep.response(structure, record)
        errors.append(abs(found.plastic_path[0] - path) / path)
        last = abs(found.plastic[0] - x) / path
    assert errors[0] > 5 * errors[1] > 25 * errors[2]
    assert max(errors[2], last) < 2e-3


def test_storeys_are_returned_to_their_strength():
    drift = np.array([0.01, 0.04, -0.04, 0.0, 0.02])
    force, tangent, plastic = mapped(drift, np.array([0.0, 0.0, 0.0, 0.03, 0.0]))
    assert plastic == pytest.approx([0.0, 0.024, -0.024, 0.016, 0.004])
    assert force[1] == pytest.approx(2e8 * (0.016 + 0.03 * 0.024))
    assert tangent.tolist() == [2e8, 6e6, 6e6, 6e6, 6e6]


def test_newmark_tends_to_the_exact_flow_with_the_square_of_the_step():
    record = hpcsweep.synthetic_records(1, seed=1, duration=8.0)[0]
    factor = newmark_yield.PGA / record.peak
    exact = hpcsweep.response(building(), record, factor)
    assert exact.excursions[0] > 2
    errors = []
    for part in (1, 4):
        peaks, lasting = newmark_drifts(factor * record.acceleration, record.dt, part)
        errors.append(np.abs(peaks / exact.drift - 1.0).max())
        far = np.abs(lasting - exact.plastic).max() / np.abs(exact.plastic).max()
    assert errors[0] > 10.0 * errors[1]
    assert max(errors[1], far) < 5e-3
    assert drifts_of(np.array([1.0, 3.0, 2.0])).tolist() == [1.0, 2.0, -1.0]
