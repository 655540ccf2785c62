"""Read finite element models: matrices M, K and optionally C, from one file or several.

Which matrix is which says its name in the file, or the end of the name of a file that holds one:
M or mass, K or stiffness, C or damping. What has another name is not used, and told.
"""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hpcsweep.job.matrix_files import ENDINGS, NAMES, TEXTS, Found, read_file
from hpcsweep.model.arguments import InputError, file_name
from hpcsweep.model.finite_elements import FiniteElements

ROLES = {
    "mass": re.compile(r"m|m(aa|gg|xx|ll|ff|hh)|mass(_?matrix)?", re.IGNORECASE),
    "stiffness": re.compile(r"k|k(aa|gg|xx|ll|ff|hh)|stiff(ness)?(_?matrix)?", re.IGNORECASE),
    "damping": re.compile(
        r"c|[bc](aa|gg|xx|ll|ff|hh)|(viscous[ _]?)?damp(ing)?(_?matrix)?", re.IGNORECASE
    ),
}
"""Names of matrices."""


def read_model(path: Any, names: Sequence[str] | None = None) -> FiniteElements:
    """Read a finite element model: sparse matrices of mass, stiffness and damping.

    Parameters
    ----------
    path : path, or sequence of paths
        A file with all matrices, by their names: ``M``, ``mass`` (``MAA``, ``MGG``, ``MXX``), and
        likewise ``K``, ``stiffness`` and, if there is damping, ``C``, ``damping``; or one file for
        each, whose name ends so, ``["K.mtx", "beam_M.mtx"]``; or a folder of such files. One
        triangle of a matrix will do; a vector of masses stands for a diagonal matrix.
    names : sequence of n str, optional
        Of the coordinates, such as ``"12.UX"``; by default those in the file, or numbers from 1.

    Returns
    -------
    FiniteElements
        `mass`, `stiffness`, `damping` (sparse, shape (n, n); None without), in the units of the
        file, and `names`. Its method `structure` reduces it and adds contacts.

    Raises
    ------
    ValueError
        If a file has no such matrices, or they are not those of a structure; one line says why.
    OSError
        If a file cannot be read.

    Warns
    -----
    UserWarning
        If the first natural period looks like mixed units, a matrix is not used, or a coordinate is
        joined to no other.

    Examples
    --------
    A chain of 100 masses on the ground, and a stop behind the last one:

    >>> n = 100
    >>> stiffness = 2e6 * np.eye(n) - 1e6 * np.eye(n, k=1) - 1e6 * np.eye(n, k=-1)
    >>> stiffness[-1, -1] = 1e6
    >>> np.savez("chain.npz", M=np.full(n, 0.5), K=stiffness)
    >>> model = hpcsweep.read_model("chain.npz")
    >>> stop = hpcsweep.Contact(direction="100", gap=0.01, stiffness=1e6)
    >>> chain = model.structure([stop], damping_ratio=0.02, reduce={"modes": 12})
    >>> round(chain.reduction.error, 3)
    0.013
    """
    listed = [*path] if isinstance(path, list | tuple) else [path]
    model = load_model([Path(file_name("path", name)) for name in listed], names)
    for problem in model.problems:
        warnings.warn(f"{listed[0]}: {problem}", stacklevel=2)
    return model


def load_model(paths: Sequence[Path], names: Any = None) -> FiniteElements:
    """Read a model from files, as `read_model`; errors name the file at fault, or the first."""
    whole = paths[0] if paths else Path("path")
    matrices: Found = {}
    read_from: dict[str, Path] = {}
    unused: list[str] = []
    for path in _files(paths):
        try:
            for name, matrix in _named(path, read_file(path)).items():
                role = NAMES if name == NAMES else _role(name)
                if not role:
                    is_told = matrix.dtype.kind in "iufc" and max(matrix.shape, default=0) > 1
                    unused += [f"{name} of {path.name}"] * is_told
                elif role == NAMES and role in matrices and [*matrices[role]] != [*matrix]:
                    raise ValueError(f"names are not those of {read_from[role].name}")
                elif role != NAMES and role in matrices:
                    raise ValueError(f"{role} is there twice, as {name!r} as well")
                else:
                    matrices[role], read_from[role] = matrix, path
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    for role in ("mass", "stiffness"):
        if role not in matrices:
            here = ", ".join(unused) if unused else "no other" if matrices else "nothing"
            limit = f"the name of one must be {role}, or {role[0].replace('s', 'k').upper()}"
            raise ValueError(f"{whole}: {role} is missing: {limit}, here is {here}")
    stored_names = matrices.pop(NAMES, None)
    names = stored_names if names is None else names
    try:
        return FiniteElements(**matrices, names=names, unused=unused)
    except InputError as error:
        error.place = f"{read_from.get(error.key, whole)}"
        raise


def _files(paths: Sequence[Path]) -> Sequence[Path]:
    """Return the files, or those in a folder; text files there must be named after a matrix."""
    if len(paths) != 1 or not paths[0].is_dir():
        return paths
    held = [file for file in sorted(paths[0].iterdir()) if file.suffix.lower() in ENDINGS]
    listed = [file for file in held if file.suffix.lower() not in TEXTS or _role(_word(file))]
    if not listed:
        raise ValueError(f"{paths[0]}: holds no file that ends in {', '.join(ENDINGS)}")
    return listed


def _named(path: Path, held: Found) -> Found:
    """Return a file's matrices; a single one without a name of its own has the file's."""
    word = _word(path)
    matrices = [name for name in held if name != NAMES]
    if len(matrices) == 1:
        (inside,) = matrices
        if (role := _role(inside)) and _role(word) not in ("", role):
            raise ValueError(f"holds the {role}, {inside}, and its name says {_role(word)}")
        if not role:
            return {word if name == inside else name: matrix for name, matrix in held.items()}
    return held


def _word(path: Path) -> str:
    """Return the last word of the name of a file."""
    return re.split(r"[-_. ]", path.stem)[-1]


def _role(name: str) -> str:
    return next((role for role, word in ROLES.items() if word.fullmatch(name)), "")
