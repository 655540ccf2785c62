"""The equations of motion (19) and their Jacobian, compiled.

State z = (u_1..u_n, v_1..v_n), shape (2n,); units as in `hpcsweep.model.structure`.
"""

import math

from hpcsweep.kernels.compile import jit
from hpcsweep.model.contact import STOP, contact_force, contact_stiffness


@jit
def right_hand_side(tau, z, amplitude, omega, beta, rho, stiffness, damping, out):
    """Evaluate z' of (19) into `out`.

    Parameters
    ----------
    tau : float
        Time.
    z, out : ndarray, shape (2n,)
        State and its derivative.
    amplitude, omega : float
        A and Omega of the ground acceleration A sin(Omega tau) (10).
    beta, rho : float
        Contact stiffness ratio and sharpness of the sigmoid.
    stiffness, damping : ndarray, shape (n, n)
        K of (3) and 2 gamma C of (8).
    """
    n = stiffness.shape[0]
    ground = amplitude * math.sin(omega * tau)
    for i in range(n):
        acceleration = -ground - contact_force(z[i] - STOP, beta, rho)
        for j in range(n):
            acceleration -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        out[i] = z[n + i]
        out[n + i] = acceleration
    return out


@jit
def jacobian(z, beta, rho, stiffness, damping, out):
    """Evaluate dz'/dz of (19) into `out`, shape (2n, 2n). Arguments as `right_hand_side`."""
    n = stiffness.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
            out[i, n + j] = 0.0
            out[n + i, j] = -stiffness[i, j]
            out[n + i, n + j] = -damping[i, j]
        out[i, n + i] = 1.0
        out[n + i, i] -= contact_stiffness(z[i] - STOP, beta, rho)
    return out
