"""Decided motions against labels of another route: motions.py draw, label and table.

Runs of Figures 3 and 6, both dampings, are decided; so many of each sort (`WANTED`) are labelled
again, from beside where they ended, by means that share no code with the decision: the Taylor
reference (`reference`) integrates the motion and, beside it, one that starts
`BESIDE` away and is drawn back to that distance after each period (Benettin's exponent).

periodic p
    The points return after p periods, p <= `LONGEST`, to `CLOSED`; or after the transient they
    come nearer to that from one half of a window to the other (`SLOW`), and the orbit that Newton's
    method finds there, with the reference's own monodromy matrix, attracts.
chaotic
    The mean logarithm of the growth a period exceeds `SURE` of its standard errors over `BATCHES`
    batches, and `LEAST`.
quasi-periodic
    Neither; the mean is below `LEAST`, or within its standard error of 0; and the spectrum of the
    points consists of lines: between them it is below `FLOOR` of its sum.

Windows are added, up to `WINDOWS`, until one of these holds.

    motions.py draw CASES.json [--torus FIGURE OMEGA A]       a place near which there are tori
    motions.py decide CASES.json                              again, as the program does now
    motions.py label CASES.json LABELS.json [--part K N]      every Nth from the Kth on
    motions.py table CASES.json LABELS.json ...
"""

import argparse
import json
import math
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from reference import reference_monodromy, reference_points
from scipy.signal.windows import blackmanharris
from tools import PAPER

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.dynamics.classify_motion import classify_motion
from hpcsweep.job import load_job
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import FrameRuns

ASIDE = 1e-5
"""From where a decided motion ended, in each component: an orbit has to be approached anew."""
CYCLES = 50_000
PART, PARTS = 100, 4
"""Periods after which a transient is looked at, and how often."""
WINDOW, WINDOWS = 250, 20
LONGEST = 120
CLOSED, ONE_POINT = 1e-10, 1e-7
SLOW, NEAR = 0.9, 1e-2
BESIDE = 1e-7
BATCHES = 12
SURE, LEAST = 3.0, 1e-3
FLOOR = 1e-6
STEPS = 6
"""Of Newton's method."""
TURNS, BY_TORI = 120, 0.03
"""Paths of 30 amplitudes that are followed at most to find the sample; every other one, once there
is one, within so much of the amplitude of a torus."""
NEAR_RESONANCE = 0.02
"""Distance after p <= 64 periods, of the torus's extent, by which a torus is near resonance."""
FIGURES = ("figure3.toml", "figure3-described.toml", "figure6.toml", "figure6-described.toml")
WANTED = {
    **{f"P{p}": 6 for p in range(1, 9)},
    "P9 to P16": 8,
    "P17 to P40": 24,
    "longer": 6,
    "multiplier from 0.99": 24,
    "chaos": 36,
    "weak chaos": 30,
    "torus": 28,
    "torus near resonance": 20,
}
WEAK = 0.05
"""Exponent a forcing period below which chaos is weak."""


@dataclass(frozen=True)
class Case:
    """A decided motion."""

    sort: str
    kind: str
    period: int
    multiplier: float
    growth: float
    damping: list[float]
    omega: float
    amplitude: float
    state: list[float]

    @property
    def point(self) -> tuple:
        """Structure, A and Omega, as the reference takes them."""
        ratio = self.damping if len(self.damping) > 1 else self.damping[0]
        return Structure(damping_ratio=ratio), self.amplitude, self.omega


@dataclass(frozen=True)
class Label:
    """What the other route says."""

    kind: str
    period: int = 0
    multiplier: float = math.nan
    growth: float = math.nan
    error: float = math.nan
    floor: float = math.nan
    periods: int = 0


def halves(points: np.ndarray, period: int) -> tuple[float, float]:
    """Largest distance of points a period apart, in either half of a window."""
    apart = np.abs(points[period:] - points[:-period]).max(axis=1)
    half = len(points) // 2
    return float(apart[:half].max()), float(apart[half:].max())


