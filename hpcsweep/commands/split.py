"""`hpcsweep split`: write jobs of a part of a job's runs each, for several allocations.

Write K jobs beside JOB, of every K-th frequency, listed point, line or record each. They are jobs
like any other; hpcsweep merge makes the file of the whole of their files:

  hpcsweep split map.toml -n 3
  hpcsweep run map-1of3.toml        here and there
  hpcsweep merge map-1of3.h5 map-2of3.h5 map-3of3.h5 -o map.h5
"""

from hpcsweep.commands import CommandError, add_job
from hpcsweep.commands.outputs import write_job


def configure(parser) -> None:
    """Add the options of the command."""
    add_job(parser)
    parser.add_argument("-n", type=int, required=True, metavar="K", help="number of parts")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.job import load_job
    from hpcsweep.job.split import split

    texts = split(load_job(options.job, options.settings), options.n, options.job)
    for path in texts:
        if path.exists():
            raise CommandError(f"{path}: exists already, and is not overwritten")
    return max(write_job(path, text) for path, text in texts.items())
