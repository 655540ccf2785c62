"""The studies there are, by the name a job gives them."""

from hpcsweep.studies.amplitude_sweep import AmplitudeSweep
from hpcsweep.studies.attractors import Attractors
from hpcsweep.studies.basins import Basins
from hpcsweep.studies.points import Points

KINDS = {study.kind: study for study in (AmplitudeSweep, Points, Attractors, Basins)}
DEFAULT_KIND = AmplitudeSweep.kind
"""Study of a job that names none."""
