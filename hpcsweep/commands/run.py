"""`hpcsweep run`: run a job, or resume it."""

import traceback
from pathlib import Path

from hpcsweep.campaign.progress import make_progress, note, say_line
from hpcsweep.commands import FAILURE, RAW, USER_ERROR, add_settings, complain
from hpcsweep.figures.options import file_name, positive

RUN_HELP = """\
Run a job. If its results file exists already, the run resumes where it stopped, on any number
of ranks, and the results equal those of an uninterrupted run bit for bit.

SIGTERM, SIGINT (Ctrl-C) and SIGUSR1 stop it in good order within seconds, with exit code 75, sent
to mpirun or to any rank: MPICH's mpirun hands all three on to the ranks and returns their exit
code. Open MPI's does so with SIGUSR1; told SIGINT it returns 1 itself, but the ranks stop in good
order. After SIGKILL of a rank mpirun says BAD TERMINATION and returns 9;
after any kill at most the last seconds are computed again. Do not press Ctrl-C twice: mpirun then
kills.

Nobody else may run a job into the same FILE: FILE.lock says which host and process does."""

RUN_EXAMPLES = """\
examples:
  mpirun -n 4 hpcsweep run figure3.toml
  hpcsweep run figure3.toml --set structure.stiffness_ratio=100 -o soft.h5
  hpcsweep run figure3.toml --set 'sweep.omega={from = 0.3, to = 0.6, count = 31}' -o map.h5
  hpcsweep run figure3.toml --set 'solver.method="bdf"' -o bdf.h5

What is set replaces the value in the file, a range as a whole; the results file holds the job with
all that was set. Give such a variant a file of its own: a file of another job is refused."""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    run = commands.add_parser(
        "run",
        help="run a job, or resume it",
        description=RUN_HELP,
        epilog=RUN_EXAMPLES,
        formatter_class=RAW,
    )
    run.add_argument("job", type=Path, metavar="JOB.toml", help="the job file")
    run.add_argument(
        "-o",
        "--output",
        type=file_name,
        metavar="FILE",
        help="results (default: the job's name + .h5)",
    )
    add_settings(run)
    run.add_argument(
        "--max-hours",
        type=positive,
        metavar="H",
        help="stop in good order shortly before H hours have passed",
    )
    run.add_argument(
        "--dry-run",
        action="store_true",
        help="compute nothing: tell the runs, bytes, core-hours, time on N ranks, and the "
        "#SBATCH lines that fit",
    )
    run.set_defaults(function=_run)


def _run(options) -> int:
    """Run a job on all ranks."""
    from hpcsweep.parallel.mpi import LauncherError, launched_size, world
    from hpcsweep.parallel.stopping import StopFlag

    # heard from here to the end of the process: a signal while a library is loaded is not lost,
    # and one that comes when all is done does no harm
    flag = StopFlag(launched=launched_size() > 1)
    if not options.dry_run:
        flag.listen()
    from hpcsweep.job import JobError, load_job
    from hpcsweep.store import StoreError, WriteError

    try:
        comm = world()
    except LauncherError as error:
        complain(str(error))
        return USER_ERROR
    if options.dry_run:
        return _dry_run(options) if comm.rank == 0 else 0
    try:
        job, problem = None, None
        if comm.rank == 0:
            try:
                job = load_job(options.job, options.settings)
            except JobError as error:
                problem = str(error)
        job, problem = comm.bcast((job, problem))
        for text in job.notes if job is not None and comm.rank == 0 else ():
            note(text)
        if problem is None:
            output = options.output or Path(f"{job.name}.h5")
            try:
                from hpcsweep.campaign import run as campaign

                code = campaign.run(
                    job,
                    output,
                    comm,
                    max_hours=options.max_hours,
                    progress=make_progress,
                    say=note,
                    flag=flag,
                )
                flag.ignore()
                if comm.rank == 0:
                    hint = "complete" if code == 0 else "stopped in good order; run again to resume"
                    say_line(f"{output}: {hint}")
                return comm.leave(code)
            except StoreError as error:
                problem = str(error)
        complain(problem, comm.rank)
        return comm.leave(USER_ERROR)
    except WriteError as error:
        complain(str(error), 0)
        comm.abort(FAILURE)
        return FAILURE
    except Exception:
        text = traceback.format_exc()
        where = f" on rank {comm.rank}" if comm.size > 1 else ""
        say_line(f"hpcsweep: failed{where}:\n{text}")
        comm.abort(FAILURE)
        return FAILURE


def _dry_run(options) -> int:
    """Print what a job will cost."""
    from hpcsweep.campaign.forecast import estimate
    from hpcsweep.job import JobError, load_job
    from hpcsweep.store import StoreError

    try:
        job = load_job(options.job, options.settings)
        text = estimate(job, options.output or Path(f"{job.name}.h5"))
    except (JobError, StoreError) as error:
        complain(str(error))
        return USER_ERROR
    print(text)
    return 0
