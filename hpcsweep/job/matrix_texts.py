"""Read matrices that are written as text.

MatrixMarket (Boisvert, Pozo & Remington, NISTIR 5935, 1996), substructures of Abaqus, and matrices
row by row. What a header says of size, number of entries and symmetry is compared with what follows
it; exponents may have Fortran's D.
"""

import math
import re
from typing import Any

import numpy as np
from scipy import sparse

from hpcsweep.earthquakes.header import number
from hpcsweep.earthquakes.text_files import has_commas, with_point
from hpcsweep.model.arguments import shown
from hpcsweep.model.sparse_matrices import MAX_COORDINATES

Lines = list[tuple[int, str]]
"""Lines with their numbers, from 1."""
Found = dict[str, Any]
"""Matrices by their names, '' of one without."""

BANNER = re.compile(r"\s*%+\s*MatrixMarket\b(.*)", re.IGNORECASE)
FORM = "%%MatrixMarket matrix coordinate real symmetric"
KNOWN = (
    ("matrix",),
    ("coordinate", "array"),
    ("real", "integer", "double"),
    ("general", "symmetric"),
)
MATRIX = re.compile(r"\s*\*MATRIX\s*,\s*TYPE\s*=\s*([^,\n]+)", re.IGNORECASE)
COMMENTS = ("%", "#", "!", "//", "**")
NUMERIC = set("0123456789+-.eEdD")
INSTEAD = f"which is not read: write MatrixMarket ({FORM}), as scipy.io.mmwrite does"
LISTED = {3: "row, column, entry", 5: "node, number, twice, entry, of Abaqus"}
"""Numbers of a line of a list of entries that is taken for a matrix."""
FOREIGN = (
    (re.compile(r"\s*DMIG\b", re.I), "DMIG of Nastran, which is not read: write it by OUTPUT4"),
    (re.compile(r"(?:.*\n){2}\s*[RCPI][SUHZR][AE]\s+\d", re.I), f"Harwell-Boeing, {INSTEAD}"),
)
"""What formats begin with that are told by name."""


def read_text(text: str) -> Found:
    """Read one matrix, or those of a substructure.

    Raises
    ------
    ValueError
        If they are not there as the text says; one line names line, number and limit.
    """
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise ValueError("is empty")
    for sign, name in FOREIGN:
        if sign.match(text):
            raise ValueError(f"is {name}")
    if banner := BANNER.match(lines[0][1]):
        return {"": _market(banner[1].lower().split(), _without_comments(lines[1:]))}
    blocks = [k for k, (_, line) in enumerate(lines) if MATRIX.match(line)]
    if blocks:
        unsymmetric = re.search(r"^\s*\*USER ELEMENT.*\bUNSYMM", text, re.I | re.M) is not None
        return _abaqus(lines, blocks, unsymmetric)
    return {"": _rows(_without_comments(lines))}


def _without_comments(lines: Lines) -> Lines:
    return [(i, line) for i, line in lines if not line.lstrip().startswith(COMMENTS)]


def _numbers(lines: Lines, separators: str = "") -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers on all lines, and how many each line has."""
    table = str.maketrans(separators, " " * len(separators))
    rows = [line.translate(table).split() for _, line in lines]
    try:
        numbers = np.fromiter((_finite(cell) for row in rows for cell in row), float)
    except ValueError as error:
        i = next(i for (i, _), row in zip(lines, rows, strict=True) if str(error) in row)
        limit = "every entry must be a finite number"
        raise ValueError(f"{limit}, line {i} has {shown(str(error))}") from None
    return numbers, np.array([len(row) for row in rows])


def _finite(cell: str) -> float:
    """Return the number in a cell; the cell is the error's text if there is none."""
    try:
        value = number(cell) if NUMERIC.issuperset(cell) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(cell)
    return value


