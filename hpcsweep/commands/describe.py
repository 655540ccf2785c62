"""`hpcsweep describe`: describe a job: modes, units, grazing amplitude, runs.

Describe a job: structure, units, natural frequencies, modes, damping ratios, contacts, the
amplitude at which free motion first touches, and the number of runs. Warn of what looks like a
mistake. It takes a second.
"""

from hpcsweep.commands import add_job, listing


def configure(parser) -> None:
    """Add the options of the command."""
    add_job(parser)


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.describe import describe, title
    from hpcsweep.job import load_job

    job = load_job(options.job, options.settings)
    print(listing(title(job), describe(job)))
    return 0
