"""`hpcsweep new`: write a job to start from."""

import shlex
from pathlib import Path

from hpcsweep.commands import RAW, USER_ERROR, complain

NEW_HELP = """\
Write a job to start from: every key with its meaning, unit, range and default. It is complete and
runs in seconds as it is. A file that exists is not touched."""

NEW_EXAMPLE = """\
example:
  hpcsweep new study.toml
  mpirun -n 2 hpcsweep run study.toml
  hpcsweep plot study.h5 -o study.png"""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    new = commands.add_parser(
        "new",
        help="write a job to start from",
        description=NEW_HELP,
        epilog=NEW_EXAMPLE,
        formatter_class=RAW,
    )
    new.add_argument("file", type=Path, metavar="FILE.toml", help="must not exist")
    new.set_defaults(function=_new)


def _new(options) -> int:
    from hpcsweep.job.template import TEMPLATE
    from hpcsweep.parallel.mpi import launched_rank

    path = options.file
    if launched_rank() != 0:
        return 0
    if path.suffix != ".toml":
        complain(f"{path}: the name of a job file must end in .toml")
        return USER_ERROR
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE)
    except FileExistsError:
        complain(f"{path}: exists already, and is not overwritten")
        return USER_ERROR
    except OSError as error:
        complain(f"{path}: cannot be written: {error.strerror or error}")
        return USER_ERROR
    # as the shell takes it: a name may have spaces, or begin with a dash
    named = f"./{path}" if str(path).startswith("-") else str(path)
    print(f"{path}: written; run it with: hpcsweep run {shlex.quote(named)}")
    return 0
