"""Read matrices with libraries that a damaged file may crash: a script, run as its own process.

It is run by `hpcsweep.job.model_files`, and writes what it has found, or what is wrong,
to its standard output. It imports nothing of the package, so that it starts quickly.
"""

import os
import pickle
import sys
from collections.abc import Callable
from typing import Any

COMPONENTS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
INSTALL = "{} is needed to read it: pip install 'hpcsweep[fem]'"
MEMORY = 8 * 2**30
"""Bytes that a library may take beyond those of its start."""
NAMES = "names"


def _mat(path: str) -> dict[str, Any]:
    import numpy as np
    from scipy.io import loadmat

    matrices = {name: matrix for name, matrix in loadmat(path).items() if not name.startswith("__")}
    if NAMES in matrices:
        matrices[NAMES] = [str(np.squeeze(matrix)).strip() for matrix in np.ravel(matrices[NAMES])]
    return matrices


def _op4(path: str) -> dict[str, Any]:
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise NotImplementedError(INSTALL.format("pyyeti")) from None
    # Nastran writes placeholders of one entry, and names such as kxx1 for those of later kinds
    matrices = op4.read(path, sparse=None)
    return {name: matrix for name, matrix in matrices.items() if matrix.shape != (1, 1)}


def _full(path: str) -> dict[str, Any]:
    try:
        from ansys.mapdl.reader.full import FullFile
    except ImportError:
        raise NotImplementedError(INSTALL.format("ansys-mapdl-reader")) from None
    places, stiffness, mass = FullFile(path).load_km(sort=True)
    names = [f"{node}.{COMPONENTS[dof] if dof < 6 else dof + 1}" for node, dof in places.tolist()]
    matrices = {"K": stiffness, "M": mass, NAMES: names}
    return {name: matrix for name, matrix in matrices.items() if matrix is not None}


READERS: dict[str, Callable[[str], dict[str, Any]]] = {".mat": _mat, ".op4": _op4, ".full": _full}
"""By the ending of a file."""


def _limit_memory() -> None:
    """Bound the memory of this process, where the system lets it."""
    import resource

    try:
        with open("/proc/self/statm") as file:  # noqa: PTH123
            now = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        most = resource.getrlimit(resource.RLIMIT_AS)[1]
        wanted = now + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (wanted if most < 0 else min(wanted, most), most))
    except (OSError, ValueError):
        return


def main(kind: str, path: str) -> None:
    """Read a file and write a pair: an error message, and the matrices."""
    import scipy.sparse

    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries print
    _limit_memory()
    said, matrices = "", {}
    try:
        matrices = READERS[kind](path)
        for matrix in matrices.values():
            if scipy.sparse.issparse(matrix) and matrix.format in ("csr", "csc", "bsr"):
                matrix.check_format(full_check=True)
    except NotImplementedError as error:
        said = str(error)
    except MemoryError:
        said = f"needs more than {MEMORY // 2**30} GB of memory to be read"
    except Exception:  # whatever a library takes the file for
        said = f"is no {kind} file, or is cut off or damaged"
    with out:
        pickle.dump((said, matrices), out, protocol=5)


if __name__ == "__main__":
    main(*sys.argv[1:])
