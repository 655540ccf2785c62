"""A foundation that sways and rocks on the soil beneath a building.

With the sway v of the foundation, its rotation theta and the drifts d of the building on it, the
displacement of a floor at the height h, relative to the ground far away, is u = v + h theta + d. In
place of theta stands w = v + H theta, H the height of the roof: what its foundation alone would
move it by. So all coordinates are displacements that the ground moves alike, as M (1, ..., 1) says:
the inertia J of rotation, of the foundation and of all floors, is J / H^2 (w' - v')^2, which their
common motion does not have. Springs and dashpots act along v, and of the rotation, over H^2, along
w - v; one of limited strength is a slider, of a moment over H. With P-Delta the weights act along
what storeys lean by, d and h theta together, rows of the floors less v: the m g h theta of rocking.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from hpcsweep.model.arguments import number, refused
from hpcsweep.model.isolation import POSITIVE, RANGE
from hpcsweep.model.slider import Slider
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import OF_SOIL


@dataclass(frozen=True)
class Soil:
    """Springs and dashpots of the soil beneath a `Building`, which must have storey heights.

    Attributes
    ----------
    mass, inertia : float
        Of the foundation, and of the rotation of foundation and floors; above 0.
    sway_stiffness, rocking_stiffness : float
        Force over displacement, and moment over rotation.
    sway_damping, rocking_damping : float
        Coefficients of dashpots, at least 0.
    sway_strength, rocking_strength : float, optional
        Force and moment that the soil bears at most; default: any.

    Examples
    --------
    >>> hpcsweep.Soil(mass=1e5, inertia=2e6, sway_stiffness=4e8, rocking_stiffness=9e9).mass
    100000.0
    """

    mass: float
    inertia: float
    sway_stiffness: float
    rocking_stiffness: float
    sway_damping: float = 0.0
    rocking_damping: float = 0.0
    sway_strength: float | None = None
    rocking_strength: float | None = None

    def __post_init__(self) -> None:
        for each in fields(self):
            if (value := getattr(self, each.name)) is not None:
                limits = (POSITIVE, *RANGE)
                if each.name.endswith("damping"):
                    limits = f"from 0 to {RANGE[1]:g}", 0.0, RANGE[1]
                value = number(f"building.soil.{each.name}", value, *limits)
                object.__setattr__(self, each.name, value)

    def beneath(self, fixed: Structure, levels: Sequence[float], top: float) -> Structure:
        """Return the structure on the soil, from that on a fixed base and heights in it."""
        n, up = fixed.n_floors, np.array(levels) / top
        relative = np.column_stack((up - 1.0, -up, np.eye(n)))
        sway, rocking = np.eye(1, n + 2)[0], np.r_[-1.0, 1.0, np.zeros(n)]
        of_rotation = np.outer(rocking, rocking) / top**2
        mass = np.diag(np.r_[self.mass, 0.0, np.diag(fixed.mass_matrix)])
        stiffness = relative.T @ fixed.elastic_stiffness @ relative
        if (taken := np.array(fixed.names.taken)).size:
            lean, drift = (
                fixed.drift_rows @ u for u in (relative + np.outer(up, rocking), relative)
            )
            stiffness += (drift.T * taken) @ drift - (lean.T * taken) @ lean
            if (least := top**2 * (taken @ (fixed.drift_rows @ up) ** 2)) >= self.rocking_stiffness:
                limit = f"above {least:.4g}, or the weights overturn it"
                raise refused("building.soil.rocking_stiffness", limit, self.rocking_stiffness)
        sliders = [replace(s, direction=np.dot(s.direction, relative)) for s in fixed.sliders]
        for name, row, spring, strength in (
            (OF_SOIL[0], sway, self.sway_stiffness, self.sway_strength),
            (OF_SOIL[1], rocking, self.rocking_stiffness / top**2, self.rocking_strength),
        ):
            if strength is None:
                stiffness += spring * np.outer(row, row)
            else:
                force = strength / (top if row is rocking else 1.0)
                sliders.append(Slider(row, spring, force, name))
        damping = relative.T @ fixed.damping_matrix @ relative
        damping += self.sway_damping * np.outer(sway, sway) + self.rocking_damping * of_rotation
        made = Structure.from_matrices(
            mass + self.inertia * of_rotation,
            stiffness,
            [],
            damping=damping,
            drift=fixed.drift_rows @ relative,
            sliders=sliders,
            collapse_drift=fixed.collapse_drift,
        )
        return made.named((*OF_SOIL, *fixed.floor_names), ())
