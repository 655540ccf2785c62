"""The structure: storeys on a fixed base beside rigid stops, or any matrices with contacts.

Units, used throughout the package: the short form is the uniform building of the paper, with
lengths in gaps (the distance from the floors at rest to the stop, so that the stop is at 1) and
time in 1/omega_0 with omega_0 = sqrt(k/m) of one storey. Masses, stiffnesses and gaps may be given
in any consistent units, which are also those of the results. Equation numbers are those of
Christopher, Dobson and Alexander, "Exploring the Dynamics of Base-Excited Structures Impacting a
Rigid Stop".
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from hpcsweep.model import matrices
from hpcsweep.model.arguments import LARGEST, count, flag, instance, items, number, refused, wrong
from hpcsweep.model.dashpot import refuse_smooth
from hpcsweep.model.definite import check_definite
from hpcsweep.model.forcing import ONE_HARMONIC, read_harmonics
from hpcsweep.model.linear_dynamics import ROUNDED
from hpcsweep.model.matrices import Matrices, read_matrices
from hpcsweep.model.rayleigh import Rayleigh, read_rayleigh
from hpcsweep.model.reach import MeasuredDynamics
from hpcsweep.model.rigid import refuse_beside
from hpcsweep.model.springs import add_springs
from hpcsweep.model.unit_names import Names, UnitNames
from hpcsweep.model.vectors import one_or_each

MAX_STIFFNESS = 1e12
"""Of a slider, in what is left of the structure while it slips."""
AT_LEAST_0 = "finite and at least 0", 0.0, LARGEST
ABOVE_0 = "finite and above 0", math.ulp(0.0), LARGEST
ANY = "a number", -math.inf, math.inf
YIELDS = "above 0 (inf: it does not yield)", math.ulp(0.0), math.inf
LIMITS = {
    "stiffness_ratio": ("at least 0, or inf", 0.0, math.inf),
    **dict.fromkeys(("storey_stiffness", "storey_damping"), AT_LEAST_0),
    **dict.fromkeys(("mass", "weight", "storey_height"), ABOVE_0),
    **dict.fromkeys(("gap", "gap_left", "restitution"), ANY),
    **dict.fromkeys(("yield_force", "yield_drift"), YIELDS),
    "flag_height": ("from 0 to 1", 0.0, 1.0),
    "hardening": ("from -0.1 to below 1", -0.1, math.nextafter(1.0, 0.0)),
}
"""Words, least and most of the parameters with one value or one per floor."""
NOT_OF_FLOORS = {"yield_force": "storey", "yield_drift": "storey"}
"""What such a parameter has a value for, besides."""
COLLAPSE = "above 0 (inf: none)", math.ulp(0.0), math.inf


@dataclass(frozen=True, repr=False)
class Structure(MeasuredDynamics):
    """Parameters of the structure and its stops, validated.

    The equation of motion of the uniform building is (8) with (5), (9) and (10)::

        u'' + 2 gamma C u' + K u + beta S(u) (u - 1) = -1 A sin(Omega tau)

    and in general that of `hpcsweep.model.matrices`, with b = -M 1 (a base that shakes).

    Parameters
    ----------
    n_floors : int
        Number of storeys n, 1 to 64; of matrices up to 512 rows.
    stiffness_ratio : float or sequence of n floats
        Contact-to-storey stiffness ratio beta >= 0 (7), one or one per floor: the spring behind a
        stop of floor i has beta_i times the stiffness of storey i. 0 means no stop, ``math.inf`` a
        rigid one, which needs `restitution`, see `hpcsweep.model.rigid`.
    sharpness : float
        rho >= 0 of the sigmoid contact spring (5); ``math.inf`` is the piecewise linear stop,
        0 a pre-tensioned linear spring of half the contact's stiffness.
    damping_ratio : float or sequence of floats
        Damping ratio zeta_i >= 0 of every mode of the free structure that vibrates, or one for
        each, lowest frequency first (12).
    mass, storey_stiffness : float or sequence of n floats, optional
        Mass of each floor, and stiffness of each storey from the lowest on. Default: 1.
    gap, gap_left : float or sequence of n floats
        Distance of each floor at rest from the stop on its right, and on its left; of any sign.
        ``math.inf``: no stop there.
    rayleigh : dict or (float, float), optional
        ``{"ratio": 0.05, "modes": (1, 3)}``, a damping ratio and the two modes that have it, or
        ``"periods"`` for the modes: damping alpha M + beta K in place of `damping_ratio`, K with
        the springs of all sliders. Or (alpha, beta) themselves.
    storey_damping : float or sequence of n floats
        Coefficient c >= 0 of a dashpot in each storey, besides.
    restitution : float or sequence of n floats, optional
        Coefficient of restitution of the stops of every floor, above 0 and at most 1: a dashpot
        beside the spring, see `hpcsweep.model.dashpot`; of rigid stops from 0 to 1. It needs
        sharpness = inf.
    tension : bool
        Whether these dashpots may pull, see `Contact`.
    yield_force, yield_drift : float or sequence of n floats, optional
        Force, or drift, at which each storey yields, above 0; ``math.inf`` for one that does not.
        One of the two.
    hardening : float or sequence of n floats
        Stiffness of a storey that yields over that before, from -0.1 to below 1.
    flag_height : float or sequence of n floats
        beta, to 1, of storeys that spring back: those that yield at the force f come home with
        (1 - beta) f. 0: they stay where they have yielded to.
    backbone : Backbone, dict or sequence of n, optional
        Of storeys that degrade, see `hpcsweep.model.backbone`; `hardening` is theirs.
    p_delta : bool
        Whether the weight above each storey over its height is taken from its stiffness, see
        `hpcsweep.model.system`. Modes and damping are those of the rest.
    weight, storey_height : float or sequence of n floats, optional
        Of each floor, and of each storey from the lowest on.
    collapse_drift : float or sequence of floats, optional
        Drift, of all storeys or of each, beyond which a motion has collapsed and ends; ``math.inf``
        for one without. Goes with sliders, and is needed where those that slip leave a stiffness
        that is negative.
    harmonics : sequence of (order, amplitude, phase)
        Of the forcing: A sum_h a_h sin(h Omega tau + phi_h). Default: A sin(Omega tau).
    matrices, motion_length, unreached, reduction
        Set by `from_matrices`, `measured_by`, `within_reach`, and that of a model
        (`hpcsweep.read_model`).
    unit_names : UnitNames
        Names of the units of all this; `names` of floors and contacts. Labels only.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    Examples
    --------
    The building of the study, in its units (gaps, and 1/omega_0 of time); and one floor between two
    stops, in m, kg and s:

    >>> hpcsweep.Structure(n_floors=3, stiffness_ratio=1000.0, sharpness=1e4).n_floors
    3
    >>> hpcsweep.Structure(
    ...     n_floors=1, mass=2.0, storey_stiffness=800.0, gap=0.01, gap_left=0.02
    ... ).gap_left
    0.02
    """

    def __post_init__(self) -> None:
        if self.matrices is not None:
            instance("matrices", self.matrices, Matrices)
        value = items("unreached", self.unreached, "numbers of contacts")
        self._set("unreached", tuple(count("unreached", contact, 1) for contact in value))
        most = matrices.MAX_ROWS if self.matrices else matrices.MAX_FLOORS
        n = count("n_floors", self.n_floors, 1, most)
        self._set("n_floors", n)
        limit = "at least 0 (inf is allowed)"
        self._set("sharpness", number("sharpness", self.sharpness, limit, 0.0))
        for name, limits in LIMITS.items():
            value = getattr(self, name)
            if value is not None or getattr(type(self), name) is not None:
                what = NOT_OF_FLOORS.get(name, "floor")
                self._set(name, one_or_each(name, value, n, what, limits))
        for name in ("gap", "gap_left"):
            if -math.inf in self._floors(getattr(self, name)):
                raise wrong(name, "must not be -inf: the stop would always push")
        if self.backbone is not None:
            self._set("backbone", self.backbones)
        self._set("harmonics", read_harmonics(self.harmonics))
        self._set("rayleigh", read_rayleigh("rayleigh", self.rayleigh, n))
        self._set("tension", flag("tension", self.tension))
        refuse_beside(self)
        free = self.matrices is None and 0.0 in self._floors(self.storey_stiffness)
        if free and any(not stop.stiffness for stop in self.all_contacts.values()):
            limit = "must be above 0 at a floor with a stop, whose stiffness is in proportion"
            raise wrong("storey_stiffness", limit)
        said_by = ("restitution", self.restitution) if self.matrices is None else None
        refuse_smooth([*self.all_contacts.values()], self.sharpness, said_by)
        self._set("p_delta", flag("p_delta", self.p_delta))
        if self.storey_height is not None and not self.names.storey_heights:
            heights = tuple(np.broadcast_to(self.storey_height, n).tolist())
            taken = tuple(self.weight_stiffness.tolist() if self.p_delta else ())
            self._set("names", self.names._replace(storey_heights=heights, taken=taken))
        if (last := max(self.contact_numbers, default=0)) > matrices.MAX_CONTACTS:
            limit = f"stops on the left numbered up to {last}, the most are {matrices.MAX_CONTACTS}"
            raise wrong("gap_left", f": {n} floors have {limit}")
        if not self.is_uniform:
            check_definite("mass" if self.matrices is None else "matrices.mass", self.mass_matrix)
        vibrate = n - self.n_rigid, "mode" + " that vibrates" * (self.n_rigid > 0)
        ratios = one_or_each("damping_ratio", self.damping_ratio, *vibrate, AT_LEAST_0)
        self._set("damping_ratio", ratios)
        if isinstance(self.rayleigh, Rayleigh) and min(self.rayleigh.modes or (n,)) <= self.n_rigid:
            limit = f"must be above {self.n_rigid}: modes up to that have no spring"
            raise wrong("rayleigh.modes", limit)
        for name in self.slider_names:
            if self.slider_names.count(name) > 1:
                raise wrong("slider.name", f"must differ, {name!r} is given twice")
        self._check_sliders()
        self._check_collapse()

    @classmethod
    def from_matrices(
        cls,
        mass: Any,
        stiffness: Any,
        contacts: Any,
        *,
        damping_ratio: float | Sequence[float] | None = None,
        damping: Any = None,
        forcing: Any = None,
        influence: Any = None,
        sharpness: float = math.inf,
        harmonics: Sequence[tuple[int, float, float]] = ONE_HARMONIC,
        drift: Any = None,
        rayleigh: Any = None,
        sliders: Any = (),
        collapse_drift: Any = None,
        springs: Any = (),
    ) -> "Structure":
        """Return a structure from its matrices, contacts and sliders.

        Parameters
        ----------
        mass, stiffness : array_like, shape (n, n)
            M and K without sliders, symmetric; n masses stand for a diagonal M. M is positive
            definite. K with the springs of all sliders may leave motions free, which contacts then
            hold, but is not negative.
        contacts : sequence of Contact
            64 at most.
        damping_ratio : float or sequence of floats, optional
            Damping ratio of every mode of the free structure that vibrates. Default: none, unless
            `damping` is given.
        damping : array_like, shape (n, n), optional
            C in place of it, its symmetric part positive semidefinite; what is skew is gyroscopic.
        forcing : array_like, shape (n,), optional
            b. Default: -M 1, a base that shakes.
        influence : array_like, shape (n,), optional
            r of a base that shakes, b = -M r, in place of it: the displacements of the coordinates
            where the base moves by 1. Default: 1 of all.
        sharpness : float
            rho of all contacts.
        harmonics : sequence of (order, amplitude, phase)
            Of the forcing, see `Structure`.
        drift : array_like, shape (any, n), optional
            Rows whose largest |row . u| is the drift. Default: each coordinate.
        rayleigh : dict or (float, float), optional
            See `Structure`.
        sliders : sequence of Slider, optional
            Modes and damping ratios are those of the structure whose
            sliders stick.
        collapse_drift : float or sequence of floats, optional
            Of the rows of `drift`, see `Structure`.
        springs : sequence of Spring, optional
            Multilinear ones, which join K and, behind the others, the contacts.

        Raises
        ------
        ValueError
            If a value is of the wrong kind or outside its range; the message names it.
        """
        dampings = {"damping_ratio": damping_ratio, "damping": damping, "rayleigh": rayleigh}
        used = [name for name, value in dampings.items() if value is not None]
        if len(used) > 1:
            raise wrong(used[0], f"and {used[1]} must not be given both")
        if len(springs):
            if sharpness != math.inf:
                raise wrong("springs", f"need sharpness = inf, sharpness is {sharpness:g}")
            stiffness, kinks = add_springs(stiffness, springs, len(mass))
            contacts = [*contacts, *kinks]
        read = read_matrices(mass, stiffness, contacts, damping, forcing, drift, sliders, influence)
        return cls(
            n_floors=len(read.mass),
            stiffness_ratio=0.0,
            sharpness=sharpness,
            damping_ratio=0.0 if damping_ratio is None else damping_ratio,
            gap=math.inf,
            rayleigh=rayleigh,
            harmonics=harmonics,
            matrices=read,
            collapse_drift=collapse_drift,
        )

    def _check_sliders(self) -> None:
        """Refuse sliders too stiff beside what carries the structure while they slip."""
        springs = self.slider_stiffness.tolist()
        if self.matrices is None or not springs:
            return
        trace = float(np.trace(self.elastic_stiffness))
        beside = trace if trace > 0.0 else min(springs)
        for name, slider, spring in zip(self.slider_names, self.sliders, springs, strict=True):
            if spring > MAX_STIFFNESS * beside:
                most = f"at most {MAX_STIFFNESS:g} times that of what is beside it, {beside:.4g}"
                raise refused(f"slider.stiffness of {name!r}", most, slider.stiffness)

    def _check_collapse(self) -> None:
        """Check `collapse_drift`, which is required if K is indefinite while sliders slip."""
        collapse = self.collapse_drift
        if collapse is not None:
            if not self.sliders:
                raise wrong("collapse_drift", "goes with yield_drift, yield_force or a slider")
            n = len(self.drift_rows)
            drifts = one_or_each("collapse_drift", collapse, n, "storey", COLLAPSE)
            self._set("collapse_drift", drifts)
        rows, limits = self.drift_rows, self.drift_limits
        for slider in self.sliders:
            b = np.array(slider.direction)
            share = rows @ b / (b @ b)  # of the elongation, where the drift is along it
            off = np.abs(rows - np.outer(share, b)).max(axis=1)
            along = off <= ROUNDED * np.abs(rows).max(axis=1)
            least = (limits[along] / np.abs(share[along])).min(initial=math.inf)
            if least <= slider.limit:
                limit = f"above the drift at which the storey yields, {slider.limit:.4g}"
                raise wrong("collapse_drift", f"must be {limit}, is {least:.4g}")
        if self.sliders:
            # motions whose drifts are bounded may leave in directions that none of these has
            _, size_of, axes = np.linalg.svd(rows[np.isfinite(limits)])
            free = axes[np.count_nonzero(size_of > ROUNDED * size_of.max(initial=0.0)) :]
            values = np.linalg.eigvalsh(free @ self.softest_stiffness @ free.T)
            if values.min(initial=0.0) < -ROUNDED * np.trace(self.stiffness_matrix):
                what = "is missing" if collapse is None else "must be finite for each that softens"
                why = "the structure softens once all sliders slip, its stiffness then has the"
                raise wrong("collapse_drift", f"{what}: {why} eigenvalue {values[0]:.4g}")

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Show the differences from the paper's building, and the sizes of matrices."""
        hidden = {f.name for f in fields(self) if not (f.init and f.repr)} | {"n_floors"}
        shown = [f"n_floors={self.n_floors}"]
        if self.matrices is not None:
            shown.append(f"matrices, {len(self.matrices.contacts)} contacts")
            shown += [f"{len(self.sliders)} sliders"] if self.sliders else []
            hidden |= {"stiffness_ratio", "gap", "gap_left", "matrices"}
            if self.matrices.damping is not None:
                ratios = self.damping_ratios[min(self.n_rigid, self.n_floors - 1) :]
                shown.append(f"damping matrix, ratios {ratios.min():.3g} to {ratios.max():.3g}")
                hidden.add("damping_ratio")
        if self.rayleigh is not None:
            hidden.add("damping_ratio")
        shown += [
            f"{f.name}={value!r}"
            for f in fields(self)
            if f.name not in hidden and (value := getattr(self, f.name)) != f.default
        ]
        return f"Structure({', '.join(shown)})"

    def named(self, *names: Sequence[Any]) -> "Structure":
        """Return the same structure with the fields of `Names`, in order."""
        return self.labelled(names=Names(*(tuple(listed) for listed in names)))

    def labelled(self, **labels: "Names | UnitNames | Structure") -> "Structure":
        """Return the same structure with other `names`, `unit_names` or `in_units_of`.

        It keeps what it knows. `in_units_of` is another one beside which it is told, in one unit.
        """
        other = copy(self)
        vars(other).update(labels)
        return other

    def without_contacts(self) -> "Structure":
        """Return the same structure without contacts."""
        names = self.names._replace(contacts=())
        if self.matrices is None:
            return replace(self, gap=math.inf, gap_left=math.inf, names=names)
        return replace(self, matrices=replace(self.matrices, contacts=()), names=names)
