"""The studies there are, by the name a job gives them."""

from hpcsweep.studies.attractors.attractors import Attractors
from hpcsweep.studies.basins.basins import Basins
from hpcsweep.studies.points import Points
from hpcsweep.studies.sweep.amplitude_sweep import AmplitudeSweep

KINDS = {study.kind: study for study in (AmplitudeSweep, Points, Attractors, Basins)}
DEFAULT_KIND = AmplitudeSweep.kind
"""Study of a job that names none."""
