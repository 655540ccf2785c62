"""Count over the runs of a study of records, for its summary."""

from typing import TYPE_CHECKING, Any, cast

from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.variables import PEAKS
from hpcsweep.studies.study import Study
from hpcsweep.studies.tally import BaseTally, share

if TYPE_CHECKING:
    from hpcsweep.studies.ground_motion.records import Records


class ResponseTally(BaseTally):
    """Tally of runs, record by record."""

    measures = tuple(peak.variable.name for peak in PEAKS[:7])

    def __init__(self, study: Study):
        super().__init__(study)
        self.linear = self.touching = 0
        self.ratios: set[tuple] = set()

    def add(self, frame, study: Study) -> None:
        """Count the runs of one record; see `BaseTally.add`."""
        super().add(frame, study)
        outcome, rule = frame["outcome"].values[0], frame["skip_rule"].values[0]
        linear = (outcome > 0) & (rule == SkipRule.LINEAR)
        self.linear += int(linear.sum())
        if "impacts" in frame:
            self.touching += int((frame["impacts"].values[0] > 0).any(axis=-1).sum())
        name = str(frame["record"].values[0])
        responses = cast("Records", study).responses
        own = hash(responses.computed)
        for factor in frame["factor"].values[0][(outcome > 0) & ~linear].tolist():
            self.ratios.add((own, name, responses.ratio(factor)))

    def _place(self, at, study: Study, part: str) -> dict[str, Any]:
        """Return the place of a value of a frame."""
        del study
        return {"record": str(at["record"].item()), "scale": float(at["scale"]), "part": part}

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        done, sizes = self.done, self._study.dimensions
        computed, counts = done - self.linear, super().summary()
        del counts["periods_per_run"]
        return counts | {
            "records": sizes["record"],
            "scales": sizes["scale"],
            "measure": self._study.coordinates["scale"].long_name,
            "below_contact": share(self.linear, done),
            "equal_ratio": share(computed - len(self.ratios), done),
            "with_contact": share(self.touching, done),
        }
