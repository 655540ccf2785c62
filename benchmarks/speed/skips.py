"""Compare the skip rules with the window procedure on random points of a map.

Points lie on short paths at random frequencies: the first run of a path starts from rest, each next
one from the end of the previous plain run, as in a sweep. At every point a run with the rules and a
plain one start from the same state. Where they differ, the plain run is continued: if it then
reaches the result of the run with the rules, it had not converged in its window, and counts as
undecided; if not, a rule is wrong.
"""

import math
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.compilation import load, needed
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns

OMEGA = (0.2, 0.8)
AMPLITUDE = 0.35
STEP = AMPLITUDE / 1250
"""Step of the paths: the one of a study of 1,250 amplitudes."""
PATH = 10
"""Points on a path."""
AGREE = 1e-5
"""Results agree to this: ten times the distance within which an orbit's points count as the same.
Points in gaps and gaps omega_0, drift relative."""
MODAL_NORM = 1e-4
"""Modal norms agree to this: they turn within a short time where the largest mode changes sign, so
that a rest of the transient of `AGREE` moves them further than it moves the points."""
LONGER = (2_000, 20_000)
"""Periods for which the plain run is continued. The jump is verified for multipliers up to 0.9999
(`solvers.skip_rule.STABLE`), of which 2,000 periods leave 0.82: the second is for those."""


@dataclass(frozen=True)
class Difference:
    """A point at which the run with the rules and the plain run differ.

    Attributes
    ----------
    omega, amplitude : float
    state : list of 2n floats
        State from which both started.
    skip_rule : str
        Rule that was used.
    what : list of str
        Results that differ.
    plain, skipped : str
        Short forms of both results.
    agrees_after : int
        Additional periods after which the plain run reached the same result; 0: it did not.
    closer : float
        Factor by which the plain run's distance from that result fell in these periods.
    """

    omega: float
    amplitude: float
    state: list[float]
    skip_rule: str
    what: list[str]
    plain: str
    skipped: str
    agrees_after: int
    closer: float


def random_path(index: int, seed: int) -> tuple[float, np.ndarray]:
    """Draw the frequency and the amplitudes of a path; each index has its own random stream."""
    rng = np.random.default_rng((seed, index))
    omega = float(rng.uniform(*OMEGA))
    length = (PATH - 1) * STEP
    amplitudes = rng.uniform(STEP, AMPLITUDE - length) + STEP * np.arange(PATH)
    return omega, amplitudes if rng.random() < 0.5 else amplitudes[::-1]


def distances(plain: dict, skipped: dict) -> dict[str, float]:
    """Measure how far apart the results of two runs are.

    Modal norms are means over the window. They are compared where the plain window holds whole
    orbits: otherwise the mean over the incomplete one differs.

    Parameters
    ----------
    plain, skipped : dict
        Results of `FrameRuns.follow`, one run each.

    Returns
    -------
    dict
        Relative for drift, as sets for points, as arrays for the rest; NaN where a run failed.
    """
    whole = len(plain["poincare"]) % max(int(skipped["orbit_period"]), 1) == 0
    return {
        "drift": _apart(plain["drift"], skipped["drift"]) / max(1.0, abs(plain["drift"])),
        "modal_norm": _apart(plain["modal_norm"], skipped["modal_norm"]) if whole else 0.0,
        "poincare": set_distance(_points(plain), _points(skipped)),
        "final_state": _apart(plain["final_state"], skipped["final_state"]),
    }


def _apart(left, right) -> float:
    """Return the largest difference; 0 where both are NaN (always in contact: no modal norm)."""
    left, right = np.atleast_1d(left), np.atleast_1d(right)
    apart = np.abs(left - right)
    return float(np.where(np.isnan(left) & np.isnan(right), 0.0, apart).max())


def differences(plain: dict, skipped: dict, far: dict[str, float]) -> list[str]:
    """Return the names of results in which two runs differ, given their `distances`."""
    if plain["outcome"] != skipped["outcome"]:
        return ["outcome"]
    found = [name for name in ("orbit_period", "contact") if plain[name] != skipped[name]]
    return found + [
        name
        for name, distance in far.items()
        if not distance <= (MODAL_NORM if name == "modal_norm" else AGREE)
    ]


def _points(run: dict) -> np.ndarray:
    return run["poincare"][: run["n_points"]]


