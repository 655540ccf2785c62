"""Where things are, how a campaign is started, how two files are compared."""

import contextlib
import dataclasses
import faulthandler
import fnmatch
import functools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
JOBS = ROOT / "jobs"
PAPER = JOBS / "paper"
DESCRIBED = (0.12622293348805766, 0.016077603302694768, 0.007699463209247604)
"""Damping ratios of the building as the paper describes it: jobs/paper/figure3-described.toml."""
LIMIT = 900
"""Seconds after which a command hangs."""
FITTED = f"*_{12 * '[0-9a-f]'}-*"
"""Files of kernels that are specialised to a structure."""

SMALL = """
[structure]
n_floors = 2
stiffness_ratio = 300.0
sharpness = 4e3
damping_ratio = 0.05

[sweep]
omega = {from = 0.5, to = 0.8, count = 4}
amplitude = {from = 0.02, to = 0.3, count = 11}
transient_cycles = 30
sampling_cycles = 20
max_orbit_period = 6

[output]
block = 4
"""
ALONG = (
    SMALL.replace("count = 4", "count = 11")
    .replace("[sweep]", '[sweep]\nalong = "omega"')
    .replace("{from = 0.02, to = 0.3, count = 11}", "[0.05, 0.1, 0.2, 0.3]")
)
"""Sweeps along the frequency, one an amplitude."""
GAPS = (
    SMALL.replace("[sweep]", '[sweep]\nalong = "structure.gap"').replace(
        "{from = 0.02, to = 0.3, count = 11}", '"0.4 * omega**2 * sqrt(gap)"'
    )
    + '[vary]\n"structure.gap" = {from = 0.5, to = 1.5, count = 11}\n'
)
"""Sweeps along a gap, one a frequency, with amplitudes tied to both."""
GRID = '[study]\nkind = "points"\n' + SMALL.replace("block = 4", "lyapunov = true")
REFINE = 'kind = "points"\nrefine = {levels = 3, wrong = 0.2}'
REFINED = (
    GRID.replace('kind = "points"', REFINE)
    .replace("from = 0.5, to = 0.8, count = 4", "from = 0.3, to = 0.9, count = 26")
    .replace("count = 11", "count = 20")
    .replace("lyapunov = true", "poincare = false")
)
"""520 points."""
TWO_STOPS = """
[structure]
n_floors = 1
gap = 0.5
gap_left = 0.5
stiffness_ratio = 50.0
sharpness = inf
"""
"""One mass between stops (jobs/structures/clearance.toml): two orbits, mirror images."""
SEEDS = f"""
{TWO_STOPS}
[sweep]
omega = [0.9, 1.0, 1.1]
amplitude = {{from = 0.2, to = 0.7, count = 11}}
transient_cycles = 100
sampling_cycles = 32
"""
"""Its motions, through which branches are followed."""
VARY = """
[vary]
structure.stiffness_ratio = [100, 300]
structure.gap = {from = 0.5, to = 1.5, count = 3}
"""
ATTRACTORS = f"""
[study]
kind = "attractors"
starts = 24
seed = 3
displacement = [-1.0, 0.9]
max_attractors = 4
max_cycles = 600
match_distance = 0.3
{TWO_STOPS}
[sweep]
omega = [0.9, 1.0, 1.1]
amplitude = {{from = 0.6, to = 0.7, count = 6}}
[output]
max_points = 32
block = 2
"""
BEARINGS = """
[building.isolation]
slab_mass = 3e5
period = 3.0
strength = 4e5
gap = 0.1
wall_stiffness = 2e9
"""
RECORDS = """
[study]
kind = "records"
[[building]]
name = "A"
mass = [2.5e5, 2.5e5]
storey_stiffness = 3e8
storey_height = 3.2
[[building]]
name = "B"
mass = [2.5e5, 2.5e5, 2.5e5]
storey_stiffness = 1e8
storey_height = 3.2
[pounding]
gap = 0.02
stiffness = 2e9
[records]
synthetic = {count = 4, seed = 3, dt = 0.02, duration = 10.0}
tail = 1.0
scale = {by = "pga", from = 0.5, to = 5.0, count = 5}
[output]
block = 2
"""
"""Two buildings under a suite of ground motions."""
YIELDING_RECORDS = (
    RECORDS.replace("storey_height", "yield_drift = 0.01\nhardening = 0.02\nstorey_height")
    .replace("[pounding]", BEARINGS + "[pounding]")
    .replace("[output]", "[output]\nenergy = true")
)
"""The same, of storeys that yield, one on bearings."""
YIELDING = """
[structure]
mass = 1.0
n_floors = 2
sharpness = inf
gap = 1.5
stiffness_ratio = 20.0
yield_drift = 0.3
hardening = 0.05
[sweep]
omega = {from = 0.3, to = 0.9, count = 4}
amplitude = {from = 0.05, to = 0.5, count = 9}
directions = ["up", "down"]
transient_cycles = 100
sampling_cycles = 20
classify_cycles = 500
[solver]
skip = "none"
[output]
block = 2
"""
"""Storeys that yield beside a stop, shaken harmonically."""
BASINS = f"""
[study]
kind = "basins"
horizontal = {{from = -0.9, to = 1.0, count = 9}}
vertical = {{from = -1.0, to = 1.0, count = 7}}
starts = 16
seed = 2
max_cycles = 600
{TWO_STOPS}
[sweep]
omega = 1.0
amplitude = 0.7
"""


