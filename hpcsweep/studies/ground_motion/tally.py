"""Count over the runs of a study of records, for its summary."""

from typing import Any

from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.keys import RecordGrid
from hpcsweep.studies.ground_motion.variables import PEAKS
from hpcsweep.studies.study import Study, as_kind
from hpcsweep.studies.tally import BaseTally, share


class ResponseTally(BaseTally):
    """Tally of runs, record by record."""

    measures = tuple(peak.variable.name for peak in PEAKS[:7])
    placed_by = ("record", "scale", "part")

    def add(self, frame, study: Study) -> None:
        """Count the runs of one record; see `BaseTally.add`."""
        super().add(frame, study)
        outcome, rule = frame["outcome"].values[0], frame["skip_rule"].values[0]
        linear = (outcome > 0) & (rule == SkipRule.LINEAR)
        self.counts["all"]["linear"] += int(linear.sum())
        if "impacts" in frame:
            self.counts["all"]["touching"] += int(
                (frame["impacts"].values[0] > 0).any(axis=-1).sum()
            )
        name = str(frame["record"].values[0])
        responses = as_kind(study, RecordGrid).responses
        own = hash(responses.computed)
        for factor in frame["factor"].values[0][(outcome > 0) & ~linear].tolist():
            self.counts["ratios"][own, name, responses.ratio(factor)] += 1

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        done, sizes = self.done, self._study.dimensions
        linear, touching = (self.counts["all"][name] for name in ("linear", "touching"))
        different, counts = len(self.counts["ratios"]), super().summary()
        del counts["periods_per_run"]
        return counts | {
            "records": sizes["record"],
            "scales": sizes["scale"],
            "measure": self._study.coordinates["scale"].long_name,
            "below_contact": share(linear, done),
            "equal_ratio": share(done - linear - different, done),
            "with_contact": share(touching, done),
        }
