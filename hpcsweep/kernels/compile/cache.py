"""Cache compiled kernels on disk: one file for each kernel and processor.

numba's own cache checks only the file of the compiled function, not those of the functions inlined
into it, so an edited kernel could keep running in its old form; and it loads all of numba's
registries, which only compilation needs, 0.42 s of every start. A folder is named after the sources
of the kernels: the program text of every file that a room declares in its `KERNELS` (without
comments, docstrings and line numbers), and the versions of numba and of numpy, which computes the
constants frozen into them. A file is named after the hash of the signature, the processor's name
and its features, so that nodes of different types keep their kernels side by side.

It lies under ``$NUMBA_CACHE_DIR`` where that is set, else under ``$XDG_CACHE_HOME/hpcsweep`` or
``~/.cache/hpcsweep``, whatever environment or path the package is installed in. Where that cannot
be written, new kernels go to a folder of the user's own under ``$TMPDIR``. numba's settings for
other packages are not touched.

A file begins with a digest of its content, which is verified before loading: machine code with one
bit changed may crash, or give results that are wrong in the tenth digit. A file that fails is
compiled again. Files are written under another name and renamed into place, and there is no index
that two processes could both change: many ranks may compile at once, and at worst work is done
twice.
"""

import ast
import contextlib
import functools
import hashlib
import os
import pickle
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from numba.core import serialize
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys

from hpcsweep.kernels import folders
from hpcsweep.kernels.compile.specialise import KEY_LENGTH, specialised_name

PACKAGE = Path(__file__).resolve().parents[2]
DECLARED = re.compile(rb"^KERNELS = (\([^)]*\))", re.MULTILINE)
"""Patterns of the files of a room that define kernels and the constants in them."""
SUFFIX = ".kernel"
HASH_LENGTH = 16
COUNTS_REFERENCES = b"NRT_"
"""In machine code that counts references to arrays (`decorators.jit`).

numba's runtime for that is compiled at its first use, which takes 28 ms of a start.
"""


def kernel_files(package: Path = PACKAGE) -> list[Path]:
    """Return the source files of the kernels, which the rooms of a package declare in `KERNELS`.

    The declarations are read, not imported: which rooms are loaded must not matter.

    Raises
    ------
    FileNotFoundError
        If a declared file does not exist: a moved file would keep running in its old form.
    """
    listed: list[Path] = []
    for room in sorted(package.glob("*/__init__.py")):
        declared = DECLARED.search(room.read_bytes())
        for pattern in ast.literal_eval(declared[1].decode()) if declared else ():
            files = sorted(room.parent.glob(pattern))
            if not files:
                path = room.parent / pattern
                raise FileNotFoundError(f"kernels are made of {path}, which is not there")
            listed += files
    return listed


def _program_text(source: bytes) -> str:
    """Return the program of a file, without comments, docstrings and line numbers."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [  # type: ignore[attr-defined]
                line
                for line in body
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ]
    return ast.dump(tree)


def _hash(texts: dict[str, bytes]) -> str:
    """Hash versions, and names and contents of files."""
    digest = hashlib.sha256(f"numba {numba.__version__} numpy {np.__version__}".encode())
    digest.update(f" python {sys.version_info[:2]}".encode())
    for name, text in texts.items():
        digest.update(b"\0".join((b"", name.encode(), text)))
    return digest.hexdigest()[:HASH_LENGTH]


@functools.cache
def source_hash() -> str:
    """Hash all sources of the kernels.

    Parsing takes as long as loading the kernels, so the hash is cached, too, under that of the
    complete files. One thread parses at a time, as numba does when it compiles, what files declare,
    too: in some versions of Python `ast.parse` counts its depth for all threads.
    """
    with global_compiler_lock:
        sources = {str(path.relative_to(PACKAGE)): path.read_bytes() for path in kernel_files()}
        kept = folders.cache_root() / "sources" / _hash(sources)
        content = folders.read_verified(kept)
        if content is not None:
            return content.decode()
        made = _hash({name: _program_text(text).encode() for name, text in sources.items()})
        with contextlib.suppress(OSError):
            folders.write_verified(kept, made.encode())
    return made


def cache_folder() -> Path:
    """Return the folder of the compiled kernels."""
    return folders.cache_root() / source_hash()


def kept_in() -> list[Path]:
    """Return the folders with compiled kernels; none where they cannot be kept."""
    kept = (root / source_hash() for root in folders.roots())
    return [folder for folder in kept if any(folder.rglob(f"*{SUFFIX}"))]


class KernelCache:
    """The cache of one function of this package, for numba's dispatcher of it."""

    def __init__(self, function: Callable):
        self._function = function
        file = Path(function.__code__.co_filename).resolve()
        self._place = file.relative_to(PACKAGE).with_suffix("")

    def _path(self, sig, codegen) -> Path:
        """Return the path of a compiled kernel below a root."""
        key = repr((sig, codegen.magic_tuple(), self._function.__code__.co_code)).encode()
        digest = hashlib.sha256(key).hexdigest()[:HASH_LENGTH]
        name = f"{self._function.__qualname__}-{digest}{SUFFIX}"
        return Path(source_hash()) / self._place / name

    def load_overload(self, sig, target_context):
        """Return a compiled kernel; None if it is absent or damaged."""
        place = self._path(sig, target_context.codegen())
        for root in folders.roots():
            content = folders.read_verified(root / place)
            if content is not None:
                if COUNTS_REFERENCES in content:
                    rtsys.initialize(target_context)
                return CompileResult._rebuild(target_context, *pickle.loads(content))
        return None

    def holds(self, sig, target_context) -> bool:
        """Return whether a kernel is in the cache."""
        place = self._path(sig, target_context.codegen())
        return any(os.access(root / place, os.R_OK) for root in folders.roots())

    def specialisations(self) -> frozenset[str]:
        """Return the keys of the cached specialisations, for any processor."""
        keys = set()
        for root in folders.roots():
            folder = root / source_hash() / self._place
            for path in folder.glob(f"{specialised_name(self._function, '*')}-*{SUFFIX}"):
                keys.add(path.name.rpartition("-")[0][-KEY_LENGTH:])
        return frozenset(keys)

    def save_overload(self, sig, data):
        """Keep a compiled kernel where that is possible."""
        if data.library.has_dynamic_globals:  # addresses of this process
            return
        place = self._path(sig, data.codegen)
        content = serialize.dumps(data._reduce())
        try:
            folders.write_verified(folders.cache_root() / place, content)
        except OSError as error:
            kept, folder = False, folders.own_folder()
            if folder is not None:
                with contextlib.suppress(OSError):
                    folders.write_verified(folder / place, content)
                    kept = True
            folders.say_unwritable(error.strerror or str(error), kept)


def processor() -> str:
    """Return the name and features of the processor for which kernels are compiled.

    By default this machine's; ``$NUMBA_CPU_NAME`` and ``$NUMBA_CPU_FEATURES`` override them.
    """
    _, name, features = cpu_target.target_context.codegen().magic_tuple()
    used = (word[1:] for word in features.split(",") if word.startswith("+"))
    return " ".join([name, *sorted(used)])
