"""One stored response to a record computed again: plainly, without the rules that spare work.

The whole response of the structure as the job gives it is computed at the scale of the run. How far
two ways may differ is measured: by how much the peaks change where the scale changes a little, over
that change. The record may not be at hand where a file is examined; then nothing is compared.
"""

import math

import numpy as np

from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.blocks import Block, Rows
from hpcsweep.studies.ground_motion.keys import RecordGrid
from hpcsweep.studies.ground_motion.responses import respond
from hpcsweep.studies.ground_motion.variables import peaks_of
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.study import RunAgain
from hpcsweep.studies.variable import Variable

NUDGE = 1e-9
"""Relative change of the scale by which the conditioning of a response is measured."""
ROUNDING = 1e-12
"""Relative difference of two ways where the conditioning is 1."""
COMPARED = ("length", "acceleration", "force", "impulse")
"""Quantities of the peaks that are compared."""
TOGETHER = {"residual_drift": "storey_drift"}
"""Peaks that are compared with the size of another: where a storey does not yield they are 0, to
rounding of that."""


def response_again(study: RecordGrid, block: Block, row: int, run: Rows) -> RunAgain:
    """Compute one complete response again.

    Parameters
    ----------
    study : RecordGrid
    block : Block
    row : int
        Of the block.
    run : dict of str to ndarray
        The run's variables.
    """
    record, at = block.run(row)
    factor = float(study.factor[record, at])
    again = RunAgain(at=run_name(study.describe((record, at))), solver=study.settings.solver)
    try:
        samples = study.record(record)
    except ValueError as error:
        again.compared = f"nothing: the record is not at hand: {error}"
        return again
    structure, tail = study.structure, study.tail
    peaks, _ = peaks_of(structure, study.settings)
    kinds: dict[str, list[Variable]] = {}
    for peak in peaks:
        if peak.units in COMPARED:
            kinds.setdefault(TOGETHER.get(peak.name, peak.name), []).append(peak)
    peaks_of_each = []
    for scale in (factor, factor * (1.0 + NUDGE)):
        response = respond(structure, samples, scale, tail, study.settings)
        if response.outcome is not Outcome.COMPLETE:
            again.problem = f"computed again it ends with {response.outcome.name}"
            return again
        peaks_of_each.append(
            [np.concatenate([p.of(response) for p in kind]) for kind in kinds.values()]
        )
    stored = [np.concatenate([run[p.name] for p in kind]) for kind in kinds.values()]
    again.compared = "peaks, computed plainly"
    again.difference = _apart(stored, peaks_of_each[0])
    again.allowed = ROUNDING * max(_apart(*peaks_of_each) / NUDGE, 1.0)
    if not again.difference <= again.allowed:
        again.problem = (
            f"computed plainly its peaks differ by {again.difference:.2g} of the largest, allowed "
            f"are {again.allowed:.2g}"
        )
    result = study.compute_run(block, row, study.initial_state)
    equal = all(result[name][0].tobytes() == run[name].tobytes() for name in run)
    again.whole_run = "equal" if equal else "same" if not again.problem else "other"
    return again


def _apart(left: list[np.ndarray], right: list[np.ndarray]) -> float:
    """Return the largest difference of two sets of peaks, each over the largest of its kind."""
    worst = 0.0
    for a, b in zip(left, right, strict=True):
        size = max(float(np.abs(b).max(initial=0.0)), float(np.abs(a).max(initial=0.0)))
        far = float(np.abs(a - b).max(initial=0.0))
        worst = max(worst, far / size if size > 0 else 0.0)
    return worst if math.isfinite(worst) else math.inf
