r"""Storeys that yield, bilinear springs as an elastic spring and a slider, and their P-Delta.

A storey of height h carries the weight P of its floor and of all above. Where it drifts by d these
stand beside its foot: about that the moment P d acts, which a couple of horizontal forces P d / h,
h apart, replaces. So of the shear k d of the storey P d / h is spent on the weight, and

    K = sum_i (k_i - P_i / h_i) b_i b_i^T,      b_i . u = d_i,

of which the second term is the geometric stiffness of the storeys. It is linear in u and belongs to
the elastic spring: a storey yields at the drift at which it would without weights, and goes on with
alpha k - P / h, which may be negative.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hpcsweep.model.arguments import wrong
from hpcsweep.model.matrices import Slider


def storey_sliders(
    stiffness: Sequence[float], yield_force: Any, yield_drift: Any, hardening: Any
) -> tuple[Slider, ...]:
    """Return the sliders of the storeys that yield, named by the number of the storey.

    A storey of stiffness k keeps the elastic spring alpha k; the slider has the rest of k, and of
    the force at which the storey yields 1 - alpha.

    Parameters
    ----------
    stiffness : sequence of n floats
        Of the storeys, from the lowest on.
    yield_force, yield_drift, hardening
        Of `hpcsweep.model.structure.Structure`.

    Raises
    ------
    ValueError
        If they do not go together; the message names one.
    """
    n, by_force = len(stiffness), yield_force is not None
    if by_force and yield_drift is not None:
        raise wrong("yield_force", "and yield_drift must not be given both")
    shares = np.broadcast_to(hardening, n).tolist()
    if not by_force and yield_drift is None:
        if any(shares):
            raise wrong("hardening", "goes with yield_force or yield_drift")
        return ()
    forces = np.broadcast_to(yield_force if by_force else np.multiply(yield_drift, stiffness), n)
    steps = (np.eye(n) - np.eye(n, k=-1)).tolist()
    return tuple(
        Slider(tuple(steps[i]), (1.0 - share) * k, (1.0 - share) * force, str(i + 1))
        for i, (k, share, force) in enumerate(zip(stiffness, shares, forces.tolist(), strict=True))
        if force < math.inf
    )


def weight_stiffness(stiffness: Sequence[float], weight: Any, height: Any) -> np.ndarray:
    """Return P / h of each storey, see above, shape (n,).

    Parameters
    ----------
    stiffness : sequence of n floats
        Of the storeys without weights, from the lowest on.
    weight, height : float or sequence of n floats
        Of each floor and of each storey.

    Raises
    ------
    ValueError
        If one is missing, or a storey cannot carry what is above it.
    """
    n = len(stiffness)
    for name, value in (("weight", weight), ("storey_height", height)):
        if value is None:
            raise wrong(name, "is missing: p_delta needs it")
    loads = np.broadcast_to(weight, n)[::-1].cumsum()[::-1] / np.broadcast_to(height, n)
    for i, (k, load) in enumerate(zip(stiffness, loads.tolist(), strict=True), 1):
        if load >= k:
            limit = f"the weight above it over its height, {load:.4g}, must be below its stiffness"
            raise wrong("p_delta", f": storey {i} does not stand: {limit}, {k:.4g}")
    return loads
