"""Compiled equations of motion (19) of a structure with elastic contacts, and their Jacobian.

State z = (y_1..y_R, y_1'..y_R'), shape (2R,); rows and units as in `hpcsweep.model.kernel_model`.
"""

import math
from typing import Any

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile import jit
from hpcsweep.model.contact import contact_force, contact_stiffness
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure

MODEL = Arena(kernel_model(Structure(1), 1.0))
"""Models of any structure are passed packed (`MODEL.pack`): numba unpacks every array of a call,
which takes longer than the equations, and cannot be interrupted meanwhile."""
read_model: Any = MODEL.read


@jit
def right_hand_side(tau, z, amplitude, packed, out):
    """Evaluate z' of (19) into `out`.

    Parameters
    ----------
    tau : float
        Time.
    z, out : ndarray, shape (2R,)
        State and its derivative.
    amplitude : float
        A of the forcing (10).
    packed : ndarray of bytes
        A packed `Model`, which must be kept.
    """
    model = read_model(packed)
    n = model.stiffness.shape[0]
    contacts = model.contacts
    ground = 0.0
    for h in range(model.harmonics.shape[0]):
        order, size, phase = model.harmonics[h]
        ground += amplitude * size * math.sin(order * model.omega * tau + phase)
    for i in range(n):
        out[i] = z[n + i]
        out[n + i] = model.forcing[i] * ground
    for k in range(contacts.row.shape[0]):
        x = contacts.sign[k] * z[contacts.row[k]] - contacts.gap[k]
        force = contact_force(x, contacts.beta[k], model.rho)
        for p in range(contacts.first[k], contacts.first[k + 1]):
            out[n + contacts.push_row[p]] -= contacts.push[p] * force
    for i in range(n):
        acceleration = out[n + i]
        for j in range(n):
            acceleration -= model.stiffness[i, j] * z[j] + model.damping[i, j] * z[n + j]
        out[n + i] = acceleration


@jit
def jacobian(z, packed, out):
    """Evaluate dz'/dz of (19) into `out`, shape (2R, 2R). Arguments as `right_hand_side`."""
    model = read_model(packed)
    n = model.stiffness.shape[0]
    contacts = model.contacts
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
            out[i, n + j] = 0.0
            out[n + i, j] = -model.stiffness[i, j]
            out[n + i, n + j] = -model.damping[i, j]
        out[i, n + i] = 1.0
    for k in range(contacts.row.shape[0]):
        row = contacts.row[k]
        x = contacts.sign[k] * z[row] - contacts.gap[k]
        stiff = contacts.sign[k] * contact_stiffness(x, contacts.beta[k], model.rho)
        for p in range(contacts.first[k], contacts.first[k + 1]):
            out[n + contacts.push_row[p], row] -= contacts.push[p] * stiff


def derivative(tau: float, z: np.ndarray, amplitude: float, packed: Any) -> np.ndarray:
    """Return z', for integrators of Python; arguments as `right_hand_side`.

    The kernel returns nothing, because numba loses a Ctrl-C that arrives while it returns an array.
    """
    out = np.empty(z.size)
    right_hand_side(tau, z, amplitude, packed, out)
    return out


def jacobian_matrix(z: np.ndarray, packed: Any) -> np.ndarray:
    """Return dz'/dz; arguments as `derivative`."""
    out = np.empty((z.size, z.size))
    jacobian(z, packed, out)
    return out
