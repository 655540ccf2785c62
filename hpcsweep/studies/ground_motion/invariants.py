"""Check the invariants that the numbers of every response to a record satisfy."""

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.invariants import Rows, listed, of_each

ROUNDING = 1.0 + 1e-9


def broken_invariants(study: Records, rows: Rows) -> list[tuple[int, str]]:
    """Check k runs against the invariants of their variables.

    Parameters
    ----------
    study : Records
    rows : dict of str to ndarray
        The file's variables, first axis the k runs.

    Returns
    -------
    list of (int, str)
        Row and message.
    """
    complete, skip_rule = rows["outcome"] == Outcome.COMPLETE, rows["skip_rule"]
    linear = skip_rule == SkipRule.LINEAR
    broken = {
        **of_each(study.variables, rows, study.structure, {}),
        "skip_rule is none or linear": ~np.isin(skip_rule, (SkipRule.NONE, SkipRule.LINEAR)),
        "a linear run is complete": linear & ~complete,
    }
    if "impacts" in rows:
        touched = (rows["impacts"] > 0).any(axis=1)
        broken["a linear run has no impacts"] = linear & touched
    end = np.abs(rows["final_state"][:, : rows["displacement"].shape[1]])
    last = rows["displacement"] * ROUNDING >= end
    broken["the last displacement is at most the largest"] = complete & ~last.all(axis=1)
    return listed(broken)
