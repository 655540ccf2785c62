"""`hpcsweep new`: write a job to start from.

Write a job to start from: every key with its meaning, unit, range and default. The job
is complete and runs in seconds. A file that exists is not touched. --kind chooses what is
computed, and whose keys are listed: records are ground motions.

example:
  hpcsweep new study.toml
  hpcsweep new pair.toml --kind records
  mpirun -n 2 hpcsweep run study.toml
  hpcsweep plot study.h5 -o study.png
"""

from hpcsweep.commands.outputs import write_job
from hpcsweep.figures.options import file_name
from hpcsweep.studies.kinds import DEFAULT_KIND, STUDIES


def configure(parser) -> None:
    """Add the options of the command."""
    from hpcsweep.job.template import RESPONSE

    parser.add_argument("file", type=file_name, metavar="FILE.toml", help="must not exist")
    parser.add_argument(
        "--kind",
        choices=(*STUDIES, RESPONSE),
        default=DEFAULT_KIND,
        help="kind of study, or a frequency response (default: %(default)s)",
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.job.template import template

    return write_job(options.file, template(options.kind))
