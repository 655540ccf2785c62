"""Folders of compiled kernels, also for where the usual one cannot be written.

Their contents are executed. A file there begins with a digest of its content, and one that does not
match (a failing disk, a truncated copy, another program) counts as absent.

Nothing here is slow to import: the command line checks the folders first.
"""

import functools
import os
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable
from pathlib import Path


def cache_root() -> Path:
    """Return the folder of the caches of all versions."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return Path(os.environ["NUMBA_CACHE_DIR"])
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hpcsweep"
    except RuntimeError:
        # a user without a home: nothing can be stored below this
        return Path(os.devnull) / "hpcsweep"


@functools.cache
def own_folder() -> Path | None:
    """Return a folder in place of `cache_root`; None if it might be another user's.

    The contents of a cache are executed.
    """
    path = Path(tempfile.gettempdir()) / f"hpcsweep-{os.getuid()}"
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        status = path.lstat()
    except OSError:
        return None
    private = stat.S_ISDIR(status.st_mode) and not status.st_mode & 0o022
    return path if private and status.st_uid == os.getuid() else None


def roots() -> list[Path]:
    """Return the folders below which compiled kernels may lie, that of `cache_root` first."""
    folder = own_folder()
    return [cache_root()] if folder is None else [cache_root(), folder]


DIGEST_LENGTH = 16
"""Bytes of the digest that a file of the cache begins with."""


def _digest(content: bytes) -> bytes:
    import hashlib

    return hashlib.blake2b(content, digest_size=DIGEST_LENGTH).digest()


def write_verified(path: Path, content: bytes) -> None:
    """Write content with its digest; raise as `write_whole`."""
    write_whole(path, _digest(content) + content)


def read_verified(path: Path) -> bytes | None:
    """Return the content written by `write_verified`; None if absent, unreadable or damaged."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    content = data[DIGEST_LENGTH:]
    return content if _digest(content) == data[:DIGEST_LENGTH] else None


def write_whole(path: Path, data: bytes) -> None:
    """Write a file under another name and rename it into place.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f"{path.name}.{uuid.uuid4().hex}")
    try:
        unfinished.write_bytes(data)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def is_writable() -> bool:
    """Return whether `cache_root` can be written; report it once if not."""
    probe = cache_root() / f".{uuid.uuid4().hex}"
    try:
        write_whole(probe, b"writable")
        probe.unlink()
    except (OSError, ValueError) as error:
        say_unwritable(getattr(error, "strerror", None) or str(error))
        return False
    return True


def say_unwritable(why: str, elsewhere: bool = True) -> None:
    """Report, once in a process, that kernels cannot be kept in `cache_root`, or anywhere."""
    folder = own_folder() if elsewhere else None
    kept = f"kept in {folder}" if folder else "not kept"
    say_once(f"{cache_root()} cannot be written ({why}): compiled kernels are {kept}")


def say_once(text: str) -> None:
    """Print a message about the folders, unless one has been printed before."""
    if not _said:
        _said.append(text)
        _way[0](text)


def set_printer(say: Callable[[str], None]) -> None:
    """Replace the function that prints messages about the folders."""
    _way[0] = say


def say_nothing(text: str) -> None:
    """Print nothing: another process does."""
    del text


def _print(text: str) -> None:
    print(f"hpcsweep: {text}", file=sys.stderr, flush=True)


_said: list[str] = []
_way: list[Callable[[str], None]] = [_print]
