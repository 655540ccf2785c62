"""A linear model of any size, in sparse matrices, and structures made from it."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hpcsweep.model import reduction
from hpcsweep.model.arguments import items, refused, wrong
from hpcsweep.model.matrices import MAX_ROWS
from hpcsweep.model.reduced import Reduced, elements_of
from hpcsweep.model.rigid import springs_of
from hpcsweep.model.sparse_matrices import motions_below, negative, sticking, symmetric
from hpcsweep.model.structure import Structure
from hpcsweep.model.vectors import is_named, shares_of, vector

MAX_REDUCED = 64
"""Rows of a reduced model."""
TOLD = 4
"""Names that are listed."""


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
    unused : sequence of str
        What else a file holds.

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

    def __init__(
        self,
        mass: Any,
        stiffness: Any,
        damping: Any = None,
        names: Any = None,
        unused: Sequence[str] = (),
    ):
        self.unused = tuple(unused)
        self.mass = symmetric("mass", mass)
        self.stiffness = symmetric("stiffness", stiffness)
        self.damping = None if damping is None else symmetric("damping", damping)
        n = self.stiffness.shape[0]
        for name, matrix in (("mass", self.mass), ("damping", self.damping)):
            if matrix is not None and matrix.shape[0] != n:
                raise wrong(name, f"has {matrix.shape[0]} rows, stiffness has {n}")
        self.names = tuple(str(k) for k in (range(1, n + 1) if names is None else names))
        if len(self.names) != n:
            raise wrong("names", f"must be {n}, one per coordinate, are {len(self.names)}")
        if len(set(self.names)) < n:
            twice = Counter(self.names).most_common(1)[0][0]
            raise wrong("names", f"must differ, {twice!r} is given twice")
        self._numbers = {name: i for i, name in enumerate(self.names)}
        diagonal = self.mass.diagonal()
        self._has_mass = np.abs(self.mass).sum(axis=1) > 0
        if np.any(diagonal[self._has_mass] <= 0) or not self._has_mass.any():
            i = int(np.argmax(self._has_mass & (diagonal <= 0)))
            at = f"{diagonal[i]:g} at coordinate {self.names[i]}"
            raise wrong("mass", f"must be positive definite, its diagonal is {at}")
        self.is_empty = ~self._has_mass & (np.abs(self.stiffness).sum(axis=1) == 0)
        used = ~self.is_empty
        if negative(_part(self.mass, self._has_mass)):
            raise wrong("mass", "must be positive definite, it has an eigenvalue of 0 or less")
        ties = np.flatnonzero(used & ~self._has_mass & (self.stiffness.diagonal() == 0))
        if ties.size:
            limit = "must have numbers above 0 on its diagonal, where there is no mass"
            where = f"{self._listed(ties)}: Lagrange multipliers, whose constraints are to be"
            raise wrong("stiffness", f"{limit}, has {ties.size} of 0 at {where} eliminated")
        if count := motions_below(_part(self.stiffness, used), -1.0):
            many = f"{count} negative eigenvalue{'s' * (count > 1)}"
            raise wrong("stiffness", f"must not be negative, it has {many}")

    @property
    def problems(self) -> Iterator[str]:
        """Yield one line for each matrix or coordinate without use, and for mixed units."""
        yield from self._told(self._grounded(), self._alone & ~self.is_empty)
        used = ~self.is_empty & ~self._grounded()
        held, stiffness = _part(self.mass, used), _part(self.stiffness, used)
        if not motions_below(stiffness, 1.0):
            nothing = np.zeros((0, int(used.sum())))
            squares = reduction.find_modes(held, stiffness, nothing, nothing.sum(axis=0), 1).squares
            if text := reduction.absurd(np.sqrt(squares[0])):
                yield text

    def _told(self, grounded: np.ndarray, alone: np.ndarray) -> Iterator[str]:
        """Yield a line for unused matrices, supports, and coordinates joined to no other."""
        for matrix in self.unused:
            yield f"{matrix} is not used: names are M or mass, K or stiffness, C or damping"
        for places, said in (
            (grounded, "taken as fixed, with equal numbers on the diagonals of K and M, and "),
            (alone & ~grounded, ""),
        ):
            if places.any():
                listed = np.flatnonzero(places)
                n = f"{listed.size} coordinate{'s are' if listed.size > 1 else ' is'}"
                hint = "" if said else "; fixed = [...] holds supports"
                yield f"{n} {said}joined to no other: {self._listed(listed)}{hint}"

    def _listed(self, places: np.ndarray) -> str:
        """Return the names of coordinates, the first of many."""
        names = ", ".join(self.names[i] for i in places[:TOLD])
        return names + ", ..." * (places.size > TOLD)

    @property
    def _alone(self) -> np.ndarray:
        """Whether a coordinate is joined to no other."""
        several = np.zeros(len(self.names), bool)
        for matrix in (self.mass, self.stiffness, self.damping):
            if matrix is not None:
                several |= np.diff(matrix.indptr) > (matrix.diagonal() != 0)
        return ~several

    def _grounded(self) -> np.ndarray:
        """Whether a coordinate is a support as some programs write it, equal in K and M."""
        alone = self._alone
        if alone[~self.is_empty].all():
            return np.zeros_like(alone)
        return alone & self._has_mass & (self.stiffness.diagonal() == self.mass.diagonal())

    def row(self, name: str, direction: Any) -> np.ndarray:
        """Return a row over all coordinates: from a vector, a name, a pair, or names with shares.

        Parameters
        ----------
        name : str
            In errors.
        given : str, int, pair of them, dict or sequence of n floats
            A pair is the first less the second.
        """
        n = len(self.names)
        if _is_pair(direction):
            direction = (str(direction[0]), 1.0), (str(direction[1]), -1.0)
        direction = shares_of(direction)
        if not is_named(direction):
            return np.array(vector(name, direction, n))
        row = np.zeros(n)
        for key, share in direction:
            row[self.number_of(name, key)] += share
        return row

    def number_of(self, name: str, key: str) -> int:
        """Return the place of a coordinate by its name or number."""
        if key in self._numbers:
            return self._numbers[key]
        if key.isdecimal() and 1 <= int(key) <= len(self.names):
            return int(key) - 1
        examples = ", ".join(self.names[:4])
        limit = f"one of the {len(self.names)} coordinates ({examples}, ...), or its number"
        raise refused(name, limit, key)

    def label(self, row: np.ndarray) -> str:
        """Name a row by its coordinates."""
        entries = np.flatnonzero(row)
        if entries.size > 2 or np.any(np.abs(row[entries]) != 1.0):
            return f"row of {self.names[int(np.abs(row).argmax())]}"
        order = sorted(entries.tolist(), key=lambda i: row[i] < 0)
        words = [("-" if row[i] < 0 else "+") + self.names[i] for i in order]
        return "".join(words).removeprefix("+")

    def _influence(self, influence: Any) -> np.ndarray:
        """Return r: 1 of all coordinates, of those whose names end with a component, or numbers."""
        ends = np.array([name.rpartition(".")[2] if "." in name else "" for name in self.names])
        if influence is not None and not isinstance(influence, str):
            return self.row("influence", influence)
        components = set(ends)
        if influence in components - {""}:
            return (ends == influence).astype(float)
        if influence is not None or len(components) > 1:
            here = ", ".join(sorted(components - {""})) or "none here"
            limit = f"the direction of the base, an end of names after a dot ({here}), or numbers"
            raise refused("influence", limit, influence)
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
        """Return a structure of the model, reduced on request.

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
        reduced = self.reduced(contacts, sliders, influence, outputs, reduce, fixed)
        return reduced.structure(contacts, sliders, damping_ratio, **others)

    def reduced(
        self, contacts, sliders, influence=None, outputs=(), reduce=None, fixed=(), more=False
    ) -> Reduced:
        """Return the reduced model, from contacts and sliders, or their tables.

        With `more` it has all modes that the error is estimated from.
        """
        contacts, sliders = elements_of("contact", contacts), elements_of("slider", sliders)
        used = ~self.is_empty
        for key in items("fixed", fixed, "a list of coordinates"):
            used[self.number_of("fixed", str(key))] = False
        hits = self._directions("contact", contacts, used)
        slides = self._directions("slider", sliders, used)
        observed = self._outputs(outputs, used)
        pairs = [row for row, output in zip(observed, outputs, strict=True) if _is_pair(output)]
        alone = [row for row, output in zip(observed, outputs, strict=True) if not _is_pair(output)]
        named = np.abs([np.zeros(used.size), *hits, *slides, *observed]).sum(axis=0) > 0
        grounded = self._grounded() & used & ~named
        lonely = self._alone & used & ~named
        used &= ~grounded
        drifts = pairs or alone or [*hits, *slides]
        if not drifts:
            raise wrong("outputs", "are missing: where there is no contact, name some")
        r = self._influence(influence)
        push, r = (self.mass @ r)[used], r[used]
        moved = float(r @ push)
        if not moved > 0:
            raise wrong("influence", "must not be 0 of all coordinates with mass")
        mass, stiffness = _part(self.mass, used), _part(self.stiffness, used)
        held, free = sticking(mass, stiffness, _array(slides, used), sliders, _array(hits, used))
        drag = None if self.damping is None else _part(self.damping, used)
        forced, drift = _array([*hits, *slides], used), _array(drifts, used)
        room = MAX_REDUCED - (np.linalg.matrix_rank(forced) if len(forced) else 0) - bool(alone)
        massless = int((used & ~self._has_mass).sum())
        _refuse_rows(reduce, int(used.sum()) - massless)
        most = reduction.most_modes(reduce, room)
        modes = reduction.find_modes(mass, held, forced, push, most, free)
        if reduce is None:
            k, error = len(modes.squares), 0.0
            x = reduction.condensed(mass, stiffness, drag, push, forced, drift, named[used])
            names = [self.names[i] for i in np.flatnonzero(used)[x.names]]
            massless = int(used.sum()) - len(names)
        else:
            measured = np.vstack((forced, drift))
            kappa = springs_of(contacts)
            k, error = reduction.choose(modes, reduce, room, measured, kappa)
            k = min(k if not more else reduction.TIMES * k + reduction.MORE, len(modes.squares))
            signed = [row * np.sign(row[np.flatnonzero(row)[0]]) for row in (*hits, *slides)]
            rows = [*alone, *signed]
            missing = r if alone else None
            basis = reduction.basis_of(modes, k)
            x = reduction.coordinates(modes, basis, _array(rows, used), drift, missing, drag)
            if sum(0 <= j < len(alone) for j in x.names) < len(alone):
                cannot = f": {k} mode{'s' * (k > 1)} cannot distinguish these {len(alone)} outputs"
                raise wrong("outputs", f"{cannot}: give fewer outputs or more reduce.modes")
            size = basis.squares.size
            names = [
                self.label(rows[j]) if j >= 0 else reduction.modal_name(-1 - j, k, size)
                for j in x.names
            ]
            slid, springs = x.pushed[len(hits) :], np.array([s.stiffness for s in sliders])
            x = x._replace(stiffness=x.stiffness - slid.T @ (springs[:, None] * slid))
        labels = [self.label(row) for row in hits], [self.label(row) for row in drifts]
        facts = {
            "modes": k,
            "frequencies": np.sqrt(modes.squares[:k]).tolist(),
            "error": error,
            "shares": ((modes.shapes[:, :k].T @ push) ** 2 / moved).tolist(),
            "coordinates": len(used),
            "empty": int((~used).sum()),
            "massless": massless,
            "memory": modes.memory,
            "told": [*self._told(grounded, lonely)],
        }
        kept = ("mass", "stiffness", "influence", "drift")
        return Reduced(
            names=names,
            contacts=x.pushed[: len(hits)].tolist(),
            sliders=x.pushed[len(hits) :].tolist(),
            contact_names=labels[0] if len(set(labels[0])) == len(labels[0]) else [],
            drift_names=labels[1],
            facts=facts,
            damping=None if x.damping is None else x.damping.tolist(),
            **{name: getattr(x, name).tolist() for name in kept},
        )

    def _outputs(self, outputs: Sequence[Any], used: np.ndarray) -> list[np.ndarray]:
        """Return the rows of outputs."""
        listed = items("outputs", outputs, "a list of coordinates")
        rows = [self._moving("outputs", output, used) for output in listed]
        for k, row in enumerate(rows):
            if any(np.array_equal(abs(row), abs(other)) for other in rows[:k]):
                raise wrong("outputs", f"must not hold a coordinate twice, as {outputs[k]!r}")
        return rows

    def _directions(self, name: str, elements: Sequence, used: np.ndarray) -> list[np.ndarray]:
        """Return the rows of contacts or sliders."""
        directions = [
            (f"{name}[{k}].direction", element.direction) for k, element in enumerate(elements)
        ]
        return [self._moving(*direction, used) for direction in directions]

    def _moving(self, name: str, direction: Any, used: np.ndarray) -> np.ndarray:
        """Return `row`, which must be of coordinates that move."""
        row = self.row(name, direction)
        if np.any(row[~used]):
            key = self.names[int(np.flatnonzero(row * ~used)[0])]
            raise wrong(name, f"names {key!r}, which is fixed, or has no mass and stiffness")
        if not row.any():
            raise wrong(name, "must not be 0")
        return row


def _refuse_rows(reduce: Any, n_mass: int) -> None:
    if reduce is None and n_mass > MAX_ROWS:
        limit = f"at most {MAX_ROWS} coordinates with mass, has {n_mass}"
        raise wrong("reduce", f'is missing: without, as {{"modes": 12}}, there are {limit}')


def _is_pair(output: Any) -> bool:
    is_list = isinstance(output, list | tuple) and len(output) == 2
    return is_list and all(isinstance(end, str | int) for end in output)


def _array(rows: Sequence[np.ndarray], used: np.ndarray) -> np.ndarray:
    return np.array(rows, float).reshape(-1, used.size)[:, used]


def _part(matrix: Any, used: np.ndarray) -> Any:
    return matrix[used][:, used]