def closed(points: np.ndarray) -> int:
    """Smallest period after which the points return to `CLOSED`; 0 if there is none."""
    for period in range(1, min(LONGEST, len(points) // 2 - 1) + 1):
        if halves(points, period)[1] <= CLOSED:
            # points a divisor apart may still be on their way to each other
            shorter = [d for d in range(1, period) if period % d == 0]
            near = (d for d in shorter if halves(points, d)[1] < SLOW * halves(points, d)[0])
            return next(near, period)
    return 0


def orbit(case: Case, z: np.ndarray, period: int) -> tuple[int, float]:
    """Smallest period, and modulus of the largest multiplier, of the orbit near z; 0 if none."""
    args = case.point
    for _ in range(STEPS):
        image, matrix = reference_monodromy(*args, z, period)
        step = np.linalg.solve(matrix - np.eye(z.size), image - z)
        z = z - step
        if np.abs(step).max() <= CLOSED:
            own = float(np.abs(np.linalg.eigvals(matrix)).max())
            apart = np.abs(reference_points(*args, z, period) - z).max(axis=1)
            smallest = 1 + int(np.argmax(apart <= ONE_POINT))
            return smallest, own ** (smallest / period)
    return 0, math.nan


def floor_of(points: np.ndarray) -> float:
    """Median of the points' power spectrum, times the number of lines, over its sum."""
    window = blackmanharris(len(points))[:, None]
    power = (np.abs(np.fft.rfft((points - points.mean(axis=0)) * window, axis=0)) ** 2).sum(axis=1)
    return float(np.median(power) * len(power) / power.sum())


def beside(case: Case) -> np.ndarray:
    """Return the state from which both routes start."""
    return np.array(case.state) + ASIDE * np.cos(np.arange(len(case.state)))


def labelled(case: Case) -> Label:
    """Label one motion."""
    args, z = case.point, beside(case)
    for part in range(PARTS):
        points = reference_points(*args, z, PART)
        z, done = points[-1], (part + 1) * PART
        period = closed(points)
        if period:
            return Label("periodic", period, orbit(case, z, period)[1], periods=done)
    points, logarithms = np.empty((0, z.size)), np.empty(0)
    offset = np.full(z.size, BESIDE / math.sqrt(z.size))
    for window in range(WINDOWS):
        seen, grown = np.empty((WINDOW, z.size)), np.empty(WINDOW)
        for k in range(WINDOW):
            other = reference_points(*args, z + offset, 1)[0]
            z = seen[k] = reference_points(*args, z, 1)[0]
            length = max(float(np.linalg.norm(other - z)), 1e-300)
            grown[k] = math.log(length / BESIDE)
            offset = (other - z) * (BESIDE / length)
        points, logarithms = np.concatenate((points, seen)), np.concatenate((logarithms, grown))
        done = PART * PARTS + (window + 1) * WINDOW
        period = closed(seen)
        if period:
            return Label("periodic", period, orbit(case, z, period)[1], periods=done)
        kept = logarithms[WINDOW // 10 :]
        batches = kept[: len(kept) // BATCHES * BATCHES].reshape(BATCHES, -1).mean(axis=1)
        mean, error = float(batches.mean()), float(batches.std(ddof=1) / math.sqrt(BATCHES))
        reported = {"growth": mean, "error": error, "floor": floor_of(points), "periods": done}
        if window >= 1 and mean > max(SURE * error, LEAST):
            return Label("chaotic", **reported)
        returns = [halves(points, period) for period in range(1, LONGEST + 1)]
        period = 1 + int(np.argmin([last for _, last in returns]))
        first, last = returns[period - 1]
        if last <= NEAR and last < SLOW * first:
            smallest, own = orbit(case, z, period)
            if own < 1:
                return Label("periodic", smallest, own, **reported)
        if window >= 1 and abs(mean) <= max(error, LEAST) and reported["floor"] <= FLOOR:
            return Label("quasi-periodic", **reported)
    return Label("not told", **reported)


def sort_of(kind: MotionClass, period: int, factor: float, growth: float, points) -> str:
    """Name the sort of `WANTED` that a decided motion is of, or nothing."""
    if kind in (MotionClass.PERIODIC, MotionClass.LONG_PERIOD):
        if factor >= 0.99:
            return "multiplier from 0.99"
        if period <= 16:
            return f"P{period}" if period <= 8 else "P9 to P16"
        return "P17 to P40" if period <= 40 else "longer"
    if kind is MotionClass.CHAOTIC:
        return "weak chaos" if growth < WEAK else "chaos"
    if kind is MotionClass.QUASI_PERIODIC:
        extent = np.abs(points - points.mean(axis=0)).max()
        away = min(np.abs(points[p:] - points[:-p]).max() for p in range(1, 65))
        return "torus near resonance" if away <= NEAR_RESONANCE * extent else "torus"
    return ""


def drawn(scale: float, seed: int, known=(), turns: int = TURNS) -> list[Case]:
    """Draw decided runs, as many of each sort as are wanted, if they are found.

    `known` are places of tori: (figure, frequency, amplitude) each.
    """
    random = np.random.default_rng(seed)
    left = {sort: max(1, round(scale * number)) for sort, number in WANTED.items()}
    cases: list[Case] = []
    tori: list[tuple[str, float, float]] = list(known)
    for turn in range(turns):
        if not any(left.values()):
            break
        again = tori[int(random.integers(len(tori)))] if tori and turn % 2 else None
        figure = again[0] if again else FIGURES[turn // 2 % len(FIGURES)]
        study = load_job(PAPER / figure).study
        settings = replace(
            study.settings,
            metrics=frozenset({"poincare", "contact", "lyapunov"}),
            skip=frozenset({"linear", "converged", "newton"}),
            classify_cycles=CYCLES,
            max_points=None,
        )
        omega = again[1] if again else float(random.choice(study.omega))
        span = float(study.amplitude[0]), float(study.amplitude[-1])
        if again:
            span = again[2] * (1 - BY_TORI), again[2] * (1 + BY_TORI)
        amplitudes = np.sort(random.uniform(*span, 30))
        runs = FrameRuns(study.structure, omega, settings).follow(amplitudes, study.initial_state)
        for k in random.permutation(len(amplitudes)):
            kind, period = MotionClass(int(runs["motion"][k])), int(runs["orbit_period"][k])
            points = runs["poincare"][k][: int(runs["n_points"][k])]
            if kind is MotionClass.LONG_PERIOD:
                # longer than the job looks for: of the window's own points
                apart = [np.abs(points[p:] - points[:-p]).max() for p in range(17, len(points))]
                period = 17 + int(np.argmax(np.array(apart) <= settings.period_tolerance))
            growth = float(runs["lyapunov"][k]) * 2 * math.pi / omega
            factor = math.exp(growth * period) if period else math.nan
            sort = sort_of(kind, period, factor, growth, points)
            if "torus" in sort:
                tori.append((figure, omega, float(amplitudes[k])))
            if left.get(sort, 0) > 0:
                left[sort] -= 1
                state = runs["final_state"][k]
                if not period or runs["classification_cycles"][k]:
                    state = points[-1]
                cases.append(
                    Case(
                        sort,
                        CLASS_NAMES[kind].replace("long period", "periodic"),
                        period,
                        factor,
                        growth,
                        np.ravel(study.structure.damping_ratio).tolist(),
                        omega,
                        float(amplitudes[k]),
                        state.tolist(),
                    )
                )
        if turn % 10 == 9:
            print(f"{turn + 1} paths, {len(cases)} motions", flush=True)
    print("not found:", {sort: number for sort, number in left.items() if number}, flush=True)
    return cases


def decided(case: Case) -> Case:
    """Decide a motion from where it is labelled, too: its class, period, multiplier, exponent."""
    structure, amplitude, omega = case.point
    solver = make_solver("flow", structure, omega, 1e-9)
    motion = classify_motion(solver, beside(case), amplitude, SweepSettings(), CYCLES)
    growth = motion.interval.mean * 2 * math.pi / omega
    period, points = motion.period, motion.points / structure.state_units
    sort = sort_of(motion.kind, period, motion.multiplier, growth, points)
    return replace(
        case,
        sort=sort or "undecided",
        kind=CLASS_NAMES[motion.kind],
        period=period,
        multiplier=motion.multiplier,
        growth=growth,
    )


def reported(cases: list[Case], labels: list[Label]) -> None:
    """Print the table, what differs, and how far multipliers and exponents are apart."""
    names = ("periodic", "quasi-periodic", "chaotic", "not told")
    table = Counter((case.sort, label.kind) for case, label in zip(cases, labels, strict=True))
    right = Counter(
        case.sort
        for case, label in zip(cases, labels, strict=True)
        if case.kind == label.kind == "periodic" and case.period == label.period
    )
    print("| decided | " + " | ".join(names) + " | period right |\n|---|" + "---:|" * 5)
    for sort in (*WANTED, "undecided"):
        counts = [str(table[sort, name] or "") for name in names]
        periodic = table[sort, "periodic"]
        print(f"| {sort} | {' | '.join(counts)} | {right[sort] if periodic else ''} |")
    orbits = [
        (abs(case.multiplier - label.multiplier), case)
        for case, label in zip(cases, labels, strict=True)
        if case.period and case.period == label.period and label.multiplier == label.multiplier
    ]
    if orbits:
        far = sorted(distance for distance, _ in orbits)
        print(f"multipliers: {len(far)}, apart {far[len(far) // 2]:.1e} (median), {far[-1]:.1e}")
    for name in names[1:]:
        own = [label for label in labels if label.kind == name]
        if own:
            floors, growths = [one.floor for one in own], [one.growth for one in own]
            print(
                f"{name}: floor {min(floors):.1e} to {max(floors):.1e}, "
                f"growth a period {min(growths):.2g} to {max(growths):.2g}"
            )


def read(path: Path, kind: type) -> list:
    """Read cases or labels; None where there is none."""
    return [one and kind(**one) for one in json.loads(path.read_text())]


def label_part(cases: list[Case], path: Path, part: int, parts: int) -> None:
    """Label a part of the cases, in random order; the file is written after each."""
    labels: list[Label | None] = read(path, Label) if path.exists() else [None] * len(cases)
    order = np.random.default_rng(0).permutation(len(cases)).tolist()
    for number in order[part::parts]:
        if labels[number]:
            continue
        labels[number] = labelled(cases[number])
        path.write_text(json.dumps([one and vars(one) for one in labels]))
        print(number, cases[number].sort, labels[number], flush=True)


def main() -> None:
    """Draw, label, or print the table of both routes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("draw", "decide", "label", "table"))
    parser.add_argument("cases", type=Path)
    parser.add_argument("labels", type=Path, nargs="*")
    parser.add_argument("--scale", type=float, default=1.0, help="of the numbers wanted")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument(
        "--torus", nargs=3, action="append", default=[], metavar=("FIGURE", "OMEGA", "A")
    )
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1))
    options = parser.parse_args()
    if options.what == "draw":
        known = [(name, float(omega), float(a)) for name, omega, a in options.torus]
        found = drawn(options.scale, options.seed, known, options.turns)
        options.cases.write_text(json.dumps([vars(decided(case)) for case in found]))
        return
    cases = read(options.cases, Case)
    if options.what == "decide":
        options.cases.write_text(json.dumps([vars(decided(case)) for case in cases]))
        return
    if options.what == "label":
        label_part(cases, options.labels[0], *options.part)
        return
    labels: list[Label | None] = [None] * len(cases)
    for path in options.labels:
        labels = [old or new for old, new in zip(labels, read(path, Label), strict=True)]
    both = [(case, label) for case, label in zip(cases, labels, strict=True) if label]
    reported(*map(list, zip(*both, strict=True)))
    for case, label in both:
        if (case.kind, case.period) != (label.kind, label.period):
            print(f"other: {case}\n    {label}")


if __name__ == "__main__":
    main()
