"""Check file names given as arguments; see `hpcsweep.model.arguments`."""

from pathlib import Path

from hpcsweep.model.arguments import file_name


def path_of(name: str, value: object) -> Path:
    """Return the path of a file name.

    Raises
    ------
    ValueError
        If it is not a file name; one line names the argument.
    """
    return Path(file_name(name, value))


def followed(path: Path) -> Path:
    """Return the file that a name stands for, following a link to a file."""
    return path.resolve() if path.is_symlink() and path.exists() else path


def beside(path: Path, suffix: str) -> Path:
    """Return the name of a file that belongs to another one, after following links."""
    path = followed(path)
    return path.with_name(path.name + suffix)
