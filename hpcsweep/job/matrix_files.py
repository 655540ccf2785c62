"""Read matrices from files of every format, by their content.

Arrays of numpy and sparse matrices of scipy are read after what their headers say has been compared
with their sizes. Libraries that a damaged file can crash, and those of the extra ``fem``, read in a
process of their own (`hpcsweep.job.matrix_reader`), with a limit to its memory.
"""

import math
import pickle
import signal
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.earthquakes.text_files import decoded, read_bytes
from hpcsweep.job import matrix_reader
from hpcsweep.job.matrix_texts import Found, check_size, read_text
from hpcsweep.model.arguments import shown
from hpcsweep.parallel.one_line import on_one_line

MAX_BYTES = 2**30
"""Of a file, and of an array in it."""
TEXTS = (".txt", ".out", ".dat", ".csv")
ENDINGS = (".npz", ".npy", *matrix_reader.READERS, ".mtx", ".mm", *TEXTS)
"""Of files with matrices; those of other endings are read by their content, too."""
DAMAGED = "is cut off or damaged"
NAMES = "names"


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
    if content.startswith(b"PK\x03\x04"):
        return _npz(content)
    if content.startswith(b"\x93NUMPY"):
        return {"": _array(BytesIO(content), len(content))}
    if content.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise ValueError("is a MATLAB file of version 7.3, which is not read: save(..., '-v7')")
    kind = ".mat" if content.startswith(b"MATLAB 5.0") else kind
    if kind in matrix_reader.READERS:
        return _read_apart(path, kind)
    if kind in (".npz", ".npy"):
        raise ValueError(f"is no {kind} file of numpy, or {DAMAGED.removeprefix('is ')}")
    return read_text(decoded(content))


def _npz(content: bytes) -> Found:
    matrices: dict[str, Any] = {}
    try:
        with zipfile.ZipFile(BytesIO(content)) as archive:
            for entry in archive.infolist():
                with archive.open(entry) as stream:
                    name = entry.filename.removesuffix(".npy")
                    matrices[name] = _array(stream, entry.file_size, name)
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError, OSError):
        raise ValueError(DAMAGED) from None
    if {"format", "shape"} <= set(matrices):
        return {"": _sparse(content, matrices)}
    return matrices


def _array(stream: Any, size: int, name: str = "") -> np.ndarray:
    """Read an array of numpy of so many bytes, with its header."""
    read = np.lib.format
    try:
        version = read.read_magic(stream)
        header = read.read_array_header_1_0 if version == (1, 0) else read.read_array_header_2_0
        shape, by_columns, dtype = header(stream)
    except Exception:  # whatever a header is taken for
        raise ValueError(DAMAGED) from None
    if dtype.hasobject:
        remedy = "scipy.sparse.save_npz writes a sparse matrix"
        raise ValueError(f"{name} holds objects of Python, which are not read: {remedy}")
    n_bytes = math.prod(shape) * dtype.itemsize
    if n_bytes > MAX_BYTES:
        limit = f"must have {MAX_BYTES / 2**30:g} GB at most"
        raise ValueError(f"{name} {limit}, has {' x '.join(map(str, shape))} entries".strip())
    data = stream.read(size)
    if len(data) != n_bytes:
        raise ValueError(
            f"{name} {DAMAGED}: its header says {n_bytes} bytes, it has {len(data)}".strip()
        )
    if not n_bytes:
        return np.zeros(shape)
    return np.frombuffer(data, dtype).reshape(shape, order="F" if by_columns else "C")


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