def of_study(job, kind: type):
    """Return a job with a study of another class and fields of its own: a small one for a test."""
    study = job.study
    fields = {field.name: getattr(study, field.name) for field in dataclasses.fields(study)}
    return dataclasses.replace(job, study=kind(**fields))


def mpirun() -> str:
    """Return the mpirun that goes with this environment's mpi4py."""
    asked = os.environ.get("HPCSWEEP_MPIRUN")
    if asked:
        return asked
    own = Path(sys.executable).parent / "mpirun"
    found = str(own) if own.exists() else shutil.which("mpirun")
    assert found, "no mpirun: install the extra 'mpich', or an MPI"
    return found


def flat(measures) -> np.ndarray:
    """All measures of a motion in a row."""
    return np.concatenate(list(vars(measures).values()))


def environment(**extra: str) -> dict[str, str]:
    """Environment of a campaign: as a user has it, Open MPI allowed to run as it must here."""
    return {
        **os.environ,
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_hwloc_base_binding_policy": "none",
        **extra,
    }


def command(ranks: int, *arguments: object) -> list[str]:
    """Command line of hpcsweep on a number of ranks; 0: without mpirun."""
    launcher = [mpirun(), "-n", str(ranks)] if ranks else []
    return [*launcher, sys.executable, "-m", "hpcsweep", *map(str, arguments)]


@functools.cache
def shipped() -> dict:
    """Load every shipped job, once for all tests of a process: a map of 1,728 parts takes 2 s."""
    from hpcsweep.job import load_job

    return {path: load_job(path) for path in sorted(JOBS.rglob("*.toml"))}


def made(text: str, path: Path, **options) -> Path:
    """Run a job, given as text, to its end in this process; return its file."""
    from hpcsweep.campaign.run import COMPLETE, run_all
    from hpcsweep.job import parse_job
    from hpcsweep.parallel.mpi import Serial

    (ending,) = run_all([(parse_job(text, "job", "job"), path)], Serial(), **options)
    assert ending.code == COMPLETE
    return path


