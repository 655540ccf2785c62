"""All Lyapunov exponents of the motion that a state goes to."""

from typing import Any

from hpcsweep.dynamics.classify_motion import classify_motion
from hpcsweep.dynamics.lyapunov import LyapunovSpectrum, spectrum_of_motion, spectrum_of_orbit
from hpcsweep.model import arguments
from hpcsweep.model.confinement import demand_confined
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import TANGENTS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.solver import SOLVERS, loaded, make_solver
from hpcsweep.studies.settings import MAX_CYCLES, SPECTRUM_CYCLES, SPECTRUM_ERROR, SweepSettings


def lyapunov_spectrum(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    *,
    error: float = SPECTRUM_ERROR.default,
    max_cycles: int = SPECTRUM_CYCLES.default,
    classify_cycles: int = 50_000,
    solver: str = "flow",
    rtol: float | None = None,
) -> LyapunovSpectrum:
    """Return all Lyapunov exponents of the motion that a state goes to, with their errors.

    The motion is classified first, so that no transient counts, as far as `classify_cycles` tell.
    Exponents of an orbit follow from its multipliers; of other motions periods are added until all
    errors are small enough.

    Parameters
    ----------
    structure : Structure
        Without sliders: the tangent maps of their motions are differences.
    amplitude, omega : float
        A and Omega of the ground acceleration A sin(Omega tau) (10).
    state : array_like, shape (2 n_floors,)
        (u, v) at tau = 0, in gaps and gaps omega_0.
    error : float
        Requested half length of the 95 % confidence interval of each exponent, per unit of time.
    max_cycles : int
        Most forcing periods to average over, 20 or more; `errors` then tell what was reached.
    classify_cycles : int
        Forcing periods after which a motion is left undecided; 0: averages begin at `state`.
    solver : {"flow", "bdf"}
    rtol : float, optional
        Relative tolerance of the solver; default the solver's own.

    Returns
    -------
    LyapunovSpectrum
        ``exponents`` and ``errors``, shape (2 n_floors,), per unit of time, largest first;
        ``dimension``, the Kaplan-Yorke dimension of the stroboscopic points, (mean, low, high);
        ``n_periods`` averaged over, 0 for an orbit.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails.

    References
    ----------
    Benettin, Galgani, Giorgilli and Strelcyn, Meccanica 15 (1980) 9. Kaplan and Yorke, Lecture
    Notes in Mathematics 730 (1979) 204.

    Examples
    --------
    Without contact both exponents are those of free decay, -zeta omega_0:

    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> found = hpcsweep.lyapunov_spectrum(stop, 0.05, 1.0, [0.5, 0.0])
    >>> found.exponents.round(12)
    array([-0.05, -0.05])
    >>> found.dimension.mean
    0.0
    """
    TANGENTS.demand(structure)
    z = arguments.finite_vector("state", state, structure.state_units.size)
    amplitude = arguments.finite("amplitude", amplitude)
    demand_confined(structure, amplitude)
    omega = arguments.forcing_frequency("omega", omega)
    error, name = arguments.positive("error", error), arguments.choice("solver", solver, SOLVERS)
    max_cycles = arguments.count("max_cycles", max_cycles, SPECTRUM_CYCLES.limits[0], MAX_CYCLES)
    classify_cycles = arguments.count("classify_cycles", classify_cycles, 0, MAX_CYCLES)
    moving = loaded(structure.within_reach(amplitude, z), name)
    tolerance = SOLVERS[name].rtol if rtol is None else rtol
    made = make_solver(name, moving.measured_at(omega, amplitude), omega, tolerance)
    motion = classify_motion(made, z, amplitude, SweepSettings(), classify_cycles)
    if motion.outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"{name}: {motion.outcome.name} in forcing period {motion.cycles}")
    if motion.period:
        return spectrum_of_orbit(made, motion.points, amplitude)
    return spectrum_of_motion(made, motion.points[-1], amplitude, error, max_cycles)
