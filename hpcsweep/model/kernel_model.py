r"""The solvers' model of a structure and its forcing: equations solved for the accelerations.

    u'' = -M^-1 K u - M^-1 C u' + f G(tau) - sum_k beta_k S(rho x_k) x_k e_k,   x_k = d_k . u - g_k

with G = A sum_h a_h sin(h Omega tau + phi_h) and f = M^-1 b. Contact k pushes along
e_k = M^-1 d_k / (d_k . M^-1 d_k), for which d_k . e_k = 1, so that its distance feels the stiffness
beta_k = kappa_k d_k . M^-1 d_k: x_k'' = ... - beta_k S x_k.

Lengths and frequencies are measured in the structure's units, powers of two, so that tolerances
mean the same for all and no digit is lost (1 for the building of the paper).

Every contact and every drift refers to one row of a list of displacements. Its first n rows are u.
A direction that is not a coordinate gets a row of its own, y = E u, with the accelerations E u'':
the state of the kernels has R >= n rows of displacements and as many velocities, and the rows
beyond n enter no force but that of their contact. The first of them are the bases of the buildings,
where they are asked for, y = 1 . M u / (1 . M 1) over the coordinates of each: the absolute
acceleration of such a row, on which contacts do not act, is the reaction of the base over the mass.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.simd import LANES
from hpcsweep.model.definite import is_symmetric
from hpcsweep.model.elements import Elements, kernel_elements
from hpcsweep.model.kernel_contacts import Contacts, kernel_contacts, wide
from hpcsweep.model.modes import per_mass
from hpcsweep.model.observed import PEAKS
from hpcsweep.model.structure import Structure

GYROSCOPIC = 4.0
"""Multiple of the rate of a gyroscopic matrix g that bounds |lambda| <= g + sqrt(k) with the larger
of both, within a quarter."""


class Model(NamedTuple):
    """A structure at one forcing frequency, in its own units."""

    stiffness: np.ndarray
    """(R, R): M^-1 K, columns beyond n are 0."""
    damping: np.ndarray
    """(R, R): M^-1 C, likewise."""
    forcing: np.ndarray
    """(R,): f."""
    ground: np.ndarray
    """(n,), with bases these behind: what the absolute acceleration u'' + ground G has
    of the forcing: -f where a base shakes, and of bases, whose reaction springs and dashpots
    have; 0 where forces act on a structure whose base rests."""
    harmonics: np.ndarray
    """(H, 3): order, amplitude and phase."""
    ramp: np.ndarray
    """(P, 3), P = 0 or 1: G and G' at the start of a period along which G is linear, and when it
    starts."""
    rows: np.ndarray
    """(R - n, n): E."""
    contacts: Contacts
    elements: Elements
    drift_rows: np.ndarray
    """(any, 2) int: a drift is y[first] - y[second], or y[first] where the second is -1; drifts of
    the structure, then elongations of sliders that are no such drift."""
    watched: np.ndarray
    """(Q, 4) int: rows whose peaks can be requested: first and second as for a drift, a side (0 for
    |y|, 1 or -1 for that times y), and the flag that requests them. In the order of
    `observed.PEAKS`, each padded to a multiple of `LANES` by rows of flag 0."""
    modal_transform: np.ndarray
    """(n, R): Phi^-1, row j gives modal coordinate j."""
    balance: np.ndarray
    """(n,): 1 / sqrt of the masses, up to a factor: units in which M^-1 K is nearly symmetric."""
    drag: float
    """Largest eigenvalue of M^-1 C; the largest rate at which a motion grows whose sliders slip if
    that is greater."""
    stiffness_bound: float
    """Of the eigenvalues of M^-1 K."""
    hardest: float
    """Likewise, of the contribution of all contacts."""
    bandwidth: int
    """M^-1 K is 0 at (i, j) where |i - j| is greater."""
    damping_bandwidth: int
    """Likewise of M^-1 C."""
    rho: float
    omega: float
    period: float
    """Of the forcing."""
    layer: float
    """Half-width of the contact layer: |x| beyond it is linear; 0 if rho is infinite."""


def kernel_model(structure: Structure, omega: float) -> Model:
    """Return the kernels' model of a structure at forcing frequency Omega; arrays are read-only."""
    return model_at_frequency(_at_any_frequency(structure), structure, omega)