def kernels_but(cache: Path, *left_out: str) -> int:
    """Copy all compiled kernels into another cache, without those of some modules; count these.

    To compile all of them takes minutes; some are enough for what a test is about.
    """
    from hpcsweep.kernels.compile.cache import SUFFIX, cache_folder

    assert called(["warmup"]).returncode == 0
    kept = cache_folder()
    folder = cache / kept.name
    shutil.copytree(kept, folder, ignore=lambda _, names: fnmatch.filter(names, FITTED))
    gone = [path for module in left_out for path in (folder / module).glob(f"*{SUFFIX}")]
    for path in gone:
        path.unlink()
    return len({path.name.rpartition("-")[0] for path in gone})  # other versions of Python have own


def hpcsweep(ranks: int, *arguments: object, cwd: Path | None = None, **extra: str):
    """Run hpcsweep to its end; return the completed process with its output as text.

    Alone and in the environment of the tests it is called here, where libraries and kernels are
    loaded: to load them takes longer than most of the commands.
    """
    if ranks == 0 and not extra:
        return called(list(map(str, arguments)), cwd)
    return subprocess.run(
        command(ranks, *arguments),
        cwd=cwd,
        env=environment(**extra),
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


@functools.cache
def load() -> None:
    """Load what commands need, once for all forks."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an old matplotlib is not made for every pyparsing
        import xarray  # noqa: F401
        from matplotlib import pyplot  # noqa: F401

    from hpcsweep.checks import validate  # noqa: F401
    from hpcsweep.commands import cli, one_thread, plot, run  # noqa: F401
    from hpcsweep.figures.film import film  # noqa: F401
    from hpcsweep.figures.options import figures
    from hpcsweep.kernels.compile.entry_points import ALL, with_called
    from hpcsweep.studies.compilation import load, needed
    from hpcsweep.studies.settings import SweepSettings

    figures()
    for solver in ("flow", "bdf"):
        load(needed(SweepSettings(solver=solver)))
    # a fork that imports the package anew calls those that are loaded here, through the same cells
    for one in with_called(*(one for one in ALL if one.on_demand)):
        one.load()


def called(arguments: list[str], cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run a command in this process, with streams, a folder and warnings of its own."""
    from hpcsweep.commands import cli

    load()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        with _given_back():
            code = _alone(lambda: cli.main(arguments), cwd, out.fileno(), err.fileno())
        return _completed(["hpcsweep", *arguments], code, out, err)


def forked(*arguments: object) -> subprocess.CompletedProcess:
    """Run a command in a fork of this process, which may be killed and has its own locks."""
    from hpcsweep.commands import cli

    load()
    words = list(map(str, arguments))
    return _in_a_fork(lambda: cli.main(words), ["hpcsweep", *words], None)


@contextlib.contextmanager
def _given_back() -> Iterator[None]:
    """Give the process back what `_alone` and a command set."""
    from hpcsweep.kernels import folders

    streams, printer = (sys.stdin, sys.stdout, sys.stderr), list(folders._way)
    descriptors = [os.dup(number) for number in range(3)]
    try:
        with contextlib.chdir(Path.cwd()), warnings.catch_warnings():
            yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        sys.stdin, sys.stdout, sys.stderr = streams
        folders._way[:] = printer
        for number, descriptor in enumerate(descriptors):
            os.dup2(descriptor, number)
            os.close(descriptor)


def python(code: str, *arguments: object, cwd: Path | None = None, anew=True, **extra: str):
    """Run a program in a fork of this process, which has libraries loaded.

    This package is loaded `anew`, for what it does when it is loaded. What the libraries read of
    the environment they have read before: a program that is about that needs a process of its own.
    """
    if anew:
        import numba  # noqa: F401
    else:
        load()

    def run() -> None:
        os.environ.update(environment(**extra))
        tempfile.tempdir = None
        sys.argv = ["-c", *map(str, arguments)]
        sys.path.insert(0, "")
        for name in [name for name in sys.modules if name.partition(".")[0] == "hpcsweep"]:
            if anew:
                del sys.modules[name]
        exec(code, {"__name__": "__main__"})

    done = _in_a_fork(run, [sys.executable, "-c", code, *map(str, arguments)], cwd)
    assert done.returncode == 0, done.stderr
    return done


def _in_a_fork(
    main: Callable, reported: list[str], cwd: Path | None
) -> subprocess.CompletedProcess:
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = fork(lambda: _alone(main, cwd, out.fileno(), err.fileno()))
        return _completed(reported, _exit_code(child), out, err)


def _completed(reported: list[str], code: int, out, err) -> subprocess.CompletedProcess:
    out.seek(0)
    err.seek(0)
    return subprocess.CompletedProcess(reported, code, out.read().decode(), err.read().decode())


def fork(function: Callable[[], int | None]) -> int:
    """Start a fork of this process that ends with a function; return its process id."""
    with warnings.catch_warnings():
        # the test runner's threads wait for it; the fork calls nothing of theirs
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        code = 1
        try:
            code = function() or 0
        finally:
            os._exit(code)
    return child


def _exit_code(child: int) -> int:
    """Wait for a child, for a limited time; return its exit code as `subprocess` does."""
    deadline = time.monotonic() + LIMIT
    ended, sleep = 0, 1e-4
    while not ended:
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
        time.sleep(sleep)
        sleep = min(2 * sleep, 0.01)
        ended, status = os.waitpid(child, os.WNOHANG)
    return os.waitstatus_to_exitcode(status)


def _alone(main: Callable, cwd: Path | None, out: int, err: int) -> int:
    """Run as a program; return its exit code."""
    with open(os.devnull) as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), 0)
    os.dup2(out, 1)
    os.dup2(err, 2)
    sys.stdin, sys.stdout, sys.stderr = (
        os.fdopen(number, mode, closefd=False) for number, mode in ((0, "r"), (1, "w"), (2, "w"))
    )
    # what hangs tells where, before it is killed
    faulthandler.dump_traceback_later(0.9 * LIMIT, file=err)
    os.chdir(cwd or Path.cwd())
    warnings.resetwarnings()
    for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", kind)  # as Python does
    try:
        code = main()
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code if isinstance(code, int) else int(code is not None)


