"""What a command finds around it: standard streams that are closed or full, folders it may not use.

`prepare` comes first of all. A closed stream would leave its descriptor to the next file that is
opened, and what is printed would then be written into the results.
"""

import contextlib
import os
import stat
import sys
import tempfile
from pathlib import Path
from typing import TextIO

from hpcsweep.campaign.progress import note
from hpcsweep.parallel.mpi import launched_rank

CACHE = "NUMBA_CACHE_DIR"


def prepare() -> None:
    """Make the streams and the cache of compiled kernels such that they can be used."""
    _open_streams()
    _choose_cache()


def silence(stream: TextIO) -> None:
    """Let a stream that cannot be written swallow all that comes, also at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _open_streams() -> None:
    """Open what is closed of the standard streams on the null device."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest that is free: this one
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", closefd=False))
        # names of files need not be text
        with contextlib.suppress(AttributeError, OSError):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def _choose_cache() -> None:
    """Choose another folder for compiled kernels where the usual one cannot be written."""
    if os.environ.get(CACHE):
        usual = Path(os.environ[CACHE])
    else:
        try:
            home = Path.home()
        except RuntimeError:  # nobody knows this user
            home = Path("/nonexistent")
        usual = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "hpcsweep"
    if _can_write(usual):
        return
    other = Path(tempfile.gettempdir()) / f"hpcsweep-{os.getuid()}"
    if not _is_own(other):
        other = Path(tempfile.mkdtemp(prefix="hpcsweep-"))
    os.environ[CACHE] = str(other)
    if launched_rank() == 0:
        note(f"{usual}: cannot be written; compiled kernels are kept in {other}")


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except (OSError, ValueError):
        return False


def _is_own(folder: Path) -> bool:
    """Make a folder in a place that all may write; tell whether nobody else can write into it."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    return own and not found.st_mode & 0o022 and _can_write(folder)
