"""A linear model of any size, by its sparse matrices, and structures that are made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hpcsweep.model.arguments import shown
from hpcsweep.model.matrices import MAX_ROWS, Slider, elements_of, is_named, vector
from hpcsweep.model.reduced import Reduced
from hpcsweep.model.reduction import (
    absurd,
    basis_of,
    choose,
    condensed,
    coordinates,
    find_modes,
    most_modes,
)
from hpcsweep.model.structure import Structure

MAX_REDUCED = 64
"""Rows of a reduced model."""
ASYMMETRY = 1e-6
"""Largest difference of a matrix from its transpose, over its largest entry: files round."""
RIGID = 1e-13
"""Square of a natural frequency, over the largest, that is 0."""


class FiniteElements:
    """Sparse matrices of a linear model, in any consistent units.

    Parameters
    ----------
    mass, stiffness : sparse or array_like, shape (n, n)
        M and K, or one triangle of each; a vector of masses stands for a diagonal M.
    damping : sparse or array_like, optional
        C.
    names : sequence of n str, optional
        Of the coordinates; by default their numbers, from 1.

    Attributes
    ----------
    mass, stiffness, damping : scipy.sparse.csr_array, shape (n, n)
        Symmetric. Damping is None where there is none.
    names : tuple of str

    Raises
    ------
    ValueError
        If they are not those of a structure; one line says why.
    """

    def __init__(self, mass: Any, stiffness: Any, damping: Any = None, names: Any = None):
        self.mass = _matrix("mass", mass)
        self.stiffness = _matrix("stiffness", stiffness)
        self.damping = None if damping is None else _matrix("damping", damping)
        n = self.stiffness.shape[0]
        for name, one in (("mass", self.mass), ("damping", self.damping)):
            if one is not None and one.shape[0] != n:
                raise ValueError(f"{name} has {one.shape[0]} rows, stiffness has {n}")
        self.names = tuple(str(k) for k in (range(1, n + 1) if names is None else names))
        if len(self.names) != n:
            raise ValueError(f"names must be {n}, one per coordinate, are {len(self.names)}")
        if len(set(self.names)) < n:
            twice = next(k for k in self.names if self.names.count(k) > 1)
            raise ValueError(f"names must differ, {twice!r} is given twice")
        self._numbers = {name: i for i, name in enumerate(self.names)}
        diagonal = self.mass.diagonal()
        self._has_mass = np.abs(self.mass).sum(axis=1) > 0
        if np.any(diagonal[self._has_mass] <= 0) or not self._has_mass.any():
            i = int(np.argmax(self._has_mass & (diagonal <= 0)))
            at = f"{diagonal[i]:g} at coordinate {self.names[i]}"
            raise ValueError(f"mass must be positive definite, its diagonal is {at}")
        self.is_empty = ~self._has_mass & (np.abs(self.stiffness).sum(axis=1) == 0)
        used = ~self.is_empty
        if _negative(_part(self.mass, self._has_mass)):
            raise ValueError("mass must be positive definite, it has an eigenvalue of 0 or less")
        if count := self._below(used, _part(self.stiffness, used), -1.0):
            raise ValueError(f"stiffness must not be negative, it has {count} negative eigenvalues")

    @property
    def problem(self) -> str:
        """A warning if the first period looks like mixed units, else nothing."""
        used = ~self.is_empty
        held = _part(self.mass, used)
        stiffness = _part(self.stiffness, used) + RIGID * self._largest(used) * held
        if self._below(used, stiffness, 1.0):
            return ""
        nothing = np.zeros((0, int(used.sum())))
        squares = find_modes(held, stiffness, nothing, nothing.sum(axis=0), 1).squares
        return absurd(np.sqrt(squares[0]))

    def _largest(self, used: np.ndarray) -> float:
        """Return about the largest omega^2."""
        has = self._has_mass & used
        return float((self.stiffness.diagonal()[has] / self.mass.diagonal()[has]).max())

    def _below(self, used: np.ndarray, stiffness: Any, side: float) -> int:
        """Return the number of omega^2 below 0 (side -1), or below what is above rounding (1)."""
        # massless rows are shifted, too
        mass = self.mass.diagonal()[used] * self._largest(used)
        shift = np.where(self._has_mass[used], mass, -side * stiffness.diagonal()) * RIGID
        return _negative(stiffness - side * sparse.diags_array(shift))

    def row(self, name: str, given: Any) -> np.ndarray:
        """Return a row over all coordinates: from a vector, a name, a pair, or names with shares.

        Parameters
        ----------
        name : str
            In errors.
        given : str, int, pair of them, dict or sequence of n floats
            A pair is the first less the second.
        """
        n = len(self.names)
        if isinstance(given, str | int):
            key = str(given)
            given = ((key.removeprefix("-"), -1.0 if key.startswith("-") else 1.0),)
        elif isinstance(given, Mapping):
            given = tuple((str(key), value) for key, value in given.items())
        elif _is_pair(given):
            given = (str(given[0]), 1.0), (str(given[1]), -1.0)
        if not is_named(given):
            return np.array(vector(name, given, n))
        row = np.zeros(n)
        for key, share in given:
            row[self.number_of(name, key)] += share
        return row

    def number_of(self, name: str, key: str) -> int:
        """Return the place of a coordinate by its name or number."""
        if key in self._numbers:
            return self._numbers[key]
        if key.isdecimal() and 1 <= int(key) <= len(self.names):
            return int(key) - 1
        known = ", ".join(self.names[:4])
        limit = f"one of the {len(self.names)} coordinates ({known}, ...), or its number"
        raise ValueError(f"{name} must be {limit}, is {shown(key)}")

    def label(self, row: np.ndarray) -> str:
        """Return a name of a row."""
        entries = np.flatnonzero(row)
        if entries.size > 2 or np.any(np.abs(row[entries]) != 1.0):
            most = self.names[int(np.abs(row).argmax())]
            return f"row of {most}"
        order = sorted(entries.tolist(), key=lambda i: row[i] < 0)
        words = [("-" if row[i] < 0 else "+") + self.names[i] for i in order]
        return "".join(words).removeprefix("+")

    def _influence(self, given: Any) -> np.ndarray:
        """Return r: 1 of all coordinates, of those whose names end with a component, or numbers."""
        ends = np.array([name.rpartition(".")[2] if "." in name else "" for name in self.names])
        if isinstance(given, str):
            if not np.any(ends == given):
                known = ", ".join(sorted(set(ends) - {""})) or "none"
                limit = f"the end of names of coordinates after a dot (here {known})"
                raise ValueError(f"influence must be {limit}, or numbers, is {given!r}")
            return (ends == given).astype(float)
        if given is not None:
            return self.row("influence", given)
        if len(set(ends)) > 1:
            known = ", ".join(sorted(set(ends)))
            raise ValueError(f"influence is missing: the direction of the base, one of {known}")
        return np.ones(len(self.names))

    def structure(
        self,
        contacts: Sequence[Any] = (),
        sliders: Sequence[Any] = (),
        *,
        damping_ratio: float | Sequence[float] | None = None,
        influence: Any = None,
        outputs: Sequence[Any] = (),
        reduce: Mapping[str, float] | None = None,
        fixed: Sequence[Any] = (),
        **others: Any,
    ) -> Structure:
        """Return a structure of the model, reduced if wanted.

        Parameters
        ----------
        contacts, sliders : sequence of Contact, of Slider, or of dict of their values
            Directions may name coordinates.
        damping_ratio : float or sequence of floats, optional
            Of every mode, or of each that is kept, the last for all others. Default: that of
            `damping`.
        influence : str or sequence of n floats, optional
            Displacements of the coordinates where the base moves by 1; ``"UX"``: 1 of those whose
            names end with ``.UX``. Default: 1 of all.
        outputs : sequence
            Coordinates, by names, numbers or as vectors, whose displacements, drifts and absolute
            accelerations are wanted; pairs of them are drifts.
        reduce : dict, optional
            ``{"modes": 12}``, ``{"error": 1e-3}`` or ``{"up_to": 60.0}``, cycles per unit of time:
            which modes are kept. Default: all coordinates with mass, 512 at most.
        fixed : sequence of str or int
            Coordinates that move with the base.
        **others
            `rayleigh`, `sharpness`, `harmonics`, `collapse_drift` of `Structure.from_matrices`.

        Returns
        -------
        Structure
            Its `reduction` has `modes`, `frequencies` (of those kept) and `error`.

        Raises
        ------
        ValueError
            If an argument is wrong; one line names it.
        """
        hits, slides = ([_table(one) for one in listed] for listed in (contacts, sliders))
        reduced = self.reduced(hits, slides, influence, outputs, reduce, fixed)
        return reduced.structure(hits, slides, damping_ratio, **others)

    def reduced(
        self, contacts, sliders, influence=None, outputs=(), reduce=None, fixed=()
    ) -> Reduced:
        """Return what a structure is made of, from tables of its contacts and sliders."""
        contacts, sliders = elements_of("contact", contacts), elements_of("slider", sliders)
        for name, listed in (("outputs", outputs), ("fixed", fixed)):
            if isinstance(listed, str):
                raise ValueError(f"{name} must be a list of coordinates, is {listed!r}")
        used = ~self.is_empty
        for key in fixed:
            used[self.number_of("fixed", str(key))] = False
        hits = self._directions("contact", contacts, used)
        slides = self._directions("slider", sliders, used)
        told = [self._moving("outputs", one, used) for one in outputs]
        for k, row in enumerate(told):
            if any(np.array_equal(abs(row), abs(other)) for other in told[:k]):
                raise ValueError(f"outputs must not hold a coordinate twice, as {outputs[k]!r}")
        pairs = [row for row, one in zip(told, outputs, strict=True) if _is_pair(one)]
        alone = [row for row, one in zip(told, outputs, strict=True) if not _is_pair(one)]
        drifts = pairs or alone or [*hits, *slides]
        if not drifts:
            raise ValueError("outputs are missing: where there is no contact, name some")
        r = self._influence(influence)
        moved = float(r @ (self.mass @ r))
        push, r = (self.mass @ r)[used], r[used]
        if not moved > 0:
            raise ValueError("influence must not be 0 of all coordinates with mass")
        tied = np.array([np.sqrt(one.stiffness) for one in sliders])[:, None] * _array(slides, used)
        mass, stiffness = _part(self.mass, used), _part(self.stiffness, used)
        sticking = stiffness + sparse.csr_array(tied.T @ tied)
        if n_free := self._below(used, sticking, 1.0):
            raise ValueError(f"stiffness leaves {n_free} motions free: fix some coordinates")
        drag = None if self.damping is None else _part(self.damping, used)
        forced, drift = _array([*hits, *slides], used), _array(drifts, used)
        n_mass = int((used & self._has_mass).sum())
        room = MAX_REDUCED - (np.linalg.matrix_rank(forced) if len(forced) else 0) - bool(alone)
        if reduce is None and n_mass > MAX_ROWS:
            limit = f"at most {MAX_ROWS} coordinates with mass, has {n_mass}"
            raise ValueError(f'reduce is missing: without, as {{"modes": 12}}, there are {limit}')
        modes = find_modes(mass, sticking, forced, push, most_modes(reduce, room))
        if reduce is None:
            k, error = len(modes.squares), 0.0
            x = condensed(mass, stiffness, drag, push, forced, drift)
            names = [self.names[i] for i in np.flatnonzero(used)[x.names]]
        else:
            measured = np.vstack((forced, drift))
            kappa = np.array([one.stiffness for one in contacts])
            k, error = choose(modes, reduce, room, measured, kappa)
            signed = [row * np.sign(row[np.flatnonzero(row)[0]]) for row in (*hits, *slides)]
            rows = [*alone, *signed]
            missing = r if alone else None
            basis = basis_of(modes, k)
            x = coordinates(modes, basis, _array(rows, used), drift, missing, drag)
            if sum(0 <= j < len(alone) for j in x.names) < len(alone):
                limit = f"fewer, or modes more: they are not told apart by {k} modes"
                raise ValueError(f"outputs must be {limit}, are {len(alone)}")
            size = basis.squares.size
            names = [self.label(rows[j]) if j >= 0 else _modal(-1 - j, k, size) for j in x.names]
            x = x._replace(stiffness=x.stiffness - _springs(x.pushed[len(hits) :], sliders))
        labels = [self.label(row) for row in hits], [self.label(row) for row in drifts]
        facts = {
            "modes": k,
            "frequencies": np.sqrt(modes.squares[:k]).tolist(),
            "error": error,
            "shares": ((modes.shapes[:, :k].T @ push) ** 2 / moved).tolist(),
            "coordinates": len(used),
            "empty": int((~used).sum()),
            "massless": int((used & ~self._has_mass).sum()),
        }
        return Reduced(
            names,
            x.mass.tolist(),
            x.stiffness.tolist(),
            x.influence.tolist(),
            x.pushed[: len(hits)].tolist(),
            x.pushed[len(hits) :].tolist(),
            x.drift.tolist(),
            labels[0] if len(set(labels[0])) == len(labels[0]) else [],
            labels[1],
            facts,
            None if x.damping is None else x.damping.tolist(),
        )

    def _directions(self, name: str, elements: Sequence, used: np.ndarray) -> list[np.ndarray]:
        """Return the rows of contacts or sliders."""
        directions = [(f"{name}[{k}].direction", one.direction) for k, one in enumerate(elements)]
        return [self._moving(*given, used) for given in directions]

    def _moving(self, name: str, given: Any, used: np.ndarray) -> np.ndarray:
        """Return `row` of coordinates that move."""
        row = self.row(name, given)
        if np.any(row[~used]):
            key = self.names[int(np.flatnonzero(row * ~used)[0])]
            raise ValueError(f"{name} names {key!r}, which is fixed, or has no mass and stiffness")
        if not row.any():
            raise ValueError(f"{name} must not be 0")
        return row


def _is_pair(output: Any) -> bool:
    is_list = isinstance(output, list | tuple) and len(output) == 2
    return is_list and all(isinstance(one, str | int) for one in output)


def _array(rows: Sequence[np.ndarray], used: np.ndarray) -> np.ndarray:
    return np.array(rows, float).reshape(-1, used.size)[:, used]


def _modal(j: int, k: int, size: int) -> str:
    """Name a modal coordinate: one of k modes, then of residual flexibility and missing mass."""
    if j < k:
        return f"mode {j + 1}"
    return f"residual {j - k + 1}" if j < size else "missing mass"


def _springs(directions: np.ndarray, sliders: Sequence[Slider]) -> np.ndarray:
    stiffness = np.array([one.stiffness for one in sliders])
    return directions.T @ (stiffness[:, None] * directions)


def _part(matrix: Any, used: np.ndarray) -> Any:
    return matrix[used][:, used]


def _table(element: Any) -> dict:
    """Return the values of a contact or slider."""
    return dict(element) if isinstance(element, Mapping) else asdict(element)


def _negative(matrix: Any) -> int:
    """Count negative eigenvalues: by Sylvester's law those are negative pivots without exchange."""
    kept = {"SymmetricMode": True}
    try:
        found = splu(matrix.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=kept)
    except RuntimeError:  # a pivot is 0
        return 1
    return int((found.U.diagonal() < 0).sum())


