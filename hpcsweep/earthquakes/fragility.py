r"""Fragility functions: the probability that a threshold is reached, given the intensity.

The fragility of a median theta and a dispersion beta is Phi(ln(x / theta) / beta). The number k_i
of n_i records at the intensity x_i that reach the threshold is binomial, so that the log-likelihood
is, up to a constant (Baker, Earthquake Spectra 31 (2015) 579),

    l = sum_i k_i ln Phi(h_i) + (n_i - k_i) ln Phi(-h_i),     h_i = b_0 + b_1 ln x_i,

with b_1 = 1 / beta, b_0 = -ln(theta) / beta. It is concave in b_0 and b_1: Newton's method finds
its only maximum, which is finite unless the data are *separable*: no record reaches the threshold
at a lower intensity than one that does not. Then beta = 0 fits best, and the data determine
nothing.

That takes the records of each stripe as others than those of the next. Where the same records are
scaled to all stripes, as in an incremental dynamic analysis, their exceedances at the stripes
depend on each other, and each record has one capacity c_i: known, or above the last stripe x_i if
no stripe reaches the threshold. Then

    l = sum_known [ln b_1 - h(c_i)^2 / 2] + sum_never ln Phi(-h(x_i)),     h(x) = b_0 + b_1 ln x,

which is concave, too. Without the second sum theta and beta are the moments of ln c.

Intervals are those of the profile likelihood: all theta (all beta) for which the largest l over the
other parameter is below the maximum by at most half the quantile of chi^2 with one degree of
freedom. They need not be symmetric, and an end is 0 or infinite where the data do not bound it. The
band about the curve comes from the normal distribution of h at each intensity, of variance (1, ln
x) C (1, ln x)^T, C the inverse of Fisher's information of b_0 and b_1: the expected one of stripes,
the observed one of capacities.

Cloud analysis fits ln R = a + b ln x by least squares to responses at arbitrary intensities, with
standard deviation s about the line and n - 2 degrees of freedom (Cornell, Jalayer, Hamburger and
Foutch 2002). A threshold r then has the median exp((ln r - a) / b) and the dispersion s / b.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from hpcsweep.earthquakes.likelihood import Likelihood
from hpcsweep.earthquakes.stripes import Capacity
from hpcsweep.model.arguments import array, instance, number, positive

FLAT = 1e-9
"""Probits by which the fit rises from the first to the last stripe, at most, if it does not rise:
rounding leaves about 1e-16."""
REACHED = "reach the threshold"
"""What records do at their capacity."""
FARTHEST = 60
"""Doublings in the search for an end of an interval: from then on there is none."""


class Fragility(NamedTuple):
    """A fragility function fitted to stripes or capacities."""

    median: float
    """Intensity theta that half of the records bring to the threshold."""
    dispersion: float
    """Standard deviation beta of the logarithm of the capacity."""
    median_interval: tuple[float, float]
    """Of the profile likelihood; an end that the data do not bound is 0 or inf."""
    dispersion_interval: tuple[float, float]
    """The same of beta."""
    confidence: float
    """Of both intervals and of the band."""
    covariance: np.ndarray
    """C of b_0 and b_1, shape (2, 2)."""
    caution: str
    """Why the median is no more than an extrapolation; empty if stripes lie on both sides of it."""

    def probability(self, intensity: Any) -> np.ndarray:
        """Return the probability that the threshold is reached at intensities above 0."""
        return ndtr(np.log(np.asarray(intensity, float) / self.median) / self.dispersion)

    def band(self, intensity: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return the confidence band of `probability`, its lower and its upper edge."""
        log_x = np.log(np.asarray(intensity, float))
        h = (log_x - math.log(self.median)) / self.dispersion
        c = self.covariance
        wide = np.sqrt(c[0, 0] + log_x * (2.0 * c[0, 1] + log_x * c[1, 1]))
        wide *= ndtri(0.5 * (1.0 + self.confidence))
        return ndtr(h - wide), ndtr(h + wide)


