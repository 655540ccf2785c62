r"""The stroboscopic map of a structure, with one number of it, or two, as parameters.

The tangent map is the solver's exact one. The derivative by the parameter is a difference over
`DIFFERENCE` of the parameter's size, to one side: that error is below the one of rounding, and each
value of another parameter than the amplitude needs a solver. By the amplitude, at A = 0.03, 0.06,
0.1 and 0.2 of Figure 3, it is accurate to 5e-6 of components up to 22, against Richardson's
extrapolation of wider differences; a test compares it with another solver, to 1e-3. That suffices:
it affects the direction of Newton's method and the tangent of a branch, but no point of it. A wider
difference would be one across grazings: with 1e-5 no branch of a sharp stop passes its first
contact.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np

from hpcsweep.dynamics.families import are_joined
from hpcsweep.dynamics.stability import held
from hpcsweep.model.arguments import choice, shown
from hpcsweep.model.observed import IMPACT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import BATCHES, SMOOTH
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.records import Observation
from hpcsweep.solvers.solver import make_solver

DIFFERENCE = 1e-8
"""Share of a parameter over which differences are taken for the slopes by it."""
KEPT_SOLVERS, KEPT_SEEN = 8, 10_000
CHATTERS = -1
"""In a signature: a rigid contact comes to rest in infinitely many impacts."""
FORCING_PARAMETERS = ("amplitude", "omega")
Ties = Mapping[str, Callable[..., float]]
NO_TIES: Ties = MappingProxyType({})
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
        number = getattr(structure, parameter)
        is_number = isinstance(number, Real) and math.isfinite(number)
        if structure.matrices is not None or not is_number:
            what = f"parameter {parameter} must be one finite number of the structure"
            raise ValueError(f"{what}, is {shown(number)}")


class ForcedMap:
    """The map z(0) -> z(T), points in units of the state; see `hpcsweep.dynamics.continuation`.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
    parameter : {"amplitude", "omega", "stiffness_ratio", "gap", "sharpness", "damping_ratio"}
        The varied one; the structure must have it as one number. Or two of them: then a value is a
        pair.
    rtol : float
        Relative tolerance of the solver.
    poll : callable, optional
        Called before each piece of the work (`polling`); may raise to leave.
    ties : mapping of str to callable, optional
        What gives the amplitude or the frequency, by its name, in place of the given one: takes the
        parameter, by its name.

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
        parameter: str | tuple[str, ...] = "amplitude",
        rtol: float = 1e-9,
        poll: Poll = None,
        ties: Ties = NO_TIES,
    ):
        self._ties = ties
        self.parameters = parameter if isinstance(parameter, tuple) else (parameter,)
        for name in self.parameters:
            check_parameter(structure, name)
        self.structure, self.amplitude, self.omega = structure, amplitude, omega
        self.parameter, self.units, self._rtol = parameter, structure.state_units, rtol
        self.size = self.units.size
        self.periods = 0
        self._poll = poll
        self._seen = lru_cache(KEPT_SEEN)(self._observe)
        self._closed = lru_cache(KEPT_SEEN)(self._closings)
        self._solvers: dict[tuple, Any] = {}

    @property
    def is_costly(self) -> bool:
        """Whether a new value of a parameter needs a solver."""
        return self.parameters != ("amplitude",) or bool(self._ties)

    @property
    def value(self) -> Any:
        """Given value of the parameter, or of both."""
        values = (
            float(getattr(self if name in FORCING_PARAMETERS else self.structure, name))
            for name in self.parameters
        )
        return next(values) if isinstance(self.parameter, str) else tuple(values)

    def _values(self, value: Any) -> dict[str, float]:
        """Return the values of all parameters, and of what they give."""
        numbers = value if isinstance(value, tuple) else (value,)
        values = dict(zip(self.parameters, numbers, strict=True))
        return values | {name: of(**values) for name, of in self._ties.items()}

    def at(self, value: Any) -> tuple[Structure, float, float]:
        """Return structure, amplitude and frequency at a value of the parameter."""
        changed: dict[str, Any] = self._values(value)
        amplitude, omega = (changed.pop(name, getattr(self, name)) for name in FORCING_PARAMETERS)
        structure = replace(self.structure, **changed) if changed else self.structure
        return structure, amplitude, omega

    def solver(self, value: Any) -> tuple[Any, float]:
        """Return the solver and the amplitude at a value of the parameter."""
        others = self._values(value)
        amplitude, key = others.pop("amplitude", self.amplitude), tuple(others.values())
        if key not in self._solvers:
            structure, amplitude, omega = self.at(value)
            measured = structure.measured_at(omega, amplitude)
            self._solvers[key] = make_solver("flow", measured, omega, self._rtol, yields=True)
            if len(self._solvers) > KEPT_SOLVERS:
                del self._solvers[next(iter(self._solvers))]
        return self._solvers[key], amplitude

    def images(self, points: np.ndarray, value: Any) -> np.ndarray:
        """Return the states after a forcing period, shape (p, N)."""
        solver, amplitude = self._begin(value, len(points))
        return solver.images(points * self.units, amplitude, poll=self._poll).states / self.units

    def tangents(self, points, value, by=0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the states after a forcing period; derivatives by those before, by parameters."""
        solver, amplitude = self._begin(value, len(points))
        images, matrices = solver.images(points * self.units, amplitude, True, self._poll)
        images, matrices = images / self.units, matrices * self.units / self.units[:, None]
        slopes = np.empty((*points.shape, by))
        for k in range(by):
            values = [*value] if isinstance(value, tuple) else [value]
            low = values[k]
            values[k] = high = low + DIFFERENCE * (abs(low) or 1.0)
            slopes[..., k] = (self.images(points, tuple(values)) - images) / (high - low)
        return images, held(matrices, len(self.structure.sliders)), slopes

    def take_round(self, scale, rows, inverse, matrices, rules) -> tuple[float, float] | None:
        """Take a round of Newton's method along the amplitude in one compiled call."""
        if self.is_costly or not BATCHES.of(self.structure):
            return None
        solver, _ = self.solver(self.amplitude)
        unit, rules = self.structure.length_unit, (*rules, DIFFERENCE)
        least, largest, periods = solver.take_round(
            rows, inverse, matrices, scale, unit, rules, self._poll
        )
        self.periods += periods
        return least, largest

    def signature(self, points: np.ndarray, value: Any) -> tuple[int, ...]:
        """Return how often each contact closes along an orbit, and how often each slider slips.

        Of rigid contacts that chatter `CHATTERS`.
        """
        if not SMOOTH.of(self.structure):
            return self.counted(self.observe(points, value))
        return self._closed(points.tobytes(), value)

    def _closings(self, points: bytes, value: Any) -> tuple[int, ...]:
        states = np.frombuffer(points).reshape(-1, self.size) * self.units
        solver, amplitude = self._begin(value, len(states))
        return solver.closings(states, amplitude, self._poll)

    def counted(self, seen: Observation) -> tuple[int, ...]:
        """Return the signature of an orbit that has been observed."""
        assert seen.measures is not None  # `_observe` has requested them
        closings = seen.measures.impacts * len(seen.points)
        rebounds = np.array([bool(one.restitution) for one in self.structure.contacts], bool)
        closings[rebounds & (seen.measures.contact_share > 0.0)] = CHATTERS
        slips = seen.slid.get("excursions", closings[:0])
        return tuple(np.rint(np.append(closings, slips)).astype(int).tolist())

    def observe(self, points: np.ndarray, value: Any, measures: int = 0) -> Observation:
        """Return the observation of an orbit, shape (p, N), with impacts and other measures."""
        return self._seen(points.tobytes(), value, measures)

    def _observe(self, points: bytes, value: Any, measures: int) -> Observation:
        states = np.frombuffer(points).reshape(-1, self.size) * self.units
        solver, amplitude = self._begin(value, len(states))
        seen = solver.observe_each(states, amplitude, measures | IMPACT, self._poll)
        if seen.outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {seen.outcome.name}")
        return seen

    def joins(self, orbit: np.ndarray, other: np.ndarray, value: Any) -> bool:
        """Return whether two orbits that attract, shape (p, N), differ in p of sliders that stick.

        And are of one family: see `hpcsweep.dynamics.families`.
        """
        solver, amplitude = self.solver(value)
        sticks, sticks_too = (
            self.observe(x, value).slid["excursions"] == 0 for x in (orbit, other)
        )
        if not sticks.any() or (sticks != sticks_too).any():
            return False
        orbits, count = (orbit * self.units, other * self.units), int(sticks.sum())
        return are_joined(solver, amplitude, *orbits, count, self._poll)

    def _begin(self, value: Any, periods: int = 1) -> tuple[Any, float]:
        self.periods += periods
        return self.solver(value)
