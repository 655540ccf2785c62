"""Motion in continuous time between stroboscopic points, for portraits and for inspection."""

import numpy as np
from scipy.integrate import solve_ivp

from hpcsweep.model.arguments import count, finite, finite_vector, instance, positive
from hpcsweep.model.equations import MODEL, derivative
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units

RTOL, ATOL = 1e-12, 1e-14
LARGEST_STEP = 1 / 64
"""In forcing periods: a grazing contact, which takes a few hundredths of one, is not stepped
over."""
MAX_SAMPLES = 10**7


def trajectory(
    structure: Structure, amplitude: float, omega: float, state: np.ndarray, n_samples: int = 800
) -> np.ndarray:
    """Integrate one forcing period and sample it evenly in time.

    With scipy's DOP853: a few milliseconds a period, so it is for pictures, not for sweeps.

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
    instance("structure", structure, Structure)
    amplitude, omega = finite("amplitude", amplitude), positive("omega", omega)
    z = finite_vector("state", state, 2 * structure.n_floors)
    n_samples = count("n_samples", n_samples, 2, MAX_SAMPLES)
    structure = structure.measured_at(omega, amplitude)
    model = kernel_model(structure, omega)
    packed, frame = MODEL.pack(model), Units(structure, model)
    size = amplitude / frame.amplitude_unit

    def motion(tau, z):
        return derivative(tau, z, size, packed)

    done = solve_ivp(
        motion,
        (0.0, model.period),
        frame.into(z),
        method="DOP853",
        t_eval=np.linspace(0.0, model.period, n_samples),
        rtol=RTOL,
        atol=ATOL,
        max_step=LARGEST_STEP * model.period,
    )
    if not done.success:
        raise ArithmeticError(f"DOP853: {done.message}")
    return frame.out_of(done.y.T)
