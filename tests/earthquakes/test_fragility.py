"""Fragility functions and cloud analysis against published numbers and other optimisers."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import binom, chi2, linregress, norm
from together import together

from hpcsweep import capacity, capacity_fragility, cloud, fragility

STRIPES = [
    *(0.178, 0.274, 0.444, 0.56, 0.652, 0.79, 0.982, 1.246),
    *(1.564, 2.014, 2.417, 3.021, 3.625, 4.028, 4.431, 5.035),
]
EXCEEDED = [0, 0, 0, 0, 0, 4, 13, 23, 38, 41, 44, 45, 45, 45, 45, 45]


def log_likelihood(median, dispersion, x=STRIPES, k=EXCEEDED, n=45):
    return binom.logpmf(k, n, norm.cdf(np.log(np.divide(x, median)) / dispersion)).sum()


def test_the_published_fit():
    found = fragility(STRIPES, EXCEEDED, 45)
    assert found.median == pytest.approx(1.21945, abs=5e-6)
    assert found.dispersion == pytest.approx(0.31007, abs=5e-6)


@together(
    "x, k, n",
    [
        (STRIPES, EXCEEDED, 45),
        ([1.0, 2.0, 3.0], [1, 1, 2], [2, 2, 2]),
        ([0.5, 3.0, 1.0, 8.0], [0, 17, 1, 20], [40, 40, 10, 20]),
        ([1e-9, 3e-9, 1e-8], [1, 9, 9], 10),
    ],
)
def test_the_maximum_of_the_likelihood(x, k, n):
    found = fragility(x, k, n)

    def less(p):
        return -log_likelihood(math.exp(p[0]), math.exp(p[1]), x, k, n)

    start = [math.log(found.median) + 0.1, math.log(found.dispersion) - 0.1]
    other = minimize(less, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12})
    assert found.median == pytest.approx(math.exp(other.x[0]), rel=1e-6)
    assert found.dispersion == pytest.approx(math.exp(other.x[1]), rel=1e-6)


@together("confidence", [0.68, 0.95])
def test_at_the_ends_of_an_interval_the_profile_has_fallen_by_half_the_quantile(confidence):
    found = fragility(STRIPES, EXCEEDED, 45, confidence)
    fall = chi2.ppf(confidence, 1) / 2
    top = log_likelihood(found.median, found.dispersion)
    options = {"xatol": 1e-9, "fatol": 1e-12}
    for end in found.median_interval:
        best = minimize(
            lambda p, end=end: -log_likelihood(end, math.exp(p[0])),
            *([math.log(0.3)], (), "Nelder-Mead"),
            options=options,
        )
        assert top + best.fun == pytest.approx(fall, rel=1e-6)
    for end in found.dispersion_interval:
        best = minimize(
            lambda p, end=end: -log_likelihood(math.exp(p[0]), end),
            *([math.log(1.2)], (), "Nelder-Mead"),
            options=options,
        )
        assert top + best.fun == pytest.approx(fall, rel=1e-6)
    assert found.median_interval[0] < found.median < found.median_interval[1]
    assert found.dispersion_interval[0] < found.dispersion < found.dispersion_interval[1]


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_promise():
    rng = np.random.default_rng(1)
    x = np.geomspace(0.4, 2.5, 8)
    held = np.zeros(3)
    for _ in range(300):
        found = fragility(x, rng.binomial(30, norm.cdf(np.log(x) / 0.4)), 30, 0.9)
        low, high = found.band([1.3])
        truth = norm.cdf(math.log(1.3) / 0.4)
        held += [
            found.median_interval[0] <= 1 <= found.median_interval[1],
            found.dispersion_interval[0] <= 0.4 <= found.dispersion_interval[1],
            low[0] <= truth <= high[0],
        ]
    # 0.9 to four standard deviations of 300 trials
    assert np.all(np.abs(held / 300 - 0.9) < 0.07)


def test_the_curve_and_its_band():
    found = fragility(STRIPES, EXCEEDED, 45)
    x = np.geomspace(0.2, 5, 20)
    low, high = found.band(x)
    p = found.probability(x)
    assert np.all((low < p) & (p < high))
    assert found.probability(found.median) == pytest.approx(0.5)
    # the delta method for the median itself, symmetric about its logarithm
    at = found.band([found.median])
    assert norm.ppf(at[1][0]) == pytest.approx(-norm.ppf(at[0][0]))


def test_the_order_of_stripes_does_not_matter_and_few_records_bound_little():
    order = np.random.default_rng(2).permutation(16)
    found = fragility(np.take(STRIPES, order), np.take(EXCEEDED, order), [45] * 16)
    assert found.median == pytest.approx(fragility(STRIPES, EXCEEDED, 45).median, rel=1e-12)
    few = fragility([1, 2, 3], [1, 1, 2], 2)
    assert few.median_interval == (0.0, math.inf)
    assert few.dispersion_interval[1] == math.inf
    assert 0 < few.dispersion_interval[0] < few.dispersion


@together(
    "arguments, message",
    [
        (([1, 2], [0, 0], 5), "exceeded must not be 0 everywhere, is 0 of 10 records"),
        (([1, 2], [5, 5], 5), "exceeded must not be total everywhere, is, of 10 records"),
        (([1, 2, 3], [0, 0, 5], 5), "separable: no record below 3 reaches .* all above 2 do"),
        (([1, 2, 3], [0, 2, 5], 5), "separable: no record below 2 reaches .* all above 2 do"),
        (([1, 2, 3], [4, 3, 1], 5), "exceeded must grow with the intensity"),
        (([1, 2, 3], [2, 2, 2], 5), "exceeded must grow with the intensity"),
        (([1, 2], [1, 6], 5), "exceeded must be from 0 to total, is 6 of 5"),
        (([1, 2], [1, -1], 5), "exceeded must be from 0 to total, is -1 of 5"),
        (([1, 2], [0, 0], [5, 0]), "exceeded must be from 0 to total, is 0 of 0"),
        (([1, 2], [1, 1.5], 5), "exceeded must be whole numbers"),
        (([1, 2], [1, math.nan], 5), "exceeded must be whole numbers"),
        (([1, 2], [1], 5), r"exceeded must have the shape of intensity, \(2,\), has \(1,\)"),
        (([0, 2], [1, 2], 5), "intensity must be finite and above 0, is 0"),
        (([[1, 2]], [[1, 2]], 5), "intensity must have one dimension"),
        (([1, 2], [1, 3], 5, 1.0), r"confidence must be from 0.5 to 0.9999, is 1.0"),
    ],
)
def test_data_that_bound_no_fragility_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        fragility(*arguments)
    assert "\n" not in str(error.value)


def censored(capacities, highest) -> tuple:
    """Return the fragility of exact responses, proportional to x / capacity, up to a stripe."""
    x = np.linspace(0.1, 1.0, 10) * highest
    return capacity_fragility(capacity(x, x / np.reshape(capacities, (-1, 1)), 1.0))


def test_known_capacities_have_their_moments_and_a_closed_interval_of_the_median():
    logs = np.log(np.random.default_rng(4).lognormal(0.3, 0.5, 44))
    found = censored(np.exp(logs), 1.01 * np.exp(logs.max()))
    assert found.median == pytest.approx(math.exp(logs.mean()), rel=1e-9)
    assert found.dispersion == pytest.approx(logs.std(), rel=1e-9)
    assert found.caution == ""
    # n / 2 ln(1 + (d / s)^2) is half the quantile
    away = logs.std() * math.sqrt(math.exp(chi2.ppf(0.95, 1) / 44) - 1)
    ends = np.exp(logs.mean() + np.array([-away, away]))
    np.testing.assert_allclose(found.median_interval, ends, rtol=1e-9)


def test_records_that_never_reach_the_threshold_count_as_above_the_last_stripe():
    given = np.random.default_rng(5).lognormal(1.0, 0.6, 30)
    highest = float(np.sort(given)[10]) * 1.001  # 11 of 30
    found = censored(given, highest)
    known = np.log(given[given <= highest])

    def less(p):
        z = (known - p[0]) / math.exp(p[1])
        never = 19 * norm.logsf((math.log(highest) - p[0]) / math.exp(p[1]))
        return -(norm.logpdf(z).sum() - known.size * p[1] + never)

    options = {"xatol": 1e-10, "fatol": 1e-13}
    other = minimize(less, [1.0, -0.5], method="Nelder-Mead", options=options)
    assert found.median == pytest.approx(math.exp(other.x[0]), rel=1e-6)
    assert found.dispersion == pytest.approx(math.exp(other.x[1]), rel=1e-6)
    for end in found.median_interval:
        best = minimize(
            lambda p, end=end: less([math.log(end), p[0]]),
            [-0.5],
            (),
            "Nelder-Mead",
            options=options,
        )
        assert best.fun - other.fun == pytest.approx(chi2.ppf(0.95, 1) / 2, rel=1e-6)
    assert "at most 36.7 % of the records reach the threshold" in found.caution


@pytest.mark.slow
def test_intervals_of_censored_capacities_hold_the_truth():
    rng = np.random.default_rng(6)
    held = np.zeros(2)
    for _ in range(200):
        found = censored(rng.lognormal(0.0, 0.4, 40), 0.95)  # 45 % reach it
        held += [
            found.median_interval[0] <= 1 <= found.median_interval[1],
            found.dispersion_interval[0] <= 0.4 <= found.dispersion_interval[1],
        ]
    assert np.all(np.abs(held / 200 - 0.95) < 0.06)  # four standard deviations


def test_the_same_records_at_more_stripes_bound_no_more():
    given = np.random.default_rng(7).lognormal(0.0, 0.4, 20)

    def width(n):
        x = np.linspace(3.0 / n, 3.0, n)
        low, high = capacity_fragility(capacity(x, x / given[:, None], 1.0)).median_interval
        return math.log(high / low)

    assert width(200) == pytest.approx(width(10), rel=1e-9)


@together(
    "x, k, told",
    [
        (STRIPES, EXCEEDED, ""),
        (
            [1.0, 2.0, 3.0],
            [1, 4, 9],
            "by the highest stripe, 3: at most 20 % of the records",
        ),
        ([1.0, 2.0, 3.0], [30, 40, 44], "by the lowest stripe, 1"),
    ],
)
def test_an_extrapolated_median_is_told(x, k, told):
    found = fragility(x, k, 45)
    assert (told in found.caution) if told else not found.caution


@together(
    "responses, message",
    [
        ([[0.1, 0.2], [0.1, 0.3]], "of 2 records 0 reach the threshold"),
        ([[0.1, 1.2], [0.1, 0.3]], "of 2 records 1 reach the threshold"),
        ([[1.0, 1.2], [1.0, 1.2]], "two different capacities are needed"),
    ],
)
def test_too_few_capacities_are_refused(responses, message):
    with pytest.raises(ValueError, match=message):
        capacity_fragility(capacity([1.0, 2.0], responses, 1.0))


def test_messages_have_the_word_for_what_records_do():
    with pytest.raises(ValueError, match=r"of 2 records 1 collapse$"):
        capacity_fragility(capacity([1.0, 2.0], [[0.1, 1.2], [0.1, 0.3]], 1.0), event="collapse")
    x, given = np.array([1.0, 2.0]), np.array([0.9, 1.5, 5.0, 5.0, 5.0, 5.0])
    reached = capacity(x, x / given[:, None], 1.0)
    told = capacity_fragility(reached, event="collapse").caution
    assert told.endswith("highest stripe, 2: at most 33.3 % of the records collapse")


def test_cloud_analysis_is_a_line_through_logarithms():
    rng = np.random.default_rng(3)
    x = rng.lognormal(0, 0.7, 40)
    r = 0.01 * x**1.2 * rng.lognormal(0, 0.3, 40)
    found = cloud(x, r)
    other = linregress(np.log(x), np.log(r))
    assert found.slope == pytest.approx(other.slope, rel=1e-12)
    assert found.intercept == pytest.approx(other.intercept, rel=1e-12)
    assert found.slope_error == pytest.approx(other.stderr, rel=1e-12)
    rest = np.log(r) - other.intercept - other.slope * np.log(x)
    assert found.dispersion == pytest.approx(math.sqrt((rest**2).sum() / 38), rel=1e-12)
    median, dispersion = found.capacity(0.02)
    assert found.median(median) == pytest.approx(0.02, rel=1e-12)
    assert dispersion == found.dispersion / found.slope


@together(
    "x, r, message",
    [
        ([1, 2], [1, 2], "intensity must have at least 3 values, 2 of them different, has 2"),
        ([1, 1, 1], [1, 2, 3], "intensity must have at least 3 values, 2 of them different, has 3"),
        ([1, 2, 3], [1, 2], r"response must have the shape of intensity, \(3,\), has \(2,\)"),
        ([1, 2, 3], [1, 0, 2], "response must be finite and above 0, is 0"),
        ([1, 2, 3], [1, math.inf, 2], "response must be finite and above 0, is inf"),
    ],
)
def test_what_makes_no_cloud_is_refused(x, r, message):
    with pytest.raises(ValueError, match=message):
        cloud(x, r)


def test_a_cloud_that_falls_has_no_fragility():
    with pytest.raises(ValueError, match="the slope must be above 0 for a fragility, is -1"):
        cloud([1, 2, 4], [4, 2, 1]).capacity(1.0)


def test_a_median_between_stripes_that_none_and_all_reach_is_no_extrapolation():
    found = capacity([1.0, 5.0, 9.0], [[1.0, 2.0, 4.0], [1.0, 2.5, 5.0]], threshold=3.0)
    fit = capacity_fragility(found)
    assert 5.0 < fit.median < 9.0
    assert fit.caution == ""
    # all reach the first stripe
    found = capacity([1.0, 5.0], [[4.0, 5.0], [5.0, 6.0]], threshold=3.0)
    assert "not bounded by the lowest stripe, 1" in capacity_fragility(found).caution
