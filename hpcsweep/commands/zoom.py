"""`hpcsweep zoom`: write the job of a finer grid over a part of a results file's."""

from pathlib import Path

from hpcsweep.commands import CommandError
from hpcsweep.commands.outputs import write_job
from hpcsweep.figures.options import file_name

SUMMARY = "write a job with a finer grid over part of a results file"
HELP = """\
Write a job like that of FILE with a finer grid over part of its frequencies or amplitudes. The new
grid holds the points of the old one, so that --reuse takes them over:

  hpcsweep zoom map.h5 --omega 0.43 0.46 --factor 4 -o finer.toml
  hpcsweep run finer.toml --reuse map.h5

Amplitude sweeps are paths: with other amplitudes they pass through other states, and nothing can be
taken over. Refine the frequencies of sweeps, and either axis of points."""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("file", type=file_name, metavar="FILE")
    for name, what in (("omega", "frequencies, as the job gives them"), ("amplitude", "A")):
        parser.add_argument(
            f"--{name}",
            type=float,
            nargs=2,
            metavar=("LOW", "HIGH"),
            help=f"ends of the part: {what} (default: all, not refined)",
        )
    parser.add_argument(
        "--factor", type=int, default=2, metavar="N", help="steps in place of one (default: 2)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="JOB.toml", help="must not exist"
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.job.zoom import zoom
    from hpcsweep.store import job_of

    if options.omega is None and options.amplitude is None:
        raise CommandError("zoom: needs --omega LOW HIGH or --amplitude LOW HIGH")
    text = zoom(job_of(options.file), options.factor, options.omega, options.amplitude)
    return write_job(options.output, text, "--reuse", str(options.file))
