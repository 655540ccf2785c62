"""Exact propagators of the linear motion between contact changes, one table a contact set.

While no contact is inside its layer the sigmoid is 0 or 1 to rounding, and with the set c of
contacts that touch (c_k in {0, 1}) the motion is linear with constant coefficients (symbols as in
`hpcsweep.model.kernel_model`)::

    u'' + D u' + (K + sum_k c_k beta_k e_k d_k^T) u = sum_k c_k beta_k g_k e_k + f G(tau)

With the augmented state x = (y, y', s_1, c_1, .., s_H, c_H, q_1, .., q_L, 1), shape (N,) with N =
2 R + 2 H + L + 1, s_h, c_h = A a_h (sin, cos)(h Omega tau + phi_h) and loads q of sliders
(`hpcsweep.model.elements`), it is x' = M x, and M depends on c but not on A. Where G is linear
along a period one pair (G, G') replaces those. Rows beyond n are outputs: y = E u. A table holds,
for one set,

- ``step``: exp(M h), the propagator over one full step h;
- ``poly``: exp(M s), 0 <= s <= h, as polynomials in sigma = 2 s / h - 1 of degree `DEGREE`;
- ``bound4``: a bound of |y_i''''| on the step, linear in |x|, which proves that no contact is
  reached (see `search`).

Size of the step. theta = h max(|lambda(M)|) is at most `THETA`. The Chebyshev coefficients of
exp(i theta sigma / 2) are Bessel functions, |c_k| = 2 |J_k(theta / 2)| <= 2 (theta/4)^k / k!,
so that the truncated tail is below 2 (0.9)^16 / 16! = 2e-14 for theta = 3.6 and degree 15. The
polynomial is found as the Taylor series about the middle of the step to order `TAYLOR`, whose
terms (theta/2)^k / k! never exceed 1.7 (no cancellation), economised to degree 15 through the
Chebyshev basis. Velocities are scaled by the largest frequency first, so that M is balanced.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile.places import allocate, part, zeros
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.backbone import SIZE
from hpcsweep.model.elements import TAKES
from hpcsweep.model.kernel_model import Model, forcing_size
from hpcsweep.model.observed import ACCELERATION, CONTACT, FLOOR
from hpcsweep.solvers.flow.rules.volterra_rule import N_NODES, N_PARTS


def economisation(taylor: int, degree: int) -> np.ndarray:
    """Return the map of monomial coefficients up to x^taylor on [-1, 1] to degree + 1 ones.

    x^k = 2^(1-k) sum_j binomial(k, j) T_(k-2j)(x), the term T_0 halved; terms above T_degree are
    dropped. All numbers are integers over 2^(taylor-1); a double holds them up to taylor = 30.

    Returns
    -------
    ndarray, shape (taylor + 1, degree + 1)
    """
    chebyshev = np.zeros((degree + 1, degree + 1))  # column d: coefficients of T_d
    chebyshev[0, 0] = chebyshev[1, 1] = 1.0
    for d in range(2, degree + 1):
        chebyshev[1:, d] = 2.0 * chebyshev[:-1, d - 1]
        chebyshev[:, d] -= chebyshev[:, d - 2]
    parts = np.zeros((degree + 1, taylor + 1))
    for k in range(taylor + 1):
        for j in range(k // 2 + 1):
            if k - 2 * j <= degree:
                half = 0.5 if k == 2 * j else 1.0
                parts[k - 2 * j, k] = half * math.comb(k, j) * 2.0 ** (1 - k)
    return np.ascontiguousarray((chebyshev @ parts).T)


DEGREE = 15
N_COEFFICIENTS = DEGREE + 1
TAYLOR = 30
THETA = 3.6
THETA_FREE = 2.2
"""Free flight: shorter, because the proof that no floor reaches the stop weakens with h^4."""
MAX_TABLES = 64
"""Most tables; when more contact sets occur the table store is emptied and refilled."""
LARGE, LARGE_COUPLED, LARGE_SPARED = 20, 32, 65
"""Rows from which on there are no propagators: steps are taken in modes (`step.spectral`). The
second is for a damping that couples modes, whose steps take n times as long, the third for smooth
contacts beside it, which are collocated anyway, and for sliders, most sets of which have no table
anyway (`series`)."""
N_POWERS = 4
"""Powers of the propagator of a step that are kept: exp(M h 2^k), k = 1, .., `N_POWERS`."""
BOUND_SAMPLES = np.linspace(-1.0, 1.0, 9 * LANES)
MODAL_NODES, MODAL_WEIGHTS = np.polynomial.legendre.leggauss(2 * LANES)
"""Of the modal norms (`modal_norm`), on a step."""
N_MODAL = MODAL_NODES.shape[0]
ZERO = np.zeros(LANES)


ECONOMISATION = economisation(TAYLOR, DEGREE)
"""(TAYLOR + 1, N_COEFFICIENTS)"""


def padded(n: int) -> int:
    """Round a number of rows up to a multiple of `LANES`."""
    return -(-n // LANES) * LANES


def sizes_of(model: Model) -> dict[str, int]:
    """Return the lengths of the arrays of a structure, by their names in `places.zeros`.

    n floors and modes, F rows with accelerations, R rows of displacements, H pairs of the forcing,
    m contacts, E elements, L loads; N of the augmented state; T tables; W watched rows.
    """
    n, rows, forcing = len(model.modal_transform), model.stiffness.shape[0], forcing_size(model)
    m, n_loads = model.contacts.row.size, model.elements.stiffness.size
    constant, count = forcing + n_loads, model.elements.first.size
    sizes = {"L": n_loads, "n": n, "R": rows, "2R": 2 * rows, "2H": forcing, "m": m}
    sizes["rigid"] = model.contacts.bounce.size
    sizes |= {"N": 2 * rows + constant + 1, "2H+L": constant}
    degrades = bool((model.elements.guard[:, TAKES] < 0.0).any())
    tabled = m if degrades else m + n_loads
    sizes |= {"T": min(2**tabled, MAX_TABLES), "W": len(model.watched)}
    sizes |= {"E": count, "states": count + degrades * SIZE * n_loads}
    sizes |= {"n+1": n + 1, "F": len(model.ground)}
    sizes |= {"n nodes": n * N_MODAL, "harmonics": 2 * len(model.harmonics)}
    sizes |= {f"padded {name}": padded(size) for name, size in sizes.items()}
    sizes |= {"2 padded F": 2 * sizes["padded F"]}
    sizes["padded R+padded R"] = padded(rows + padded(rows))
    spared = n_loads > 0 or model.layer == math.inf
    apart = not spared and are_apart(model)
    spared = spared or (model.layer > 0.0 and not apart)
    large = rows >= (LARGE if apart else LARGE_SPARED if spared else LARGE_COUPLED)
    large = large and not sizes["rigid"] and not degrades
    volterra = apart and model.layer > 0.0
    for name in ("2R", "N"):
        sizes[f"tabled {name}"] = 0 if large else sizes[name]
    modes = padded(n) if large or volterra else 0
    sizes |= {"modes": modes, "2 modes": 2 * modes}
    units = 2 + forcing if volterra else 0
    sizes |= {"levels": LEVELS if volterra else 0, "units": units, "modal n": n if volterra else 0}
    sizes |= {"2 modes+2H": 2 * modes + forcing, "nodes+units": N_NODES + units}
    sizes |= {"responses": CAPACITY if volterra else 0, "built": 1 + N_PARTS + m}
    strides = large and model.elements.first.size == 0
    sizes |= {"strides": STRIDES if strides else 0, "2+2H": 2 + forcing if strides else 0}
    sizes |= {"strided N": sizes["N"] if strides else 0}
    return sizes


class Spectrum(NamedTuple):
    """The free structure in its modes, u = Phi q, of a large one; rows are padded with zeros."""

    shapes: np.ndarray
    """(R, padded n): Phi, of all rows."""
    columns: np.ndarray
    """(n, padded R): the same by columns."""
    to_modes: np.ndarray
    """(n, padded n): Phi^-1, by columns."""
    squares: np.ndarray
    """(padded n,): Lambda."""
    rates: np.ndarray
    """(padded n,): minus the diagonal of Gamma."""
    damping: np.ndarray
    """(n, padded n): the rest of Gamma; no rows if there is none."""
    forcing: np.ndarray
    """(padded n,): Phi^-1 f."""
    kicks: np.ndarray
    """(m + L, padded n): Phi^-1 e_k of contacts, then of sliders, times their stiffness."""
    slides: np.ndarray
    """(L, padded n): elongations of sliders."""
    stops: np.ndarray
    """(n, padded m): the rows of contacts, by columns."""


FEW = 3
"""Contacts whose rows are bounded one by one, not in eights."""


class Strides(NamedTuple):
    """Strides of free flight, see `step.strides`: tables by their length, and workspace."""

    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    """Number of lengths, 0 before there are tables."""
    steps: np.ndarray = zeros("strides", 2, "2+2H", "modes")
    """By how much coordinates, then speeds, change by those of the start and the pairs."""
    turns: np.ndarray = zeros("strides", "2H", 2)
    """A number of the pairs at the end by both of its pair at the start."""
    bends: np.ndarray = zeros(2, "2+2H", "modes")
    """Fourth derivatives, and fifth over the frequency, by the same."""
    reached: np.ndarray = zeros("strided N")
    modes: np.ndarray = zeros("2 modes")
    time: np.ndarray = zeros(1)
    """Augmented state, modes and time at the end of some: see `guard.events.look_ahead`."""


REFINED, CONVERGED, SAME_SQUARE = 3, 1e-9, 1e-13
"""Most steps of that refinement; a change whose square is rounding; difference of eigenvalues, in
the largest, whose modes are left."""
COUPLED = 1e-14
"""Entry of Gamma beside its diagonal, in the largest of all, that is rounding."""


def _refined_modes(inverse: np.ndarray, matrix: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return Phi, Phi^-1 and Lambda of a matrix, as exact as doubles are, from Phi^-1.

    Those of a symmetric eigenproblem have errors of the size of the largest eigenvalue: after a
    time t a slow mode would be off by 1e-16 max(Lambda) t^2. With D = Phi^-1 A Phi they are taken
    off by Phi (1 + E), E_ij = D_ij / (D_jj - D_ii), in the longest numbers of the processor.
    """
    exact = matrix.astype(np.longdouble)
    shapes, left = (m.astype(np.longdouble) for m in (np.linalg.inv(inverse), inverse))
    for _ in range(REFINED):
        # what is small needs no more than doubles
        left += (np.eye(len(left)) - left @ shapes).astype(float) @ left.astype(float)
        modal = left @ (exact @ shapes)
        squares = np.diag(modal).copy()
        apart = squares - squares[:, None]
        near = np.abs(apart) <= SAME_SQUARE * squares.max()
        change = np.where(near, 0, modal / np.where(near, 1, apart)).astype(float)
        squares += np.sum(modal * change.T - modal.T * change, 1)
        shapes += shapes.astype(float) @ change
        left -= change @ left.astype(float)
        if np.abs(change).max() < CONVERGED:
            break
    return shapes.astype(float), left.astype(float), squares.astype(float)


