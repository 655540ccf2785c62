"""Read finite element models: matrices M, K and optionally C, from one file or several.

Which matrix is which says its name in the file, or the end of the name of a file that holds one:
M or mass, K or stiffness, C or damping. What has another name is not used, and told.

Files of every format are read by their content. Arrays of numpy and sparse matrices of scipy are
read after what their headers say has been compared with their sizes. Libraries that a damaged file
can crash, and those of the extra ``fem``, read in a process of their own
(`hpcsweep.job.matrix_reader`), with a limit to its memory.
"""

import pickle
import re
import signal
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.earthquakes.text_files import decoded, read_bytes
from hpcsweep.job import matrix_reader
from hpcsweep.job.matrix_reader import NAMES
from hpcsweep.job.matrix_texts import Found, check_size, read_text
from hpcsweep.model.arguments import InputError, file_name, shown
from hpcsweep.model.finite_elements import FiniteElements
from hpcsweep.parallel.one_line import on_one_line

ROLES = {
    "mass": re.compile(r"m|m(aa|gg|xx|ll|ff|hh)|mass(_?matrix)?", re.IGNORECASE),
    "stiffness": re.compile(r"k|k(aa|gg|xx|ll|ff|hh)|stiff(ness)?(_?matrix)?", re.IGNORECASE),
    "damping": re.compile(
        r"c|[bc](aa|gg|xx|ll|ff|hh)|(viscous[ _]?)?damp(ing)?(_?matrix)?", re.IGNORECASE
    ),
}
"""Names of matrices."""
MAX_BYTES = 2**30
"""Of a file, and of an array in it."""
TEXTS = (".txt", ".out", ".dat", ".csv")
ENDINGS = (".npz", ".npy", *matrix_reader.READERS, ".mtx", ".mm", *TEXTS)
"""Of files with matrices; those of other endings are read by their content, too."""
ZIP = b"PK\x03\x04"
DAMAGED = "is cut off or damaged"


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


def read_file(path: Path) -> Found:
    """Return the matrices in a file by their names, '' where there is none, and `NAMES`.

    Raises
    ------
    ValueError
        If it is of no format that is read, is damaged or too large; one line says why.
    OSError
        If it cannot be read.
    """
    try:
        content = read_bytes(path, MAX_BYTES)
    except FileNotFoundError:
        raise FileNotFoundError(2, "there is no such file", str(path)) from None
    kind = path.suffix.lower()
    if content.startswith((ZIP, b"\x93NUMPY")):
        return _numpy(content)
    if content.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise ValueError("is a MATLAB file of version 7.3, which is not read: save(..., '-v7')")
    kind = ".mat" if content.startswith(b"MATLAB 5.0") else kind
    if kind in matrix_reader.READERS:
        return _read_apart(path, kind)
    if kind in (".npz", ".npy"):
        raise ValueError(f"is no {kind} file of numpy, or {DAMAGED.removeprefix('is ')}")
    return read_text(decoded(content))


def _numpy(content: bytes) -> Found:
    """Read what numpy or scipy has written: an array, several, or a sparse matrix."""
    try:
        if content.startswith(ZIP):
            with zipfile.ZipFile(BytesIO(content)) as archive:
                n_bytes = sum(entry.file_size for entry in archive.infolist())
            if n_bytes > MAX_BYTES:
                raise MemoryError
        read = np.load(BytesIO(content))  # no objects of Python, and only what is there
        matrices = {"": read} if isinstance(read, np.ndarray) else dict(read)
    except MemoryError:
        raise ValueError(f"must have arrays of {MAX_BYTES / 2**30:g} GB at most") from None
    except Exception:  # whatever a header is taken for
        objects = "or holds objects of Python: scipy.sparse.save_npz writes a sparse matrix"
        raise ValueError(f"{DAMAGED}, {objects}") from None
    if {"format", "shape"} <= set(matrices):
        return {"": _sparse(content, matrices)}
    return {name: matrix for name, matrix in matrices.items() if isinstance(matrix, np.ndarray)}


def _sparse(content: bytes, arrays: Found) -> Any:
    from scipy.sparse import load_npz

    shape = np.ravel(arrays["shape"])
    if shape.size != 2 or shape.dtype.kind not in "iu" or shape.min() < 0:
        raise ValueError(f"its shape must be rows and columns, is {shown(shape.tolist())}")
    check_size(*shape.tolist())
    try:
        return load_npz(BytesIO(content))
    except Exception:  # whatever its parts are taken for
        raise ValueError(f"{DAMAGED}: its parts are not those of a sparse matrix") from None


def _read_apart(path: Path, kind: str) -> Found:
    """Read a file in a process of its own, which may crash."""
    command = [sys.executable, "-P", matrix_reader.__file__, kind, str(path)]
    done = subprocess.run(command, capture_output=True, check=False, stdin=subprocess.DEVNULL)
    if done.returncode < 0 or not done.stdout:
        why = signal.Signals(-done.returncode).name if done.returncode < 0 else "without output"
        raise ValueError(f"{DAMAGED}: the reader of {kind} files ended by {why}")
    said, matrices = pickle.loads(done.stdout)  # of our own process
    if said:
        raise ValueError(on_one_line(said))
    return matrices
