"""`hpcsweep run`: run a job, or resume it.

Run one job or several. If the results file exists, the run resumes where it stopped, on any number
of ranks, and the results equal those of an uninterrupted run bit for bit.

SIGTERM, SIGINT (Ctrl-C), SIGUSR1 and SIGHUP (unless nohup ignores it), sent to any rank, stop the
run in good order within seconds, with exit code 75. MPICH's mpirun passes the first three on and
returns the exit code of the ranks. Open MPI's does so with SIGUSR1; after SIGINT it returns 1, but
the ranks stop in good order. After SIGKILL of a rank mpirun says BAD TERMINATION and returns 9.
After any kill at most the last seconds are computed again. Do not press Ctrl-C twice:
mpirun then kills the ranks.

Only one run may write FILE at a time: FILE.lock says which host and process it is.

Several jobs form one queue on all ranks, the costliest frame of any job first, each with its own
file. A job that is refused or fails does not stop the others. What is left is listed at the end,
and the exit code is the worst: 1 before 2 before 75.

examples:
  mpirun -n 4 hpcsweep run figure3.toml
  mpirun -n 8 hpcsweep run a.toml b.toml c.toml
  hpcsweep run finer.toml --reuse figure3.h5
  hpcsweep run figure3.toml --set structure.stiffness_ratio=100 -o soft.h5
  hpcsweep run figure3.toml --set 'sweep.omega={from = 0.3, to = 0.6, count = 31}' -o map.h5
  hpcsweep run figure3.toml --set 'solver.method="bdf"' -o bdf.h5

--set replaces a value of the job, a range as a whole; the results file holds the job as it was run.
Give such a variant its own file with -o: the file of another job is refused.
"""

from collections import Counter
from pathlib import Path

from hpcsweep.campaign.progress import make_progress, note, say_line
from hpcsweep.commands import FAILURE, USER_ERROR, abort, add_job, complain, listing
from hpcsweep.figures.options import file_name, positive


def configure(parser) -> None:
    """Add the options of the command."""
    add_job(parser, "jobs", nargs="+")
    parser.add_argument(
        "-o",
        "--output",
        type=file_name,
        metavar="FILE",
        help="results of a single job (default: the job's name + .h5)",
    )
    parser.add_argument(
        "--reuse",
        type=Path,
        action="append",
        default=[],
        metavar="OLD",
        help="take over results of an earlier file, bit for bit, if only the grid of frequencies "
        "and amplitudes differs; may be given more than once",
    )
    parser.add_argument(
        "--max-hours",
        type=positive,
        metavar="H",
        help="stop in good order shortly before H hours have passed; with --dry-run the time in "
        "which the advised ranks are done (default: 1)",
    )
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="show no progress; how it ends is told"
    )
    parser.add_argument(
        "--dry-run",
        action="store_true",
        help="compute only a timed sample: print runs, bytes, core-hours, the fewest ranks for "
        "--max-hours, and the #SBATCH lines that fit",
    )


def run(options) -> int:
    """Run a job on all ranks."""
    from hpcsweep.parallel.mpi import launched_rank, launched_size, on_master, world
    from hpcsweep.parallel.stopping import StopFlag

    if options.dry_run:
        # on one rank, whichever MPI the launcher is of
        if launched_rank() == 0:
            from hpcsweep.campaign.describe import title
            from hpcsweep.campaign.forecast import WANTED_SECONDS, estimate, sum_lines

            jobs, sums = _read(options), Counter[str]()
            within = 3600 * options.max_hours if options.max_hours else WANTED_SECONDS
            listings = [
                listing(title(job), estimate(job, output, sums, within)) for job, output in jobs
            ]
            if len(jobs) > 1:
                listings.append(listing(f"all {len(jobs)} jobs", sum_lines(sums)))
            print("\n\n".join(listings))
        return 0
    # listens from here to the end of the process: a signal while a library is loading is not lost,
    # and one after the last run does no harm
    flag = StopFlag(launched=launched_size() > 1)
    flag.listen()
    from hpcsweep.job import JobError
    from hpcsweep.store import StoreError, WriteError

    comm = world()
    try:
        jobs = on_master(comm, lambda: _read(options), JobError)
        if comm.rank == 0:
            from hpcsweep.model.description import slow

            texts = (text for job, _ in jobs for text in (*job.notes, *slow(job.structure)))
            for text in dict.fromkeys(texts):
                note(text)
        from hpcsweep.campaign import run as campaign

        endings = campaign.run_all(
            jobs,
            comm,
            max_hours=options.max_hours,
            progress=None if options.quiet else make_progress,
            say=note,
            flag=flag,
            reuse=options.reuse,
        )
        flag.ignore()
        if comm.rank == 0:
            _print_endings(endings)
        codes = {code for _, code, _ in endings}  # failed before refused, stopped, complete
        worst = (code for code in (FAILURE, USER_ERROR, campaign.STOPPED) if code in codes)
        return comm.leave(next(worst, 0))
    except (JobError, StoreError) as error:
        complain(str(error), comm.rank)
        return comm.leave(USER_ERROR)
    except WriteError as error:
        complain(str(error), 0)
        comm.abort(FAILURE)
        return FAILURE
    except Exception as error:
        return abort(comm, error)


def _read(options) -> list:
    """Read the jobs, each with its results file.

    Raises
    ------
    JobError
        If one is not a valid job, or cannot be run beside the others.
    """
    from hpcsweep.job import JobError, load_job

    if options.output and len(options.jobs) > 1:
        raise JobError(f"-o {options.output}: goes with one job, each of several has its own file")
    if options.reuse and len(options.jobs) > 1:
        raise JobError(f"--reuse {options.reuse[0]}: goes with one job")
    jobs = [load_job(path, options.settings) for path in options.jobs]
    outputs = [options.output or Path(f"{job.name}.h5") for job in jobs]
    by_meaning: dict[str, Path] = {}
    by_file: dict[Path, Path] = {}
    for path, job, output in zip(options.jobs, jobs, outputs, strict=True):
        if (same := by_meaning.setdefault(job.fingerprint, path)) is not path:
            raise JobError(f"{path}: is the same job as {same}; name each job once")
        if (same := by_file.setdefault(output.resolve(), path)) is not path:
            raise JobError(f"{path}: has the file of {same}, {output}; give it another name")
    return list(zip(jobs, outputs, strict=True))


def _print_endings(endings) -> None:
    """Print how each job ended, and the remaining runs."""
    from hpcsweep.campaign.run import COMPLETE, STOPPED

    words = {COMPLETE: "complete", STOPPED: "stopped in good order; run again to resume"}
    for output, code, why in endings:
        if code in words:
            say_line(f"{output}: {words[code]}")
        else:
            complain(why, 0)
    left = [str(output) for output, code, _ in endings if code != COMPLETE]
    if len(endings) > 1 and left:
        say_line(f"left: {len(left)} of {len(endings)} jobs: {', '.join(left)}")
