"""Names of files that a caller hands over; see `hpcsweep.model.arguments`."""

import os
from collections.abc import Sequence
from pathlib import Path

from hpcsweep.model.arguments import refused


def path_of(name: str, value: object) -> Path:
    """Take the name of a file.

    Raises
    ------
    ValueError
        If it is none; one line names the argument.
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str) or not text:
        raise refused(name, "a path", value)
    return Path(text)


def followed(path: Path) -> Path:
    """Return the file that a name stands for: of a link that leads to one, the name at its end."""
    return path.resolve() if path.is_symlink() and path.exists() else path


def beside(path: Path, suffix: str) -> Path:
    """Return the name of a file that belongs to another one, under whatever name that is given."""
    path = followed(path)
    return path.with_name(path.name + suffix)


def paths_of(name: str, value: object) -> list[Path]:
    """Take a sequence of names of files; one name is none.

    Raises
    ------
    ValueError
    """
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise refused(name, "a sequence of paths", value)
    return [path_of(name, one) for one in value]
