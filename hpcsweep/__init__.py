"""Large parameter studies of impacting structures.

Units: lengths in gaps, time in 1/omega_0, or those in which a structure is given; see
`hpcsweep.model.structure`.
"""

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the aliases say that they are public; imported when they are first used
    from hpcsweep.api.branches import branch as branch
    from hpcsweep.api.curves import curve as curve
    from hpcsweep.api.trajectory import trajectory as trajectory
    from hpcsweep.dynamics.continuation.periodic import orbit as orbit
    from hpcsweep.earthquakes.demands import write_demands as write_demands
    from hpcsweep.earthquakes.fragility import capacity_fragility as capacity_fragility
    from hpcsweep.earthquakes.fragility import cloud as cloud
    from hpcsweep.earthquakes.fragility import fragility as fragility
    from hpcsweep.earthquakes.intensity import intensity as intensity
    from hpcsweep.earthquakes.reading import read_record as read_record
    from hpcsweep.earthquakes.spectrum import spectrum as spectrum
    from hpcsweep.earthquakes.stripes import capacity as capacity
    from hpcsweep.earthquakes.stripes import fractiles as fractiles
    from hpcsweep.earthquakes.synthetic import synthetic_records as synthetic_records
    from hpcsweep.job import load_job as load_job
    from hpcsweep.model.buildings import Building as Building
    from hpcsweep.model.buildings import adjacent as adjacent
    from hpcsweep.model.matrices import Contact as Contact
    from hpcsweep.model.record import Record as Record
    from hpcsweep.model.structure import Structure as Structure
    from hpcsweep.solvers.response import Response as Response
    from hpcsweep.solvers.response import first_contact_scale as first_contact_scale
    from hpcsweep.solvers.response import history as history
    from hpcsweep.solvers.response import response as response
    from hpcsweep.solvers.solver import stroboscopic_points as stroboscopic_points
    from hpcsweep.store import meanings as meanings
    from hpcsweep.store import open_results as open_results
    from hpcsweep.studies.attractors.runs import attractors as attractors

_DECLARED = re.findall(
    r"from hpcsweep\.(\S+) import \w+ as (\w+)", Path(__file__).read_text(encoding="utf-8")
)
_HOME = {name: module for module, name in _DECLARED} | {"__version__": "campaign.provenance"}
"""Module of each public name, as declared above: the one list for people, tools and programs."""
__all__ = sorted(_HOME)


def __getattr__(name: str):
    """Import a public name when it is first used, so that the command line starts fast."""
    import importlib

    if name not in _HOME:
        raise AttributeError(f"module 'hpcsweep' has no attribute {name!r}")
    module = importlib.import_module(f"hpcsweep.{_HOME[name]}")
    return module.version() if name == "__version__" else getattr(module, name)