def _matrix(name: str, given: Any) -> Any:
    """Return a symmetric sparse matrix, of both triangles."""
    try:
        found = sparse.csr_array(given) if sparse.issparse(given) else np.asarray(given)
        if np.iscomplexobj(found):
            raise TypeError
        if found.ndim in (1, 2) and np.prod(found.shape) == max(found.shape):
            dense = found if isinstance(found, np.ndarray) else found.toarray()
            found = np.diag(dense.ravel())  # a vector of masses, in a row or a column
        found = sparse.csr_array(found, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a matrix of real numbers, is {shown(given)}") from None
    if found.ndim != 2 or found.shape[0] != found.shape[1] or not found.nnz:
        raise ValueError(f"{name} must be square, and not 0, has the shape {found.shape}")
    if not np.isfinite(found.data).all():
        raise ValueError(f"{name} must be finite, holds {found.data[~np.isfinite(found.data)][0]}")
    lower, upper = sparse.tril(found, -1), sparse.triu(found, 1)
    if (lower.count_nonzero() == 0) != (upper.count_nonzero() == 0):
        found = sparse.csr_array(found + lower.T + upper.T)
    off = abs(found - found.T).tocoo()
    if off.nnz and off.data.max() > ASYMMETRY * abs(found).max():
        i, j = (int(place[off.data.argmax()]) for place in off.coords)
        entries = f"({i + 1}, {j + 1}) is {found[i, j]:g}, ({j + 1}, {i + 1}) is {found[j, i]:g}"
        raise ValueError(f"{name} must be symmetric: entry {entries}")
    return sparse.csr_array((found + found.T) / 2.0)
