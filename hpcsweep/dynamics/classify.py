"""Classify the motion in which each run of a campaign ended.

A run whose orbit period was found is periodic; "no period found" is not yet chaos. Other runs are
classified by the largest Lyapunov exponent lambda of the steady window, from exact tangent maps,
and by the stroboscopic points. With N forcing periods T in the window, the window's growth is G =
lambda N T, the logarithm of the factor by which a small difference grew over the window:

- chaotic: G > `CHAOS_GROWTH`;
- quasi-periodic: G within `NEUTRAL_GROWTH` of 0, and the points lie on one closed curve, or a
  few, along which they go round without approaching anything (`on_closed_curve`);
- long period: the points repeat after more periods than the job sought, at most N / 2;
- undecided: everything else. G well below 0 is a motion that contracts to an orbit: a transient
  slower than the window, or a period above N / 2. A window of this length cannot decide a G between
  the bounds; a longer one (``sweep.sampling_cycles``) can.

The class is that of the window: chaos may be a transient that would end later.
"""

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from itertools import groupby

import numpy as np

from hpcsweep.dynamics.orbit import orbit_period
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.outcome import Outcome

CHAOS_GROWTH = 5.0
"""Least growth of chaos over the window. The finite window leaves an error of the order of 1 in G:
the tangent vector starts and ends at different angles to the growing direction, and an impact
stretches it by up to a few e-folds within one period. Followed for 1,000 more periods, of 84
windows of 100 periods above 5 (Figures 4 and 7 as described) 74 kept a positive exponent, of 120
drawn from the maps of Figure 6 112; the others had left transient chaos. Of 20 between 3 and 5
(Figures 4 and 7) 14 did."""
NEUTRAL_GROWTH = 3.0
"""Largest growth, either sign, of a quasi-periodic window, whose true exponent is 0. Of 120 windows
on closed curves (maps of Figure 6) 87 were neutral over 1,000 more periods, |G| <= 5; 12 had
converged to an orbit, 12 were contracting to one, 9 were weakly chaotic."""
MOTION = "motion"
"""Variable of the classes in datasets without the variables that define them."""
UNSTABLE = 0.01
"""ln |mu_1| per orbit above which a repeated orbit is one that repels. Within the window it
repeats only because the motion has not left it yet: the run does not end in it."""
CURVES = (1, 2, 3, 4, 5, 6)
"""Numbers of closed curves (a torus born of P2 has two) that are tried."""
MIN_ON_CURVE = 20
"""Fewest points by which a closed curve is recognised; with 100 there can be five curves."""
CURVE_STEP = 0.2
"""Longest step between neighbours along a closed curve, in units of its diameter. Points spread
evenly round a circle are pi / k diameters apart, k of them: 0.16 at 20. Long orbits and weak chaos
near grazing, whose points lie on open arcs, have steps from 0.24."""
CURVE_SCATTER = 0.03
"""Largest root mean square distance of the points from the chords between their neighbours along
the curve, in its diameters; on a circle 0.02 at 20 points, and falling with their square."""
CURVE_DRIFT = 0.1
"""Relative change of a curve's mean radius between the two halves of the window above which the
motion is still transient."""
PEAKS, NEAR_PEAK = 3, 10
"""Spectral peaks tried as rotation number, and values tried on either side of each."""
PEAK_WIDTH = 0.12
"""Half width of the range tried, in 1 / N: twice the error of a peak of the padded spectrum."""


class Shakedown(IntEnum):
    """What the sliders do over the orbit of a run."""

    UNKNOWN = 0
    """No orbit is known."""
    ELASTIC = 1
    """None slips: their lasting elongations are constant."""
    PLASTIC = 2
    """They slip forth and back: lasting elongations repeat."""
    RATCHETING = 3
    """Lasting elongations grow each time; relative to that the motion repeats."""


def shakedown_name(kind: int | None) -> str:
    """Return what a name of a motion says of its sliders; nothing without sliders, or an orbit."""
    return f" {Shakedown(kind).name.lower()}" if kind else ""


class MotionClass(IntEnum):
    """Class of the motion of a run."""

    NOT_COMPUTED = 0
    """No committed result."""
    NO_CONTACT = 1
    """No contact, and no slip, in the steady window (only where the file holds ``contact``)."""
    PERIODIC = 2
    """The variable ``orbit_period`` holds the period."""
    LONG_PERIOD = 3
    """Repeats within the window, with a period above the job's ``max_orbit_period``."""
    QUASI_PERIODIC = 4
    CHAOTIC = 5
    UNDECIDED = 6
    """None of these can be established from this window, or from the variables of the file."""
    FAILED = 7
    """The solver failed."""

    @property
    def word(self) -> str:
        """Its name in files, figures and messages."""
        is_torus = self is MotionClass.QUASI_PERIODIC
        return "quasi-periodic" if is_torus else self.name.lower().replace("_", " ")


