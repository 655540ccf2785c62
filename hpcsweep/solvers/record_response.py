"""Peaks of the response of a structure to a ground-motion record."""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.kernel_model import Model
from hpcsweep.model.observed import CLOSINGS, DISSIPATED, FORCE, SPEED, TIME, TOGETHER, Measures
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.measures import along_rows, of_structure, peaks_of
from hpcsweep.solvers.outcome import Outcome

SAME_TIME = 1e-9
"""Part of a sample interval by which a tail may miss a whole number of them."""

SAME_FORCE = 1e-9
"""Part of its strength by which a flag that rests may miss the force at which it slips back."""


class Slid(NamedTuple):
    """What the L sliders of a structure have done, in units of length; shapes (L,)."""

    elongation: np.ndarray
    """Largest |b . u|."""
    force: np.ndarray
    """At the end, in the unit of force."""
    plastic: np.ndarray
    """p at the end."""
    path: np.ndarray
    """Sum of |dp|."""
    excursions: np.ndarray
    stiffness: np.ndarray
    """Part of k with which each unloads, 0 where its force is lost, ..."""
    lost: np.ndarray
    """... and when, NaN if it is not."""
    largest: np.ndarray
    """Force over k of one that degrades; NaN of others."""

    def stretch(self, spring: np.ndarray) -> np.ndarray:
        """Return the elongations that unloading takes back, of sliders of stiffness k."""
        return self.force / np.where(self.stiffness > 0.0, spring * self.stiffness, math.inf)


NONE_SLID = Slid(*(np.zeros(0),) * 4, np.zeros(0, int), *(np.zeros(0),) * 3)


class Ended(NamedTuple):
    """How a motion has ended."""

    state: np.ndarray
    """(2n,), in units of the structure."""
    duration: float
    """Likewise."""
    outcome: Outcome
    collapsed: bool


class Energy(NamedTuple):
    """Energies of a motion at its end, relative to the ground, in the unit of force times length.

    Kinetic and strain energy are less those at the start, and that of springs is less the work of
    the weights of P-Delta.
    """

    input: float
    """Work of the ground, the integral of b . u' a(t)."""
    kinetic: float
    strain: float
    """Of springs, those of sliders and contacts included."""
    viscous: float
    """Taken by the damping matrix ..."""
    contacts: float
    """... by the dashpots of contacts ..."""
    sliders: float
    """... and by sliders."""

    @property
    def balance(self) -> float:
        """Input less all others over the largest of them: rounding."""
        return (self.input - sum(self[1:])) / (max(map(abs, self)) or 1.0)