def set_distance(left: np.ndarray, right: np.ndarray) -> float:
    """Return the Hausdorff distance (maximum norm) of two sets of points, (k, 2n) and (m, 2n).

    It is 0 for two empty sets, infinite for one.
    """
    if not len(left) or not len(right):
        return 0.0 if len(left) == len(right) else math.inf
    between = np.abs(left[:, None, :] - right[None, :, :]).max(axis=2)
    return float(max(between.min(axis=0).max(), between.min(axis=1).max()))


class Comparison:
    """Both procedures for one frame.

    Parameters
    ----------
    structure : Structure
    omega : float
    settings : SweepSettings
        Settings with the rules to compare.
    """

    def __init__(self, structure: Structure, omega: float, settings: SweepSettings):
        self._given = structure, omega
        self._settings = replace(settings, skip=frozenset())
        self._plain = FrameRuns(structure, omega, self._settings)
        self._skipping = FrameRuns(structure, omega, settings)
        self.seconds = [0.0, 0.0]
        """CPU seconds of the plain runs, and of those with the rules."""
        self.largest = dict.fromkeys(("drift", "modal_norm", "poincare", "final_state"), 0.0)
        """Largest distances of results that agree, in the units of `AGREE`."""

    def compare(self, amplitude: float, state: np.ndarray) -> tuple[dict, dict, Difference | None]:
        """Compute both runs from a state.

        Returns
        -------
        plain, skipped : dict
            Results of the two runs.
        difference : Difference or None
        """
        begun = time.process_time()
        plain = _run(self._plain, amplitude, state)
        between = time.process_time()
        skipped = _run(self._skipping, amplitude, state)
        self.seconds[0] += between - begun
        self.seconds[1] += time.process_time() - between
        far = distances(plain, skipped)
        what = differences(plain, skipped, far)
        if not what:
            self.largest = {name: max(self.largest[name], far[name]) for name in self.largest}
            return plain, skipped, None
        agrees_after, closer = self._go_on(amplitude, plain, skipped)
        difference = Difference(
            self._given[1],
            amplitude,
            np.asarray(state).tolist(),
            SkipRule(skipped["skip_rule"]).name,
            what,
            describe(plain),
            describe(skipped),
            agrees_after,
            closer,
        )
        return plain, skipped, difference

    def _go_on(self, amplitude, plain, skipped) -> tuple[int, float]:
        """Continue the plain run until it agrees; return (periods, fall of the distance)."""
        if SkipRule(skipped["skip_rule"]) is SkipRule.NONE:
            return 0, 1.0
        first = last = set_distance(_points(plain), _points(skipped))
        for periods in LONGER:
            # the window must end at the same point of the orbit as that of the plain run
            period = max(int(skipped["orbit_period"]), 1)
            transient = periods + (-periods - self._settings.sampling_cycles) % period
            settings = replace(self._settings, transient_cycles=transient)
            longer = _run(FrameRuns(*self._given, settings), amplitude, plain["final_state"])
            last = set_distance(_points(longer), _points(skipped))
            if not differences(longer, skipped, distances(longer, skipped)):
                return periods, first / max(last, 1e-16)
        return 0, first / max(last, 1e-16)


def _run(frame: FrameRuns, amplitude: float, state: np.ndarray) -> dict:
    return {name: values[0] for name, values in frame.follow([amplitude], state).items()}


def describe(run: dict) -> str:
    """Format a result briefly, e.g. ``P2 contact 110 drift 1.234``."""
    if run["outcome"] != Outcome.COMPLETE:
        return Outcome(run["outcome"]).name
    return f"P{run['orbit_period']} contact {int(run['contact']):b} drift {run['drift']:.9g}"


def _compare_path(
    index: int, count: int, seed: int, structure: Structure, settings: SweepSettings
) -> dict:
    """Compare the first `count` points of a path."""
    omega, amplitudes = random_path(index, seed)
    frame = Comparison(structure, omega, settings)
    state = np.zeros(2 * structure.n_floors)
    rows, found = [], []
    for amplitude in amplitudes[:count]:
        plain, skipped, difference = frame.compare(float(amplitude), state)
        rows.append((int(skipped["cycles"]), int(skipped["skip_rule"])))
        if difference is not None:
            found.append(difference)
        state = plain["final_state"]
    return {"rows": rows, "differences": found, "seconds": frame.seconds, "far": frame.largest}


