"""Measure errors against the requested tolerance."""

import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from reference import reference_points

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import SOLVERS, make_solver

REQUESTED = tuple(10.0**-k for k in range(3, 13))
ALLOWED = {"flow": 1.0, "bdf": 3e3}
"""C of the promise error <= C rtol + `FLOOR` after one period in the motions of `regimes`. `bdf`
controls the error of a step, of which a period has hundreds, and the stop amplifies it."""
FLOOR = {"flow": 1e-10, "bdf": 2e-11}
"""Error that no tolerance removes: the closed-form passages of `flow`, which leave up to 1e-11 each
(`flow.crossing.NEGLECTED`), and for `bdf` rounding."""


@dataclass(frozen=True)
class Regime:
    """One motion, measured over one period from several states of its path."""

    name: str
    structure: Structure
    amplitude: float
    omega: float = 0.445
    steady: bool = False
    """Start on the linear steady state (which touches, if A says so), not at rest."""

    @property
    def start(self) -> np.ndarray:
        """State at tau = 0, shape (2n,)."""
        if not self.steady:
            return np.zeros(2 * self.structure.n_floors)
        response = self.amplitude * self.structure.linear_steady_state(self.omega)
        return np.concatenate((response.imag, self.omega * response.real))


@dataclass(frozen=True)
class Row:
    """Largest error of one period (gaps, gaps omega_0) over the states of a regime."""

    regime: str
    solver: str
    rtol: float
    error: float


def regimes() -> list[Regime]:
    """Return the motions: free, slow and fast contact, soft and sharp stops, one and six floors."""
    printed = Structure()
    return [
        Regime("no contact", printed, 0.012),
        Regime("grazing", printed, (1 + 1e-5) * printed.grazing_amplitude(0.445), steady=True),
        Regime("contact C23", printed, 0.0987),
        Regime("beta = 1e5", Structure(stiffness_ratio=1e5), 0.06),
        Regime("soft: beta = 50, rho = 30", Structure(stiffness_ratio=50.0, sharpness=30.0), 0.1),
        Regime("rho = inf", Structure(sharpness=float("inf")), 0.15),
        Regime("n = 1", Structure(n_floors=1), 0.5, 0.9),
        Regime("n = 6", Structure(n_floors=6), 0.05, 0.25),
    ]


def measure(
    chosen: list[Regime] | None = None,
    requested: tuple[float, ...] = REQUESTED,
    n_states: int = 3,
    say: Callable = lambda text: None,
) -> list[Row]:
    """Measure both solvers at every tolerance against the Taylor reference.

    The states are stroboscopic points. Each period starts on the reference's path, so errors are
    those of one period.
    """
    rows = []
    for regime in regimes() if chosen is None else chosen:
        say(regime.name)
        path = reference_points(
            regime.structure, regime.amplitude, regime.omega, regime.start, n_states + 1
        )
        for name in SOLVERS:
            for rtol in requested:
                solver = make_solver(name, regime.structure, regime.omega, rtol)
                error = 0.0
                for start, end in itertools.pairwise(path):
                    points, outcome = solver.points(start, regime.amplitude, 1)
                    if outcome is not Outcome.COMPLETE:
                        error = float("inf")
                        break
                    error = max(error, float(np.abs(points[0] - end).max()))
                rows.append(Row(regime.name, name, rtol, error))
    return rows


def as_json(rows: list[Row]) -> list[dict]:
    """Convert the rows to plain types."""
    return [asdict(row) for row in rows]


def as_text(rows: list[Row]) -> str:
    """Format a table: error by regime and solver, a column for each tolerance."""
    requested = sorted({row.rtol for row in rows}, reverse=True)
    lines = ["error of one period by requested tolerance"]
    lines.append(f"{'':27s}{'':5s}" + "".join(f"{rtol:8.0e}" for rtol in requested))
    for regime, solver in dict.fromkeys((row.regime, row.solver) for row in rows):
        own = {row.rtol: row.error for row in rows if (row.regime, row.solver) == (regime, solver)}
        cells = "".join(f"{own[rtol]:8.0e}" for rtol in requested)
        lines.append(f"{regime:27s}{solver:5s}{cells}")
    return "\n".join(lines)