@dataclass(frozen=True, eq=False)
class Response(Measures):
    """Peaks of the response to a record, from its first sample to the end of its tail.

    Peaks are over continuous time unless they are asked for at the samples, where those of contacts
    are, too. Displacements, drifts and forces include those at rest, which are 0 unless a contact
    is pressed (`hpcsweep.model.equilibrium`). Units are those of the structure.

    Attributes
    ----------
    displacement, storey_drift, floor_acceleration : ndarray, shapes (n,), (D,) and (n,)
        See `hpcsweep.model.observed.Measures`, ...
    contact_force, impacts, simultaneous, impact_velocity, impulse, contact_share : ndarray, (k,)
        ... with sums over the record and its tail.
    drift, force
        `storey_drift` and `contact_force`.
    contact_time : ndarray, shape (k,)
        Time in which each contact was closed.
    dissipated : ndarray, shape (k,)
        Energy that the dashpot of each contact has taken; 0 without one.
    residual : ndarray, shape (n,)
        |u_i - u_i at rest| at the end: what is left of the motion after the tail, and of a
        structure whose sliders have slipped their lasting displacement with it.
    residual_displacement, residual_drift : ndarray, shapes (n,) and (rows,)
        Displacements from rest at which the structure would come to rest with its sliders as they
        ended, and the drifts there; 0 without sliders.
    final_state : ndarray, shape (2n,)
        (u, u') at the end.
    displacement_time, drift_time, acceleration_time, force_time : ndarray
        When these peaks are, from the first sample on.
    ductility, slider_force : ndarray, shape (L,)
        Largest elongation of each slider over that at which it first slips, F / k, and its largest
        force.
    plastic, plastic_path : ndarray, shape (L,)
        Lasting elongation p of each slider at the end, and the sum of its changes.
    excursions : ndarray of int, shape (L,)
        How often it has slipped.
    final_slider_force : ndarray, shape (L,)
        Force of each slider at the end.
    slider_energy : ndarray, shape (L,)
        Energy that it has dissipated, F times the plastic path.
    strength_lost : ndarray, shape (L,)
        When a slider with a backbone has lost all force; NaN if it has not.
    base_shear : ndarray, shape (B,)
        Largest reaction of the base of each building (`Structure.buildings`), the sum of its forces
        of inertia and of its contacts, if it is wanted; else empty.
    collapsed : bool
        Whether a drift has left its limit (`collapse_drift`). The motion ends there, and all the
        above is of the motion until then.
    collapse_time : float
        When; NaN if it has not.
    duration : float
        Time that was integrated; that up to the failure if one occurred.
    outcome : Outcome
    energy : Energy or None
        Energies at the end, if they are wanted.

    Examples
    --------
    From `hpcsweep.response`. A mass on a spring under the sudden acceleration 1 moves to twice its
    static displacement -1 / k, at half its period:

    >>> step = hpcsweep.Record([1.0, 1.0], dt=4.0)
    >>> free = hpcsweep.Structure(n_floors=1, stiffness_ratio=0.0, damping_ratio=0.0)
    >>> peaks = hpcsweep.response(free, step)
    >>> peaks.displacement.round(12), (peaks.displacement_time / math.pi).round(12)
    (array([2.]), array([1.]))
    """

    contact_time: np.ndarray
    dissipated: np.ndarray
    residual: np.ndarray
    final_state: np.ndarray
    displacement_time: np.ndarray
    drift_time: np.ndarray
    acceleration_time: np.ndarray
    force_time: np.ndarray
    ductility: np.ndarray
    slider_force: np.ndarray
    plastic: np.ndarray
    plastic_path: np.ndarray
    excursions: np.ndarray
    final_slider_force: np.ndarray
    slider_energy: np.ndarray
    strength_lost: np.ndarray
    residual_displacement: np.ndarray
    residual_drift: np.ndarray
    base_shear: np.ndarray
    collapsed: bool
    collapse_time: float
    duration: float
    outcome: Outcome
    energy: Energy | None = None

    @property
    def drift(self) -> np.ndarray:
        """Shape (D,)."""
        return self.storey_drift

    @property
    def force(self) -> np.ndarray:
        """Shape (k,)."""
        return self.contact_force


def response_of(
    structure: Structure, model: Model, tally: Any, slid: Slid, ended: Ended
) -> Response:
    """Make a response from what has been gathered in the kernels' units.

    Parameters
    ----------
    structure : Structure
    model : Model
    tally
        Has `peaks` and `times` of the rows of `Model.watched`, and `impacts`.
    slid : Slid
    ended : Ended
    """
    n, state, impacts = structure.n_floors, ended.state, tally.impacts
    length, rate = structure.length_unit, structure.frequency_unit
    peaks = peaks_of(structure, model, tally.peaks)
    times = of_structure(structure, along_rows(model, tally.times / rate))
    shear = peaks["floor_acceleration"][n:]
    if shear.size:
        shear = shear * structure.base_masses
    unit = structure.force_per_length
    spring = np.array([slider.stiffness for slider in structure.sliders])
    strength = np.array([slider.strength for slider in structure.sliders])
    elongation, path = slid.elongation * length, slid.path * length
    plastic = slid.plastic * length
    reached = np.where(np.isnan(slid.largest), strength, spring * slid.largest * length)
    lasting = np.full(n, math.nan if ended.collapsed else 0.0)
    if plastic.any() and not ended.collapsed:
        lasting = _lasting(structure, plastic, slid.stiffness) - structure.rest[:n]
    return Response(
        **of_structure(structure, peaks),
        impacts=impacts[CLOSINGS].astype(int),
        simultaneous=impacts[TOGETHER].astype(int),
        impact_velocity=impacts[SPEED] * (length * rate),
        contact_share=impacts[TIME] / rate / (ended.duration or 1.0),
        contact_time=impacts[TIME] / rate,
        impulse=impacts[FORCE] * unit * (length / rate),
        dissipated=impacts[DISSIPATED] * unit * length**2,
        residual=np.abs(state[:n] - structure.rest[:n]),
        final_state=state,
        displacement_time=times["displacement"],
        drift_time=times["storey_drift"],
        acceleration_time=times["floor_acceleration"],
        force_time=times["contact_force"],
        ductility=elongation * spring / strength,
        slider_force=np.where(slid.excursions, reached, spring * elongation),
        plastic=plastic,
        plastic_path=path,
        excursions=slid.excursions,
        final_slider_force=slid.force,
        strength_lost=slid.lost,
        slider_energy=structure.slider_losses(path, slid.excursions),
        residual_displacement=lasting,
        residual_drift=structure.drift_rows @ lasting,
        base_shear=shear,
        collapsed=ended.collapsed,
        collapse_time=ended.duration if ended.collapsed else math.nan,
        duration=ended.duration,
        outcome=ended.outcome,
    )


