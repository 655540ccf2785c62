"""Sample a motion in continuous time: displacements, velocities, accelerations, forces."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hpcsweep.model.arguments import count
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.instants import accelerations
from hpcsweep.solvers.trajectory import MAX_SAMPLES, PeriodMap

if TYPE_CHECKING:
    import xarray


def trajectory(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    n_periods: int = 1,
    samples: int = 400,
) -> "xarray.Dataset":
    """Follow a motion and sample it evenly in time.

    By the exact flow, so that all samples are as exact as `stroboscopic_points`.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the forcing.
    state : array_like, shape (2 n_floors,)
        (u, v) at time 0; of L sliders the lasting elongations p behind.
    n_periods : int
        Forcing periods.
    samples : int
        Samples of each period, at least 2.

    Returns
    -------
    xarray.Dataset
        ``displacement``, ``velocity`` and ``acceleration`` (floor, time), relative to the ground;
        ``contact_force`` (contact, time), positive where a contact pushes; of sliders
        ``slider_force`` and ``lasting_elongation`` (slider, time). The unit of each is in its
        attribute ``units``.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If a solver fails.

    Examples
    --------
    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> motion = hpcsweep.trajectory(stop, 0.05, 1.0, state=[0.5, 0.0], samples=4)
    >>> motion.displacement.values.round(9) + 0.0  # cos(tau) / 2
    array([[ 0.5,  0. , -0.5,  0. ,  0.5]])
    """
    import xarray

    n_periods = count("n_periods", n_periods, 1)
    samples = count("samples", samples, 2, MAX_SAMPLES)
    path = PeriodMap(structure, amplitude, omega, state, samples).follow(n_periods)
    n, period = structure.n_floors, structure.forcing.period(omega)
    moving, plastic = np.split(path.states, [2 * n], axis=1)
    time = np.arange(len(moving)) * (period / samples)
    phase = np.arange(len(moving)) % samples * (2.0 * np.pi / samples)
    order, size, start = np.array(structure.forcing.terms).T
    ground = amplitude * np.sin(np.outer(phase, order) + start) @ size
    force = structure.contact_forces(moving)
    rate = accelerations(structure, moving, (force, path.slider_force), ground)

    rows = {
        "displacement": ("floor", moving[:, :n], "length", "displacement"),
        "velocity": ("floor", moving[:, n:], "velocity", "velocity"),
        "acceleration": ("floor", rate, "acceleration", "acceleration relative to the ground"),
        "contact_force": ("contact", force, "force", "contact force"),
    }
    contacts = [structure.contact_names[k] for k in structure.contact_numbers]
    named = {"floor": np.arange(1, n + 1), "contact": contacts}
    if plastic.size:
        rows["slider_force"] = ("slider", path.slider_force, "force", "slider force")
        rows["lasting_elongation"] = ("slider", plastic, "length", "lasting elongation")
        named["slider"] = list(structure.slider_names)

    def notes(kind: str, name: str) -> dict[str, str]:
        return {"units": unit_of(structure, kind), "long_name": name}

    return xarray.Dataset(
        {key: ((dim, "time"), values.T, notes(*of)) for key, (dim, values, *of) in rows.items()},
        coords={"time": ("time", time, notes("time", "time")), **named},
        attrs={"amplitude": float(amplitude), "omega": float(omega)},
    )
