"""The contact law: the stop, the sigmoid that switches it on, the layer in which it does."""

import math

NEGLIGIBLE_FORCE = 1e-13
"""Contact force (gaps omega_0^2) at the edge of the layer that is neglected outside it."""


def layer_half_width(beta: float, rho: float) -> float:
    """Choose the half-width of the contact layer, in gaps.

    Outside it the neglected force r = beta/rho y exp(-y), y = rho |u - 1|, is below
    `NEGLIGIBLE_FORCE`.
    """
    if rho == math.inf or beta == 0.0:
        return 0.0
    if rho == 0.0:
        return math.inf
    y = 20.0
    for _ in range(50):
        y = max(20.0, math.log(beta / rho * y / NEGLIGIBLE_FORCE))
    return y / rho