class Cloud(NamedTuple):
    """A cloud analysis: ln R = intercept + slope ln x, and the scatter about it."""

    intercept: float
    """Logarithm a of the median response at the intensity 1."""
    slope: float
    """b: 1 where responses are proportional to the intensity."""
    dispersion: float
    """Standard deviation s of ln R about the line, n - 2 degrees of freedom."""
    slope_error: float
    """Standard error of the slope."""

    def median(self, intensity: Any) -> np.ndarray:
        """Return the median response at intensities above 0."""
        return np.exp(self.intercept + self.slope * np.log(np.asarray(intensity, float)))

    def capacity(self, threshold: float) -> tuple[float, float]:
        """Return the median and the dispersion of the fragility at a threshold above 0.

        Raises
        ------
        ValueError
            If responses do not grow with the intensity.
        """
        if self.slope <= 0:
            raise ValueError(f"the slope must be above 0 for a fragility, is {self.slope:.4g}")
        log_r = math.log(positive("threshold", threshold))
        return math.exp((log_r - self.intercept) / self.slope), self.dispersion / self.slope


def fragility(intensity: Any, exceeded: Any, total: Any, confidence: float = 0.95) -> Fragility:
    """Fit a fragility function to stripes by maximum likelihood.

    Parameters
    ----------
    intensity : array_like, shape (s,)
        Intensity of each stripe, finite and above 0; in any order.
    exceeded : array_like of whole numbers, shape (s,)
        Records of each stripe that reach the threshold.
    total : array_like of whole numbers, shape (s,), or one
        Records of each stripe, at least 1.
    confidence : float
        Confidence of the intervals and of the band, from 0.5 to 0.9999.

    Returns
    -------
    Fragility
        A tuple that begins with the median and the dispersion.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range, or if the data determine no
        fragility: no record reaches the threshold, all do, they are separable, or fewer reach it as
        the intensity grows.

    References
    ----------
    Baker, Earthquake Spectra 31 (2015) 579; Porter, Kennedy and Bachman, ibid. 23 (2007) 471.

    Examples
    --------
    >>> fit = hpcsweep.fragility([0.5, 1.0, 2.0], exceeded=[1, 5, 9], total=10)
    >>> round(float(fit.median), 6), round(float(fit.dispersion), 6)
    (1.0, 0.540866)
    """
    x, k, n = _stripes(intensity, exceeded, total)
    fit = Likelihood(np.log(x), k, n)
    b = fit.largest(np.zeros(2), np.eye(2))
    if not b[1] * np.ptp(np.log(x)) > FLAT:
        raise ValueError(
            "exceeded must grow with the intensity: the dispersion is not positive, "
            f"its inverse is {b[1]:.4g}"
        )
    return _fragility(fit, b, fit.expected(b), confidence, (x.min(), x.max()), k / n)