def _lasting(structure: Structure, plastic: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the displacements of the structure at rest, its flags home where they slip back."""
    from hpcsweep.model.equilibrium import static_equilibrium  # reading results needs no scipy

    pairs = [(one.stiffness, one.strength, one.returns) for one in structure.sliders]
    spring, strength, returns = np.array(pairs, float).T
    u = static_equilibrium(structure, plastic, share)
    force = np.sign(plastic) * spring * (structure.slider_directions @ u - plastic)
    home = np.where(force < returns - SAME_FORCE * strength, 0.0, plastic)
    return u if np.array_equal(home, plastic) else _lasting(structure, home, share)


def energy_of(
    structure: Structure, response: Response, slid: Slid, start: np.ndarray, integrals: np.ndarray
) -> Response:
    """Return a response with its energies; see `energy_at`."""
    taken = response.dissipated, response.slider_energy
    energy = energy_at(structure, (response.final_state, slid), taken, start, integrals)
    return replace(response, energy=energy)


def energy_at(structure: Structure, reached, taken, start, integrals: np.ndarray) -> Energy:
    """Return the energies of a motion.

    Parameters
    ----------
    structure : Structure
    reached : pair of ndarray, shape (2n,), and Slid
        (u, u') and what the sliders have done.
    taken : pair of ndarray, shapes (k,) and (L,)
        Energy that contacts and sliders have dissipated.
    start : ndarray, shape (2n,)
        (u, u') at the start.
    integrals : ndarray, shape (n + 1, n)
        Of u_i' u_j', and of G u_i', in the kernels' units.
    """
    n, length, rate = structure.n_floors, structure.length_unit, structure.frequency_unit
    spring = np.array([slider.stiffness for slider in structure.sliders])
    pull = np.array([slider.shares[1] for slider in structure.sliders])
    first = structure.slider_directions @ start[:n]

    def held(state: np.ndarray, force: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """Return kinetic and strain energy."""
        u, v = np.split(state, 2)
        strain = 0.5 * (u @ structure.elastic_stiffness @ u + force @ stretch)
        strain += pull @ np.abs(structure.slider_directions @ u - stretch)
        return np.array([0.5 * v @ structure.mass_matrix @ v, strain + structure.contact_energy(u)])

    state, slid = reached
    kinetic, strain = held(state, slid.force, slid.stretch(spring)) - held(
        start, spring * first, first
    )
    work = length**2 * rate * integrals
    return Energy(
        input=float(rate * work[n] @ structure.forcing_vector),
        kinetic=float(kinetic),
        strain=float(strain),
        viscous=float((structure.damping_matrix * work[:n]).sum()),
        contacts=float(taken[0].sum()),
        sliders=float(taken[1].sum()),
    )


def intervals(n_samples: int, dt: float, tail: float) -> tuple[int, float]:
    """Return how many whole sample intervals a record and its tail have, and what is left."""
    n_tail = int(tail / dt + SAME_TIME)
    rest = tail - n_tail * dt
    return n_samples - 1 + n_tail, rest if rest > SAME_TIME * dt else 0.0
