"""The equations of motion (19) and their Jacobian, compiled.

State z = (u_1..u_n, v_1..v_n), shape (2n,); units as in `hpcsweep.model.structure`.
"""

import math

from hpcsweep.kernels.compile import jit


@jit
def sigmoid(y):
    """Evaluate 1 / (1 + exp(-y)) without overflow (5).

    Parameters
    ----------
    y : float
        rho (u - 1); any finite value or an infinity.
    """
    if y >= 0.0:
        return 1.0 / (1.0 + math.exp(-y))
    e = math.exp(y)
    return e / (1.0 + e)


@jit
def switch(x, rho):
    """Evaluate the contact sigmoid at distance x = u - 1 past the stop, in [0, 1].

    ``rho = inf`` gives the unit step with value 1/2 at x = 0.
    """
    if rho == math.inf:
        if x > 0.0:
            return 1.0
        return 0.0 if x < 0.0 else 0.5
    return sigmoid(rho * x)


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
        x = z[i] - 1.0
        acceleration = -ground - beta * switch(x, rho) * x
        for j in range(n):
            acceleration -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        out[i] = z[n + i]
        out[n + i] = acceleration
    return out


@jit
def contact_stiffness(x, beta, rho):
    """Differentiate the contact force beta S(x) x with respect to x = u - 1.

    d/dx [x S] = S + rho x S (1 - S); at rho = inf the unit step.
    """
    s = switch(x, rho)
    if rho == math.inf:
        return beta * s
    return beta * s * (1.0 + rho * x * (1.0 - s))


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
        out[n + i, i] -= contact_stiffness(z[i] - 1.0, beta, rho)
    return out