CLASS_NAMES = {kind: kind.word for kind in MotionClass}


def class_names(structure: Structure) -> dict[MotionClass, str]:
    """Return `CLASS_NAMES`; where springs yield, contact alone does not tell the first class."""
    free = {} if LINEAR.of(structure) else {MotionClass.NO_CONTACT: "nothing closes or slips"}
    return CLASS_NAMES | free


def tells_chaos(names) -> bool:
    """Return whether these variables identify chaos: classified motions, or exponents."""
    return MOTION in names or "lyapunov" in names


def classify(results, settings, units_at: Callable | None = None) -> np.ndarray:
    """Classify every run of a campaign.

    Parameters
    ----------
    results : xarray.Dataset
        From `hpcsweep.open_results`. Without ``lyapunov`` nothing is chaotic or quasi-periodic;
        without ``poincare`` nothing has a long period or is quasi-periodic; without ``contact``
        nothing is free of contact. Otherwise a run is undecided. If there is a variable `MOTION`,
        its classes are returned.
    settings : SweepSettings
        Settings of the runs: ``sampling_cycles`` and ``period_tolerance`` are used.
    units_at : callable (omega, amplitude, place along the frame), optional
        Units of states to which the tolerance is relative, as of `RunGrid`. Default: 1.

    Returns
    -------
    ndarray of int8, shape (direction, frame, amplitude)
        `MotionClass` of each run.
    """
    outcome = results["outcome"].values
    if MOTION in results:
        return _with_failures(results[MOTION].values, outcome)
    period = results["orbit_period"].values
    cycles = np.where(period > 0, period, settings.sampling_cycles)
    time = cycles * (2 * math.pi / _of_runs(results, "omega"))
    if "lyapunov" in results:
        growth = results["lyapunov"].values * time
    else:
        growth = np.full(period.shape, math.nan)

    classes = np.full(period.shape, MotionClass.UNDECIDED, np.int8)
    classes[(period == 0) & (growth > CHAOS_GROWTH)] = MotionClass.CHAOTIC
    classes[(period > 0) & ~(growth > UNSTABLE)] = MotionClass.PERIODIC
    if "contact" in results:
        slips = results["slider_energy"].values.any(-1) if "slider_energy" in results else False
        classes[(results["contact"].values == 0) & ~np.asarray(slips)] = MotionClass.NO_CONTACT
    classes = _with_failures(classes, outcome)
    if "poincare" in results:
        points, counts = results["poincare"].values, results["n_points"].values
        omega = _of_runs(results, "omega")
        # the points of a list have amplitudes of their own
        variable = "forcing_amplitude" if "forcing_amplitude" in results else "amplitude"
        amplitude = _of_runs(results, variable)
        for at in np.argwhere((classes == MotionClass.UNDECIDED) & (period == 0)):
            run = tuple(at.tolist())
            units = units_at(float(omega[run]), float(amplitude[run]), run[-1]) if units_at else 1.0
            window = points[run][: counts[run]] / units
            classes[run] = classify_points(window, growth[run], settings.period_tolerance)
    return classes


def _of_runs(results, name: str) -> np.ndarray:
    """Return a frequency or an amplitude of each run, in the shape of the runs."""
    outcome = results["outcome"]
    return results[name].broadcast_like(outcome).transpose(*outcome.dims).values


def _with_failures(classes: np.ndarray, outcome: np.ndarray) -> np.ndarray:
    classes = np.where(outcome == Outcome.COMPLETE, classes, MotionClass.FAILED)
    classes[outcome == Outcome.NOT_COMPUTED] = MotionClass.NOT_COMPUTED
    return classes.astype(np.int8)


