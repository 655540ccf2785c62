"""Test numerical stability: the solvers at, and beyond, the limits of any reasonable use.

Every case passes if the run ends with COMPLETE and finite, consistent results, or with a named
outcome (non-finite, step limit, solver failed). It fails on a NaN reported as complete, on an error
above its limit, on a missed step limit, on an exception, and if it takes longer than
`Case.seconds`.
"""

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from reference import reference_points
from scipy.special import spence

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import flow_map
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import SOLVERS, make_solver
from stability.cases import Case, cases, made
from stability.random_runs import (
    any_run,
    any_structure,
    random_run,
    uniform_building,
)
from stability.watchdog import Lost, each

CAP = 3000
"""Steps a forcing period may take in the random runs; the solver's own cap is far larger."""
PER_STRUCTURE = 20
"""Random runs that share a structure and a frequency."""
HUGE_STATE = 1e4
"""Size of a state from which on rounding may hide the stop and a solver may give up."""
WORST_ERROR = {"flow": 1e-7, "bdf": 1e-2}
"""Error of one period (over max(1, |z|)) from which on a case counts as wrong."""
ENERGY_DRIFT = 1e-8
"""Relative change of the energy allowed over all periods of an energy case."""
DRAWN = {"random": (uniform_building, random_run), "random, any": (any_structure, any_run)}
"""Of random runs, by kind: draws of a structure with a frequency, of an amplitude and a state."""


@dataclass(frozen=True)
class Answer:
    """Answer to a case: outcomes by name, a remark, and whether it passed."""

    outcome: str
    remark: str
    passed: bool


def energy(structure: Structure, z: np.ndarray) -> float:
    """Compute the energy of an undamped structure and its stops.

    A contact at the distance x past its stop pushes with kappa S(rho x) x, which has the potential
    kappa (max(x, 0)^2 / 2 - P(x)), with P(x) = int_-inf^x |s| / (1 + exp(rho |s|)) ds by the
    dilogarithm.
    """
    n = structure.n_floors
    u, v = z[:n], z[n:]
    x = structure.directions @ u - np.array([contact.gap for contact in structure.contacts])
    potential = 0.5 * np.maximum(x, 0.0) ** 2
    rho = structure.sharpness
    if rho == 0.0:
        potential = 0.25 * x**2
    elif rho < math.inf:
        y = rho * np.abs(x)
        tail = y * np.log1p(np.exp(-y)) - spence(1.0 + np.exp(-y))
        potential = potential - np.where(x < 0, tail, math.pi**2 / 6 - tail) / rho**2
    contact = structure.contact_stiffness @ potential
    moving = v @ structure.mass_matrix @ v
    return float(0.5 * (moving + u @ structure.stiffness_matrix @ u) + contact)


def answer(case: Case | None) -> Answer | None:
    """Run one case; None compiles the kernels that all of them need."""
    if case is None:
        make_solver("flow", Structure(1), 1.0, 1e-9).observe(np.array([0.9, 1.0]), 0.1, 1, True)
        reference_points(Structure(1), 0.1, 1.0, np.array([0.9, 1.0]), 1)
        return None
    if case.kind in DRAWN:
        return _random_runs(case)
    structure = made(case.structure)
    state = np.array(case.state) if case.state else np.zeros(2 * structure.n_floors)
    solver = make_solver(case.solver, structure, case.omega, SOLVERS[case.solver].rtol)
    seen = solver.observe(state, case.amplitude, case.n_periods, modal_norm=True)
    problem = _inconsistent(structure, seen, case.n_periods)
    if problem:
        return Answer(seen.outcome.name, problem, False)
    if seen.outcome is not Outcome.COMPLETE:
        remark = f"in period {len(seen.points) + 1}"
        return Answer(seen.outcome.name, remark, not case.complete)
    check = {"reference": _against_reference, "energy": _energy_kept, "linear": _still_linear}
    if case.kind in check:
        remark, passed = check[case.kind](case, structure, state, seen)
        return Answer(seen.outcome.name, remark, passed)
    size = float(np.abs(seen.points / structure.state_units).max(initial=0.0))
    return Answer(seen.outcome.name, f"max |z| {size:.3g}, contact {seen.contact:b}", True)


def _inconsistent(structure, seen, n_periods):
    """Describe an inconsistency of a run; '' if there is none."""
    if not np.all(np.isfinite(seen.points)):
        return "points that are not finite are handed out"
    if seen.outcome is not Outcome.COMPLETE:
        return "" if len(seen.points) < n_periods else "failed, but all periods are there"
    if len(seen.points) != n_periods:
        return f"complete, but {len(seen.points)} of {n_periods} periods are there"
    if not math.isfinite(seen.peak_drift) or seen.peak_drift < 0:
        return f"drift is {seen.peak_drift}"
    if seen.contact >> len(structure.contact_labels):
        return f"contact bits {seen.contact:b} beyond the last contact"
    norms = seen.modal_norm
    if np.any(norms < 0) or np.any(norms > 1 + 1e-9) or len(np.unique(np.isnan(norms))) > 1:
        return f"modal norms {norms.tolist()}"
    return ""


def _against_reference(case, structure, state, seen):
    exact = reference_points(structure, case.amplitude, case.omega, state, 1)[0]
    if not np.all(np.isfinite(exact)):
        return "the reference gave up", True
    units = structure.state_units
    size = max(1.0, float(np.abs(exact / units).max()))
    error = float(np.abs((seen.points[0] - exact) / units).max()) / size
    return f"error of one period {error:.1e}", error <= WORST_ERROR[case.solver]


