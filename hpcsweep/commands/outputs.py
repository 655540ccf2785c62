"""Protect files: a command overwrites only a file of the kind that it writes.

Results, jobs and journals are hours of work, and a slip of the keyboard (``explore a.h5 -o b.h5``)
must not cost them. The first bytes of a file show its kind; a name that is not a regular file, such
as ``/dev/null``, is simply written to.
"""

import contextlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from hpcsweep.commands import CommandError

HEAD = 4096
"""First bytes of each kind of file."""
PICTURE, PAGE, FILM, DEMANDS, TABLE = "picture", "page", "film", "table of demands", "table"
COLLAPSES = "collapse fragility"
KINDS = {
    "results file": rb"\x89HDF",
    "journal": rb'\{"kind": ',
    PICTURE: rb"\x89PNG|\xff\xd8\xff|RIFF....WEBP|%PDF|%!PS|II\*\0|MM\0\*|\s*<(\?xml|svg)|\x1f\x8b",
    PAGE: rb"(?i)\s*<!doctype html",
    FILM: rb"GIF8|....ftyp",
    DEMANDS: rb"[^\n]*,\d+-P[FI][AD]-",
    COLLAPSES: rb'\{\s*"CollapseFragility"',
    TABLE: rb"PAR1|PK\x03\x04.{26}(docProps|xl|_rels|\[Content)"
    rb"|job,structure,storeys |([^\n]+,)?(record,scale|direction,[^\n]+,amplitude)( \[[^\n,]*\])?,",
}
"""Patterns of the first bytes, by kind."""


def kind_of(path: Path) -> str:
    """Return the kind of a file: a key of `KINDS`, ``job file`` or ``file``.

    Empty where there is nothing to lose: not a regular file, or an empty one.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if not head:
        return ""
    for kind, pattern in KINDS.items():
        if re.match(pattern, head, re.DOTALL):
            return kind
    return "job file" if path.suffix == ".toml" else "file"


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn a failure to write `path` into one line."""
    try:
        yield
    except OSError as error:
        raise CommandError(f"{path}: cannot be written: {error.strerror or error}") from error
    except UnicodeEncodeError:
        limit = f"must be text where it ends in {path.suffix}"
        raise CommandError(f"{path}: cannot be written: the name {limit}") from None


def check_overwriting(path: Path, kind: str) -> None:
    """Make sure that a command that writes `kind` need not leave `path` alone.

    Raises
    ------
    CommandError
    """
    with writing(path):
        there = kind_of(path)
    if there not in ("", kind):
        what = "is there already" if there == "file" else f"is a {there}"
        raise CommandError(
            f"{path}: {what}, and no {kind} is written over it; name another {kind} with -o"
        )


def write_job(path: Path, text: str) -> int:
    """Write a new job file, print how to run it, and return the exit code.

    Parameters
    ----------
    path : Path
    text : str
    """
    from hpcsweep.parallel.mpi import launched_rank

    if launched_rank() != 0:
        return 0
    if path.suffix != ".toml":
        raise CommandError(f"{path}: the name of a job file must end in .toml")
    with writing(path):
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise CommandError(f"{path}: exists already, and is not overwritten") from None
    # quoted for the shell: a name may have spaces, or begin with a dash
    named = f"./{path}" if str(path).startswith("-") else str(path)
    print(f"{path}: written; run it with: {shlex.join(['hpcsweep', 'run', named])}")
    return 0
