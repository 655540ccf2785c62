"""Counts over the lines of a study of branches, for its summary."""

from collections import Counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.meetings import Meeting
from hpcsweep.dynamics.continuation.plane import KINDS
from hpcsweep.studies.branches.variables import Origin, Reason
from hpcsweep.studies.study import Study
from hpcsweep.studies.tally import BaseTally, count, share, shares

if TYPE_CHECKING:
    from hpcsweep.studies.branches.branches import Branches

CODES = {
    "found_by": "branch_id",
    "branch_period": "branch_id",
    "special_kind": "special_kind",
    "meeting_kind": "meeting_kind",
}
"""Variables whose values are counted, where another one is above 0."""
SUMS = ("n_seeds", "n_covered", "n_others", "n_curves")
SEED_VARIABLES = ("seed_value", "seed_period", "seed_reason")


class BranchTally(BaseTally):
    """Counts over lines."""

    def __init__(self, study: Study):
        super().__init__(study)
        self.codes: dict[str, Counter[int]] = {name: Counter() for name in CODES}
        self.sums = dict.fromkeys(SUMS, 0)
        self.points = self.stable = self.curve_points = self.asked = self.followed = 0
        self.missed: list[dict] = []

    def add(self, line, study: Study) -> None:
        """Count a line; see `BaseTally.add`."""
        super().add(line, study)
        if not line["outcome"].values.any():
            return
        for name, held in CODES.items():
            if name in line:
                count(self.codes[name], line[name].values[line[held].values > 0])
        for name in SUMS:
            self.sums[name] += int(line[name].values.sum()) if name in line else 0
        self.points += int((line["step_branch"].values > 0).sum())
        self.stable += int((line["stable"].values > 0).sum())
        branches = cast("Branches", study)
        if branches.curves:
            self._add_curves(line, branches)
        there = line["seed_period"].values > 0
        for k in np.argwhere(there & (line["seed_reason"].values > 0)).tolist():
            at = {name: line[name].values[tuple(k)].item() for name in SEED_VARIABLES}
            self.missed.append(
                {
                    "line": branches.describe_task(int(line["line"].values[k[1]])),
                    "value": at["seed_value"],
                    "period": at["seed_period"],
                    "reason": Reason(at["seed_reason"]).name.lower().replace("_", " "),
                }
            )

    def _add_curves(self, line, study: "Branches") -> None:
        kinds, branch = (line[f"special_{x}"].values for x in ("kind", "branch"))
        period = np.take_along_axis(line["branch_period"].values, np.maximum(branch, 1) - 1, -1)
        asked = np.isin(kinds, [KINDS[name] for name in study.curves])
        self.curve_points += int((line["curve_of_step"].values > 0).sum())
        self.asked += int((asked & (period <= study.settings.max_orbit_period)).sum())
        self.followed += int((line["special_curve"].values > 0).sum())

    def summary(self) -> dict[str, Any]:
        """Return what was counted; see `BaseTally.summary`."""
        sources, kinds = self.codes["found_by"], self.codes["special_kind"]
        branches, seeds = sources.total(), self.sums["n_seeds"]
        return super().summary() | {
            "branches": branches,
            "parameter": cast("Branches", self._study).parameter,
            "sources": {
                one.name.lower(): share(sources[one], branches)
                for one in Origin
                if one is not Origin.NONE
            },
            "points": self.points,
            "points_stable": share(self.stable, self.points),
            "special_points": {kind.name.lower().replace("_", " "): kinds[kind] for kind in Kind},
            **({"curves": self._told_of_curves()} if self.asked else {}),
            "seeds": seeds,
            "seeds_covered": share(self.sums["n_covered"], seeds),
            "seeds_missed": self.missed,
            "motions_not_periodic": self.sums["n_others"],
            "classes": {},
            "periods": shares(self.codes["branch_period"], branches),
            "contact_sets": {},
        }

    def _told_of_curves(self) -> dict:
        meetings = self.codes["meeting_kind"]
        return {
            "curves": self.sums["n_curves"],
            "points": self.curve_points,
            "special_points": self.asked,
            "followed": share(self.followed, self.asked),
            "meetings": {one.value: meetings[k] for k, one in enumerate(Meeting, 1)},
        }
