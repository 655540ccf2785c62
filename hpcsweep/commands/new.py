"""`hpcsweep new`: write a job to start from."""

from pathlib import Path

from hpcsweep.commands.outputs import write_job

SUMMARY = "write a job to start from"
HELP = """\
Write a job to start from: every key with its meaning, unit, range and default. The job
is complete and runs in seconds. A file that exists is not touched."""

EXAMPLES = """\
example:
  hpcsweep new study.toml
  mpirun -n 2 hpcsweep run study.toml
  hpcsweep plot study.h5 -o study.png"""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("file", type=Path, metavar="FILE.toml", help="must not exist")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.job.template import template

    return write_job(options.file, template())
