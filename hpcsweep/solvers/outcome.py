"""Outcome of a run."""

from enum import IntEnum


class Outcome(IntEnum):
    """Outcome of a run (one amplitude of one sweep); stored in the file as an integer."""

    NOT_COMPUTED = 0
    """No committed result (readers report it; no solver returns it)."""
    COMPLETE = 1
    """All periods requested were integrated or proved redundant."""
    NON_FINITE = 2
    """The state left the range of double precision."""
    STEP_LIMIT = 3
    """One forcing period needed more steps than the solver's limit."""
    SOLVER_FAILED = 4
    """The integrator gave up: its step became too small or its iteration diverged."""
    COLLAPSED = 5
    """A motion under a harmonic forcing has left the limits of a drift, and ended."""


COMPLETE = int(Outcome.COMPLETE)
NON_FINITE = int(Outcome.NON_FINITE)
STEP_LIMIT = int(Outcome.STEP_LIMIT)
SOLVER_FAILED = int(Outcome.SOLVER_FAILED)
COLLAPSED = int(Outcome.COLLAPSED)
"""The same as the kernels return them. A response to a record that has collapsed is complete."""

REMEDIES = {
    Outcome.NON_FINITE: "the motion left double precision: check structure and amplitude",
    Outcome.STEP_LIMIT: "a period needed too many steps: a larger solver.rtol, or the other "
    "solver.method",
    Outcome.SOLVER_FAILED: "the integrator gave up: a larger solver.rtol, or solver.method = "
    '"flow"',
    Outcome.COLLAPSED: "the structure has collapsed under this amplitude: no remedy is needed",
}
"""Remedies for failed runs; the rest of the job is valid without them."""
