"""Measure how much faster `flow` is than the specified solver and compiled peers.

Ratios are of CPU seconds for the same periods from the same states, measured in turn.
"""

import time
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from reference import reference_points

from hpcsweep.job import Job
from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind
from hpcsweep.studies.sweep.runs import frame_runs
from speed import cpu_seconds
from speed.peers import Stretch, absent, absent_text, methods

FIGURE_3 = """
[sweep]
omega = 0.445
amplitude = {from = 0.0048, to = 0.25, step = 0.001}
"""
"""The sweep of the paper's Figure 3, damping as printed."""
AGAINST = (
    ("bdf", 1e-6),
    ("scipy BDF", 1e-6),
    ("scipy DOP853", 1e-9),
    ("numbalsoda DOP853", 1e-9),
)
SETTLE, LONG, SHORT = 2000, 400, 2
"""Forcing periods: to the attractor from rest, timed with `flow`, timed with the others."""


@dataclass(frozen=True)
class Ratio:
    """One peer against `flow` on one motion.

    Attributes
    ----------
    motion : str
    amplitude : float
    method : str
    rtol : float
    microseconds, flow_microseconds : float
        CPU time of a forcing period, the least over all turns.
    ratio : float
        Ratio of these two.
    quartiles : list of float
        25, 50 and 75 per cent of the ratios within each turn.
    error, flow_error : float
        After `SHORT` periods from the attractor, max norm.
    specialised : bool
        Whether the kernels of `flow` are specialised to the structure.
    """

    motion: str
    amplitude: float
    method: str
    rtol: float
    microseconds: float
    flow_microseconds: float
    ratio: float
    quartiles: list[float]
    error: float
    flow_error: float
    specialised: bool


def pounding() -> Structure:
    """Return the two buildings of jobs/structures/pounding.toml, three floors of which pound."""
    sizes = (3, 5)
    n = sum(sizes)
    stiffness, drift = np.zeros((2, n, n))
    first = 0
    for size in sizes:
        own = slice(first, first + size)
        stiffness[own, own] = Structure(size).stiffness_matrix
        drift[own, own] = Structure(size).drift_rows
        first += size
    contacts = []
    for floor in range(min(sizes)):
        direction = np.zeros(n)
        direction[floor], direction[sizes[0] + floor] = 1.0, -1.0
        contacts.append(Contact(tuple(direction.tolist()), 0.5, 500.0))
    return Structure.from_matrices((1.0,) * n, stiffness, contacts, damping_ratio=0.05, drift=drift)


def motions() -> list[Stretch]:
    """Return the motions that are compared.

    For the paper's building, one with one contact a period and one with two floors in contact; for
    two pounding buildings, one with two and one with three floors in contact.
    """
    paper, two = Structure(), pounding()
    return [
        Stretch("building", paper, 0.445, 0.06, SETTLE, SHORT),
        Stretch("building", paper, 0.445, 0.0987, SETTLE, SHORT),
        Stretch("pounding", two, 0.4, 0.15, SETTLE, SHORT),
        Stretch("pounding", two, 0.4, 0.28, SETTLE, SHORT),
    ]


def motion_ratios(
    compared: list[Stretch] | None = None,
    against: tuple[tuple[str, float], ...] = AGAINST,
    turns: int = 7,
) -> list[Ratio]:
    """Compare `flow` at rtol 1e-9 with peers on the attractor, from rest, of each motion."""
    known = {(name, rtol): prepare for name, rtol, prepare in methods()}
    peers = [key for key in against if key in known]
    found = []
    for regime in motions() if compared is None else compared:
        structure, omega, amplitude = regime.structure, regime.omega, regime.amplitude
        flow = FlowMap(structure, omega)
        rest = np.zeros(2 * structure.n_floors)
        start = flow.advance(rest, amplitude, regime.settle).state
        exact = reference_points(structure, amplitude, omega, start, regime.n_periods)
        ours = known["flow", 1e-9](regime)
        prepared = [known[key](regime) for key in peers]
        errors = [float(np.abs(points(start) - exact).max()) for points in (ours, *prepared)]
        times = np.empty((turns, 1 + len(peers)))
        for turn in range(turns):
            times[turn, 0] = cpu_seconds(partial(flow.advance, start, amplitude, LONG)) / LONG
            for k, points in enumerate(prepared, 1):
                times[turn, k] = cpu_seconds(partial(points, start)) / regime.n_periods
        least = 1e6 * times.min(axis=0)
        for k, (method, rtol) in enumerate(peers, 1):
            quartiles = np.percentile(times[:, k] / times[:, 0], [25, 50, 75])
            found.append(
                Ratio(
                    regime.name,
                    amplitude,
                    method,
                    rtol,
                    float(least[k]),
                    float(least[0]),
                    float(least[k] / least[0]),
                    quartiles.tolist(),
                    errors[k],
                    errors[0],
                    flow.is_specialised,
                )
            )
    return found


