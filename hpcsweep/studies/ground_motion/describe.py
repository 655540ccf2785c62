"""Describe the records of a study, before anything is computed, and count over its runs after."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from hpcsweep.earthquakes.intensity import OWN_PERIOD
from hpcsweep.earthquakes.spectrum import spectrum
from hpcsweep.earthquakes.units import seconds_in
from hpcsweep.model.isolation import isolated_period
from hpcsweep.model.plausibility import implausible, told
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import known_unit, unit_of
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.ground_motion.keys import RecordGrid
from hpcsweep.studies.study import Lines, Study, as_kind
from hpcsweep.studies.tally import BaseTally, share
from hpcsweep.studies.variables import percent_of_height

MOST = 60
"""Records that are listed."""
STRONG, WEAK = 3.0, 1e-3
"""Peak accelerations in g beyond which a record's unit looks wrong: the strongest that was ever
recorded is 4 g."""
SCALED = 10.0
"""Factor beyond which a record is not like a stronger one any more."""
MOST_EQUAL = 5
"""Names of equal records that are listed."""
YIELDS = 0.5
"""Drift ratio in percent from which on frames of reinforced concrete begin to yield."""
FAR = 0.7
"""Peak ground displacement in PGV x significant duration beyond which a baseline drifts: recorded
motions reach 0.09, synthetic ones of 3 s 0.55, El Centro cut off before 180 s of zeros 2.9."""


def lines(study: RecordGrid) -> Lines:
    """Tell the scales and the records."""
    (scale, unit), named = study.intensities(study.scale), partial(unit_of, study.structure)
    unit = "" if unit == "1" else f" {unit}"
    yield (
        "scales",
        f"{scale.size} of {study.measure}, {scale[0]:.6g} to {scale[-1]:.6g}{unit}; records are "
        f"multiplied by {study.factor.min():.4g} to {study.factor.max():.4g}",
    )
    yield from (("building", text) for text in told(study.structure, study.gravity))
    period = study.structure.longest_period
    yield (
        "records",
        f"PGA in g of {study.gravity:g} {named('acceleration')}, PGV in {named('velocity')}, "
        f"PGD in {named('length')}, significant duration in {named('time')}"
        + f", Sa({period:.4g}; 5 %) in g"
        * math.isfinite(period),
    )
    width = max(len(facts.name) for facts in study.suite)
    for i, facts in enumerate(study.suite[:MOST]):
        yield (
            "",
            f"{facts.name:{width}}  PGA {facts.pga / study.gravity:7.4f}  PGV {facts.pgv:9.4g}  "
            f"PGD {facts.pgd:9.4g}  duration {facts.duration:7.3g}  "
            f"{_spectral(study, i, period)}{facts.samples} samples of {facts.dt:g}",
        )
    if len(study.suite) > MOST:
        yield "", f"and {len(study.suite) - MOST} more"


def _spectral(study: RecordGrid, i: int, period: float) -> str:
    """Return Sa(T_1) in g of an available record, if any mode vibrates."""
    if math.isinf(period):
        return ""
    try:
        (sa,) = spectrum(study.record(i), [period]).acceleration / study.gravity
        return f"Sa {sa:7.4f}  "
    except ValueError:
        return "Sa not known: the record is not there, or T is too short  "


def warnings(study: RecordGrid) -> Iterator[str]:
    """Return one line for each thing that looks like a mistake."""
    structure = study.structure
    yield from implausible(structure, seconds_in(structure.unit_names.time or "s"))
    sliding = isolated_period(structure)
    if sliding is not None and OWN_PERIOD in study.measure.periods:
        unit = known_unit(structure, "time")
        yield (
            f"records are scaled by Sa at T1 = {structure.longest_period:.4g}{unit}, the period "
            f"of stuck bearings; while they slide it is {sliding:.4g}{unit}: "
            'records.scale.period = "isolated"?'
        )
    for facts in study.suite[:MOST]:
        pga = facts.pga / study.gravity
        if not WEAK <= pga <= STRONG:
            yield f"{facts.name} has a PGA of {pga:.3g} g: is its unit right?"
        if facts.pgd > FAR * facts.pgv * facts.duration:
            moved = f"{facts.pgd:.3g}{known_unit(study.structure, 'length')}"
            yield f"{facts.name}: the ground is displaced by {moved}: its baseline drifts"
    equal: dict[str, list[str]] = {}
    for facts in study.suite:
        equal.setdefault(facts.digest, []).append(facts.name)
    for names in equal.values():
        if len(names) > 1:
            more = ", ..." * (len(names) > MOST_EQUAL)
            yield f"{len(names)} records are equal: {', '.join(names[:MOST_EQUAL])}{more}"
    if (factor := study.factor.max(axis=1)).max() > SCALED:
        yield (
            f"{(factor > SCALED).sum()} of {len(study.suite)} records are multiplied by more than "
            f"{SCALED:g}, by up to {factor.max():.3g}: stronger records would be better"
        )


def elastic_drift(results, structure: Structure) -> float:
    """Return the largest drift ratio of storeys without a slider, in percent; 0: not known."""
    percent = percent_of_height(results)
    if percent is None or "storey_drift" not in results:
        return 0.0
    yields = [slider.direction for slider in structure.sliders]
    is_elastic = [tuple(row) not in yields for row in structure.drift_rows.tolist()]
    drift = (results["storey_drift"].values * percent)[..., is_elastic]
    return float(np.nanmax(drift, initial=0.0))


def elastic_words(drift: float) -> str:
    """Return what is said where storeys that stay elastic drift so far; nothing if they may."""
    if drift <= YIELDS:
        return ""
    return f"elastic: drifts of up to {drift:.2g} %; frames yield from some {YIELDS:g} % on"


def alone_words(structure: Structure) -> str:
    """Return the words for the motion beside that of a structure: see `BESIDE`."""
    return "no contact" if structure.contacts else "elastic motion" * (not LINEAR.of(structure))


class ResponseTally(BaseTally):
    """Tally of runs, record by record."""

    placed_by = ("record", "scale", "part")
    at_once = 64
    elastic = 0.0

    def add(self, frame, study: Study) -> None:
        """Count the runs of some records; see `BaseTally.add`."""
        super().add(frame, study)
        grid = as_kind(study, RecordGrid)
        self.elastic = max(self.elastic, elastic_drift(frame, study.structure))
        outcome, rule = frame["outcome"].values, frame["skip_rule"].values
        linear = (outcome > 0) & (rule == SkipRule.LINEAR)
        self.counts["all"]["linear"] += int(linear.sum())
        if "impacts" in frame:
            self.counts["all"]["touching"] += int((frame["impacts"].values > 0).any(axis=-1).sum())
        for name, least in ("collapsed", 1), ("strength_lost", -math.inf):
            if name in frame:
                known = frame[name].values >= least
                self.counts["all"][name] += int(known.any(axis=tuple(range(2, known.ndim))).sum())
        structure, factors = hash(grid.responses.computed), frame["factor"].values
        different = (outcome > 0) & ~linear
        for name, row, chosen in zip(frame["record"].values, factors, different, strict=True):
            for factor in row[chosen].tolist():
                self.counts["ratios"][structure, str(name), grid.responses.ratio(factor)] += 1

    def summary(self) -> dict[str, Any]:
        """Return the counts; see `BaseTally.summary`."""
        done, sizes = self.done, self._study.dimensions
        linear, touching = (self.counts["all"][name] for name in ("linear", "touching"))
        different, counts = len(self.counts["ratios"]), super().summary()
        del counts["periods_per_run"]
        grid = as_kind(self._study, RecordGrid)
        units = "scale", "scale_unit"
        counts["largest"] = {
            name: most | dict(zip(units, grid.intensities(most["scale"]), strict=True))
            for name, most in self.largest.items()
        }
        for name in "collapsed", "strength_lost":
            if name in self.counts["all"]:
                counts[name] = share(self.counts["all"][name], done)
        return counts | {
            "records": sizes["record"],
            "scales": sizes["scale"],
            "measure": self._study.coordinates["scale"].long_name,
            "below_contact": share(linear, done),
            "equal_ratio": share(done - linear - different, done),
            "with_contact": share(touching, done),
            "elastic": elastic_words(self.elastic),
        }
