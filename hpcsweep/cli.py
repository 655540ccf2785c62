"""The command line: one function a command."""

import argparse
import json
import sys
import time
import traceback
from pathlib import Path

from hpcsweep.progress import make_progress

USER_ERROR, FAILURE = 2, 1

DESCRIPTION = """\
Parameter studies of base-excited structures impacting a rigid stop.

Start under mpirun or srun to use many ranks; alone, one rank does it all."""

EPILOG = """\
examples:
  mpirun -n 4 hpcsweep run jobs/figure3.toml    compute, or go on with, figure3.h5
  hpcsweep status figure3.h5                    what is done, live
  hpcsweep plot figure3.h5 -o figure3.png       draw the orbit diagram

exit codes:
  0   complete
  75  stopped in good order before the end (time limit or signal): run again to go on
  2   a mistake in what was asked: one line says which; nothing was written
  1   anything else, with a traceback"""

RUN_HELP = """\
Run a job. If its results file exists already, the run goes on where it stopped, on any number
of ranks, and the results equal those of an uninterrupted run bit for bit.

SIGTERM, SIGINT and SIGUSR1 stop it in good order (exit code 75)."""


class _Parser(argparse.ArgumentParser):
    """A parser whose mistakes take one line, from one rank."""

    def error(self, message: str):
        _complain(f"{message} (see {self.prog} --help)")
        raise SystemExit(USER_ERROR)


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of all commands."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = _Parser(prog="hpcsweep", description=DESCRIPTION, epilog=EPILOG, formatter_class=raw)
    parser.add_argument(
        "--version", action="store_true", help="print the versions of hpcsweep and its libraries"
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    run = commands.add_parser(
        "run", help="run a job, or go on with it", description=RUN_HELP, formatter_class=raw
    )
    run.add_argument("job", type=Path, metavar="JOB.toml", help="the job file")
    run.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="results (default: the job's name + .h5)"
    )
    run.add_argument(
        "--max-hours",
        type=_positive,
        metavar="H",
        help="stop in good order shortly before H hours have passed",
    )
    run.add_argument(
        "--dry-run",
        action="store_true",
        help="compute nothing: tell the runs, bytes, core-hours and time on N ranks",
    )
    run.set_defaults(function=_run)

    status = commands.add_parser(
        "status",
        help="tell what is done in a results file, live or not",
        description="Tell what is done in a results file; it may be in use by a running campaign.",
    )
    status.add_argument("file", type=Path, metavar="FILE")
    status.add_argument("--json", action="store_true", help="machine-readable")
    status.set_defaults(function=_status)

    plot = commands.add_parser(
        "plot",
        help="draw the orbit diagram of one frame",
        description="Draw the orbit diagram of one frame: the stroboscopic displacement of each "
        "floor against the forcing amplitude, sweeps up and down, contact regions along the top.",
    )
    plot.add_argument("file", type=Path, metavar="FILE")
    plot.add_argument(
        "-o", "--output", type=Path, metavar="PNG", help="picture (default: FILE with .png)"
    )
    plot.add_argument(
        "--omega", type=float, help="frequency; the nearest frame is drawn (default: the first)"
    )
    plot.add_argument(
        "--color",
        choices=("direction", "contact", "period"),
        default="direction",
        help="what the colours tell (default: %(default)s)",
    )
    plot.set_defaults(function=_plot)

    bench = commands.add_parser(
        "bench",
        help="measure run time against error, for our solvers and their peers",
        description="Measure run time against error on several regimes, for our solvers, scipy's "
        "and, where installed (extra 'bench'), numbalsoda and CVODE; the ratio of bdf to flow "
        "over a job's first frame; and flow against the number of floors.",
    )
    bench.add_argument(
        "job", type=Path, nargs="?", metavar="JOB.toml", help="job of the ratio (default: Figure 3)"
    )
    bench.add_argument("--ratio", action="store_true", help="only the ratio of bdf to flow")
    bench.add_argument("--json", action="store_true", help="machine-readable")
    bench.add_argument(
        "--plot", type=Path, metavar="PNG", help="also draw the work-precision figure"
    )
    bench.set_defaults(function=_bench)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    parser = build_parser()
    options = parser.parse_args(arguments)
    if options.version:
        return _version()
    if options.command is None:
        parser.error("a command is needed")
    return options.function(options)


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be greater than 0, is {text}")
    return value


def _complain(message: str, rank: int | None = None) -> None:
    from hpcsweep.mpi import launched_rank

    if (launched_rank() if rank is None else rank) == 0:
        print(f"hpcsweep: error: {message}", file=sys.stderr, flush=True)


def _version() -> int:
    from hpcsweep.provenance import git_commit, library_versions, version

    commit = git_commit()
    print(f"hpcsweep {version()}{f' ({commit})' if commit else ''}")
    print(library_versions())
    return 0


