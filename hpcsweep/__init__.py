"""Large parameter studies of impacting structures.

Units: lengths in gaps, time in 1/omega_0, or those in which a structure is given; see
`hpcsweep.model.structure`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hpcsweep.dynamics.continuation.periodic import orbit
    from hpcsweep.earthquakes.demands import write_demands
    from hpcsweep.earthquakes.fragility import capacity_fragility, cloud, fragility
    from hpcsweep.earthquakes.intensity import intensity
    from hpcsweep.earthquakes.reading import read_record
    from hpcsweep.earthquakes.spectrum import spectrum
    from hpcsweep.earthquakes.stripes import capacity, fractiles
    from hpcsweep.earthquakes.synthetic import synthetic_records
    from hpcsweep.job import load_job
    from hpcsweep.model.buildings import Building, adjacent
    from hpcsweep.model.matrices import Contact
    from hpcsweep.model.record import Record
    from hpcsweep.model.structure import Structure
    from hpcsweep.solvers.response import Response, first_contact_scale, history, response
    from hpcsweep.solvers.solver import stroboscopic_points
    from hpcsweep.store import meanings, open_results
    from hpcsweep.store.branches import branch
    from hpcsweep.store.curves import curve
    from hpcsweep.store.trajectory import trajectory
    from hpcsweep.studies.attractors.runs import attractors

__all__ = [
    "Building",
    "Contact",
    "Record",
    "Response",
    "Structure",
    "__version__",
    "adjacent",
    "attractors",
    "branch",
    "capacity",
    "capacity_fragility",
    "cloud",
    "curve",
    "first_contact_scale",
    "fractiles",
    "fragility",
    "history",
    "intensity",
    "load_job",
    "meanings",
    "open_results",
    "orbit",
    "read_record",
    "response",
    "spectrum",
    "stroboscopic_points",
    "synthetic_records",
    "trajectory",
    "write_demands",
]

_HOME = {
    "Building": "hpcsweep.model.buildings",
    "Contact": "hpcsweep.model.matrices",
    "adjacent": "hpcsweep.model.buildings",
    "Record": "hpcsweep.model.record",
    "Structure": "hpcsweep.model.structure",
    "Response": "hpcsweep.solvers.response",
    "first_contact_scale": "hpcsweep.solvers.response",
    "history": "hpcsweep.solvers.response",
    "response": "hpcsweep.solvers.response",
    "stroboscopic_points": "hpcsweep.solvers.solver",
    "load_job": "hpcsweep.job",
    "meanings": "hpcsweep.store",
    "open_results": "hpcsweep.store",
    "branch": "hpcsweep.store.branches",
    "curve": "hpcsweep.store.curves",
    "orbit": "hpcsweep.dynamics.continuation.periodic",
    "trajectory": "hpcsweep.store.trajectory",
    "intensity": "hpcsweep.earthquakes.intensity",
    "read_record": "hpcsweep.earthquakes.reading",
    "spectrum": "hpcsweep.earthquakes.spectrum",
    "synthetic_records": "hpcsweep.earthquakes.synthetic",
    "capacity": "hpcsweep.earthquakes.stripes",
    "capacity_fragility": "hpcsweep.earthquakes.fragility",
    "cloud": "hpcsweep.earthquakes.fragility",
    "fractiles": "hpcsweep.earthquakes.stripes",
    "fragility": "hpcsweep.earthquakes.fragility",
    "write_demands": "hpcsweep.earthquakes.demands",
    "attractors": "hpcsweep.studies.attractors.runs",
}


def __getattr__(name: str):
    """Import public names when they are first used, so that the command line starts fast."""
    import importlib

    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    if name == "__version__":
        from hpcsweep.campaign.provenance import version

        return version()
    raise AttributeError(f"module 'hpcsweep' has no attribute {name!r}")
