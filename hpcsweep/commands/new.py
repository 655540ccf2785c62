"""`hpcsweep new`: write a job to start from."""

from pathlib import Path

from hpcsweep.commands import RAW
from hpcsweep.commands.outputs import write_job

NEW_HELP = """\
Write a job to start from: every key with its meaning, unit, range and default. The job
is complete and runs in seconds. A file that exists is not touched."""

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
    from hpcsweep.job.template import template

    return write_job(options.file, template())