def _run(options) -> int:
    """Run a job on all ranks."""
    from hpcsweep.job import JobError, load_job
    from hpcsweep.mpi import LauncherError, world
    from hpcsweep.store import StoreError

    try:
        comm = world()
    except LauncherError as error:
        _complain(str(error))
        return USER_ERROR
    try:
        job, problem = None, None
        if comm.rank == 0:
            try:
                job = load_job(options.job)
            except JobError as error:
                problem = str(error)
        job, problem = comm.bcast((job, problem))
        if problem is None:
            output = options.output or Path(f"{job.name}.h5")
            try:
                if options.dry_run:
                    return _dry_run(job, output, comm)
                from hpcsweep import campaign

                code = campaign.run(
                    job, output, comm, max_hours=options.max_hours, progress=make_progress
                )
                if comm.rank == 0:
                    hint = "complete" if code == 0 else "stopped in good order; run again to go on"
                    print(f"{output}: {hint}", file=sys.stderr)
                return code
            except StoreError as error:
                problem = str(error)
        _complain(problem, comm.rank)
        return USER_ERROR
    except Exception:
        text = traceback.format_exc()
        where = f" on rank {comm.rank}" if comm.size > 1 else ""
        print(f"hpcsweep: failed{where}:\n{text}", file=sys.stderr, flush=True)
        comm.abort(FAILURE)
        return FAILURE


def _dry_run(job, output: Path, comm) -> int:
    """Tell what a job will cost."""
    if comm.rank != 0:
        return 0
    from hpcsweep.estimate import estimate

    print(estimate(job, output))
    return 0


def _status(options) -> int:
    from hpcsweep.store import StoreError, status

    try:
        state = status(options.file)
    except StoreError as error:
        _complain(str(error))
        return USER_ERROR
    if options.json:
        print(json.dumps(state, indent=1))
        return 0
    print(_describe(state))
    return 0


def _describe(state: dict) -> str:
    """Write a status as a person reads it."""
    done, total = state["runs_done"], state["runs_total"]
    lines = [
        f"{state['file']}: {'complete' if state['complete'] else 'not complete'}",
        f"  runs      {done} of {total} ({100 * done / total:.1f} %), frames "
        f"{state['frames_done']} of {state['frames_total']}, solver {state['solver']}",
    ]
    if state["runs_per_core_second"]:
        lines.append(
            f"  cost      {state['core_seconds']:.3g} core seconds, "
            f"{state['runs_per_core_second']:.3g} runs per core second, about "
            f"{state['core_seconds_remaining']:.3g} core seconds left"
        )
    if state["periods_per_run"] is not None:
        spared = ", ".join(f"{name} {count}" for name, count in state["runs_spared"].items())
        lines.append(
            f"  periods   {state['periods_per_run']:.3g} integrated a run, of "
            f"{state['periods_per_run_plain']}; runs spared: {spared}"
        )
    lines.append(f"  no period found in {state['no_period_found']} runs")
    lines.append(f"  failures  {state['n_failed']}")
    lines += [
        f"    Omega = {f['omega']:.6g}, A = {f['amplitude']:.6g}, {f['direction']}: {f['outcome']}"
        for f in state["failures"]
    ]
    for session in state["sessions"]:
        started = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(session["started"]))
        lines.append(
            f"  session   {started}, {session['ranks']} ranks on {' '.join(session['hosts'])}, "
            f"{session['transport']}: {session['ended'] or 'running or killed'}"
        )
    return "\n".join(lines)


def _plot(options) -> int:
    from hpcsweep.figures import orbit_diagram
    from hpcsweep.store import StoreError, open_results

    output = options.output or options.file.with_suffix(".png")
    try:
        results = open_results(options.file)
        orbit_diagram.draw(results, output, omega=options.omega, color=options.color)
    except (StoreError, orbit_diagram.PlotError) as error:
        _complain(str(error))
        return USER_ERROR
    except OSError as error:
        _complain(f"{output}: cannot be written: {error.strerror or error}")
        return USER_ERROR
    print(output)
    return 0


def _bench(options) -> int:
    from hpcsweep import bench
    from hpcsweep.job import JobError, load_job, parse_job

    try:
        job = load_job(options.job) if options.job else parse_job(bench.FIGURE_3, "", "figure3")
    except JobError as error:
        _complain(str(error))
        return USER_ERROR
    rows, by_floors = [], []
    if not options.ratio:
        rows = bench.work_precision(say=lambda text: print(f"  {text}", file=sys.stderr))
        by_floors = bench.floors()
    ratio = bench.sweep_ratio(job)
    if options.plot and rows:
        from hpcsweep.figures import work_precision

        work_precision.draw(rows, options.plot)
    if options.json:
        print(json.dumps(bench.as_json(rows, ratio, by_floors), indent=1))
    else:
        print(bench.as_text(rows, ratio, by_floors))
    return 0
