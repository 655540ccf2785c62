"""Describe the records of a study, before anything is computed, and count over its runs after."""

import math
from collections.abc import Iterator
from typing import Any

from hpcsweep.earthquakes.intensity import spectral_acceleration
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.keys import RecordGrid
from hpcsweep.studies.ground_motion.variables import PEAKS
from hpcsweep.studies.study import Study, as_kind
from hpcsweep.studies.tally import BaseTally, share

MOST = 60
"""Records that are listed."""
STRONG, WEAK = 3.0, 1e-3
"""Peak accelerations in g beyond which a record's unit looks wrong: the strongest that was ever
recorded is 4 g."""
FAR = 0.3
"""Peak ground displacement in PGV x duration beyond which a baseline drifts."""


def lines(study: RecordGrid) -> Iterator[str]:
    """List scales and records, a line each, warnings last."""
    structure, measure, scale = study.structure, study.measure, study.scale

    def named(quantity: str) -> str:
        return unit_of(structure, quantity)

    unit = "" if measure.quantity == "1" else f" {named(measure.quantity)}"
    low, high = study.factor.min(), study.factor.max()
    yield (
        f"scales:     {scale.size} of {measure}, {scale[0]:.6g} to {scale[-1]:.6g}{unit}; records "
        f"are multiplied by {low:.4g} to {high:.4g}"
    )
    period = 2.0 * math.pi / float(structure.frequencies[0])
    yield (
        f"records:    PGA in g of {study.gravity:g} {named('acceleration')}, PGV in "
        f"{named('velocity')}, PGD in {named('length')}, significant duration in {named('time')}, "
        f"Sa({period:.4g}; 5 %) in g"
    )
    width = max(len(one.name) for one in study.suite)
    for i, one in enumerate(study.suite[:MOST]):
        spectral = _spectral(study, i, period)
        yield (
            f"  {one.name:{width}}  PGA {one.pga / study.gravity:7.4f}  PGV {one.pgv:9.4g}  PGD "
            f"{one.pgd:9.4g}  duration {one.duration:7.3g}  Sa {spectral}  "
            f"{one.samples} samples of {one.dt:g}"
        )
    if len(study.suite) > MOST:
        yield f"  and {len(study.suite) - MOST} more"


def _spectral(study: RecordGrid, i: int, period: float) -> str:
    """Return Sa(T_1) in g of an available record."""
    try:
        return f"{spectral_acceleration(study.record(i), period) / study.gravity:7.4f}"
    except (ValueError, OSError):
        return "not known: the record is not there, or T is too short"


def warnings(study: RecordGrid) -> Iterator[str]:
    """Return one line for each thing that looks like a mistake."""
    for one in study.suite[:MOST]:
        pga = one.pga / study.gravity
        if not WEAK <= pga <= STRONG:
            yield f"{one.name} has a PGA of {pga:.3g} g: is its unit right?"
        if one.pgd > FAR * one.pgv * one.samples * one.dt:
            yield f"{one.name}: the ground is displaced by {one.pgd:.3g}: its baseline drifts"


class ResponseTally(BaseTally):
    """Tally of runs, record by record."""

    measures = (*(one.variable.name for one in PEAKS[:7]), "ductility", "excursions", "base_shear")
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
        if "collapsed" in frame:
            self.counts["all"]["collapsed"] += int(frame["collapsed"].values[0].sum())
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
        if (collapsed := self.counts["all"].get("collapsed")) is not None:
            counts["collapsed"] = share(collapsed, done)
        return counts | {
            "records": sizes["record"],
            "scales": sizes["scale"],
            "measure": self._study.coordinates["scale"].long_name,
            "below_contact": share(linear, done),
            "equal_ratio": share(done - linear - different, done),
            "with_contact": share(touching, done),
        }
