r"""Reduce a linear model to its lowest modes and the residual flexibility of those left out.

With the modes K phi = omega^2 M phi, Phi^T M Phi = 1, and the rows D of contacts and sliders, along
which forces act, the displacements are those of the subspace

    u = Phi q + Psi p,    Psi = (K^-1 - Phi Omega^-2 Phi^T) D^T,

of MacNeal (1971) and Rubin (1975): Psi is what a static force along each row moves of the modes
that are left out. The equations are projected on it (Ritz), with the mass of Psi. So all static
flexibilities D K^-1 D^T are exact, M and K stay definite, and forces of any law act on it, of
several contacts at once. Without that mass, f = D Psi would only make the spring of a contact
softer, k / (1 + k f): one row less, but it holds for a single contact that is a spring (not for a
dashpot, a smooth stop or several contacts), and the error is ten times as large on a cantilever.

Phi and Psi are orthogonal with respect to M and K, since D Phi = Psi^T K Phi + D Phi, and so are
the modes of Psi alone, so that q and p are modal coordinates of the reduced structure.

The base moves by r. What r has of no mode kept, r - (Phi, Psi) (Phi, Psi)^T M r, is the *missing
mass* of seismic practice: it rides with the base. It is a coordinate y of shape s, whose frequency
is that of the fastest other one, so that no step becomes shorter, and a millionth more: of two
equal ones eigenvectors would be any mixture, and so their damping. Contacts do not move it. Then r
lies in the space, and the absolute acceleration of a row d, d u'' + d r G, is that of the row.

Rows are coordinates x of the reduced structure: x = S (q, p, y), S = [[P, P_y], [some of 1]]. The
modal coordinates that the rows P replace are those with the pivots of QR; others keep their place,
in lengths of their largest displacement.

The *error* is that of one motion: from rest with the speeds K^-1 M r, the shape in which the base
deflects the structure, and all contacts closed, for half the longest period that they leave. It is
the largest difference of a displacement of the rows from that of three times as many modes and more
(all, where the matrices are small), over the largest that the rows would reach without contacts.

Where K is singular its rigid modes are kept, K^-1 is that of loads less what moves them (inertia
relief), and in the motion of the error they have the frequency of the lowest mode that vibrates.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import count, number, positive, refused, wrong

KINDS = ("modes", "error", "up_to")
"""Of reductions: what says how many modes are kept."""
TIMES, MORE = 3, 16
"""The error of k modes is taken from `TIMES` k + `MORE` modes."""
ENTRY, COPIES = 16, 3
"""Bytes of an entry of factors, with its place, and times that modes are there while found."""
MASSLESS = 1e-13
"""1 / omega^2 over the largest one, of a mode without mass."""
QUASI_STATIC = 1e-10
"""M_ii / K_ii over the largest one, of a coordinate whose mass is left out: a penalty spring."""
DEPENDENT = 1e-10
"""Mass of a residual mode, over that of others, that is rounding; of the static deflections it is
the square of this."""
DISTINCT = 1e-3
"""Part of a row that no other row has, from which on it is a coordinate of its own."""
APART = 1.0 + 2e-6
"""Square of the frequency of the missing mass over that of the fastest mode."""
MODAL = re.compile(r"(?:mode|residual) \d+|missing mass")
"""Names of coordinates that are amounts of modes."""
SAMPLES = 1000
"""Instants of the motion that the error is taken from."""
MIN_PERIOD, MAX_PERIOD = 1e-5, 100.0
"""First period, in units of time, that is no sign of mixed units."""


@dataclass(frozen=True)
class Reduction:
    """How a structure came from a larger model.

    Attributes
    ----------
    modes : int
        Free modes that are kept.
    frequencies : tuple of float
        Of these, in rad per unit of time.
    error : float
        Estimated error of a motion with contact, relative; 0 where nothing is left out.
    shares : tuple of float
        Effective mass of each of these modes over the mass that the base moves.
    coordinates, empty, massless : int
        Of the model; those of them that have neither mass nor stiffness or are fixed; and those
        without mass, which are condensed.
    force_error : float, optional
        Of forces of contacts; where it is known, both errors are those under records.
    memory : float
        Bytes that the factors of the stiffness and the modes took; 0 where that was not told.
    told : tuple of str
        What is told of matrices and coordinates of the model, a line each.
    """

    modes: int
    frequencies: tuple[float, ...]
    error: float
    shares: tuple[float, ...]
    coordinates: int
    empty: int
    massless: int
    force_error: float | None = None
    memory: float = 0.0
    told: tuple[str, ...] = ()


class NaturalModes(NamedTuple):
    """Lowest modes of a model, and static deflections."""

    squares: np.ndarray
    """(N,): omega^2, ascending."""
    shapes: np.ndarray
    """(n, N)"""
    is_whole: bool
    """Whether these are all modes."""
    rows: np.ndarray
    """(p, n): along which forces act."""
    static: np.ndarray
    """(n, p): K^-1 of them."""
    mass: Any
    stiffness: Any
    push: np.ndarray
    """(n,): M r."""
    speeds: np.ndarray
    """(n,): K^-1 M r."""
    memory: float
    """Bytes of the factors of K and of the modes."""


class Basis(NamedTuple):
    """Modal coordinates of a reduced structure: kept modes, then those of Psi."""

    squares: np.ndarray
    """(k + ...,): omega^2"""
    shapes: np.ndarray
    """(n, k + ...)"""


def find_modes(
    mass, stiffness, rows: np.ndarray, push: np.ndarray, most: int, free: np.ndarray | None = None
) -> NaturalModes:
    """Find the lowest modes of sparse matrices, `most` or all of them, rigid ones first.

    Massless rows are condensed: 1 / omega^2 is an eigenvalue of M - mu K, of these 0. Beside rigid
    modes, `free`, (n, r), it is one on what is orthogonal to them.
    """
    from scipy.linalg import eigh, null_space
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    from hpcsweep.model.sparse_matrices import SMALL, elastic_solve

    n = len(push)
    free = np.zeros((n, 0)) if free is None else free
    is_whole = n <= SMALL or 2 * most >= n
    solve, factorised = elastic_solve(stiffness, mass, free)
    if is_whole:
        pencil = mass.toarray(), stiffness.toarray()
        if free.size:
            rest = null_space((mass @ free).T)
            inverse, shapes = eigh(*(rest.T @ matrix @ rest for matrix in pencil))
            shapes = rest @ shapes
        else:
            inverse, shapes = eigh(*pencil)
        inverse, shapes = inverse[::-1], shapes[:, ::-1]
        has_mass = inverse > MASSLESS * inverse[0]
        inverse = inverse[has_mass]
        squares, shapes = 1.0 / inverse, shapes[:, has_mass] / np.sqrt(inverse)
    else:
        first = mass @ np.cos(np.arange(n))  # any, but always the same
        inverted = LinearOperator((n, n), matvec=solve, dtype=float)
        try:
            squares, shapes = eigsh(stiffness, most, mass, 0.0, v0=solve(first), OPinv=inverted)
        except ArpackError as error:
            raise wrong("stiffness", f"and mass: modes are not found ({error})") from None
        order = np.argsort(squares)
        squares, shapes = squares[order], shapes[:, order]
    squares = np.append(np.zeros(free.shape[1]), squares)
    shapes = np.hstack((free, shapes))
    static = solve(np.ascontiguousarray(rows.T)) if len(rows) else np.zeros((n, 0))
    memory = float(ENTRY * factorised.nnz + COPIES * shapes.nbytes)
    speeds = solve(push) + free @ (free.T @ push) / lowest(squares)
    return NaturalModes(
        squares, shapes, is_whole, rows, static, mass, stiffness, push, speeds, memory
    )


def lowest(squares: np.ndarray) -> float:
    """Return the lowest omega^2 of modes that vibrate, where rigid ones come first; 1 of none."""
    return float(squares[np.flatnonzero(squares)[:1]].sum()) or 1.0


def basis_of(modes: NaturalModes, k: int) -> Basis:
    """Return the basis of k modes with their residual flexibility."""
    squares, kept = modes.squares[:k], modes.shapes[:, :k]
    over = np.where(squares > 0.0, squares, np.inf)[:, None]
    psi = modes.static - kept @ ((modes.rows @ kept).T / over)
    psi = psi - kept @ (kept.T @ (modes.mass @ psi))
    size, whole = (np.einsum("ij,ij->j", v, modes.mass @ v) for v in (psi, modes.static))
    left = size > DEPENDENT**2 * whole
    psi = psi[:, left] / np.sqrt(size[left])
    weights, turn = np.linalg.eigh(psi.T @ (modes.mass @ psi))
    apart = weights > DEPENDENT
    psi = psi @ (turn[:, apart] / np.sqrt(weights[apart]))
    residual_squares, turn = np.linalg.eigh(psi.T @ (modes.stiffness @ psi))
    return Basis(np.concatenate((squares, residual_squares)), np.hstack((kept, psi @ turn)))


def error_of(
    modes: NaturalModes, k: int, rows: np.ndarray, kappa: np.ndarray, whole: Basis
) -> float:
    """Estimate the error of k modes.

    Parameters
    ----------
    modes : NaturalModes
    k : int
    rows : ndarray, shape (m + any, n)
        Of the m contacts, then others.
    kappa : ndarray, shape (m,)
        Stiffness of the contacts.
    whole : Basis
        That of all modes that are known.
    """
    if modes.is_whole and k >= len(modes.squares):
        return 0.0
    basis = basis_of(modes, k)
    most = _moves(modes, whole, rows, kappa[:0])[0]
    end, exact = _moves(modes, whole, rows, kappa)[1:]
    moved = _moves(modes, basis, rows, kappa, end)[2]
    return float(np.abs(moved - exact).max() / most) if most > 0 else 0.0


def _moves(modes: NaturalModes, basis: Basis, rows, kappa, end: float = 0.0):
    """Return the largest displacement of a motion, its end, and its displacements."""
    along = rows @ basis.shapes
    pushed = along[: len(kappa)] * np.sqrt(kappa)[:, None]
    held = np.where(basis.squares > 0.0, basis.squares, lowest(basis.squares))
    squares, turn = np.linalg.eigh(np.diag(held) + pushed.T @ pushed)
    rates = np.sqrt(squares)
    end = end or math.pi / rates[0]
    start = turn.T @ (basis.shapes.T @ (modes.mass @ modes.speeds)) / rates
    moved = (along @ turn * start) @ np.sin(np.outer(rates, np.linspace(0.0, end, SAMPLES)))
    return np.abs(moved).max(), end, moved


def most_modes(wanted: Any, room: int) -> int:
    """Return the number of modes from which a reduction and its error are found."""
    asked = wanted.get("modes") if isinstance(wanted, Mapping) else None
    most = min(asked, room) if isinstance(asked, int) and asked > 0 else room
    return TIMES * most + MORE


def choose(modes: NaturalModes, wanted: Any, room: int, rows: np.ndarray, kappa: np.ndarray):
    """Return the number of modes that a reduction asks for, and its error; see `error_of`.

    Parameters
    ----------
    modes : NaturalModes
        As many as `most_modes`.
    wanted : dict
        ``{"modes": k}``, ``{"error": e}`` or ``{"up_to": f}``.
    room : int
        Most modes.
    rows, kappa
        See `error_of`.
    """
    if not isinstance(wanted, Mapping) or len(wanted) != 1 or not set(wanted) <= set(KINDS):
        raise refused("reduce", f"one of {', '.join(KINDS)}", wanted)
    ((by, value),) = wanted.items()
    most = min(room, len(modes.squares))
    rigid = int(np.count_nonzero(modes.squares == 0.0))

    def error(k: int) -> float:
        n_modes = len(modes.squares) if modes.is_whole else TIMES * k + MORE
        return error_of(modes, k, rows, kappa, basis_of(modes, n_modes))

    if by == "modes":
        k = count("reduce.modes", value, max(rigid, 1), most)
    elif by == "up_to":
        ends = modes.squares[[min(rigid, most - 1), most - 1]]
        first, last = (np.sqrt(ends) / (2 * math.pi)).tolist()
        limit = f"from the first frequency, {first:.4g}, to that of mode {most}, {last:.4g}"
        number("reduce.up_to", value, limit, first * (1 - 1e-9), last * (1 + 1e-9))
        k = int(np.sum(modes.squares[:most] <= (2 * math.pi * value) ** 2 * (1 + 1e-9)))
    else:
        positive("reduce.error", value)
        k = next((k for k in range(max(rigid, 1), most + 1) if error(k) <= value), 0)
        if not k:
            limit = f"at least {error(most):.2g}, that of {most} modes"
            raise wrong("reduce.error", f"must be {limit}, is {value:g}")
    return k, error(k)


class Coordinates(NamedTuple):
    """Coordinates x of a structure, and its matrices."""

    names: list[int]
    """Of the first coordinates their row among `physical`, of the others -1 - j, of mode j."""
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray | None
    influence: np.ndarray
    pushed: np.ndarray
    """(m, r): rows of contacts and sliders in x ..."""
    drift: np.ndarray
    """... and of drifts."""


def coordinates(
    modes: NaturalModes, basis: Basis, physical: np.ndarray, drift: np.ndarray, r: Any, damping: Any
) -> Coordinates:
    """Make independent rows coordinates; with r, add the missing mass."""
    from scipy.linalg import qr

    shapes = basis.shapes
    size = shapes.shape[1]
    base, rest = shapes.T @ modes.push, np.zeros(len(shapes))
    if r is not None:
        rest = r - shapes @ base
    missing = float(rest @ (modes.mass @ rest))
    is_more = missing > MASSLESS * float(base @ base)

    def along(rows: np.ndarray, rides: bool) -> np.ndarray:
        more = [(rows @ rest)[:, None] * rides] if is_more else []
        return np.hstack((rows @ shapes, *more))

    kept: list[int] = []
    span = np.zeros((0, size))
    for i, row in enumerate(physical @ shapes):
        left = row - span.T @ (span @ row)
        if np.linalg.norm(left) > DISTINCT * np.linalg.norm(row) and len(kept) < size:
            kept.append(i)
            span = np.linalg.qr(np.vstack((span, left)).T)[0].T
    independent = along(physical[kept], True)
    pivots = qr(independent[:, :size], mode="r", pivoting=True)[1] if kept else np.arange(size)
    others = sorted(pivots[len(kept) :].tolist())
    unit = np.eye(size + is_more)
    scale = np.append(np.abs(shapes).max(axis=0), 1.0)[: size + is_more]
    others += [size] * is_more
    back = np.linalg.inv(np.vstack((independent, unit[others] * scale[others, None])))
    weights = np.append(np.ones(size), missing)[: size + is_more]
    squares = np.append(basis.squares, APART * basis.squares.max())[: size + is_more]
    drag = None
    if damping is not None:
        inner = np.zeros_like(unit)
        inner[:size, :size] = shapes.T @ (damping @ shapes)
        inner[size:, size:] = rest @ (damping @ rest)
        drag = _symmetric(back.T @ inner @ back)
    base = np.append(base, 1.0)[: size + is_more]
    return Coordinates(
        [*kept, *(-1 - j for j in others)],
        _symmetric(back.T @ (weights[:, None] * back)),
        _symmetric(back.T @ ((weights * squares)[:, None] * back)),
        drag,
        clean(np.linalg.solve(back, base)),
        clean(along(modes.rows, False) @ back),
        clean(along(drift, True) @ back),
    )


def condensed(mass, stiffness, damping, push, rows, drift, named) -> Coordinates:
    """Keep all coordinates with mass; the others follow them as under static loads.

    So do those that a penalty spring holds, unless they are `named`, shape (n,).
    """
    has = np.asarray(abs(mass).sum(axis=1)).ravel() > 0
    if len(rows) and rows[:, ~has].any():
        limit = "a contact or slider acts on coordinates without mass, which are condensed"
        raise wrong("reduce", f"is missing: {limit} without it")
    diagonal = stiffness.diagonal()
    ratio = np.full(len(push), np.inf)
    np.divide(mass.diagonal(), diagonal, where=has & (diagonal > 0), out=ratio)
    has &= named | (ratio > QUASI_STATIC * ratio[np.isfinite(ratio)].max(initial=0.0))
    follow = np.zeros((len(push), int(has.sum())))
    follow[has] = np.eye(int(has.sum()))
    if not has.all():
        from hpcsweep.model.sparse_matrices import factors

        below = stiffness[~has]
        follow[~has] = -factors(below[:, ~has]).solve(below[:, has].toarray())
    condensed_mass = _symmetric(follow.T @ (mass @ follow))
    return Coordinates(
        np.flatnonzero(has).tolist(),
        condensed_mass,
        _symmetric(follow.T @ (stiffness @ follow)),
        None if damping is None else _symmetric(follow.T @ (damping @ follow)),
        clean(np.linalg.solve(condensed_mass, follow.T @ push)),
        rows @ follow,
        clean(drift @ follow),
    )


def absurd(first: float) -> str:
    """Return a warning if the first frequency looks like mixed units, else ''."""
    period = 2 * math.pi / first
    if MIN_PERIOD <= period <= MAX_PERIOD:
        return ""
    return f"the first period is {period:.4g} units of time: are mass and stiffness in one system?"


def physical(names: Sequence[str]) -> list[int]:
    """Return the places of names that are not modal; all where there is no other."""
    return [i for i, name in enumerate(names) if not MODAL.fullmatch(name)] or [*range(len(names))]


def modal_name(j: int, k: int, size: int) -> str:
    """Name a modal coordinate: one of k modes, then of residual flexibility and missing mass."""
    if j < k:
        return f"mode {j + 1}"
    return f"residual {j - k + 1}" if j < size else "missing mass"


def clean(rows: np.ndarray) -> np.ndarray:
    """Round the entries of rows that are 0, 1 or -1 but for rounding."""
    near = np.round(rows)
    return np.where((np.abs(rows - near) < 1e-11) & (np.abs(near) <= 1.0), near, rows) + 0.0


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return (matrix + matrix.T) / 2.0
