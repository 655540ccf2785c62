"""What is observed of a motion: each quantity once.

Rows whose peaks kernels gather, the keys of ``output``, allocation, checksums, labels of figures,
what summaries tell and the tables of the documentation are made of `TABLE`. A quantity that is
added to it, and to `Measures`, is missing nowhere but in the kernel that computes it
(`hpcsweep.solvers.flow.observe.peaks`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

DRIFT, FLOOR, ACCELERATION, CONTACT, IMPACT, ENERGY, ROWS = 4, 8, 16, 32, 64, 128, 256
"""Flags that request: peaks of drifts, of floors, of absolute accelerations of floors and of the
distances of contacts past their stops; impacts; the integrals of the energy of a response; what
any rows of displacements do, see `hpcsweep.solvers.flow.observe.rows`."""
MAX_ORDER = 16
"""Highest harmonic of a row."""
CLOSINGS, SPEED, FORCE, TIME, DISSIPATED, TOGETHER = range(6)
N_IMPACTS = 6
"""Rows of impacts: closings of a contact, largest closing speed, integral of its force over its
unit (`LinearDynamics.force_per_length`), time in which it is closed, that is where its distance
past the stop is 0 or more, energy that its dashpot has taken, over the unit of its force, and
closings of a rigid one while others that it pushes were at their stops."""
ROUNDING = 2.0**-46
"""Part of the size of a motion, 64 units of rounding, below which its distances and speeds tell
nothing: a closing counts that is faster, of a contact that has come apart by more since it has last
been closed.

A distance x = d . u - g is known to the rounding of g and of the state it is made of: to a few
units of the largest of |g|, |u_i| and |u_i'| over the unit of frequency. A contact that comes to
rest at its stop passes it any number of times. The size of a motion is the largest of these that it
has had where a contact has closed, and of the peaks of its floors where they are gathered. What has
opened with the speed w against an acceleration a comes apart by w^2 / 2 a, so that w of 2e-7 counts
where size and a are 1."""


class Quantity(NamedTuple):
    """One quantity."""

    name: str
    dim: str
    """Dimension of the values of one run."""
    units: str
    meaning: str
    label: str = ""
    """Of figures; summaries tell those that have one, where they are largest."""
    flag: int = 0
    """That requests it of motions, 0 of what is known of responses alone."""
    order: int = 0
    """Of the time derivative of which it is the peak."""


TABLE = (
    Quantity(
        "storey_drift", "storey", "length", "peak drift of each storey", "peak storey drift", DRIFT
    ),
    Quantity(
        "displacement",
        "floor",
        "length",
        "peak displacement of each floor",
        "peak displacement",
        FLOOR,
    ),
    Quantity(
        "floor_acceleration",
        "floor",
        "acceleration",
        "peak absolute acceleration of each floor",
        "peak floor acceleration",
        ACCELERATION,
        order=2,
    ),
    Quantity(
        "contact_force",
        "stop",
        "force",
        "peak force of each contact",
        "peak contact force",
        CONTACT,
    ),
    Quantity("impacts", "stop", "1", "closings of each contact", "impacts", IMPACT),
    Quantity(
        "simultaneous",
        "stop",
        "1",
        "closings of each rigid stop with others that it pushes at theirs",
        "simultaneous impacts",
        IMPACT,
    ),
    Quantity(
        "impact_velocity",
        "stop",
        "velocity",
        "largest closing speed",
        "largest closing speed",
        IMPACT,
    ),
    Quantity("impulse", "stop", "impulse", "impulse of each contact", "impulse", IMPACT),
    Quantity(
        "contact_share",
        "stop",
        "1",
        "share of time each contact is closed",
        "share of time in contact",
        IMPACT,
    ),
    Quantity("contact_time", "stop", "time", "time each contact is closed"),
    Quantity("dissipated", "stop", "energy", "energy that each contact has taken"),
    Quantity(
        "ductility",
        "slider",
        "1",
        "peak elongation of each slider over that of yielding",
        "ductility",
    ),
    Quantity("slider_force", "slider", "force", "peak force of each slider"),
    Quantity("plastic", "slider", "length", "lasting elongation that each slider gains"),
    Quantity("plastic_path", "slider", "length", "sum of its changes"),
    Quantity("excursions", "slider", "1", "how often each slider has slipped", "excursions"),
    Quantity("slider_energy", "slider", "energy", "energy that each slider dissipates"),
    Quantity(
        "strength_lost", "slider", "time", "when each slider has lost all force; NaN: it has not"
    ),
    Quantity(
        "residual_drift",
        "storey",
        "length",
        "lasting drift of each storey; NaN: collapsed",
        "residual storey drift",
    ),
    Quantity(
        "base_shear",
        "building",
        "force",
        "peak reaction of the base of each building",
        "peak base shear",
    ),
)
"""In the order of files."""
MOTIONS = tuple(quantity for quantity in TABLE if quantity.flag)
"""Those of motions, which jobs request."""
PEAKS = tuple(quantity for quantity in MOTIONS if quantity.flag != IMPACT)
"""Those that are the peak of a row, in the order of `Model.watched`."""
ANY_PEAK = sum(quantity.flag for quantity in PEAKS)
WITHIN_PASSAGES = sum(quantity.flag for quantity in PEAKS if quantity.order > 1)
"""Flags of all of them, and of those that may be larger while a smooth contact closes than before
and after."""


@dataclass(frozen=True, eq=False)
class Measures:
    """Measures of motions: peaks over continuous time, and what contacts have done.

    Those of a forcing have any leading axes, of motions; their sums are those of a forcing period.

    Attributes
    ----------
    storey_drift : ndarray, shape (..., D)
        Largest |row . u| of each row of ``structure.drift_rows``.
    displacement : ndarray, shape (..., n)
        Largest |u_i|, relative to the ground.
    floor_acceleration : ndarray, shape (..., n)
        Largest absolute acceleration, |u_i'' + a| of a base that shakes.
    contact_force : ndarray, shape (..., k)
        Largest force of each contact, where its floors are farthest past it; 0 if it has not
        closed.
    impacts : ndarray, shape (..., k)
        How often each contact has closed, having been open by more than rounding (`ROUNDING`).
    impact_velocity : ndarray, shape (..., k)
        Largest speed with which it has closed.
    impulse : ndarray, shape (..., k)
        Integral of its force over time.
    contact_share : ndarray, shape (..., k)
        Share of the time in which it was closed.
    simultaneous : ndarray, shape (..., k)
        How often it has closed while others that it pushes were at their stops, all rigid: there is
        no law of nature for it (`hpcsweep.model.rigid`).
    """

    storey_drift: np.ndarray
    displacement: np.ndarray
    floor_acceleration: np.ndarray
    contact_force: np.ndarray
    impacts: np.ndarray
    impact_velocity: np.ndarray
    impulse: np.ndarray
    contact_share: np.ndarray
    simultaneous: np.ndarray
