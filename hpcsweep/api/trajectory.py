"""Sample a motion in continuous time: displacements, velocities, accelerations, forces."""

from typing import Any

import numpy as np

from hpcsweep.model.arguments import count, finite_vector
from hpcsweep.model.equations import MODEL, derivative
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import without_sliders
from hpcsweep.solvers.solver import stroboscopic_points
from hpcsweep.solvers.trajectory import MAX_SAMPLES
from hpcsweep.solvers.trajectory import trajectory as one_period


def trajectory(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    n_periods: int = 1,
    samples: int = 400,
):
    """Follow a motion and sample it evenly in time.

    Each forcing period starts from the exact stroboscopic point, so that errors do not accumulate,
    and is integrated by scipy's DOP853 to 1e-9: for inspection and pictures, not for sweeps.

    Parameters
    ----------
    structure : Structure
        Without sliders.
    amplitude, omega : float
        A and Omega of the forcing.
    state : array_like, shape (2 n_floors,)
        (u, v) at time 0.
    n_periods : int
        Forcing periods.
    samples : int
        Samples of each period, at least 2.

    Returns
    -------
    xarray.Dataset
        ``displacement``, ``velocity`` and ``acceleration`` (floor, time), relative to the ground;
        ``contact_force`` (contact, time), positive where a contact pushes. The unit of each is in
        its attribute ``units``.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If a solver fails.

    References
    ----------
    Hairer, Norsett and Wanner, *Solving Ordinary Differential Equations I*, II.5.

    Examples
    --------
    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> motion = hpcsweep.trajectory(stop, 0.05, 1.0, state=[0.5, 0.0], samples=4)
    >>> motion.displacement.values.round(9) + 0.0  # cos(tau) / 2
    array([[ 0.5,  0. , -0.5,  0. ,  0.5]])
    """
    import xarray

    without_sliders(structure)
    n_periods = count("n_periods", n_periods, 1)
    samples = count("samples", samples, 2, MAX_SAMPLES)
    n = structure.n_floors
    start = finite_vector("state", state, 2 * n)
    points = [start]
    if n_periods > 1:
        points += [*stroboscopic_points(structure, amplitude, omega, start, n_periods - 1)]
    parts = [one_period(structure, amplitude, omega, z, samples + 1) for z in points]
    states = np.concatenate([*(part[:-1] for part in parts), parts[-1][-1:]])
    period = structure.forcing.period(omega)
    time = np.arange(len(states)) * (period / samples)
    within = np.arange(len(states)) % samples * (period / samples)

    def quantity(dims, values, kind: str, name: str):
        return dims, values, {"units": unit_of(structure, kind), "long_name": name}

    return xarray.Dataset(
        {
            "displacement": quantity(("floor", "time"), states[:, :n].T, "length", "displacement"),
            "velocity": quantity(("floor", "time"), states[:, n:].T, "velocity", "velocity"),
            "acceleration": quantity(
                ("floor", "time"),
                _accelerations(structure, amplitude, omega, within, states),
                "acceleration",
                "acceleration relative to the ground",
            ),
            "contact_force": quantity(
                ("contact", "time"), structure.contact_forces(states).T, "force", "contact force"
            ),
        },
        coords={
            "time": quantity("time", time, "time", "time"),
            "floor": np.arange(1, n + 1),
            "contact": [structure.contact_names[k] for k in structure.contact_numbers],
        },
        attrs={"amplitude": float(amplitude), "omega": float(omega)},
    )


def _accelerations(structure: Structure, amplitude, omega, times, states) -> np.ndarray:
    """Evaluate u'' at states, shape (n, k)."""
    model = kernel_model(structure, omega)
    packed, units = MODEL.pack(model), Units(structure, model)
    rate, n = structure.frequency_unit, structure.n_floors
    size = amplitude / units.amplitude_unit
    found = np.empty((n, len(states)))
    for k, (time, z) in enumerate(zip(times, states, strict=True)):
        rates = derivative(time * rate, units.into(z), size, packed)
        half = rates.size // 2
        found[:, k] = rates[half : half + n] * units.amplitude_unit
    return found
