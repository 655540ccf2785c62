"""`hpcsweep warmup`: compile the kernels before they are needed.

Compile the kernels into the cache: $NUMBA_CACHE_DIR, else $XDG_CACHE_HOME/hpcsweep or
~/.cache/hpcsweep. `run` compiles by itself; this command does it before an allocation is spent, or
into a folder that is read-only later. Kernels are compiled for the processor of this machine: run
it on a node of the type that will compute.

Given jobs, it also compiles kernels specialised to their structures, which take 0.65 to 0.9 of the
time and give the same results to the last bit. `run` specialises by itself from half a million
histories a rank on, and uses specialised kernels wherever the cache has them.

examples:
  hpcsweep warmup                                      on all processors of the machine
  srun -n 1 -c 4 hpcsweep warmup --jobs 4              on a node of a cluster
  hpcsweep warmup jobs/paper/bluecrystal.toml          also specialised to its structure
  NUMBA_CACHE_DIR=/opt/kernels hpcsweep warmup         for all users of an image
"""

from pathlib import Path

from hpcsweep.commands import CommandError


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "job",
        type=Path,
        nargs="*",
        metavar="JOB.toml",
        help="also compile kernels specialised to the structures of these jobs",
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: all processors)")


def run(options) -> int:
    """Run the command."""
    import functools
    import time

    from hpcsweep.job import load_job
    from hpcsweep.kernels.compile.cache import kept_in, processor
    from hpcsweep.parallel.mpi import launched_rank
    from hpcsweep.studies.compilation import load, warm_up_all
    from hpcsweep.studies.part import Part
    from hpcsweep.studies.study import as_kind

    if options.jobs is not None and options.jobs < 1:
        raise CommandError(f"--jobs {options.jobs}: must be at least 1")
    studies = [load_job(path).study for path in options.job]
    if launched_rank() != 0:
        return 0
    begun = time.perf_counter()

    say = functools.partial(print, flush=True)
    warm_up_all(say, options.jobs)
    for study in studies:
        part = as_kind(study.part((0,) * len(study.axes)), Part)
        # on no ranks any number of runs pays for kernels of their own
        load(part.kernels(n_ranks=0), say, options.jobs)
    seconds = time.perf_counter() - begun
    folders = " and ".join(map(str, kept_in()))
    where = f"in {folders}" if folders else "are not kept"
    print(f"ready in {seconds:.1f} s: kernels for {processor().split()[0]} {where}")
    return 0
