"""Count over the runs of a study of records, for its summary."""

from typing import Any

import numpy as np

from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.variables import PEAKS
from hpcsweep.studies.tally import failures, share

LARGEST = [peak.variable for peak in PEAKS[:7]]


class ResponseTally:
    """Tally of runs, record by record."""

    def __init__(self, study):
        self._study = study
        self.outcomes = np.zeros(len(Outcome), int)
        self.linear = self.touching = 0
        self.ratios: set[tuple] = set()
        self.largest: dict[str, dict] = {}

    @property
    def done(self) -> int:
        """Number of computed runs."""
        return int(self.outcomes[Outcome.COMPLETE :].sum())

    def add(self, frame, study) -> None:
        """Count the runs of one record, an xarray.Dataset, of a study or of a part of it."""
        outcome, rule = frame["outcome"].values[0], frame["skip_rule"].values[0]
        self.outcomes += np.bincount(outcome, minlength=self.outcomes.size)
        linear = (outcome > 0) & (rule == SkipRule.LINEAR)
        self.linear += int(linear.sum())
        if "impacts" in frame:
            self.touching += int((frame["impacts"].values[0] > 0).any(axis=-1).sum())
        name = str(frame["record"].values[0])
        own = hash(study.responses.computed)
        for factor in frame["factor"].values[0][(outcome > 0) & ~linear].tolist():
            self.ratios.add((own, name, study.responses.ratio(factor)))
        for variable in LARGEST:
            if variable.name in frame:
                self._largest(frame[variable.name].isel(record=0), variable, frame.attrs["part"])

    def _largest(self, array, variable, part: str) -> None:
        values = array.values
        if not np.isfinite(values).any():
            return
        place = np.unravel_index(int(np.nanargmax(values)), values.shape)
        at = array.isel(dict(zip(array.dims, place, strict=True)))
        if float(at) > self.largest.get(variable.name, {"value": -np.inf})["value"]:
            self.largest[variable.name] = {
                "value": float(at),
                "units": unit_of(self._study.structure, variable.units),
                "of": str(at[array.dims[-1]].item()),
                "record": str(at["record"].item()),
                "scale": float(at["scale"]),
                "part": part,
            }

    def summary(self) -> dict[str, Any]:
        """Return the counts: numbers, strings, lists and dicts."""
        done = self.done
        computed = done - self.linear
        return {
            "records": self._study.dimensions["record"],
            "scales": self._study.dimensions["scale"],
            "measure": self._study.coordinates["scale"].long_name,
            "below_contact": share(self.linear, done),
            "equal_ratio": share(computed - len(self.ratios), done),
            "with_contact": share(self.touching, done),
            "largest": self.largest,
            "failures": failures(self.outcomes),
        }
