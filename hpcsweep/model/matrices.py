"""Validate matrices that define a structure, and the contacts of any structure.

    M u'' + C u' + K u + sum_k d_k kappa_k S(rho x_k) x_k = A b sum_h a_h sin(h Omega tau + phi_h)

with x_k = d_k . u - g_k the distance past the stop of contact k. A floor that hits a stop on its
right has d = e_i, on its left d = -e_i; floors i and j of two buildings pound with d = e_i - e_j.
A sharp stop may have a dashpot beside its spring (`hpcsweep.model.dashpot`).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from numbers import Real
from typing import Any

import numpy as np

from hpcsweep.model import arguments
from hpcsweep.model.arguments import finite, not_negative, number, positive, refused, wrong
from hpcsweep.model.dashpot import damping_of_restitution, felt_mass
from hpcsweep.model.definite import check_damping
from hpcsweep.model.flags import flag_modes
from hpcsweep.model.rigid import read_bounce

MAX_FLOORS = 64
"""Storeys of a building before stops: each may have one."""
MAX_ROWS = 512
MAX_LABEL = 100
"""Characters of a name."""
MAX_CONTACTS = 64
"""Contact sets are stored as the bits of one 64-bit integer."""

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
Shares = tuple[tuple[str, float], ...]
"""Names of coordinates of a model, each with its share of a direction."""


def vector(
    name: str,
    value: Any,
    size: int | None,
    what: str = "entries",
    parts: Sequence[str] = (),
    read: Callable[[str, Any], float] = number,
) -> Vector:
    """Read a sequence of numbers, of a given size if not None; `parts` are names of its entries."""
    listed = _listed(value)
    if listed is None:
        raise refused(name, "a list of numbers", value)
    if size is not None and len(listed) != size:
        raise wrong(name, f"must have {size} {what}, has {len(listed)}")
    names = [f"{name}.{part}" for part in parts] or [name] * len(listed)
    return tuple(map(read, names, listed))


def one_or_each(
    name: str, value: Any, count: int, what: str, limits: tuple[str, float, float]
) -> float | Vector:
    """Read one number, or a sequence with one for each of `count`, within limits."""
    value = arguments.plain(value)
    if not hasattr(value, "__len__") or isinstance(value, str | bytes):
        return number(name, value, *limits)

    words = f"numbers, one per {what}"
    return vector(name, value, count, words, read=lambda part, entry: number(part, entry, *limits))


def each(name: str, value: Any, count: int, what: str) -> Vector:
    """Read a number for each of `count`, from one number or a sequence."""
    value = arguments.plain(value)
    if hasattr(value, "__len__"):
        return vector(name, value, count, f"numbers, one per {what}")
    return (number(name, value),) * count


def matrix(name: str, value: Any, shape: tuple[int | None, int | None]) -> Matrix:
    """Read a matrix of finite numbers, row by row."""
    if isinstance(value, np.ndarray) and value.dtype == float and value.ndim == 2 and value.size:
        sizes = tuple(size or len(value) for size in shape)
        if value.shape == sizes and np.isfinite(value).all():
            return tuple(map(tuple, value.tolist()))
    rows = _listed(value)
    if rows is None or not rows or any(_listed(row) is None for row in rows):
        raise refused(name, "a list of rows of numbers", value)
    n_rows, n_columns = shape
    if n_rows is not None and len(rows) != n_rows:
        raise wrong(name, f"must have {n_rows} rows, one per mass, has {len(rows)}")
    width = len(rows) if n_columns is None else n_columns
    return tuple(vector(name, row, width, "entries in each row", read=finite) for row in rows)


def _direction(name: str, direction: Any, refusal: str) -> Any:
    """Read a direction that is not 0: numbers, or names of coordinates of a model, as `Shares`."""
    direction = shares_of(direction)
    if is_named(direction):
        read: Any = tuple((key, finite(f"{name}.{key}", value)) for key, value in direction)
        sizes = tuple(share for _, share in read)
    else:
        read = sizes = vector(name, direction, None, read=finite)
    if not any(sizes):
        raise wrong(name, f"must not be 0: {refusal}")
    return read


def shares_of(direction: Any) -> Any:
    """Return a direction that names coordinates of a model as `Shares`, another one unchanged."""
    if isinstance(direction, str | int) and not isinstance(direction, bool):
        name = str(direction)
        direction = {name.removeprefix("-"): -1.0 if name.startswith("-") else 1.0}
    if isinstance(direction, Mapping):
        return tuple((str(key), share) for key, share in direction.items())
    return direction


def is_named(direction: Any) -> bool:
    """Return whether a direction names coordinates of a model."""
    return isinstance(direction, tuple) and bool(direction) and isinstance(direction[0], tuple)


def _listed(value: Any) -> list | None:
    """Return the items of a sequence, or None if it is not one; a set has no order."""
    if np.ma.is_masked(value):
        return None
    if isinstance(value, np.ndarray):
        return list(value) if value.ndim else None
    return list(value) if isinstance(value, list | tuple) else None


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
        direction = _direction("contact.direction", self.direction, refusal)
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
class Slider:
    """A spring in series with a slider, which slips where the force reaches its strength.

    The force is k (d - p), d = b . u, with |k (d - p)| <= F; while it slips p follows d, so that
    F stays. Rest is p = 0. Beside an elastic spring of stiffness alpha k0 a slider with k =
    (1 - alpha) k0 and F = (1 - alpha) f_y makes a bilinear spring of initial stiffness k0 that
    yields at the force f_y, with kinematic hardening; several in parallel, any backbone. See
    `hpcsweep.model.elements`. Units are those of the structure that it belongs to.

    Parameters
    ----------
    direction : sequence of n floats, str, int or dict
        b: the displacement that lengthens it by 1, not 0; of a model as that of a `Contact`.
    stiffness : float
        k > 0.
    strength : float
        F > 0.
    name : str, optional
    kinetic : float, optional
        Force with which it slips, above 0 and at most F, at which it begins to; F unless given.
    returns : float, optional
        Force R, from 0 to below F, at which p slips back to 0, see `hpcsweep.model.flags`.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    References
    ----------
    Iwan, Journal of Applied Mechanics 33 (1966) 893, of several in parallel.

    Examples
    --------
    The second of two storeys yields at a drift of 20 mm:

    >>> slider = hpcsweep.Slider(direction=(-1.0, 1.0), stiffness=1e7, strength=2e5)
    >>> slider.strength / slider.stiffness
    0.02
    """

    direction: Vector
    stiffness: float
    strength: float
    name: str | None = None
    kinetic: float | None = field(default=None, metadata={"later": True})
    returns: float | None = field(default=None, metadata={"later": True})

    def __post_init__(self) -> None:
        direction = _direction("slider.direction", self.direction, "such a slider is never moved")
        object.__setattr__(self, "direction", direction)
        for name in ("stiffness", "strength"):
            object.__setattr__(self, name, positive(f"slider.{name}", getattr(self, name)))
        kinetic = "kinetic", "above 0, and at most", math.ulp(0.0), self.strength
        returns = "returns", "from 0 to below", 0.0, math.nextafter(self.strength, 0.0)
        for name, limit, least, most in (kinetic, returns):
            if (value := getattr(self, name)) is not None:
                limits = f"{limit} strength, {self.strength:g}", least, most
                object.__setattr__(self, name, number(f"slider.{name}", value, *limits))
        if self.returns is not None and self.kinetic is not None:
            raise wrong("slider.returns", "and kinetic must not be given both")
        name = self.name if isinstance(self.name, str) else ""
        if self.name is not None and not (name.isprintable() and 0 < len(name) <= MAX_LABEL):
            limit = f"a text of up to {MAX_LABEL} characters that can be printed"
            raise refused("slider.name", limit, self.name)

    @property
    def spring(self) -> float:
        """Stiffness that K has of it in its first mode."""
        return self.stiffness

    @property
    def limit(self) -> float:
        """Elongation F / k at which it first slips."""
        return self.strength / self.stiffness

    @property
    def slips(self) -> float:
        """Force with which it slips."""
        return self.strength if self.kinetic is None else self.kinetic

    @property
    def shares(self) -> tuple[float, float]:
        """Energy that it takes for each unit of its path, and holds for each of p."""
        back = -self.slips if self.returns is None else self.returns
        return 0.5 * (self.slips - back), 0.5 * (self.slips + back)

    @property
    def lost(self) -> float:
        """Energy (F - F_k)^2 / 2 k that it takes besides F_k times its path, when it slips."""
        return (self.strength - self.slips) ** 2 / (2.0 * self.stiffness)

    @property
    def taken(self) -> float:
        """Stiffness that its bit takes out of that matrix, and unit of its loads."""
        return self.stiffness

    def modes(self, bit: int, length: float) -> list[tuple[tuple, list[tuple]]]:
        """Return its modes with their guards, see `hpcsweep.model.elements`.

        Of each mode past, key, and the load, a constant and the share of p; of each guard the mode
        to which it leads, s, a, b, c, r, and where p is taken 1 and the shift.

        Parameters
        ----------
        bit : int
            Of the key, where it slips.
        length : float
            Unit of length.
        """
        limit, delta = self.limit / length, self.slips / self.stiffness / length
        up = (0, -1.0, 0.0, 1.0 / limit, 0.0, 0.0, 1.0, -delta)
        down = (0, 1.0, 0.0, 1.0 / limit, 0.0, 0.0, 1.0, delta)
        sticks = [(1, 1.0, 1.0, 0.0, limit, 1.0), (2, -1.0, 1.0, 0.0, -limit, 1.0)]
        if self.returns is not None:
            return flag_modes(1 << bit, limit, self.returns / self.stiffness / length)
        return [
            ((0, 0, 0.0, 1.0), sticks),
            ((0, 1 << bit, -delta, 0.0), [up]),
            ((0, 1 << bit, delta, 0.0), [down]),
        ]


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
    listed = _listed(mass)
    if listed and all(isinstance(value, Real) for value in listed):
        mass = np.diag(vector("matrices.mass", listed, None)).tolist()
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
