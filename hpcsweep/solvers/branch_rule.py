"""Rules by which branches of periodic orbits are followed, compiled and in Python alike.

`hpcsweep.dynamics.continuation` has what they mean, in `cycle` those of Newton's method, in
`branch` those of steps; `hpcsweep.solvers.flow.orbit` is compiled by the same numbers.
"""

DIFFERENCE = 1e-8
"""Share of a parameter over which differences are taken for the slopes by it."""
STEPS = 12
CONTRACTS = 0.2
"""Factor by which moves must fall for the Jacobian to be kept."""
REACHED = 1e-8
"""Largest move before the last, and of the last: the remaining distance is then rounding."""
EXACT, ROUNDING = 1e-13, 1e-11
"""Moves with a kept Jacobian end at the first, or where they no longer fall and the last one that
did was at most the second: the map's own rounding, times the norm of the inverse, can be above the
first."""
MAX_PRODUCT = 1e6
"""Growth of errors of tangent maps up to which their product has its multipliers to 1e-10."""

ANGLE = 0.12
MAX_ANGLE = 0.5
ASTRAY = 0.5
GROWTH = 2.0
ON_DIVISOR = 1e-3
"""Share of its distance from an orbit of a period that divides its own, below which it is one."""
ON_A_STEP = 1e-8
"""Largest last move to an ordinary point of a branch: multipliers are accurate to about that."""
OF_A_STEP, MIN_MOVE = 0.01, 1e-10
"""The same as a share of the step, where that is less, and the least that is asked of it."""
CLOSED = 1e-3
"""Share of a step within which a closed branch comes back to its start."""