def sweep_ratio(job: Job, n_samples: int = 12, repeats: int = 3) -> dict:
    """Compare `flow` with `bdf` at rtol 1e-6 on a job's first frame.

    The frame is swept with `flow`. At amplitudes spread over it both methods then take the same
    periods from the same states.

    Returns
    -------
    dict
        Microseconds per period of both, their ratio (median and quartiles over the samples), and
        the CPU seconds `flow` took for the whole sweep, with the job's skip rules, per run.
    """
    study = as_kind(job.study, RunGrid)
    omega = float(study.omega[0])
    size = 2 * study.structure.n_floors
    frame_runs(study.structure, omega, study.settings).follow(study.amplitude[:2], np.zeros(size))
    begun = time.process_time()
    swept = frame_runs(study.structure, omega, study.settings).follow(
        study.amplitude, study.initial_state
    )
    seconds = time.process_time() - begun
    flow = make_solver("flow", study.structure, omega, 1e-9)
    bdf = make_solver("bdf", study.structure, omega, 1e-6)
    ours, theirs = [], []
    for index in np.linspace(0, study.amplitude.size - 1, n_samples).astype(int):
        amplitude, state = float(study.amplitude[index]), swept["final_state"][index]
        flow.advance(state, amplitude, 2)
        for _ in range(repeats):
            begun = time.process_time()
            flow.advance(state, amplitude, 400)
            ours.append((time.process_time() - begun) / 400)
            begun = time.process_time()
            bdf.advance(state, amplitude, 2)
            theirs.append((time.process_time() - begun) / 2)
    ratio = np.array(theirs) / np.array(ours)
    return {
        "job": job.name,
        "flow_microseconds_per_period": 1e6 * float(np.mean(ours)),
        "bdf_microseconds_per_period": 1e6 * float(np.mean(theirs)),
        "ratio_of_means": float(np.mean(theirs) / np.mean(ours)),
        "ratio_quartiles": [float(value) for value in np.percentile(ratio, [25, 50, 75])],
        "sweep_seconds": seconds,
        "sweep_runs": int(study.amplitude.size),
        "periods_per_run": float(swept["cycles"].mean()),
    }


def as_json(motions: list[Ratio], sweep: dict) -> dict:
    """Convert all ratios to plain types."""
    return {
        "motions": [asdict(row) for row in motions],
        "sweep": sweep,
        "not_installed": absent(),
    }


def as_text(motions: list[Ratio], sweep: dict) -> str:
    """Format all ratios, a line each."""
    lines = [
        "flow against others on the attractor, CPU time a period (building: beta = 1000, Omega = "
        "0.445; pounding: jobs/structures/pounding.toml, Omega = 0.4):"
    ]
    for row in motions:
        low, middle, high = row.quartiles
        lines.append(
            f"  {row.motion:9s}A = {row.amplitude:<7g}{row.method:18s}{row.rtol:6.0e} "
            f"{row.microseconds:9.4g} us, flow {row.flow_microseconds:.3g} us: ratio "
            f"{row.ratio:.4g} (in turn {low:.4g}, {middle:.4g}, {high:.4g}); error "
            f"{row.error:.0e}, flow {row.flow_error:.0e}"
            + (", specialised" if row.specialised else "")
        )
    lines += absent_text()
    quartiles = ", ".join(f"{value:.4g}" for value in sweep["ratio_quartiles"])
    lines += [
        f"{sweep['job']}, states spread over the sweep: flow "
        f"{sweep['flow_microseconds_per_period']:.3g} us, bdf at 1e-6 "
        f"{sweep['bdf_microseconds_per_period']:.4g} us a period",
        f"  bdf / flow = {sweep['ratio_of_means']:.4g} (quartiles {quartiles})",
        f"  sweep of {sweep['sweep_runs']} runs with flow: {sweep['sweep_seconds']:.3g} s, "
        f"{sweep['periods_per_run']:.3g} periods a run",
    ]
    return "\n".join(lines)