def compare(
    n_points: int,
    seed: int = 0,
    processes: int = 1,
    structure: Structure | None = None,
    settings: SweepSettings | None = None,
    say: Callable = lambda text: None,
) -> dict:
    """Compare the rules with the window procedure on random points.

    Parameters
    ----------
    n_points : int
    seed : int
        The same points for the same seed, on any number of processes.
    processes : int
    structure : Structure, optional
        Default: that of the paper's Figure 6 (beta = 1000), damping as printed.
    settings : SweepSettings, optional
        Default: those of a job that names none, all rules.

    Returns
    -------
    dict
        Plain types: counts, periods per point, how often each rule was used, and every
        difference.
    """
    given = structure or Structure(), settings or SweepSettings()
    paths = [
        (k, min(PATH, n_points - k * PATH), seed, *given) for k in range(math.ceil(n_points / PATH))
    ]
    cycles: list[list[int]] = []
    skip_rules: Counter[str] = Counter()
    found: list[Difference] = []
    far: dict[str, float] = {}
    seconds = np.zeros(2)
    for done, path in enumerate(_all_paths(paths, processes), 1):
        cycles.append([row[0] for row in path["rows"]])
        skip_rules.update(SkipRule(row[1]).name for row in path["rows"])
        found += path["differences"]
        seconds += path["seconds"]
        far = {name: max(value, far.get(name, 0.0)) for name, value in path["far"].items()}
        if done % 100 == 0:
            say(f"skips: {done * PATH} of {n_points} points, {len(found)} differences")
    followed = [count for path in cycles for count in path[1:]]
    plain = given[1].transient_cycles + given[1].sampling_cycles
    return {
        "points": n_points,
        "seed": seed,
        "periods_plain": plain,
        "periods_per_point": float(np.mean([count for path in cycles for count in path])),
        "periods_per_followed_point": float(np.mean(followed)) if followed else None,
        "cpu_seconds_plain": float(seconds[0]),
        "cpu_seconds_with_rules": float(seconds[1]),
        "skip_rules": {kind.name: skip_rules[kind.name] for kind in SkipRule},
        "largest_agreeing": far,
        "undecided": sum(difference.agrees_after > 0 for difference in found),
        "unexplained": sum(difference.agrees_after == 0 for difference in found),
        "differences": [asdict(difference) for difference in found],
    }


def _warm_up(settings: SweepSettings) -> None:
    load(needed(settings))


def _all_paths(paths: list[tuple], processes: int) -> Iterator[dict]:
    if processes == 1:
        _warm_up(paths[0][-1])
        yield from map(_compare_path, *zip(*paths, strict=True))
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, _warm_up, (paths[0][-1],)) as pool:
        yield from pool.map(_compare_path, *zip(*paths, strict=True), chunksize=4)


def as_text(result: dict) -> str:
    """Format a result of `compare` as a report, one line for each difference."""
    n = result["points"]
    share = {name: f"{name} {count}" for name, count in result["skip_rules"].items()}
    followed = result["periods_per_followed_point"]
    lines = [
        f"rules that spare periods against the window procedure, {n} random points of Figure 6 "
        f"(seed {result['seed']}):",
        f"  periods integrated a point: {result['periods_per_point']:.4g} of "
        f"{result['periods_plain']}"
        + ("" if followed is None else f"; {followed:.4g} where the path is followed"),
        f"  CPU time: plain {result['cpu_seconds_plain']:.3g} s, with rules "
        f"{result['cpu_seconds_with_rules']:.3g} s",
        f"  points by rule: {', '.join(share.values())}",
        "  farthest apart where they agree: "
        + ", ".join(f"{name} {value:.1e}" for name, value in result["largest_agreeing"].items()),
        f"  differences: {len(result['differences'])} ({len(result['differences']) / n:.2%}), of "
        f"which the plain run was undecided: {result['undecided']}, unexplained: "
        f"{result['unexplained']}",
    ]
    for difference in result["differences"]:
        after = difference["agrees_after"]
        cause = f"plain agrees after {after} more" if after else "UNEXPLAINED"
        lines.append(
            f"    Omega {difference['omega']!r} A {difference['amplitude']!r} "
            f"{difference['skip_rule']}: {' '.join(difference['what'])}: plain "
            f"{difference['plain']}, with rules {difference['skipped']}; {cause}"
        )
        if not after:
            lines.append(
                f"      from {difference['state']}, distance fell by {difference['closer']:.3g}"
            )
    return "\n".join(lines)