def model_at_frequency(model: Model, structure: Structure, omega: float) -> Model:
    """Return the model of a structure at another forcing frequency."""
    own = float(omega / structure.frequency_unit)
    return model._replace(omega=own, period=structure.forcing.period(own))


@lru_cache(maxsize=64)
def _at_any_frequency(structure: Structure, bases: bool = False, always: bool = False) -> Model:
    """Return the model but for the forcing frequency; see `record_model`."""
    length, rate = structure.length_unit, structure.frequency_unit
    mass = structure.mass_matrix
    n = structure.n_floors
    stiffness = per_mass(mass, structure.stiffness_matrix) / rate**2
    damping = per_mass(mass, structure.damping_matrix) / rate
    own = structure.base_rows if bases else np.zeros((0, n))
    rows = _Rows(n, len(own))
    places = [rows.of(direction) for direction in structure.directions]
    slides = [rows.slide(slider.direction) for slider in structure.sliders]
    drifts = [rows.difference(row) for row in structure.drift_rows]
    limited = drifts.copy()
    drifts += [(i, below) for i, below, _ in slides if (i, below) not in drifts]
    drift_rows = np.array(drifts, np.int64)
    extra = np.vstack((own, np.array(rows.extra).reshape(-1, n)))
    layer = float(structure.layer_half_width / length)
    rates = np.linalg.eigvals(damping)
    drag = float(rates.real.max())
    if not is_symmetric(structure.damping_matrix):
        drag += GYROSCOPIC * float(np.abs(rates.imag).max())
    masses = np.diag(mass)
    forcing = wide(per_mass(mass, structure.forcing_vector), extra)
    contacts = kernel_contacts(structure, places, extra, (stiffness, damping), layer, len(own))
    growth = _growth(structure, drag)
    model = Model(
        stiffness=_extended(stiffness, extra),
        damping=_extended(damping, extra),
        forcing=forcing,
        ground=-forcing[:n] if structure.shakes else np.zeros(n),
        harmonics=np.array(structure.forcing.terms, float).reshape(-1, 3),
        ramp=np.zeros((0, 3)),
        rows=extra,
        contacts=contacts,
        elements=kernel_elements(structure, contacts, slides, limited, extra, always),
        drift_rows=drift_rows.reshape(-1, 2),
        watched=_watched(drift_rows.reshape(-1, 2), n + len(own), places),
        modal_transform=np.hstack((structure.modal_transform, np.zeros((n, len(extra))))),
        balance=np.sqrt(masses.max() / masses),
        drag=max(drag, growth),
        stiffness_bound=max(float(structure.stiffness_bound / rate**2), growth**2),
        hardest=_hardest(structure),
        bandwidth=_bandwidth(stiffness) if not len(extra) else n + len(extra) - 1,
        damping_bandwidth=_bandwidth(damping) if not len(extra) else n + len(extra) - 1,
        rho=float(structure.sharpness * length),
        omega=0.0,
        period=0.0,
        layer=layer,
    )
    return _of_one_kind(model)


def forcing_size(model: Model) -> int:
    """Return the size of the forcing's state: a pair for each harmonic or ramp."""
    return 2 * (len(model.harmonics) + len(model.ramp))


def record_model(
    structure: Structure, dt: float, bases: bool = False, always: bool = False
) -> Model:
    """Return the kernels' model of a structure under a record: its period is a sample interval.

    Along an interval G is linear, as held by ``ramp``, which the caller writes. With `bases` the
    first rows beyond n are those of the buildings; `always` is that of `kernel_elements`.
    """
    model = _at_any_frequency(structure, bases, always)
    n = structure.n_floors
    own = model.forcing[n : n + len(structure.base_rows)] if bases else model.forcing[:0]
    return model._replace(
        ground=np.append(model.ground, -own),
        harmonics=np.zeros((0, 3)),
        ramp=np.zeros((1, 3)),
        omega=0.0,
        period=float(dt * structure.frequency_unit),
    )


