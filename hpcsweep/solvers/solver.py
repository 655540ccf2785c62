"""Both solvers behind one interface, and a function for stroboscopic points.

A solver belongs to one structure and one frequency and has the methods of `FlowMap`: `advance`,
`settle`, `points`, `observe`, `grow`, `monodromy` and `images`; what they return is in
`hpcsweep.solvers.records`. All of them start at phase tau = 0 of the forcing and advance whole
forcing periods T = 2 pi / Omega. One that cannot tell when an orbit has closed integrates all of
them in `settle`, and returns period 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from hpcsweep.model.arguments import choice, finite, finite_vector, forcing_frequency, instance
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import BATCHES, BDF, CLOSING
from hpcsweep.solvers.outcome import Outcome


@dataclass(frozen=True)
class SolverKind:
    """A solver and its properties.

    Attributes
    ----------
    module, made : str
        Module, and its factory: callable (structure, omega, rtol).
    rtol : float
        Default relative tolerance of jobs.
    tight : float
        Relative tolerance with which it recomputes the runs of another solver.
    period_error : float
        Error of one forcing period in units of the relative tolerance, at beta = 1000 and a tangent
        map of norm 1: some three times the largest measured.
    follows_orbits : bool
        Whether it computes batches of runs that skip rules finish (`FlowMap.follow_orbits`).
    classify_cycles : int
        Default number of forcing periods after which the motion of a run counts as undecided. A
        solver that takes a second where `flow` takes a millisecond classifies only on request.
    """

    module: str
    made: str
    rtol: float
    tight: float
    period_error: float
    follows_orbits: bool = False
    classify_cycles: int = 0

    def batches(self, structure: Structure) -> bool:
        """Return whether it computes batches of runs of a structure."""
        return self.follows_orbits and BATCHES.of(structure)

    def load(self) -> Callable[[Structure, float, float], Any]:
        """Import the solver, which takes longer than most commands that compute nothing."""
        return getattr(import_module(f"hpcsweep.solvers.{self.module}"), self.made)


SOLVERS = {
    "flow": SolverKind(
        "flow",
        "FlowMap",
        rtol=1e-9,
        tight=1e-11,
        period_error=1e3,
        follows_orbits=True,
        classify_cycles=50_000,
    ),
    "bdf": SolverKind("bdf", "BdfMap", rtol=1e-6, tight=1e-10, period_error=3e3),
}


def witness_of(name: str, structure: Structure) -> str:
    """Return the solver that recomputes the runs of another one: the other one if it can.

    Else `flow` computes again, at a tighter tolerance.
    """
    return "bdf" if name == "flow" and BDF.of(structure) else "flow"


def make_solver(
    name: str, structure: Structure, omega: float, rtol: float, yields: bool = False
) -> Any:
    """Return the solver `name` for one structure and frequency.

    With `yields` one that knows sliders, but no tangent, where there are some.

    Raises
    ------
    ValueError
        If there is no solver of that name, or another argument is outside its range.
    """
    kind = SOLVERS[choice("solver", name, SOLVERS)]
    if yields and kind.follows_orbits and not CLOSING.of(structure):
        from hpcsweep.solvers.yielding_map import YieldingMap

        return YieldingMap(structure, omega, rtol)
    solver = kind.load()(structure, omega, rtol)
    if name == "flow" and not getattr(solver, "is_specialised", True):
        _load_march()
    return solver


@cache
def _load_march() -> None:
    """Load, once in a process, what motions of any structure call, and say what is compiled."""
    from hpcsweep.solvers.compiling import load_aloud
    from hpcsweep.solvers.flow.specialised import FOR_ANY, with_called

    load_aloud(with_called(FOR_ANY.march))


def loaded(structure: Structure, name: str = "flow", branches: bool = False) -> Structure:
    """Return a structure; load what its motions, or branches, call, and say what is compiled."""
    if name == "flow":
        from hpcsweep.solvers.compiling import load_aloud
        from hpcsweep.solvers.flow.specialised import branch_kernels, needed_kernels

        load_aloud((branch_kernels if branches else needed_kernels)(structure))
    return structure


def stroboscopic_points(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: np.ndarray,
    n_periods: int,
    solver: str = "flow",
    rtol: float = 1e-9,
) -> np.ndarray:
    """Return the stroboscopic points z(T), z(2T), ..., z(n_periods T).

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the ground acceleration A sin(Omega tau) (10).
    state : array_like, shape (2 n_floors,)
        (u, v) at tau = 0, in gaps and gaps omega_0; of L sliders the lasting elongations p behind.
    n_periods : int
    solver : {"flow", "bdf"}
    rtol : float
        Relative tolerance of the solver.

    Returns
    -------
    ndarray, shape (n_periods, 2 n_floors), of L sliders 2 n_floors + L

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails; the message names the outcome and the period.

    Examples
    --------
    At resonance the displacement without contact is A / (2 zeta) cos(tau): a fixed point.

    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> points = hpcsweep.stroboscopic_points(stop, 0.05, 1.0, [0.5, 0.0], n_periods=2)
    >>> points.round(12) + 0.0
    array([[0.5, 0. ],
           [0.5, 0. ]])
    """
    instance("structure", structure, Structure)
    z = finite_vector("state", state, structure.state_units.size)
    amplitude = finite("amplitude", amplitude)
    structure = structure.within_reach(amplitude, z)
    structure = structure.measured_at(forcing_frequency("omega", omega), amplitude)
    made = make_solver(solver, structure, omega, rtol, yields=True)
    points, outcome = made.points(z, amplitude, n_periods)
    if outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"{solver}: {outcome.name} in forcing period {len(points) + 1}")
    return points
