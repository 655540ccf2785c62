"""Read finite element models: matrices M, K and, if wanted, C, from one file or one file each.

Which matrix is which says its name in the file, or the end of the name of a file that holds one:
M or mass, K or stiffness, C or damping. Formats are those of libraries:

- ``.npz`` of numpy (dense) and scipy (sparse), ``.mat``, MatrixMarket ``.mtx``;
- matrices written row by row as text, such as ``printA`` of OpenSees writes them;
- ``.mtx`` of Abaqus, ``*SUBSTRUCTURE MATRIX OUTPUT``;
- Nastran ``.op4`` by pyyeti, ANSYS ``.full`` by ansys-mapdl-reader: the optional extra ``fem``.
"""

import re
import warnings
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.model.arguments import file_name
from hpcsweep.model.finite_elements import FiniteElements

ROLES = {
    "mass": re.compile(r"m|m(aa|gg|xx|ll|ff|hh)|mass(_?matrix)?", re.IGNORECASE),
    "stiffness": re.compile(r"k|k(aa|gg|xx|ll|ff|hh)|stiff(ness)?(_?matrix)?", re.IGNORECASE),
    "damping": re.compile(r"c|[bc](aa|gg|xx|ll|ff|hh)|damp(ing)?(_?matrix)?", re.IGNORECASE),
}
"""Names of matrices."""
NAMES = "names"
COMPONENTS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
INSTALL = "{} is needed to read it: pip install 'hpcsweep[fem]'"
Found = dict[str, Any]
"""Matrices by their roles, and names of coordinates; or by the name in the file, before."""

MAX_SAID = 200
"""Characters of what a library says of a file."""


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
        If the first natural period looks like mixed units.

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
    listed = [path] if isinstance(path, str | PathLike) else list(path)
    model = load_model([Path(file_name("path", one)) for one in listed], names)
    if problem := model.problem:
        warnings.warn(f"{listed[0]}: {problem}", stacklevel=2)
    return model


def load_model(paths: Sequence[Path], names: Any = None) -> FiniteElements:
    """Read a model from files, as `read_model`; errors name that of what is wrong, or the first."""
    if len(paths) == 1 and paths[0].is_dir():
        folder = paths[0]
        paths = sorted(one for one in folder.iterdir() if one.suffix in READERS)
        if not paths:
            raise ValueError(f"{folder}: holds no file that ends in {', '.join(READERS)}")
    whole = paths[0] if paths else Path("path")
    read_from: dict[str, Path] = {}
    try:
        found: Found = {}
        for path in paths:
            read_from[""] = path
            held = _read(path)
            if len(held) == 1 and not _role(next(iter(held))):
                own = re.split(r"[-_. ]", path.stem)[-1]
                held = {own: next(iter(held.values()))}
            for name, matrix in held.items():
                role = NAMES if name == NAMES else _role(name)
                if role in found:
                    raise ValueError(f"{role} is there twice, as {name!r} as well")
                if role:
                    found[role], read_from[role] = matrix, path
        read_from[""] = whole
        for role in ("mass", "stiffness"):
            if role not in found:
                here = ", ".join(held) if paths else "nothing"
                limit = f"the name of one must be {role}, or {role[0].replace('s', 'k').upper()}"
                raise ValueError(f"{role} is missing: {limit}, here is {here}")
        own = found.pop(NAMES, None)
        return FiniteElements(**found, names=own if names is None else names)
    except OSError:
        raise
    except Exception as error:  # whatever a library says of a file that it cannot read
        said = " ".join(str(error).split()) or type(error).__name__
        said = said if len(said) <= MAX_SAID else f"{said[: MAX_SAID - 3]}..."
        where = str(read_from.get(said.split()[0], read_from.get("", whole)))
        raise ValueError(said if said.startswith(where) else f"{where}: {said}") from None


def _role(name: str) -> str:
    return next((role for role, word in ROLES.items() if word.fullmatch(name)), "")


def _read(path: Path) -> Found:
    """Return what a file holds by its names."""
    if not path.exists():
        raise FileNotFoundError(2, "there is no such file", str(path))
    return READERS.get(path.suffix.lower(), _text)(path)


def _npz(path: Path) -> Found:
    with np.load(path, allow_pickle=False) as file:
        if "format" in file and "shape" in file:
            from scipy.sparse import load_npz

            return {"": load_npz(path)}
        return dict(file.items())


def _mat(path: Path) -> Found:
    from scipy.io import loadmat

    found = {name: one for name, one in loadmat(path).items() if not name.startswith("__")}
    for name, matrix in found.items():
        if name == NAMES:
            found[name] = [str(np.squeeze(one)).strip() for one in np.ravel(matrix)]
        elif _role(name) and 1 in matrix.shape and max(matrix.shape) > 1:
            found[name] = np.ravel(matrix)
    return found


def _mtx(path: Path) -> Found:
    """Read MatrixMarket, or substructures of Abaqus, which write lower triangles row by row."""
    with path.open() as file:
        if file.readline().startswith("%%MatrixMarket"):
            from scipy.io import mmread

            return {"": mmread(path)}
    text = path.read_text()
    blocks = re.findall(r"^\*MATRIX, *TYPE=(\w+)[^\n]*\n([^*]*)", text, re.M | re.I)
    if not blocks:
        raise ValueError("is neither MatrixMarket nor a substructure of Abaqus")
    found: Found = {}
    for kind, body in blocks:
        entries = np.array(re.findall(r"[^\s,]+", body), float)
        n = round((np.sqrt(8 * entries.size + 1) - 1) / 2)
        if n * (n + 1) // 2 == entries.size:
            found[kind.lower()] = np.zeros((n, n))
            found[kind.lower()][np.tril_indices(n)] = entries
        else:
            n = round(np.sqrt(entries.size))
            found[kind.lower()] = entries.reshape(n, n)
    return found


def _op4(path: Path) -> Found:
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise ValueError(INSTALL.format("pyyeti")) from None
    held = op4.read(str(path), sparse=None)
    # Nastran writes placeholders of one entry, and names such as kxx1 for those of later kinds
    return {name: one for name, one in held.items() if one.shape != (1, 1)}


def _full(path: Path) -> Found:
    try:
        from ansys.mapdl.reader.full import FullFile
    except ImportError:
        raise ValueError(INSTALL.format("ansys-mapdl-reader")) from None
    try:
        places, stiffness, mass = FullFile(path).load_km(sort=True)
    except NotImplementedError as error:
        raise ValueError(str(error)) from None
    names = [f"{node}.{COMPONENTS[dof] if dof < 6 else dof + 1}" for node, dof in places.tolist()]
    found = {"K": stiffness, "M": mass, NAMES: names}
    return {name: one for name, one in found.items() if one is not None}


def _text(path: Path) -> Found:
    text = re.sub("[,;]", " ", path.read_text()).split("\n")
    return {"": np.array([row.split() for row in text if row.strip()], float)}


READERS: dict[str, Callable[[Path], Found]] = {
    ".npz": _npz,
    ".mat": _mat,
    ".mtx": _mtx,
    ".op4": _op4,
    ".full": _full,
    **dict.fromkeys((".txt", ".out", ".dat", ".csv"), _text),
}
"""By the ending of a file; others are read as text."""
