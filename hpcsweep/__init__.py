"""Large parameter studies of impacting structures.

Units: lengths in gaps, time in 1/omega_0, or those in which a structure is given; see
`hpcsweep.model.structure`.
"""

import functools
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the aliases say that they are public
    from hpcsweep.api.branches import branch as branch
    from hpcsweep.api.curves import curve as curve
    from hpcsweep.api.lyapunov import lyapunov_spectrum as lyapunov_spectrum
    from hpcsweep.api.trajectory import trajectory as trajectory
    from hpcsweep.dynamics.boundaries import basin_boundary as basin_boundary
    from hpcsweep.dynamics.continuation.periodic import orbit as orbit
    from hpcsweep.dynamics.lifetime import mean_lifetime as mean_lifetime
    from hpcsweep.dynamics.returns import return_times as return_times
    from hpcsweep.earthquakes.demands import write_demands as write_demands
    from hpcsweep.earthquakes.floor_spectra import floor_spectra as floor_spectra
    from hpcsweep.earthquakes.fragility import capacity_fragility as capacity_fragility
    from hpcsweep.earthquakes.fragility import cloud as cloud
    from hpcsweep.earthquakes.fragility import fragility as fragility
    from hpcsweep.earthquakes.hazard import annual_frequency as annual_frequency
    from hpcsweep.earthquakes.intensity import intensity as intensity
    from hpcsweep.earthquakes.reading import read_record as read_record
    from hpcsweep.earthquakes.separation import separation as separation
    from hpcsweep.earthquakes.spectrum import pair_spectrum as pair_spectrum
    from hpcsweep.earthquakes.spectrum import spectrum as spectrum
    from hpcsweep.earthquakes.stripes import capacity as capacity
    from hpcsweep.earthquakes.stripes import fractiles as fractiles
    from hpcsweep.earthquakes.synthetic import synthetic_records as synthetic_records
    from hpcsweep.job import load_job as load_job
    from hpcsweep.job.model_files import read_model as read_model
    from hpcsweep.model.adjacent import adjacent as adjacent
    from hpcsweep.model.backbone import Backbone as Backbone
    from hpcsweep.model.buildings import Building as Building
    from hpcsweep.model.isolation import Isolation as Isolation
    from hpcsweep.model.matrices import Contact as Contact
    from hpcsweep.model.record import Record as Record
    from hpcsweep.model.slider import Slider as Slider
    from hpcsweep.model.soil import Soil as Soil
    from hpcsweep.model.springs import Spring as Spring
    from hpcsweep.model.structure import Structure as Structure
    from hpcsweep.solvers.history import history as history
    from hpcsweep.solvers.response import Response as Response
    from hpcsweep.solvers.response import first_contact_scale as first_contact_scale
    from hpcsweep.solvers.response import response as response
    from hpcsweep.solvers.solver import stroboscopic_points as stroboscopic_points
    from hpcsweep.store import meanings as meanings
    from hpcsweep.store import open_results as open_results
    from hpcsweep.studies.attractors.runs import attractors as attractors

    __version__: str
else:  # at run time alone, so that a type checker sees names that are not there

    @functools.cache
    def _homes() -> dict[str, str]:
        """Return the module of each public name: the lines above, which are read as text."""
        import ast
        from pathlib import Path

        return {
            name.name: str(node.module)
            for node in ast.walk(ast.parse(Path(__file__).read_text()))
            if isinstance(node, ast.ImportFrom)
            for name in node.names
            if name.asname
        }

    def __getattr__(name: str):
        """Import public names when they are first used, so that the command line starts fast."""
        if name == "__version__":
            return importlib.import_module("hpcsweep.campaign.provenance").version()
        homes = _homes()
        if name == "__all__":
            return sorted({*homes, "__version__"})
        if name not in homes:
            raise AttributeError(f"module 'hpcsweep' has no attribute {name!r}")
        return getattr(importlib.import_module(homes[name]), name)

    def __dir__() -> list[str]:
        """Tell public names, to those who complete them."""
        return __getattr__("__all__")
