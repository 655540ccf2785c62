"""Solvers that `bench` compares, each as a function from a state to points."""

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.equations import MODEL, derivative, jacobian_matrix, right_hand_side
from hpcsweep.model.kernel_model import Model, kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import make_solver

TOLERANCES = (1e-3, 1e-6, 1e-9)
TIGHT = (1e-6, 1e-9, 1e-12)
"""Tolerances of the methods of high order, which are loose at 1e-3."""
SCIPY = {"BDF": TOLERANCES, "Radau": TOLERANCES, "LSODA": TIGHT, "DOP853": TIGHT}
"""Methods of scipy's solve_ivp and their tolerances, with compiled equations and, where they are
used, Jacobians. No peer is given a step limit: one short enough for every contact makes DOP853
seven times slower and no more accurate. What a loose tolerance steps over, its error shows."""
MAX_STEPS = 1_000_000
"""Steps the peers may take in one forcing period."""


@dataclass(frozen=True)
class Package:
    """A package that provides peers, used where it is installed.

    Attributes
    ----------
    module, name : str
        Import name and distribution name.
    install : str
        Arguments of the installer.
    """

    module: str
    name: str
    install: str


PACKAGES = (
    Package("sksundae", "scikit-sundae", "pip install 'hpcsweep[bench]'"),
    Package("numbalsoda", "numbalsoda", "pip install numbalsoda, with a Fortran compiler"),
)
"""numbalsoda has no wheels and builds from source: the extra 'bench' does without it."""


@dataclass(frozen=True)
class Stretch:
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


def absent() -> list[str]:
    """Return the names of packages with peers that are not installed."""
    return [package.name for package in _absent()]


def absent_text() -> list[str]:
    """Format a line for each package with peers that is not installed."""
    return [
        f"  not measured: {package.name} is not installed ({package.install})"
        for package in _absent()
    ]


def _absent() -> list[Package]:
    return [package for package in PACKAGES if importlib.util.find_spec(package.module) is None]


def methods() -> Iterator[tuple[str, float, Callable]]:
    """Return (name, rtol, function) of every method that is installed.

    The function takes a `Stretch` and returns one that maps a state to the stroboscopic points, or
    raises ArithmeticError.
    """
    for rtol in TIGHT:
        yield "flow", rtol, _ours("flow", rtol)
    for rtol in TOLERANCES:
        yield "bdf", rtol, _ours("bdf", rtol)
    for method, tolerances in SCIPY.items():
        for rtol in tolerances:
            yield f"scipy {method}", rtol, _scipy(method, rtol)
    yield from _numbalsoda()
    yield from _cvode()


def _ours(name: str, rtol: float) -> Callable:
    def prepare(regime: Stretch):
        solver = make_solver(name, regime.structure, regime.omega, rtol)

        def points(state):
            found, outcome = solver.points(state, regime.amplitude, regime.n_periods)
            if outcome is not Outcome.COMPLETE:
                raise ArithmeticError(outcome.name)
            return found

        return points

    return prepare


class Problem(NamedTuple):
    """A regime in the form that the equations need."""

    model: Model
    """Kept: its packed form holds the addresses of its arrays."""
    packed: Any
    frame: Units
    amplitude: float
    period: float


def _problem(regime: Stretch) -> Problem:
    model = kernel_model(regime.structure, regime.omega)
    frame = Units(regime.structure, model)
    amplitude = regime.amplitude / frame.amplitude_unit
    return Problem(model, MODEL.pack(model), frame, amplitude, model.period)


def _by_periods(regime: Stretch, frame: Units, one: Callable) -> Callable:
    def points(state):
        z, found = frame.into(state), []
        for _ in range(regime.n_periods):
            z = one(z)
            found.append(z)
        return frame.out_of(np.array(found))

    return points


def _scipy(method: str, rtol: float) -> Callable:
    from scipy.integrate import solve_ivp

    def prepare(regime: Stretch):
        problem = _problem(regime)
        options: dict[str, Any] = {"rtol": rtol, "atol": rtol}
        if method in ("BDF", "Radau", "LSODA"):
            options["jac"] = lambda _t, z: jacobian_matrix(z, problem.packed)

        def one(state):
            found = solve_ivp(
                lambda t, z: derivative(t, z, problem.amplitude, problem.packed),
                (0.0, problem.period),
                state,
                method=method,
                **options,
            )
            if not found.success:
                raise ArithmeticError(found.message)
            return found.y[:, -1]

        return _by_periods(regime, problem.frame, one)

    return prepare


def _numbalsoda() -> Iterator[tuple[str, float, Callable]]:
    try:
        import numba
        import numbalsoda
    except ImportError:
        return

    def compiled(problem: Problem):
        packed, amplitude, size = problem.packed, problem.amplitude, problem.frame.size

        @numba.cfunc(numbalsoda.lsoda_sig)
        def derivative(tau, z_, out_, _data):
            z = numba.carray(z_, (size,))
            out = numba.carray(out_, (size,))
            right_hand_side(tau, z, amplitude, packed, out)

        return derivative

    def prepare_with(solve, rtol):
        def prepare(regime: Stretch):
            problem = _problem(regime)
            derivative = compiled(problem)
            times = np.array([0.0, problem.period])

            def one(state):
                found, success = solve(
                    derivative.address, state, times, rtol=rtol, atol=rtol, mxstep=MAX_STEPS
                )
                if not success:
                    raise ArithmeticError("the integrator gave up")
                return found[-1]

            return _by_periods(regime, problem.frame, one)

        return prepare

    for name, solve in (("DOP853", numbalsoda.dop853), ("LSODA", numbalsoda.lsoda)):
        for rtol in TIGHT:
            yield f"numbalsoda {name}", rtol, prepare_with(solve, rtol)


def _cvode() -> Iterator[tuple[str, float, Callable]]:
    try:
        from sksundae.cvode import CVODE
    except ImportError:
        return

    def prepare_with(rtol):
        def prepare(regime: Stretch):
            problem = _problem(regime)

            def one(state):
                solver = CVODE(
                    lambda t, z, out: right_hand_side(t, z, problem.amplitude, problem.packed, out),
                    method="BDF",
                    rtol=rtol,
                    atol=rtol,
                    max_num_steps=MAX_STEPS,
                )
                found = solver.solve([0.0, problem.period], state)
                if not found.success:
                    raise ArithmeticError(str(found.message))
                return found.y[-1]

            return _by_periods(regime, problem.frame, one)

        return prepare

    for rtol in TIGHT:
        yield "CVODE BDF", rtol, prepare_with(rtol)
