"""Check the invariants that the numbers of every response to a record satisfy."""

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.variables import ALONE, PEAKS, TIMES
from hpcsweep.studies.invariants import listed, of_outcome

SIGNED = ("final_state", "impulse", "dissipated")
ROUNDING = 1.0 + 1e-9


def broken_invariants(rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
    """Check k runs against the invariants of their variables.

    Parameters
    ----------
    rows : dict of str to ndarray
        The file's variables, first axis the k runs.

    Returns
    -------
    list of (int, str)
        Row and message.
    """
    outcome, skip_rule = rows["outcome"], rows["skip_rule"]
    complete, linear = outcome == Outcome.COMPLETE, skip_rule == SkipRule.LINEAR
    broken = {
        **of_outcome(outcome),
        "skip_rule is none or linear": ~np.isin(skip_rule, (SkipRule.NONE, SkipRule.LINEAR)),
        "a linear run is complete": linear & ~complete,
    }
    for peak in (*PEAKS, *TIMES, *ALONE):
        name = peak.variable.name
        if name not in rows:
            continue
        values = rows[name]
        least = -np.inf if name in SIGNED else 0.0
        with np.errstate(invalid="ignore"):
            good = (np.isfinite(values) & (values >= least)).all(axis=1)
        broken[f"{name} is finite, and a size"] = complete & ~good
        if values.dtype.kind == "f" and peak not in ALONE:
            broken[f"{name} of a failed run is NaN"] = ~complete & ~np.isnan(values).all(axis=1)
    if "impacts" in rows:
        touched = (rows["impacts"] > 0).any(axis=1)
        broken["a linear run has no impacts"] = linear & touched
    end = np.abs(rows["final_state"][:, : rows["displacement"].shape[1]])
    last = rows["displacement"] * ROUNDING >= end
    broken["the last displacement is at most the largest"] = complete & ~last.all(axis=1)
    return listed(broken)