def _energy_kept(case, structure, state, seen):
    levels = np.array([energy(structure, z) for z in seen.points]) / energy(structure, state) - 1
    end, most = float(levels[-1]), float(np.abs(levels).max())
    touched = "" if seen.contact else ", but no contact"
    remark = f"relative drift {end:+.1e} at the end, {most:.1e} at most{touched}"
    return remark, most <= ENERGY_DRIFT and not touched


def _still_linear(case, structure, state, seen):
    away = float(np.abs(seen.points - state).max())
    remark = f"moved {away:.1e} from the closed form, contact {seen.contact:b}"
    return remark, away <= 1e-10 and seen.contact == 0


def steps_taken(solver: flow_map.FlowMap) -> int:
    """Count the linear steps, and the steps in layers, of all periods not observed so far."""
    counts = solver.counts
    return int(counts[0] + counts[2])


def _random_runs(case: Case) -> Answer:
    """Run a batch of one-period runs under a cap of steps and count their outcomes."""
    rng = np.random.default_rng(case.seed)
    draw_structure, draw_run = DRAWN[case.kind]
    found: Counter[str] = Counter()
    wrong: list[str] = []
    own_cap, flow_map.MAX_STEPS = flow_map.MAX_STEPS, CAP
    try:
        for k in range(case.n_periods):
            if k % PER_STRUCTURE == 0:
                structure, omega = draw_structure(rng)
                solver: Any = make_solver("flow", structure, omega, SOLVERS["flow"].rtol)
                taken = steps_taken(solver)
            amplitude, z = draw_run(rng, structure)
            problem = ""
            if k % 4 == 0:
                seen = solver.observe(z, amplitude, 1, modal_norm=k % 8 == 0)
                outcome, problem = seen.outcome, _inconsistent(structure, seen, 1)
            else:
                points, outcome = solver.points(z, amplitude, 1)
                if len(points) != (outcome is Outcome.COMPLETE) or not np.isfinite(points).all():
                    problem = f"{outcome.name} with points {points.tolist()}"
            found[outcome.name] += 1
            now = steps_taken(solver)
            size = np.abs(z / structure.state_units).max()
            if outcome is Outcome.SOLVER_FAILED and size < HUGE_STATE:
                problem = "the solver gave up a state of ordinary size"
            if now - taken > CAP + 1:
                problem = f"{now - taken} steps under a cap of {CAP}"
            taken = now
            if problem:
                where = f"{structure}, omega {omega!r}, A {amplitude!r}, z {z.tolist()}"
                wrong.append(f"run {k}: {problem} ({where})")
    finally:
        flow_map.MAX_STEPS = own_cap
    counts = ", ".join(f"{name} {count}" for name, count in found.most_common())
    return Answer(counts, wrong[0] if wrong else "", not wrong)


def stress(quick: bool, seed: int, say: Callable = lambda text: None) -> list[dict]:
    """Run all cases, in a process that is killed if it hangs.

    Returns
    -------
    list of dict
        The fields of `Case` and `Answer`, and ``took`` (s), for each case.
    """
    rows = []
    begun = time.perf_counter()
    for case, result in each(answer, cases(quick, seed), lambda case: case.seconds):
        now = time.perf_counter()
        got = Answer("LOST", result.reason, False) if isinstance(result, Lost) else result
        rows.append({**asdict(case), **asdict(got), "took": now - begun})
        begun = now
        say(row_text(rows[-1]))
    return rows


def merged(rows: list[dict]) -> list[dict]:
    """Merge all passed batches of random runs of a kind into one row."""
    for kind in DRAWN:
        random = [row for row in rows if row["kind"] == kind and row["passed"]]
        if len(random) < 2:
            continue
        total: Counter = Counter()
        for row in random:
            for part in row["outcome"].split(", "):
                name, count = part.split(" ")
                total[name] += int(count)
        runs = sum(row["n_periods"] for row in random)
        one = dict(
            random[0],
            asked=f"{runs} runs of one period",
            outcome=", ".join(f"{name} {count}" for name, count in total.most_common()),
            took=sum(row["took"] for row in random),
        )
        rows = [row for row in rows if row not in random] + [one]
    return rows


def row_text(row: dict) -> str:
    """Format one case on one line."""
    verdict = "pass" if row["passed"] else "FAIL"
    head = f"{verdict}  {row['group']:14s} {row['asked']:48s}"
    return f"{head} {row['took']:7.2f} s  {row['outcome']}  {row['remark']}".rstrip()


def as_text(rows: list[dict]) -> str:
    """Format all cases as a table."""
    failed = sum(not row["passed"] for row in rows)
    lines = [row_text(row) for row in merged(rows)]
    seconds = sum(row["took"] for row in rows)
    lines.append(f"{len(rows)} cases, {failed} failed, {seconds:.0f} s")
    return "\n".join(lines)


def as_json(rows: list[dict]) -> dict:
    """Convert to plain types; infinite numbers become text."""

    def plain(value):
        if isinstance(value, float) and not math.isfinite(value):
            return str(value)
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [plain(item) for item in value]
        return value

    return {"cases": plain(rows), "failed": sum(not row["passed"] for row in rows)}
