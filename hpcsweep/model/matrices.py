"""Validate matrices that define a structure, and the contacts of any structure.

    M u'' + C u' + K u + sum_k d_k kappa_k S(rho x_k) x_k = A b sum_h a_h sin(h Omega tau + phi_h)

with x_k = d_k . u - g_k the distance past the stop of contact k. A floor that hits a stop on its
right has d = e_i, on its left d = -e_i; floors i and j of two buildings pound with d = e_i - e_j.
A sharp stop may have a dashpot beside its spring (`hpcsweep.model.dashpot`).
"""

import math
from dataclasses import astuple, dataclass, field, replace
from numbers import Real
from typing import Any

import numpy as np

from hpcsweep.model import arguments
from hpcsweep.model.arguments import finite, not_negative, wrong
from hpcsweep.model.dashpot import damping_of_restitution, felt_mass
from hpcsweep.model.definite import check_damping
from hpcsweep.model.rigid import read_bounce
from hpcsweep.model.slider import Slider
from hpcsweep.model.vectors import Matrix, Vector, direction_of, is_named, listed, matrix, vector

MAX_FLOORS = 64
"""Storeys of a building before stops: each may have one."""
MAX_ROWS = 512
MAX_CONTACTS = 64
"""Contact sets are stored as the bits of one 64-bit integer."""


@dataclass(frozen=True)
class Contact:
    """A stop behind which a spring lies: it pushes with kappa S(rho x) x, x = d . u - g.

    Units are those of the structure that it belongs to.

    Parameters
    ----------
    direction : sequence of n floats, str, int or dict
        d: the displacement towards the stop, not 0. Of a model (`hpcsweep.read_model`) the name or
        number of a coordinate, after ``-`` for the opposite side, or names with their shares.
    gap : float
        g: of any sign; at 0 the structure rests at the stop, below 0 the stop pushes it.
    stiffness : float
        kappa >= 0; ``math.inf`` for a rigid stop, at which speeds jump, see `hpcsweep.model.rigid`.
    damping : float
        c >= 0 of a dashpot beside the spring: kappa x + c x'. Requires a sharp stop.
    tension : bool
        Whether the dashpot may pull, until x = 0; without it the contact never pulls, and lets go
        where kappa x + c x' falls to 0. See `hpcsweep.model.dashpot`.
    restitution : float, optional
        e, from 0 to 1, of a rigid stop, which needs it.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    References
    ----------
    Anagnostopoulos, Earthquake Engineering & Structural Dynamics 16 (1988) 443, of the dashpot.

    Examples
    --------
    Floors 1 and 3 of three face each other, 10 mm apart:

    >>> contact = hpcsweep.Contact(direction=(1.0, 0.0, -1.0), gap=0.01, stiffness=1e6)
    >>> contact.damping
    0.0
    """

    direction: Vector
    gap: float
    stiffness: float
    damping: float = field(default=0.0, metadata={"later": True})
    tension: bool = field(default=False, metadata={"later": True})
    restitution: float | None = field(default=None, metadata={"later": True})

    def __post_init__(self) -> None:
        refusal = "such a contact can never be reached"
        direction = direction_of("contact.direction", self.direction, refusal)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "gap", finite("contact.gap", self.gap))
        object.__setattr__(self, "stiffness", self._read_stiffness())
        object.__setattr__(self, "damping", not_negative("contact.damping", self.damping))
        object.__setattr__(self, "tension", arguments.flag("contact.tension", self.tension))
        object.__setattr__(self, "restitution", read_bounce(self))

    def _read_stiffness(self) -> float:
        if self.stiffness == math.inf:
            return math.inf
        return not_negative("contact.stiffness", self.stiffness)

    @classmethod
    def from_restitution(
        cls,
        direction: Any,
        gap: float,
        stiffness: float,
        restitution: float,
        mass: Any,
        tension: bool = False,
    ) -> "Contact":
        """Return a contact whose dashpot gives a collision the coefficient of restitution.

        Parameters
        ----------
        direction, gap, stiffness, tension
            See `Contact`.
        restitution : float
            e of a collision under the contact's own force, above 0 and at most 1.
        mass : array_like, shape (n,) or (n, n)
            M of the structure.
        """
        if stiffness == math.inf:
            return cls(direction, gap, stiffness, 0.0, tension, restitution)
        contact = cls(direction, gap, stiffness, 0.0, tension)
        felt = felt_mass(contact.direction, mass)
        damping = damping_of_restitution(restitution, contact.stiffness, felt, contact.tension)
        return replace(contact, damping=damping)


