"""Run time against error: the solvers of this package and their peers on the same periods.

Every figure is paired: all methods take the same periods from the same states on the same machine
in one run, in turn, and the turns are repeated; the median and the spread (half the range between
quartiles) are told. Errors are against `hpcsweep.reference`, which shares no code with any of
them.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

import numpy as np

from hpcsweep.equations import jacobian, right_hand_side
from hpcsweep.job import Job
from hpcsweep.reference import reference_points
from hpcsweep.solver import make_solver
from hpcsweep.structure import Structure
from hpcsweep.sweep import sweep_block

FIGURE_3 = """
[sweep]
omega = 0.445
amplitude = {from = 0.0048, to = 0.25, step = 0.001}
"""
"""The sweep of the paper's Figure 3, damping as printed."""
REPEATS = 5
SCIPY = (("Radau", 1e-6), ("LSODA", 1e-6), ("LSODA", 1e-9), ("DOP853", 1e-6), ("DOP853", 1e-9))
LONGEST_STEP = 0.02
"""Step limit of the explicit and adaptive peers, or they would step over short contacts."""


@dataclass(frozen=True)
class Regime:
    """A stretch of motion on which methods are compared.

    Attributes
    ----------
    name : str
    structure : Structure
    omega, amplitude : float
    settle, n_periods : int
        Periods from rest to the start, and periods measured (few where the motion is chaotic).
    """

    name: str
    structure: Structure
    omega: float
    amplitude: float
    settle: int
    n_periods: int


@dataclass(frozen=True)
class Row:
    """One method on one regime; times in microseconds per forcing period."""

    regime: str
    method: str
    rtol: float
    microseconds: float
    spread: float
    error: float


def regimes() -> list[Regime]:
    """List the regimes of the comparison."""
    printed = Structure()
    described = Structure(damping_ratio=tuple(0.05 / (2 * printed.frequencies**2)))
    soft = Structure(stiffness_ratio=100.0)
    hard = Structure(stiffness_ratio=1e5)
    return [
        Regime("no contact", printed, 0.445, 0.012, 100, 5),
        Regime("P1 C3", printed, 0.445, 0.06, 100, 5),
        Regime("P2 C23", printed, 0.445, 0.0987, 100, 5),
        Regime("P8 C23", described, 0.445, 0.07, 300, 8),
        Regime("chaos C23", described, 0.445, 0.0987, 100, 3),
        Regime("beta = 100", soft, 0.445, 0.0987, 100, 5),
        Regime("beta = 1e5", hard, 0.445, 0.0987, 100, 3),
    ]


def methods() -> Iterator[tuple[str, float, Callable]]:
    """Give (name, rtol, function) of every method that is installed.

    The function takes a `Regime` and returns one that maps a state to the stroboscopic points.
    """
    for rtol in (1e-6, 1e-9):
        yield "flow", rtol, _ours("flow", rtol)
    for rtol in (1e-3, 1e-6, 1e-9):
        yield "bdf", rtol, _ours("bdf", rtol)
    for method, rtol in SCIPY:
        yield f"scipy {method}", rtol, _scipy(method, rtol)
    yield from _numbalsoda()
    yield from _cvode()


def _ours(name: str, rtol: float) -> Callable:
    def prepare(regime: Regime):
        solver = make_solver(name, regime.structure, regime.omega, rtol)
        return lambda state: solver.points(state, regime.amplitude, regime.n_periods)[0]

    return prepare


def _arguments(regime: Regime) -> tuple:
    structure = regime.structure
    return (
        regime.amplitude,
        regime.omega,
        structure.stiffness_ratio,
        structure.sharpness,
        structure.stiffness_matrix.copy(),
        np.ascontiguousarray(structure.damping_matrix),
    )


def _by_periods(regime: Regime, one: Callable) -> Callable:
    def points(state):
        found = []
        for _ in range(regime.n_periods):
            state = one(state)
            found.append(state)
        return np.array(found)

    return points


def _scipy(method: str, rtol: float) -> Callable:
    from scipy.integrate import solve_ivp

    def prepare(regime: Regime):
        given = _arguments(regime)
        size = 2 * regime.structure.n_floors
        period = 2 * math.pi / regime.omega
        beta, rho, stiffness, damping = given[2:]
        options = {"rtol": rtol, "atol": rtol, "max_step": LONGEST_STEP}
        if method in ("Radau", "LSODA"):
            options["jac"] = lambda _t, z: jacobian(
                z, beta, rho, stiffness, damping, np.empty((size, size))
            )

        def one(state):
            found = solve_ivp(
                lambda t, z: right_hand_side(t, z, *given, np.empty(size)),
                (0.0, period),
                state,
                method=method,
                **options,
            )
            return found.y[:, -1]

        return _by_periods(regime, one)

    return prepare


