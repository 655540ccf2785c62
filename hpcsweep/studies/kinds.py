"""All kinds of study, by their names in jobs."""

from typing import Any

from hpcsweep.studies.attractors.attractors import Attractors
from hpcsweep.studies.basins.basins import Basins
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.points import Points
from hpcsweep.studies.sweep.amplitude_sweep import AmplitudeSweep

ALL: tuple[Any, ...] = (AmplitudeSweep, Points, Attractors, Basins, Records, Branches)
KINDS = {study.kind: study for study in ALL}
DEFAULT_KIND = AmplitudeSweep.kind
"""Default study of a job."""