def capacity_fragility(
    found: Capacity, confidence: float = 0.95, event: str = REACHED
) -> Fragility:
    """Fit a fragility function to the capacities of records that are scaled to all stripes.

    Records whose capacity is infinite count as not reaching the threshold up to their last stripe,
    those whose capacity is NaN are left out.

    Parameters
    ----------
    found : Capacity
        Of `capacity`, of any shape.
    confidence : float
        As of `fragility`.
    event : str
        What records do at their capacity, in messages: "collapse", say.

    Returns
    -------
    Fragility
        Its median is in the intensity measure of the scales.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range, or if there are no two different
        finite capacities.

    References
    ----------
    Vamvatsikos and Cornell, Earthquake Engineering & Structural Dynamics 31 (2002) 491.

    Examples
    --------
    >>> responses = [[1.0, 2.0, 5.0], [0.5, 1.0, 2.0], [0.1, 0.2, 0.3]]
    >>> found = hpcsweep.capacity([1.0, 2.0, 4.0], responses, threshold=1.5)  # 1.5, 3 and above 4
    >>> fit = hpcsweep.capacity_fragility(found)
    >>> round(float(fit.median), 6), round(float(fit.dispersion), 6)
    (2.960421, 0.575766)
    """
    instance("found", found, Capacity)
    is_known = ~np.isnan(found.scale)
    scale, below, above = (getattr(found, name)[is_known] for name in ("scale", "below", "above"))
    never = np.isinf(scale)
    reached = scale[~never]
    if np.any(reached <= 0):
        raise ValueError(f"capacities must be above 0, is {reached.min():g}")
    if np.unique(reached).size < 2:
        raise ValueError(
            f"two different capacities are needed: of {scale.size} records {reached.size} {event}"
        )
    logs = np.log(reached)
    zeros = np.zeros(never.sum())
    fit = Likelihood(np.log(below[never]), zeros, zeros + 1.0, logs)
    b = fit.largest(np.array([-logs.mean(), 1.0]) / logs.std(), np.eye(2))
    # the lowest stripe is that which the first reach, or lies below what none reaches
    ends = below.min() or above.min(), np.where(never, below, above).max()
    shares = np.array([0.0, reached.size / scale.size])
    return _fragility(fit, b, fit.slopes(b)[1], confidence, ends, shares, event)


def _fragility(
    fit: Likelihood,
    b: np.ndarray,
    information: np.ndarray,
    confidence: float,
    ends: tuple[float, float],
    shares: np.ndarray,
    event: str = REACHED,
) -> Fragility:
    """Return the fragility of the largest likelihood, at `b`, with its intervals.

    `ends` are the lowest and the highest stripe, `shares` the parts of records that reach the
    threshold at stripes, or what else the event is.
    """
    confidence = number("confidence", confidence, "from 0.5 to 0.9999", 0.5, 0.9999)
    least = fit.value(b) - 0.5 * float(ndtri(0.5 * (1.0 + confidence))) ** 2
    covariance = np.linalg.inv(information)
    place = -b[0] / b[1]
    line = np.array([1.0, place]) / b[1]

    def of_median(log_theta: float) -> float:
        along = np.array([[-log_theta, 1.0]])
        return fit.value(fit.largest(np.zeros(2), along, b[1:])) - least

    def of_inverse(log_b1: float) -> float:
        start = np.array([0.0, math.exp(log_b1)])
        across = np.array([[1.0, 0.0]])
        return fit.value(fit.largest(start, across, -place * start[1:])) - least

    step = math.sqrt(float(line @ covariance @ line))
    medians = [_end(of_median, place, sign * step) for sign in (-1.0, 1.0)]
    step = math.sqrt(float(covariance[1, 1])) / b[1]
    inverses = [_end(of_inverse, math.log(b[1]), sign * step) for sign in (-1.0, 1.0)]
    return Fragility(
        median=math.exp(place),
        dispersion=1.0 / float(b[1]),
        median_interval=(_exp(medians[0]), _exp(medians[1])),
        dispersion_interval=(_exp(-inverses[1]), _exp(-inverses[0])),
        confidence=confidence,
        covariance=covariance,
        caution=_caution(math.exp(place), *ends, shares, event),
    )


def _caution(median: float, lowest: float, highest: float, shares: np.ndarray, event: str) -> str:
    """Write why a median is extrapolated, empty if it is not."""
    words = "the median is an extrapolation, not bounded by the"
    if median > highest or shares.max() < 0.5:
        share = f"at most {100 * shares.max():.3g} % of the records {event}"
        return f"{words} highest stripe, {highest:.4g}: {share}"
    below = median < lowest or shares.min() > 0.5
    return f"{words} lowest stripe, {lowest:.4g}" if below else ""


