"""`hpcsweep describe`: describe what a job computes, before it is run."""

from pathlib import Path

from hpcsweep.commands import RAW, add_settings

HELP = """\
Describe a job: structure, units, natural frequencies, modes, damping ratios, contacts, the
amplitude at which free motion first touches, and the number of runs. Warn of what looks like a
mistake. It takes a second."""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    parser = commands.add_parser(
        "describe",
        help="describe a job: modes, units, grazing amplitude, runs",
        description=HELP,
        formatter_class=RAW,
    )
    parser.add_argument("job", type=Path, metavar="JOB.toml")
    add_settings(parser)
    parser.set_defaults(function=_describe)


def _describe(options) -> int:
    from hpcsweep.campaign.describe import describe
    from hpcsweep.campaign.forecast import study_text
    from hpcsweep.job import load_job

    job = load_job(options.job, options.settings)
    print("\n".join([f"{job.name}: {study_text(job.study)}", *job.notes, *describe(job)]))
    return 0
