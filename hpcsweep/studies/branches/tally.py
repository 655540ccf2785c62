"""Counts over the lines of a study of branches, for its summary."""

from collections import Counter

import numpy as np

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.meetings import Meeting
from hpcsweep.dynamics.continuation.plane import KINDS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.branches.variables import Met, Origin, Reason
from hpcsweep.studies.tally import count, failures, share, shares


class BranchTally:
    """Counts over lines; see `hpcsweep.studies.tally.RunTally`."""

    def __init__(self, study):
        self._parameter = study.parameter
        self.outcomes = np.zeros(len(Outcome), int)
        self.sources = np.zeros(len(Origin), int)
        self.reasons = np.zeros(len(Reason), int)
        self.kinds = np.zeros(len(Kind) + 1, int)
        self.periods: Counter[int] = Counter()
        self.curves = self.curve_points = self.asked = self.followed = 0
        self.meetings = np.zeros(len(Met) + 1, int)
        self.cycles = self.points = self.stable = self.others = 0
        self.seeds = self.covered = 0
        self.missed: list[dict] = []

    @property
    def done(self) -> int:
        """Lines that are computed."""
        return int(self.outcomes[Outcome.COMPLETE :].sum())

    def add(self, line, study) -> None:
        """Count a line, an xarray.Dataset, of a study or of a part of it."""
        outcome = line["outcome"].values.ravel()
        self.outcomes += np.bincount(outcome, minlength=self.outcomes.size)
        if not outcome.any():
            return
        held = line["branch_id"].values > 0
        self.sources += np.bincount(line["found_by"].values[held], minlength=self.sources.size)
        count(self.periods, line["branch_period"].values[held])
        kinds = line["special_kind"].values
        self.kinds += np.bincount(kinds[kinds > 0], minlength=self.kinds.size)
        if study.curves:
            self._add_curves(line, study)
        self.points += int((line["step_branch"].values > 0).sum())
        self.stable += int((line["stable"].values > 0).sum())
        self.cycles += int(line["cycles"].values.sum())
        self.seeds += int(line["n_seeds"].values.sum())
        self.covered += int(line["n_covered"].values.sum())
        self.others += int(line["n_others"].values.sum())
        there = line["seed_period"].values > 0
        reasons = line["seed_reason"].values
        self.reasons += np.bincount(reasons[there], minlength=self.reasons.size)
        for k in np.argwhere(there & (reasons > 0)).tolist():
            at = {name: line[name].values[tuple(k)].item() for name in SEED_VARIABLES}
            self.missed.append(
                {
                    "line": study.describe_task(int(line["line"].values[k[1]])),
                    "value": at["seed_value"],
                    "period": at["seed_period"],
                    "reason": Reason(at["seed_reason"]).name.lower().replace("_", " "),
                }
            )

    def _add_curves(self, line, study) -> None:
        kinds, branch = (line[f"special_{x}"].values for x in ("kind", "branch"))
        period = np.take_along_axis(line["branch_period"].values, np.maximum(branch, 1) - 1, -1)
        asked = np.isin(kinds, [KINDS[name] for name in study.curves])
        self.curves += int(line["n_curves"].values.sum())
        self.curve_points += int((line["curve_of_step"].values > 0).sum())
        self.asked += int((asked & (period <= study.settings.max_orbit_period)).sum())
        self.followed += int((line["special_curve"].values > 0).sum())
        met = line["meeting_kind"].values
        self.meetings += np.bincount(met[met > 0], minlength=self.meetings.size)

    def summary(self) -> dict:
        """Return what was counted: numbers, strings, lists and dicts."""
        branches = int(self.sources.sum())
        return {
            "branches": branches,
            "parameter": self._parameter,
            "periods_per_run": self.cycles / self.done if self.done else None,
            "sources": {
                one.name.lower(): share(int(self.sources[one]), branches)
                for one in Origin
                if one is not Origin.NONE
            },
            "points": self.points,
            "points_stable": share(self.stable, self.points),
            "special_points": {
                kind.name.lower().replace("_", " "): int(self.kinds[kind]) for kind in Kind
            },
            **({"curves": self._told_of_curves()} if self.asked else {}),
            "seeds": self.seeds,
            "seeds_covered": share(self.covered, self.seeds),
            "seeds_missed": self.missed,
            "motions_not_periodic": self.others,
            "classes": {},
            "periods": shares(self.periods, branches, sorted(self.periods)),
            "contact_sets": {},
            "largest": {},
            "failures": failures(self.outcomes),
        }

    def _told_of_curves(self) -> dict:
        return {
            "curves": self.curves,
            "points": self.curve_points,
            "special_points": self.asked,
            "followed": share(self.followed, self.asked),
            "meetings": {one.value: int(self.meetings[k]) for k, one in enumerate(Meeting, 1)},
        }


SEED_VARIABLES = ("seed_value", "seed_period", "seed_reason")