def are_apart(model: Model) -> bool:
    """Return whether damping couples no modes."""
    n = len(model.modal_transform)
    transform = model.modal_transform[:, :n]
    gamma = transform @ model.damping[:n, :n] @ np.linalg.inv(transform)
    return bool(np.abs(gamma - np.diag(np.diag(gamma))).max() <= COUPLED * np.abs(gamma).max())


def spectrum_of(model: Model, sizes: dict[str, int]) -> Spectrum:
    """Return the modes of a structure; nothing where neither steps nor layers need them."""
    n, width = sizes["n"], sizes["modes"]
    if width == 0:
        rows, numbers = np.zeros((0, 0)), np.zeros(0)
        return Spectrum(rows, rows, rows, numbers, numbers, rows, numbers, rows, rows, rows)
    shapes, inverse, squares = _refined_modes(model.modal_transform[:, :n], model.stiffness[:n, :n])
    gamma = inverse @ model.damping[:n, :n] @ shapes
    rates = np.diag(gamma).copy()
    rest = gamma - np.diag(rates)
    coupled = np.abs(rest).max() > COUPLED * np.abs(gamma).max()
    sliders = model.elements.stiffness[:, None] * model.elements.kick[:, :n]
    m, row = sizes["m"], model.contacts.row
    kicks = np.vstack((model.contacts.kick[:, :n], sliders)) @ inverse.T

    def wide(values: np.ndarray) -> np.ndarray:
        return np.pad(values, [*(values.ndim - 1) * [(0, 0)], (0, width - n)])

    every = np.vstack((shapes, model.rows @ shapes))
    return Spectrum(
        shapes=wide(every),
        columns=np.pad(every.T, [(0, 0), (0, sizes["padded R"] - len(every))]),
        to_modes=wide(inverse.T),
        squares=wide(squares),
        rates=wide(-rates),
        damping=wide(rest if coupled else rest[:0]),
        forcing=wide(inverse @ model.forcing[:n]),
        kicks=wide(kicks),
        slides=wide(model.elements.reach @ shapes),
        stops=np.pad(every[row].T, [(0, 0), (0, sizes["padded m"] - m)]),
    )