@dataclass(frozen=True)
class Matrices:
    """Validated arguments of `Structure.from_matrices`; hashable tuples."""

    mass: Matrix
    stiffness: Matrix
    contacts: tuple[Contact, ...]
    damping: Matrix | None = None
    forcing: Vector | None = None
    drift: Matrix | None = None
    sliders: tuple[Slider, ...] = field(default=(), metadata={"later": True})
    influence: Vector | None = field(default=None, metadata={"later": True})
    origin: str = field(default="", metadata={"later": True})
    """What a reduced model is made of, hashed: its matrices are rounded as the machine rounds."""

    @property
    def meaning(self) -> tuple | None:
        """What counts of matrices that are computed from a file, for the fingerprint of a job."""
        elements: tuple[Any, ...] = (*self.contacts, *self.sliders)
        laws = (astuple(element)[1:] for element in elements)
        return (self.origin, *laws) if self.origin else None


def read_matrices(
    mass, stiffness, contacts, damping, forcing, drift, sliders, influence
) -> Matrices:
    """Validate matrices; see `Structure.from_matrices`."""
    # a vector of masses stands for a diagonal matrix
    entries = listed(mass)
    if entries and all(isinstance(value, Real) for value in entries):
        mass = np.diag(vector("matrices.mass", entries, None)).tolist()
    checked = matrix("matrices.mass", mass, (None, None))
    n = len(checked)
    if n > MAX_ROWS:
        limit = f"at most {MAX_ROWS} rows, has {n}: a larger model is reduced (hpcsweep.read_model)"
        raise wrong("matrices.mass", f"must have {limit}")
    if forcing is not None and influence is not None:
        raise wrong("matrices.forcing", "and influence must not be given both")
    read = Matrices(
        checked,
        matrix("matrices.stiffness", stiffness, (n, n)),
        _several(Contact, contacts, n),
        None if damping is None else matrix("matrices.damping", damping, (n, n)),
        None if forcing is None else vector("matrices.forcing", forcing, n, read=finite),
        None if drift is None else matrix("matrices.drift", drift, (None, n)),
        _several(Slider, sliders, n),
        None if influence is None else vector("matrices.influence", influence, n, read=finite),
    )
    if len(read.contacts) + len(read.sliders) > MAX_CONTACTS:
        limit = f"and sliders must be at most {MAX_CONTACTS} together"
        raise wrong("contacts", f"{limit}, are {len(read.contacts)} and {len(read.sliders)}")
    if read.damping is not None:
        check_damping(np.array(read.damping))
    return read


def _several(kind: Any, elements: Any, n: int) -> tuple:
    """Read contacts or sliders of a structure with n coordinates."""
    name, key = kind.__name__, kind.__name__.lower()
    listed = tuple(arguments.items(f"{key}s", elements, f"a list of {name}"))
    if len(listed) > MAX_CONTACTS:
        raise wrong(f"{key}s", f"must be at most {MAX_CONTACTS}, are {len(listed)}")
    for place, element in enumerate(listed, 1):
        if not isinstance(element, kind):
            raise wrong(f"{key}s", f"must be a list of {name}, holds {arguments.shown(element)}")
        if is_named(element.direction):
            limit = f"must be {n} numbers: it names coordinates, which goes with a model"
            raise wrong(f"{key}[{place - 1}].direction", limit)
        if len(element.direction) != n:
            limit = f"must have {n} entries, has {len(element.direction)}"
            raise wrong(f"{key}.direction of {key} {place}", limit)
    return listed
