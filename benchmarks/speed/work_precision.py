"""Measure run time against error: the solvers of this package and their peers.

All methods integrate the same periods from the same states, in turn, and the turns are repeated;
the median and the spread (half the interquartile range) are reported. Errors are against
`reference`, which shares no code with any of them.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from reference import reference_points

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import make_solver
from speed import cpu_seconds
from speed.peers import Stretch, absent, absent_text, methods

REPEATS = 5
PER_LINE = 3
"""Regimes side by side in the table."""


@dataclass(frozen=True)
class Row:
    """One method on one regime; times in microseconds per forcing period."""

    regime: str
    method: str
    rtol: float
    microseconds: float
    spread: float
    error: float


def regimes() -> list[Stretch]:
    """Return the regimes of the comparison."""
    printed = Structure()
    described = Structure(damping_ratio=tuple(0.05 / (2 * printed.frequencies**2)))
    soft = Structure(stiffness_ratio=100.0)
    hard = Structure(stiffness_ratio=1e5)
    return [
        Stretch("no contact", printed, 0.445, 0.012, 100, 5),
        Stretch("P1 C3", printed, 0.445, 0.06, 100, 5),
        Stretch("P2 C23", printed, 0.445, 0.0987, 100, 5),
        Stretch("P8 C23", described, 0.445, 0.07, 300, 8),
        Stretch("chaos C23", described, 0.445, 0.0987, 100, 3),
        Stretch("beta = 100", soft, 0.445, 0.0987, 100, 5),
        Stretch("beta = 1e5", hard, 0.445, 0.0987, 100, 3),
    ]


def work_precision(
    chosen: list[Stretch] | None = None, repeats: int = REPEATS, say: Callable = lambda text: None
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
        prepared, errors = [], []
        for name, rtol, prepare in methods():
            points = prepare(regime)
            try:
                errors.append(float(np.abs(points(start) - exact).max()))
            except ArithmeticError as failure:
                say(f"{regime.name}: {name} at {rtol:g} failed: {failure}")
                continue
            prepared.append((name, rtol, points))
        times = np.array(
            [
                [cpu_seconds(partial(points, start)) for _, _, points in prepared]
                for _ in range(repeats)
            ]
        )
        times *= 1e6 / regime.n_periods
        low, middle, high = np.percentile(times, [25, 50, 75], axis=0)
        rows += [
            Row(regime.name, name, rtol, float(middle[k]), float(high[k] - low[k]) / 2, errors[k])
            for k, (name, rtol, _) in enumerate(prepared)
        ]
    return rows


def as_json(rows: list[Row]) -> dict:
    """Convert the rows to plain types."""
    return {"rows": [asdict(row) for row in rows], "not_installed": absent()}


def as_text(rows: list[Row]) -> str:
    """Format one table a regime."""
    lines = ["run time against error: CPU us a forcing period (median +- half the quartile"]
    lines.append("range), and error at the end of the stretch (max norm, gaps and gaps omega_0):")
    shown = list(dict.fromkeys((row.method, row.rtol) for row in rows))
    chosen = list(dict.fromkeys(row.regime for row in rows))
    found = {(row.method, row.rtol, row.regime): row for row in rows}
    for first in range(0, len(chosen), PER_LINE):
        group = chosen[first : first + PER_LINE]
        lines += ["", f"{'':25s}" + "".join(f"{name:>30s}" for name in group)]
        for method, rtol in shown:
            cells = [_cell(found.get((method, rtol, regime))) for regime in group]
            lines.append(f"{method:18s}{rtol:7.0e}" + "".join(f"{cell:>30s}" for cell in cells))
    lines += absent_text()
    return "\n".join(lines)


def _cell(row: Row | None) -> str:
    if row is None:
        return "failed"
    return f"{_short(row.microseconds)} +- {_short(row.spread)}  {row.error:.0e}"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