def classify_points(points: np.ndarray, growth: float, tolerance: float) -> MotionClass:
    """Classify a window that is not chaotic and in which no short period was found.

    Parameters
    ----------
    points : ndarray, shape (N, 2n)
        Stroboscopic points of the window.
    growth : float
        G of the window, NaN if unknown.
    tolerance : float
        Points closer than this count as equal.
    """
    if len(points) < 2:
        return MotionClass.UNDECIDED
    if orbit_period(points, len(points) // 2, tolerance):
        return MotionClass.LONG_PERIOD
    if abs(growth) <= NEUTRAL_GROWTH and on_closed_curve(points):
        return MotionClass.QUASI_PERIODIC
    return MotionClass.UNDECIDED


def on_closed_curve(points: np.ndarray) -> bool:
    """Return whether the points lie on one closed curve, or every m-th point on one of m.

    On such a curve z_j = f(j theta mod 1) with a smooth f: in the order of j theta mod 1 they are a
    closed polygon of short steps for the right rotation number theta, and for no theta if they
    scatter. The curve must also be stationary: its radius is compared between the halves of the
    window.

    Parameters
    ----------
    points : ndarray, shape (N, 2n)
        Consecutive stroboscopic points.
    """
    return any(
        len(points) // m >= MIN_ON_CURVE and all(_one_curve(points[k::m]) for k in range(m))
        for m in CURVES
    )


def _one_curve(points: np.ndarray) -> bool:
    count = len(points)
    radius = np.linalg.norm(points - points.mean(axis=0), axis=1)
    diameter = 2 * radius.max()
    if diameter == 0:
        return False
    first, second = radius[: count // 2].mean(), radius[count // 2 :].mean()
    if abs(first - second) > CURVE_DRIFT * max(first, second):
        return False
    rotation = _rotation_numbers(points)
    if rotation.size == 0:
        return False
    phase = np.outer(rotation, np.arange(count)) % 1.0
    along = points[np.argsort(phase, axis=1)]
    steps = np.linalg.norm(along - np.roll(along, 1, axis=1), axis=2)
    best = int(steps.sum(axis=1).argmin())
    if steps[best].max() > CURVE_STEP * diameter:
        return False
    left, right = np.roll(along[best], 1, axis=0), np.roll(along[best], -1, axis=0)
    chord = right - left
    square = np.maximum(np.sum(chord**2, axis=1), np.finfo(float).tiny)
    part = np.clip(np.sum((along[best] - left) * chord, axis=1) / square, 0.0, 1.0)
    scatter = np.linalg.norm(along[best] - left - part[:, None] * chord, axis=1)
    return bool(np.sqrt(np.mean(scatter**2)) <= CURVE_SCATTER * diameter)


def _rotation_numbers(points: np.ndarray) -> np.ndarray:
    """Return rotation numbers near the largest peaks of the points' spectrum, shape (k,).

    There are none if it only rises towards 0 or 1/2: the points drift, or alternate.
    """
    count = len(points)
    window = np.hanning(count)[:, None]
    power = np.abs(np.fft.rfft((points - points.mean(axis=0)) * window, 8 * count, axis=0)) ** 2
    power = power.sum(axis=1)
    inner = power[1:-1]
    peaks = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]))
    peaks = peaks[np.argsort(-power[peaks], kind="stable")][:PEAKS]
    near = np.linspace(-PEAK_WIDTH, PEAK_WIDTH, 2 * NEAR_PEAK + 1) / count
    return (peaks[:, None] / (8 * count) + near).ravel()


def class_shares(classes: np.ndarray) -> dict[MotionClass, float]:
    """Return the share of every class among the runs that were computed.

    Parameters
    ----------
    classes : ndarray of int
        From `classify`.

    Returns
    -------
    dict of MotionClass to float
        All classes but NOT_COMPUTED; the shares sum to 1, or are all 0 if nothing was computed.
    """
    computed = max(int((classes != MotionClass.NOT_COMPUTED).sum()), 1)
    return {
        kind: int((classes == kind).sum()) / computed
        for kind in MotionClass
        if kind is not MotionClass.NOT_COMPUTED
    }


def contact_name(contact: int, labels: int | Sequence[str], room: int | None = None) -> str:
    """Return the name of a contact set, C with its members; 'none' if it is empty.

    C23: floors 2 and 3 at their stops on the right; C23L: at those on the left; C2,3L: one of each.
    With more than nine, C7-12,15; contacts of matrices by their numbers.

    Parameters
    ----------
    contact : int
        Bit k - 1 is contact k.
    labels : int or sequence of str
        `Structure.contact_labels`, or the number of floors, each with a stop on the right.
    room : int, optional
        Most letters of the name: a longer one ends in ",...".
    """
    if isinstance(labels, int):
        labels = [str(k + 1) for k in range(labels)]
    members = [label for k, label in enumerate(labels) if label and contact >> k & 1]
    if not members:
        return "none"
    many = any(len(label.rstrip("L")) > 1 for label in labels)
    items = []
    for side in ("", "L"):
        numbers = [int(m.rstrip("L")) for m in members if m.endswith("L") == bool(side)]
        if many:
            items += [part + side for part in ranges(numbers)]
        elif numbers:
            items.append("".join(map(str, numbers)) + side)
    name = "C" + ",".join(items)
    while room is not None and len(name) > room and len(items) > 1:
        items.pop()
        name = f"C{','.join(items)},..."
    return name


def ranges(numbers: Sequence[int], dash: str = "-") -> list[str]:
    """Format ascending numbers, three and more in a row as a range."""
    parts: list[str] = []
    for _, group in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]):
        row = [str(number) for _, number in group]
        parts += [row[0] + dash + row[-1]] if len(row) > 2 else row
    return parts
