"""Counts over the lines of a study of branches, for its summary."""

from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.plane import KINDS, Meeting
from hpcsweep.studies.branches.keys import BranchGrid
from hpcsweep.studies.branches.variables import Origin, Reason
from hpcsweep.studies.study import Study, as_kind
from hpcsweep.studies.tally import BaseTally, share, shares

CODES = {
    "found_by": "branch_id",
    "branch_period": "branch_id",
    "special_kind": "special_kind",
    "meeting_kind": "meeting_kind",
}
"""Variables whose values are counted, where another one is above 0."""
SUMS = ("n_seeds", "n_covered", "n_others", "n_curves")
HELD = ("step_branch", "stable", "curve_of_step", "special_curve")
"""Variables that are above 0 where there is something to be counted."""
SEED_VARIABLES = ("seed_value", "seed_period", "seed_reason")


class BranchTally(BaseTally):
    """Counts over lines."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.missed: list[dict] = []

    def add(self, line, study: Study) -> None:
        """Count a line; see `BaseTally.add`."""
        super().add(line, study)
        if not line["outcome"].values.any():
            return
        sums = self.counts["all"]
        for name, held in CODES.items():
            if name in line:
                self.count(name, line[name].values[line[held].values > 0])
        for name in (*SUMS, *HELD):
            if name in line:
                values = line[name].values
                sums[name] += int((values > 0).sum() if name in HELD else values.sum())
        if kinds := as_kind(study, BranchGrid).curves:
            sums["asked"] += _n_asked(line, kinds, study.settings.max_orbit_period)
        there = line["seed_period"].values > 0
        for k in np.argwhere(there & (line["seed_reason"].values > 0)).tolist():
            value, period, reason = (line[name].values[tuple(k)].item() for name in SEED_VARIABLES)
            self.missed.append(
                {
                    "line": study.describe_task(int(line["line"].values[k[1]])),
                    "value": value,
                    "period": period,
                    "reason": Reason(reason).name.lower().replace("_", " "),
                }
            )

    def summary(self) -> dict[str, Any]:
        """Return what was counted; see `BaseTally.summary`."""
        sources, kinds, sums = (self.counts[x] for x in ("found_by", "special_kind", "all"))
        branches, seeds, points = sources.total(), sums["n_seeds"], sums["step_branch"]
        return super().summary() | {
            "branches": branches,
            "parameter": as_kind(self._study, BranchGrid).parameter,
            "sources": {
                origin.name.lower(): share(sources[origin], branches)
                for origin in Origin
                if origin is not Origin.NONE
            },
            "points": points,
            "points_stable": share(sums["stable"], points),
            "special_points": {kind.name.lower().replace("_", " "): kinds[kind] for kind in Kind},
            **({"curves": self._summary_of_curves()} if sums["asked"] else {}),
            "seeds": seeds,
            "seeds_covered": share(sums["n_covered"], seeds),
            "seeds_missed": self.missed,
            "motions_not_periodic": sums["n_others"],
            "classes": {},
            "periods": shares(self.counts["branch_period"], branches),
            "contact_sets": {},
        }

    def _summary_of_curves(self) -> dict:
        sums, meetings = self.counts["all"], self.counts["meeting_kind"]
        return {
            "curves": sums["n_curves"],
            "points": sums["curve_of_step"],
            "special_points": sums["asked"],
            "followed": share(sums["special_curve"], sums["asked"]),
            "meetings": {meeting.value: meetings[k] for k, meeting in enumerate(Meeting, 1)},
        }


def _n_asked(line, names: tuple[str, ...], longest: int) -> int:
    """Count the special points of a line whose curves were to be followed."""
    kinds, branch = (line[f"special_{x}"].values for x in ("kind", "branch"))
    period = np.take_along_axis(line["branch_period"].values, np.maximum(branch, 1) - 1, -1)
    return int((np.isin(kinds, [KINDS[name] for name in names]) & (period <= longest)).sum())