def _watched(drift_rows: np.ndarray, n: int, places) -> np.ndarray:
    """List the rows of all quantities that have a peak; see `Model.watched`."""
    along = {
        "storey": [(int(i), int(below), 0) for i, below in drift_rows],
        "floor": [(i, -1, 0) for i in range(n)],
        "stop": [(row, -1, int(sign)) for row, sign in places],
    }
    listed: list[tuple[int, int, int, int]] = []
    for quantity in PEAKS:
        listed += [(*row, quantity.flag) for row in along[quantity.dim]]
        listed += -len(listed) % LANES * [(0, -1, 0, 0)]
    return np.array(listed, np.int64).reshape(-1, 4)


def _of_one_kind(value):
    """Copy all arrays, C-contiguous, for good."""
    if isinstance(value, tuple):
        return type(value)(*(_of_one_kind(field) for field in value))
    if not isinstance(value, np.ndarray):
        return value
    copy = np.array(value, order="C")
    copy.flags.writeable = False
    return copy


class _Rows:
    """Rows of displacements to which contacts and drifts refer."""

    def __init__(self, n: int, n_bases: int):
        self._n = n + n_bases
        self.extra: list[np.ndarray] = []

    def of(self, direction: np.ndarray) -> tuple[int, float]:
        """Find or add the row of a direction; return it and the sign."""
        entries = np.flatnonzero(direction)
        if entries.size == 1 and abs(direction[entries[0]]) == 1.0:
            return int(entries[0]), float(direction[entries[0]])
        for place, known in enumerate(self.extra):
            for sign in (1.0, -1.0):
                if np.array_equal(sign * known, direction):
                    return self._n + place, sign
        self.extra.append(np.array(direction, float))
        return self._n + len(self.extra) - 1, 1.0

    def slide(self, direction: Sequence[float]) -> tuple[int, int, float]:
        """Return the two rows, and the sign of their difference, of an elongation."""
        array = np.array(direction, float)
        first, second = self.difference(array)
        return (first, second, 1.0) if second >= 0 else (first, -1, self.of(array)[1])

    def difference(self, direction: np.ndarray) -> tuple[int, int]:
        """Return the two rows whose difference is a drift, or one row and -1."""
        entries = np.flatnonzero(direction)
        if entries.size == 2 and sorted(direction[entries].tolist()) == [-1.0, 1.0]:
            upper, lower = entries if direction[entries[0]] > 0 else entries[::-1]
            return int(upper), int(lower)
        return self.of(direction)[0], -1


def _extended(matrix: np.ndarray, extra: np.ndarray) -> np.ndarray:
    """Extend a matrix (n, n) to all rows, (R, R), with columns 0 beyond n."""
    tall = wide(matrix.T, extra).T
    return np.hstack((tall, np.zeros((len(tall), len(extra)))))


def _bandwidth(matrix: np.ndarray) -> int:
    i, j = np.nonzero(matrix)
    return int(np.abs(i - j).max(initial=0))


def _growth(structure: Structure, drag: float) -> float:
    """Bound the rate at which a motion grows whose sliders slip, or whose springs soften.

    0 if that stiffness is definite. With the least eigenvalue -k of its M^-1 K lambda^2 + d lambda
    = k, d <= `drag`, so that |lambda| is at most the larger root of lambda^2 - d lambda = k.
    """
    softer, rows = np.minimum(structure.contact_stiffness, 0.0), structure.directions
    if not structure.sliders and not softer.any():
        return 0.0
    root = np.linalg.cholesky(structure.mass_matrix)
    soft = structure.softest_stiffness + rows.T @ (softer[:, None] * rows)
    half = np.linalg.solve(root, soft) / structure.frequency_unit**2
    least = float(np.linalg.eigvalsh(np.linalg.solve(root, half.T).T)[0])
    return 0.5 * (drag + float(np.sqrt(drag**2 - 4.0 * least))) if least < 0.0 else 0.0


def _hardest(structure: Structure) -> float:
    """Return the largest eigenvalue of the contribution of all contacts to M^-1 K."""
    reach = np.sqrt(np.abs(structure.contact_stiffness))[:, None] * structure.directions
    together = reach @ per_mass(structure.mass_matrix, reach.T) / structure.frequency_unit**2
    return float(np.linalg.eigvalsh(together)[-1]) if len(reach) else 0.0
