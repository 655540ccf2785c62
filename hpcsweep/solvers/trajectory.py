"""Motion in continuous time between stroboscopic points, for portraits and inspection."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hpcsweep.model.arguments import count, finite, finite_vector, forcing_frequency, instance
from hpcsweep.model.equations import MODEL, derivative
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import solver_arguments

RTOL, ATOL = 1e-12, 1e-14
MAX_STEP = 1 / 64
"""In forcing periods: a grazing contact, which takes a few hundredths of one, is not stepped
over."""
MAX_SAMPLES = 10**7
SHORTEST = 1e-4
"""In forcing periods: interval at which distances from contacts are tested."""


def trajectory(
    structure: Structure, amplitude: float, omega: float, state: np.ndarray, n_samples: int = 800
) -> np.ndarray:
    """Integrate one forcing period and sample it evenly in time.

    With scipy's DOP853: a few milliseconds a period, for pictures, not for sweeps.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
    state : ndarray, shape (2n,)
        At tau = 0.
    n_samples : int
        At least 2; the first is at tau = 0, the last at tau = T.

    Returns
    -------
    ndarray, shape (n_samples, 2n)

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the integrator gives up.
    """
    n_samples = count("n_samples", n_samples, 2, MAX_SAMPLES)
    done, units, period = _one_period(structure, amplitude, omega, state)
    return units.out_of(done.sol(np.linspace(0.0, period, n_samples)).T)


class Crossing(NamedTuple):
    """A contact that closes or opens."""

    contact: int
    """Number of the contact, from 1."""
    closes: bool
    phase: float
    """Share of the forcing period."""


def crossings(
    structure: Structure, amplitude: float, omega: float, state: np.ndarray
) -> list[Crossing]:
    """Return the contacts that close and open in one forcing period, in order of time.

    Parameters, errors and method as in `trajectory`. A contact shorter than `SHORTEST` forcing
    periods may be missed.
    """
    done, units, period = _one_period(structure, amplitude, omega, state)
    times = np.linspace(0.0, period, round(1 / SHORTEST) + 1)
    n, found = structure.n_floors, []
    gaps = [contact.gap for contact in structure.contacts]
    for number, row, gap in zip(structure.contact_numbers, structure.directions, gaps, strict=True):

        def distance(time, row=row, gap=gap):
            return units.out_of(done.sol(time).T)[..., :n] @ row - gap

        beyond = distance(times) >= 0.0
        for at in np.flatnonzero(beyond[1:] != beyond[:-1]).tolist():
            time = brentq(distance, times[at], times[at + 1], xtol=1e-14 * period)
            found.append(Crossing(number, bool(beyond[at + 1]), time / period))
    return sorted(found, key=lambda one: one.phase)


def _one_period(structure: Structure, amplitude: float, omega: float, state: np.ndarray):
    """Integrate one forcing period; return scipy's solution, its units and the period."""
    instance("structure", structure, Structure)
    amplitude, omega = finite("amplitude", amplitude), forcing_frequency("omega", omega)
    solver_arguments(structure, omega, RTOL)
    z = finite_vector("state", state, 2 * structure.n_floors)
    structure = structure.measured_at(omega, amplitude)
    model = kernel_model(structure, omega)
    packed, units = MODEL.pack(model), Units(structure, model)
    size = amplitude / units.amplitude_unit

    def motion(tau, z):
        return derivative(tau, z, size, packed)

    done = solve_ivp(
        motion,
        (0.0, model.period),
        units.into(z),
        method="DOP853",
        dense_output=True,
        rtol=RTOL,
        atol=ATOL,
        max_step=MAX_STEP * model.period,
    )
    if not done.success:
        raise ArithmeticError(f"DOP853: {done.message}")
    return done, units, model.period
