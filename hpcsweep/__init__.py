"""Large parameter studies of base-excited structures impacting a rigid stop.

Units throughout: lengths in gaps, time in 1/omega_0; see `hpcsweep.model.structure`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hpcsweep.model.structure import Structure
    from hpcsweep.solvers.solver import stroboscopic_points
    from hpcsweep.store import open_results

__all__ = ["Structure", "__version__", "open_results", "stroboscopic_points"]

_HOME = {
    "Structure": "hpcsweep.model.structure",
    "stroboscopic_points": "hpcsweep.solvers.solver",
    "open_results": "hpcsweep.store",
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
