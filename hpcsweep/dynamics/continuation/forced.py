r"""The stroboscopic map of a structure, with one number of it as the parameter of branches.

The tangent map is the solver's exact one. The derivative by the parameter is a central difference
over `DIFFERENCE` of the parameter's size. By the amplitude, at A = 0.03, 0.06, 0.1 and 0.2 of
Figure 3, it is accurate to 6e-9 of components up to 22, against Richardson's extrapolation of wider
differences; a test compares it with another solver, to 1e-3. That suffices: it affects the
direction of Newton's method and the tangent of a branch, but no point of it.
"""

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np

from hpcsweep.model.arguments import choice, shown
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.measures import IMPACT_FLAG
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation
from hpcsweep.solvers.solver import Solver, make_solver

DIFFERENCE = 1e-5
KEPT_SOLVERS, KEPT_SEEN = 8, 10_000
FORCING_PARAMETERS = ("amplitude", "omega")
PARAMETERS = (*FORCING_PARAMETERS, "stiffness_ratio", "gap", "sharpness", "damping_ratio")


def check_parameter(structure: Structure, parameter: str) -> None:
    """Make sure that a structure has a parameter of `PARAMETERS`, as one number.

    Raises
    ------
    ValueError
        One line that says what it must be.
    """
    choice("parameter", parameter, PARAMETERS)
    if parameter not in FORCING_PARAMETERS:
        given = getattr(structure, parameter)
        is_number = isinstance(given, Real) and math.isfinite(given)
        if structure.matrices is not None or not is_number:
            what = f"parameter {parameter} must be one finite number of the structure"
            raise ValueError(f"{what}, is {shown(given)}")


class ForcedMap:
    """The map z(0) -> z(T), points in units of the state; see `hpcsweep.dynamics.continuation`.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
    parameter : {"amplitude", "omega", "stiffness_ratio", "gap", "sharpness", "damping_ratio"}
        The varied one; the structure must have it as one number.
    rtol : float
        Relative tolerance of the solver.
    poll : callable, optional
        Called before each forcing period; may raise to leave.

    Raises
    ------
    ValueError
        If the structure has no such number.
    """

    def __init__(
        self,
        structure: Structure,
        amplitude: float,
        omega: float,
        parameter: str = "amplitude",
        rtol: float = 1e-9,
        poll: Callable[[], None] | None = None,
    ):
        check_parameter(structure, parameter)
        self.structure, self.amplitude, self.omega = structure, amplitude, omega
        self.parameter, self.units, self._rtol = parameter, structure.state_units, rtol
        self.size = self.units.size
        self.periods = 0
        self._poll = poll
        self._seen: OrderedDict[tuple, Observation] = OrderedDict()
        self._solvers: OrderedDict[float, Solver] = OrderedDict()

    @property
    def value(self) -> float:
        """Given value of the parameter."""
        home = self if self.parameter in FORCING_PARAMETERS else self.structure
        return float(getattr(home, self.parameter))

    def at(self, value: float) -> tuple[Structure, float, float]:
        """Return structure, amplitude and frequency at a value of the parameter."""
        if self.parameter == "amplitude":
            return self.structure, value, self.omega
        if self.parameter == "omega":
            return self.structure, self.amplitude, value
        changed: dict[str, Any] = {self.parameter: value}
        return replace(self.structure, **changed), self.amplitude, self.omega

    def solver(self, value: float) -> tuple[Solver, float]:
        """Return the solver and the amplitude at a value of the parameter."""
        structure, amplitude, omega = self.at(value)
        key = 0.0 if self.parameter == "amplitude" else value
        if key not in self._solvers:
            measured = structure.measured_at(omega, amplitude)
            self._solvers[key] = make_solver("flow", measured, omega, self._rtol)
            if len(self._solvers) > KEPT_SOLVERS:
                self._solvers.popitem(last=False)
        return self._solvers[key], amplitude

    def image(self, x: np.ndarray, value: float) -> np.ndarray:
        """Return the state after a forcing period."""
        solver, amplitude = self._begin(value)
        end = solver.advance(x * self.units, amplitude, 1)
        if end.outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {end.outcome.name}")
        return end.state / self.units

    def tangent(self, x: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state after a forcing period and its derivative by the one before."""
        solver, amplitude = self._begin(value)
        end, matrix = solver.monodromy(x * self.units, amplitude, 1)
        return end / self.units, matrix * self.units / self.units[:, None]

    def slope(self, x: np.ndarray, value: float) -> np.ndarray:
        """Return the derivative by the parameter."""
        step = DIFFERENCE * (abs(value) or 1.0)
        high, low = value + step, value - step
        return (self.image(x, high) - self.image(x, low)) / (high - low)

    def signature(self, points: np.ndarray, value: float) -> tuple[int, ...]:
        """Return the number of closings of each contact along an orbit."""
        return self.closings(self.observe(points, value))

    def observe(self, points: np.ndarray, value: float) -> Observation:
        """Return the observation of an orbit, shape (p, N), including impacts."""
        key = points.tobytes(), value
        if key not in self._seen:
            self._seen[key] = self._observe(points, value)
            if len(self._seen) > KEPT_SEEN:
                self._seen.popitem(last=False)
        return self._seen[key]

    def _observe(self, points: np.ndarray, value: float) -> Observation:
        solver, amplitude = self._begin(value, len(points))
        seen = solver.observe(points[0] * self.units, amplitude, len(points), measures=IMPACT_FLAG)
        if seen.outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {seen.outcome.name}")
        return seen

    def closings(self, seen: Observation) -> tuple[int, ...]:
        """Return the number of closings of each contact in a window."""
        count = len(self.structure.contacts)
        first = seen.measures.size - 4 * count
        own = seen.measures[first : first + count] * len(seen.points)
        return tuple(np.rint(own).astype(int).tolist())

    def _begin(self, value: float, periods: int = 1) -> tuple[Solver, float]:
        if self._poll is not None:
            self._poll()
        self.periods += periods
        return self.solver(value)