class Tables(NamedTuple):
    """Propagators of the contact sets so far; `count[0]` of them are valid.

    Of a large structure they have lengths and rotations alone.
    """

    spectrum: Spectrum
    strides: Strides = part(Strides)
    count: np.ndarray = zeros(1, dtype=int)  # type: ignore[assignment]
    keys: np.ndarray = zeros("T", dtype=np.uint64)
    h: np.ndarray = zeros("T")
    step: np.ndarray = zeros("T", "tabled N", "padded 2R")
    """Column k of exp(M h), its first 2R rows, contiguous; rows are padded with zeros to a multiple
    of `LANES`."""
    powers: np.ndarray = zeros("T", N_POWERS, "tabled 2R", "padded 2R")
    """The same over 2, 4, .. steps, without the forcing."""
    poly: np.ndarray = zeros("T", "2R", "tabled N", N_COEFFICIENTS)
    columns: np.ndarray = zeros("T", N_COEFFICIENTS, "tabled 2R", "padded 2R")
    """The same again, without the forcing, by coefficient, column, then row."""
    bound4: np.ndarray = zeros("T", "tabled N", "padded R")
    """Column k bounds the fourth derivatives per |x_k|."""
    rotation: np.ndarray = zeros("T", "harmonics")
    """cos and sin of h Omega times the step, for each harmonic."""
    modal: np.ndarray = zeros(1, "tabled N", "padded n nodes")
    """The modal coordinates at the nodes `MODAL_NODES` of a step of free flight, column k per x_k,
    rows by mode, then node."""