def run_script(ranks: int, script: Path, *arguments: object, cwd: Path | None = None):
    """Run a script that uses hpcsweep, as `hpcsweep` does the command."""
    line = command(ranks)
    line[line.index("-m") :] = [str(script), *map(str, arguments)]
    return subprocess.run(
        line,
        cwd=cwd,
        env=environment(PYTHONPATH=f"{ROOT}:{ROOT / 'tests' / 'support'}"),
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


def refuse(done: subprocess.CompletedProcess, *words: str) -> None:
    """Check that a command was refused in one line with these words, and with exit code 2."""
    assert done.returncode == 2, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("hpcsweep: error: ")
    for word in words:
        assert word in lines[0]


def datasets(path: Path) -> dict[str, np.ndarray]:
    """Return every dataset of a file, as raw bytes."""
    found = {}
    with h5py.File(path, "r", locking=False) as file:
        for name, data in file.items():
            values = data[...]
            raw = b"\0".join(values.flat) if values.dtype == object else values.tobytes()
            found[name] = np.frombuffer(raw, np.uint8)
    return found


def assert_same_datasets(left: Path, right: Path) -> None:
    """Compare two files' datasets bit for bit."""
    a, b = datasets(left), datasets(right)
    assert a.keys() == b.keys()
    different = [name for name in a if not np.array_equal(a[name], b[name])]
    assert different == []


def spot(picture: np.ndarray, panel, x: float, y: float, reach: int = 0) -> np.ndarray:
    """Return the colours of a frame around a place in a panel, shape (k, 3)."""
    column, row = np.floor(panel.transData.transform((x, y))).astype(int)
    row = len(picture) - 1 - row
    around = picture[row - reach : row + reach + 1, column - reach : column + reach + 1, :3]
    return around.reshape(-1, 3).astype(int)