def cloud(intensity: Any, response: Any) -> Cloud:
    """Fit the logarithm of responses to that of intensities by least squares.

    Parameters
    ----------
    intensity, response : array_like, shape (n,)
        Of each unscaled record, finite and above 0; at least 3, at 2 intensities.

    Returns
    -------
    Cloud
        Intercept, slope and scatter of ln(response) over ln(intensity), each number a float.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Cornell, Jalayer, Hamburger and Foutch, Journal of Structural Engineering 128 (2002) 526.

    Examples
    --------
    Responses of 3 s^2, and e^(+-0.1) times that:

    >>> responses = 3.0 * np.array([1, 1, 16, 16]) * np.exp([0.1, -0.1, 0.1, -0.1])
    >>> fit = hpcsweep.cloud([1.0, 1.0, 4.0, 4.0], responses)
    >>> round(math.exp(fit.intercept), 9), round(fit.slope, 9)
    (3.0, 2.0)
    """
    x, y = _positive("intensity", intensity), _positive("response", response)
    if x.shape != y.shape:
        raise ValueError(f"response must have the shape of intensity, {x.shape}, has {y.shape}")
    if x.size < 3 or np.ptp(x) == 0:
        raise ValueError(
            f"intensity must have at least 3 values, 2 of them different, has {x.size}"
        )
    p, q = np.log(x), np.log(y)
    away = p - p.mean()
    squares = float(away @ away)
    slope = float(away @ q) / squares
    intercept = float(q.mean() - slope * p.mean())
    rest = q - intercept - slope * p
    dispersion = math.sqrt(float(rest @ rest) / (x.size - 2))
    return Cloud(intercept, slope, dispersion, dispersion / math.sqrt(squares))


def _end(excess: Any, middle: float, step: float) -> float:
    """Return the zero of a function that is positive at `middle` and falls, or an infinity."""
    inner, outer = middle, middle + step
    for _ in range(FARTHEST):
        if excess(outer) <= 0:
            return float(brentq(excess, inner, outer, xtol=1e-12, rtol=1e-12))
        inner, outer = outer, outer + (outer - inner) * 2.0
        if abs(outer - middle) > 700.0:
            break
    return math.copysign(math.inf, step)


def _exp(value: float) -> float:
    return 0.0 if value == -math.inf else math.exp(value) if value < 700.0 else math.inf


def _stripes(
    intensity: Any, exceeded: Any, total: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the validated stripes; refuse those that determine no fragility."""
    x = _positive("intensity", intensity)
    k, n = array("exceeded", exceeded), array("total", total)
    if n.ndim == 0:
        n = np.full(x.shape, float(n))
    for name, counts in (("exceeded", k), ("total", n)):
        if counts.shape != x.shape:
            raise ValueError(
                f"{name} must have the shape of intensity, {x.shape}, has {counts.shape}"
            )
        if not np.all(counts == np.floor(counts)):
            raise ValueError(f"{name} must be whole numbers")
    if not np.all((n >= 1) & (k >= 0) & (k <= n)):
        i = int(np.argmin((n >= 1) & (k >= 0) & (k <= n)))
        raise ValueError(f"exceeded must be from 0 to total, is {k[i]:g} of {n[i]:g}")
    if not k.any():
        raise ValueError(f"exceeded must not be 0 everywhere, is 0 of {n.sum():g} records")
    if np.array_equal(k, n):
        raise ValueError(f"exceeded must not be total everywhere, is, of {n.sum():g} records")
    first, last = x[k > 0].min(), x[k < n].max()
    if first >= last:
        raise ValueError(
            f"exceeded must not be separable: no record below {first:g} reaches the threshold, "
            f"all above {last:g} do; stripes are needed between"
        )
    return x, k, n


def _positive(name: str, values: Any) -> np.ndarray:
    """Return validated finite numbers above 0, shape (m,)."""
    numbers = array(name, values)
    if numbers.ndim != 1:
        raise ValueError(f"{name} must have one dimension, has shape {numbers.shape}")
    wrong = numbers[~((numbers > 0) & (numbers < math.inf))]
    if wrong.size:
        raise ValueError(f"{name} must be finite and above 0, is {wrong[0]:g}")
    return numbers