def _numbalsoda() -> Iterator[tuple[str, float, Callable]]:
    try:
        import numba
        import numbalsoda
    except ImportError:
        return

    def prepare_with(solve):
        def prepare(regime: Regime):
            amplitude, omega, beta, rho, stiffness, damping = _arguments(regime)
            n = regime.structure.n_floors
            size = 2 * n

            @numba.cfunc(numbalsoda.lsoda_sig)
            def derivative(tau, z_, out_, _data):
                z = numba.carray(z_, (size,))
                out = numba.carray(out_, (size,))
                right_hand_side(tau, z, amplitude, omega, beta, rho, stiffness, damping, out)

            times = np.linspace(0.0, 2 * math.pi / omega, 2 + int(20 / omega))

            def one(state):
                found, _ = solve(derivative.address, state, times)
                return found[-1]

            return _by_periods(regime, one)

        return prepare

    def explicit(address, state, times):
        return numbalsoda.dop853(address, state, times, rtol=1e-9, atol=1e-9)

    def automatic(address, state, times):
        return numbalsoda.lsoda(address, state, times, rtol=1e-9, atol=1e-9)

    yield "numbalsoda DOP853", 1e-9, prepare_with(explicit)
    yield "numbalsoda LSODA", 1e-9, prepare_with(automatic)


def _cvode() -> Iterator[tuple[str, float, Callable]]:
    try:
        from sksundae.cvode import CVODE
    except ImportError:
        return

    def prepare(regime: Regime):
        given = _arguments(regime)
        period = 2 * math.pi / regime.omega

        def one(state):
            solver = CVODE(
                lambda t, z, out: right_hand_side(t, z, *given, out),
                method="BDF",
                rtol=1e-9,
                atol=1e-9,
                max_step=LONGEST_STEP,
                max_num_steps=1_000_000,
            )
            return solver.solve([0.0, period], state).y[-1]

        return _by_periods(regime, one)

    yield "CVODE BDF", 1e-9, prepare


def work_precision(
    chosen: list[Regime] | None = None, repeats: int = REPEATS, say: Callable = lambda text: None
) -> list[Row]:
    """Measure every method on every regime."""
    rows = []
    for regime in regimes() if chosen is None else chosen:
        say(regime.name)
        flow = make_solver("flow", regime.structure, regime.omega, 1e-9)
        start = flow.advance(
            np.zeros(2 * regime.structure.n_floors), regime.amplitude, regime.settle
        ).state
        exact = reference_points(
            regime.structure, regime.amplitude, regime.omega, start, regime.n_periods
        )
        prepared = [(name, rtol, prepare(regime)) for name, rtol, prepare in methods()]
        errors = [float(np.abs(points(start) - exact).max()) for _, _, points in prepared]
        times = np.array(
            [[_seconds(points, start) for _, _, points in prepared] for _ in range(repeats)]
        )
        times *= 1e6 / regime.n_periods
        low, middle, high = np.percentile(times, [25, 50, 75], axis=0)
        rows += [
            Row(regime.name, name, rtol, float(middle[k]), float(high[k] - low[k]) / 2, errors[k])
            for k, (name, rtol, _) in enumerate(prepared)
        ]
    return rows


def _seconds(points: Callable, start: np.ndarray) -> float:
    """Time one call, or many where one is too short for the clock."""
    begun = time.perf_counter()
    points(start)
    once = time.perf_counter() - begun
    calls = int(2e-3 / max(once, 1e-6))
    if calls < 2:
        return once
    begun = time.perf_counter()
    for _ in range(calls):
        points(start)
    return (time.perf_counter() - begun) / calls


