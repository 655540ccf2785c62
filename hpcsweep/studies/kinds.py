"""All kinds of study, by their names in jobs. Each is imported when it is first asked for."""

from collections import UserDict
from importlib import import_module
from typing import Any

DEFAULT_KIND = "amplitude_sweep"
"""Default study of a job."""
STUDIES = {
    DEFAULT_KIND: "sweep.runs.AmplitudeSweep",
    "points": "points.Points",
    "attractors": "attractors.attractors.Attractors",
    "basins": "basins.basins.Basins",
    "records": "ground_motion.records.Records",
    "branches": "branches.branches.Branches",
}
"""Module and class of each kind of study in this folder."""


class _Kinds(UserDict[str, Any]):
    """The classes of `STUDIES`: all take 30 ms to import, a job needs one."""

    def __getitem__(self, kind: str) -> Any:
        module, _, name = self.data[kind].rpartition(".")
        return getattr(import_module(f"hpcsweep.studies.{module}"), name)


KINDS = _Kinds(STUDIES)
