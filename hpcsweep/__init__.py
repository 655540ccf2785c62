"""Large parameter studies of impacting structures.

Units: lengths in gaps, time in 1/omega_0, or those in which a structure is given; see
`hpcsweep.model.structure`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hpcsweep.model.matrices import Contact
    from hpcsweep.model.structure import Structure
    from hpcsweep.solvers.solver import stroboscopic_points
    from hpcsweep.store import open_results
    from hpcsweep.studies.attractor_runs import attractors

__all__ = [
    "Contact",
    "Structure",
    "__version__",
    "attractors",
    "open_results",
    "stroboscopic_points",
]

_HOME = {
    "Contact": "hpcsweep.model.matrices",
    "Structure": "hpcsweep.model.structure",
    "stroboscopic_points": "hpcsweep.solvers.solver",
    "open_results": "hpcsweep.store",
    "attractors": "hpcsweep.studies.attractor_runs",
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