def _market(said: list[str], lines: Lines) -> Any:
    """Read a MatrixMarket matrix whose banner gives object, format, field and symmetry."""
    if len(said) != len(KNOWN) or not all(map(tuple.__contains__, KNOWN, said)):
        limit = "coordinate or array, real or integer, general or symmetric"
        raise ValueError(f"its first line must be like {FORM} ({limit}), says {shown(said)}")
    _, form, _, symmetry = said
    width = 3 if form == "coordinate" else 2
    sizes, n_sizes = _numbers(lines[:1])
    if n_sizes.tolist() != [width] or np.any(sizes != np.floor(sizes)) or sizes.min() < 0:
        words = "rows, columns and entries" if width == 3 else "rows and columns"
        at = f"line {lines[0][0]} is {shown(lines[0][1].strip())}" if lines else "has none"
        raise ValueError(f"below its first line must be its {words}, {at}")
    n, m, n_entries = (*map(int, sizes), 0)[:3]
    check_size(n, m)
    lower = symmetry == "symmetric"  # one triangle stands for both
    if lower and n != m:
        raise ValueError(f"says that it is symmetric, and has {n} rows and {m} columns")
    entries, widths = _numbers(lines[1:])
    if form == "array":
        n_entries, n_there = n * (n + 1) // 2 if lower else n * m, entries.size
    else:
        n_there = len(widths)
    if n_there != n_entries:
        limit = f"must have {n_entries} entries, as line {lines[0][0]} says"
        raise ValueError(f"{limit}, has {n_there}")
    if form == "array":
        if not lower:
            return entries.reshape(m, n).T
        made = np.zeros((n, n))
        made.T[np.triu_indices(n)] = entries  # column by column
        return made
    if np.any(widths != 3):
        k = int((widths != 3).argmax())
        limit = f"row, column and entry, line {lines[1 + k][0]} has {widths[k]} numbers"
        raise ValueError(f"every line must have {limit}")
    i, j, values = entries.reshape(-1, 3).T
    outside = (i < 1) | (i > n) | (j < 1) | (j > m) | (i != np.floor(i)) | (j != np.floor(j))
    if outside.any():
        k = int(outside.argmax())
        at = f"line {lines[1 + k][0]} has ({i[k]:.10g}, {j[k]:.10g})"
        raise ValueError(f"places of entries are counted from 1 to {n} and {m}, {at}")
    if lower and (i > j).any() and (i < j).any():
        raise ValueError("says that it is symmetric, and has entries on both sides of the diagonal")
    row, column = i.astype(int) - 1, j.astype(int) - 1
    places, many = np.unique(row * m + column, return_counts=True)
    if np.any(many > 1):
        at = divmod(places[many.argmax()], m)
        raise ValueError(f"entry ({at[0] + 1}, {at[1] + 1}) is given twice")
    return sparse.csr_array((values, (row, column)), shape=(n, m))


def check_size(n: int, m: int) -> None:
    """Refuse a matrix of too many rows or columns."""
    if max(n, m) > MAX_COORDINATES:
        raise ValueError(f"must have {MAX_COORDINATES} rows and columns at most, is {n} x {m}")


def _abaqus(lines: Lines, blocks: list[int], unsymmetric: bool) -> Found:
    """Read the matrices of a substructure: lower triangles by rows, or whole matrices."""
    matrices: dict[str, Any] = {}
    for k in blocks:
        header = MATRIX.match(lines[k][1])
        assert header is not None
        name = header[1].strip().lower()
        if name in matrices:
            raise ValueError(f"{name.upper()} is there twice")
        after = range(k + 1, len(lines))
        end = next((at for at in after if re.match(r"\s*\*[^*]", lines[at][1])), len(lines))
        entries, _ = _numbers(_without_comments(lines[k + 1 : end]), ",")
        whole = round(np.sqrt(entries.size))
        n = whole if unsymmetric else round((np.sqrt(8 * entries.size + 1) - 1) / 2)
        if unsymmetric and whole * whole == entries.size:
            matrices[name] = entries.reshape(n, n)
        elif not unsymmetric and n * (n + 1) // 2 == entries.size:
            matrices[name] = np.zeros((n, n))
            matrices[name][np.tril_indices(n)] = entries
        else:
            limit = "those of n rows" if unsymmetric else "n (n + 1) / 2, those of a triangle"
            raise ValueError(f"the numbers of {name.upper()} must be {limit}, are {entries.size}")
    return matrices


def _rows(lines: Lines) -> np.ndarray:
    """Read a matrix row by row; numbers are separated by blanks, commas, semicolons or tabs."""
    if not lines:
        raise ValueError("has only comments")
    if re.fullmatch(r"\W*sep=.\W*", lines[0][1]):
        lines = lines[1:]
    strong = next((sign for sign in ";\t" if any(sign in line for _, line in lines)), "")
    if strong:
        cells = [[cell.strip() for cell in line.split(strong)] for _, line in lines]
        if has_commas(cell for row in cells for cell in row):
            rows = (" ".join(map(with_point, row)) for row in cells)
            lines = [(i, row) for (i, _), row in zip(lines, rows, strict=True)]
    entries, widths = _numbers(lines, ",;")
    if np.any(widths != widths[0]):
        k = int((widths != widths[0]).argmax())
        (first, _), (i, _) = lines[0], lines[k]
        said = f"line {first} has {widths[0]} numbers, line {i} has {widths[k]}"
        raise ValueError(f"all lines must have as many numbers as it has lines: {said}")
    matrix = entries.reshape(len(lines), -1)
    check_size(*matrix.shape)
    n, width = matrix.shape
    if width in LISTED and n > 1 and (n != width or _are_entries(matrix)):
        raise ValueError(f"looks like a list of entries ({LISTED[width]}), {INSTEAD}")
    return matrix


def _are_entries(matrix: np.ndarray) -> bool:
    """Return whether rows of a square that no stored triangle is begin with whole numbers alone."""
    places, stored = matrix[:, :-1], (matrix.T, np.tril(matrix), np.triu(matrix))
    if any(np.array_equal(matrix, each) for each in stored):
        return False
    return bool(np.all((places >= 0) & (places == np.floor(places))))