STRIDES = 8
"""Lengths of strides, from one step to 128."""
LEVELS = 24
"""Number of step lengths: the last is 1/3,000 of the first."""
CAPACITY = 512
"""Most tables; when more occur the store is emptied and refilled."""


UNFILLED = ~np.uint64(0)
OF_FLOORS, OF_ACCELERATIONS, OF_CONTACTS = range(3)
"""Places in `Outputs.first`."""


class Outputs(NamedTuple):
    """Tables of the n floors, and of the bases behind them, see `observe.peaks`, and workspace."""

    first: np.ndarray
    """(3,) int: places in `Model.watched` of the first floor, of its acceleration and of the first
    contact, see `OF_FLOORS`."""
    place: np.ndarray
    """Table and time of `end`."""
    key: np.ndarray
    """(T,) unsigned: contact set of each table, `UNFILLED` of one that is none."""
    pair: np.ndarray = zeros("T", "tabled N", "2 padded F")
    """Column k of values and slopes per x_k, `LANES` of each in turns."""
    poly: np.ndarray = zeros("T", "F", "tabled N", N_COEFFICIENTS)
    """Polynomials on a step per x_k."""
    bound4: np.ndarray = zeros("T", "tabled N", "padded F")
    """Column k bounds |q''''| per |x_k|."""
    end: np.ndarray = zeros("2 padded F")
    """Values and slopes at the end of a step."""


def outputs_of(model: Model, sizes: dict[str, int]) -> Outputs:
    """Allocate the outputs of a structure."""
    return allocate(
        Outputs,
        sizes,
        first=np.argmax(model.watched[:, 3, None] == (FLOOR, ACCELERATION, CONTACT), axis=0),
        place=np.full(2, -1.0),
        key=np.full(sizes["T"], UNFILLED),
    )