def sweep_ratio(job: Job, n_samples: int = 12, repeats: int = 3) -> dict:
    """Compare `flow` with `bdf` at rtol 1e-6 on a job's first frame.

    The frame is swept with `flow`. At amplitudes spread over it both methods then take the same
    periods from the same states.

    Returns
    -------
    dict
        Microseconds per period of both, their ratio (median and quartiles over the samples), and
        the seconds `flow` took for the whole sweep, with the job's skip rules, per run.
    """
    omega = float(job.omega[0])
    size = 2 * job.structure.n_floors
    sweep_block(job.structure, omega, job.amplitude[:2], np.zeros(size), job.settings)
    begun = time.perf_counter()
    swept = sweep_block(job.structure, omega, job.amplitude, job.initial_state, job.settings)
    seconds = time.perf_counter() - begun
    flow = make_solver("flow", job.structure, omega, 1e-9)
    bdf = make_solver("bdf", job.structure, omega, 1e-6)
    ours, theirs = [], []
    for index in np.linspace(0, job.amplitude.size - 1, n_samples).astype(int):
        amplitude, state = float(job.amplitude[index]), swept["final_state"][index]
        flow.advance(state, amplitude, 2)
        for _ in range(repeats):
            begun = time.perf_counter()
            flow.advance(state, amplitude, 400)
            ours.append((time.perf_counter() - begun) / 400)
            begun = time.perf_counter()
            bdf.advance(state, amplitude, 2)
            theirs.append((time.perf_counter() - begun) / 2)
    ratio = np.array(theirs) / np.array(ours)
    return {
        "job": job.name,
        "flow_microseconds_per_period": 1e6 * float(np.mean(ours)),
        "bdf_microseconds_per_period": 1e6 * float(np.mean(theirs)),
        "ratio_of_means": float(np.mean(theirs) / np.mean(ours)),
        "ratio_quartiles": [float(value) for value in np.percentile(ratio, [25, 50, 75])],
        "sweep_seconds": seconds,
        "sweep_runs": int(job.amplitude.size),
        "periods_per_run": float(swept["cycles"].mean()),
    }


def floors(numbers=(1, 3, 10, 30), repeats: int = 3, n_periods: int = 100) -> list[dict]:
    """Measure `flow` against the number of floors, at each structure's first resonance."""
    found = []
    for n in numbers:
        structure = Structure(n_floors=n)
        omega = float(structure.frequencies[0])
        amplitude = 3.0 * structure.grazing_amplitude(omega)
        flow = make_solver("flow", structure, omega, 1e-9)
        state = flow.advance(np.zeros(2 * n), amplitude, 50).state
        times = []
        for _ in range(repeats):
            begun = time.perf_counter()
            flow.advance(state, amplitude, n_periods)
            times.append(1e6 * (time.perf_counter() - begun) / n_periods)
        found.append(
            {
                "n_floors": n,
                "microseconds_per_period": float(np.median(times)),
                "contact_tables": flow.n_tables,
            }
        )
    return found


def as_json(rows: list[Row], ratio: dict, by_floors: list[dict]) -> dict:
    """Put all results into plain types."""
    return {"work_precision": [asdict(row) for row in rows], "sweep": ratio, "floors": by_floors}


def as_text(rows: list[Row], ratio: dict, by_floors: list[dict]) -> str:
    """Write all results as tables."""
    lines = []
    if rows:
        lines.append(
            "us per forcing period (median +- half the quartile range) and error (max norm)"
        )
    names = list(dict.fromkeys((row.method, row.rtol) for row in rows))
    chosen = list(dict.fromkeys(row.regime for row in rows))
    if rows:
        lines.append(f"{'method':24s}" + "".join(f"{name:>26s}" for name in chosen))
    for method, rtol in names:
        cells = []
        for regime in chosen:
            row = next(r for r in rows if (r.method, r.rtol, r.regime) == (method, rtol, regime))
            cells.append(f"{row.microseconds:10.4g} +-{row.spread:6.2g} {row.error:7.0e}")
        lines.append(f"{method:17s} {rtol:6.0e}" + "".join(f"{cell:>26s}" for cell in cells))
    quartiles = ", ".join(f"{value:.4g}" for value in ratio["ratio_quartiles"])
    lines += [
        "",
        f"{ratio['job']}, same periods in one run: flow {ratio['flow_microseconds_per_period']:.3g}"
        f" us, bdf at 1e-6 {ratio['bdf_microseconds_per_period']:.4g} us a period",
        f"  bdf / flow = {ratio['ratio_of_means']:.4g} (quartiles {quartiles})",
        f"  sweep of {ratio['sweep_runs']} runs with flow: {ratio['sweep_seconds']:.3g} s, "
        f"{ratio['periods_per_run']:.3g} periods a run",
    ]
    if by_floors:
        lines += ["", "flow against the number of floors (first resonance, 3 x grazing amplitude):"]
    lines += [
        f"  n = {row['n_floors']:3d}: {row['microseconds_per_period']:9.4g} us a period, "
        f"{row['contact_tables']} contact tables"
        for row in by_floors
    ]
    return "\n".join(lines)
