"""Compiling before it is needed: progress, what is learnt, processes, caches that are read only."""

import ast
import gc
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import Future
from pathlib import Path

import numba
import pytest
import tools
from tools import JOBS, assert_same_datasets, environment

import hpcsweep
from hpcsweep.kernels import folders
from hpcsweep.kernels.compile import entry_points, warm
from hpcsweep.kernels.compile.cache import SUFFIX, cache_folder
from hpcsweep.solvers import response
from hpcsweep.solvers.compiling import SILENCE, announced
from hpcsweep.solvers.flow import flow_map, record_map

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)


FLOW_KERNELS = [one for one in entry_points.ALL if one.name.startswith("hpcsweep.solvers.")]
assert FLOW_KERNELS, (flow_map, record_map)  # their imports register them


class Fake:
    """In place of an entry point."""

    def __init__(self, name, kept=False):
        self.name = self.__name__ = name
        self.specialisation = None
        self.__module__ = f"{__name__}.{name.partition('.')[0]}"
        self.is_kept, self.is_loaded = kept, False

    def load(self):
        self.is_loaded = True


@pytest.fixture
def reported(monkeypatch, tmp_path):
    """Compile fake kernels; return the reported progress."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    def compiled(names: str, kept="", jobs=1):
        fakes = [Fake(name, name in kept) for name in names]
        found: list[tuple[int, int]] = []
        warm.load_all(fakes, lambda *progress: found.append(progress), jobs)
        assert all(fake.is_loaded for fake in fakes)
        return found

    return compiled


def test_progress_is_told_of_what_is_to_be_compiled(reported):
    assert reported("abc") == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert reported("ab", kept="ab") == []
    assert reported("ab", kept="a") == [(0, 1), (1, 1)]


def test_kernels_of_a_module_are_compiled_together():
    """They share parts. The largest group first, callers before what they call."""
    fakes = [Fake(name) for name in ("leaf.a", "other.a", "root.a", "root.b", "leaf.b")]
    order = [one.name for group in warm._groups(fakes) for one in group]
    assert order == ["leaf.b", "leaf.a", "root.b", "root.a", "other.a"]


def test_what_a_kernel_calls_is_found_before_it_is_compiled():
    """Compiled kernels name the cells from which they read the addresses that they call."""
    every = entry_points.with_called(*FLOW_KERNELS)
    assert every == FLOW_KERNELS
    on_demand = {one.name for one in every if one.on_demand}
    seen = 0
    for one in every:
        one.load()
        called = set()
        for path in cache_folder().rglob(f"{one.__name__}-*{SUFFIX}"):
            called |= set(re.findall(rb"address of ([\w.]+)", path.read_bytes()))
        known = {other.name for other in entry_points.with_called(one)} | on_demand
        assert {name.decode() for name in called} <= known
        seen += len(called)
    assert seen > 10


def test_a_kernel_on_demand_is_loaded_by_who_needs_it():
    loaded = """
import numpy as np
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.specialised import FOR_ANY, march_elements, needed_kernels
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE
measure = FOR_ANY.measures[-1]
for restitution in (None, 0.6):
    structure = Structure(2, 100.0, np.inf, restitution=restitution)
    solver = FlowMap(structure, 0.5)
    solver.advance(np.zeros(4), 2.0, 3)
    print(march_elements.is_loaded, march_elements in needed_kernels(structure))
    solver.observe(np.zeros(4), 2.0, 3)
    print(measure.is_loaded, measure in needed_kernels(structure, measures=True))
    solver.observe(np.zeros(4), 2.0, 3, measures=ANY_MEASURE)
    print(measure.is_loaded, measure in needed_kernels(structure))
"""
    done = subprocess.run(
        [sys.executable, "-c", loaded],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    without = ["False False", "False True", "True False"]
    assert done.stdout.splitlines() == [*without, "True True", "True True", "True False"], (
        done.stderr
    )


def test_the_garbage_collector_is_as_it_was_before(reported):
    before = gc.get_threshold()
    reported("a")
    assert gc.get_threshold() == before


def test_there_is_a_line_at_the_start_and_now_and_then(monkeypatch):
    times = iter([0.0, 1.0, SILENCE + 1.0, SILENCE + 1.0])
    monkeypatch.setattr("hpcsweep.solvers.compiling.time.monotonic", lambda: next(times))
    lines: list[str] = []
    tell = announced(lines.append, "kernels")
    for done in range(4):
        tell(done, 3)
    assert lines == [
        "compiling 3 kernels, once for this type of processor: 3 to 5 s each",
        "compiled 2 of 3 kernels",
    ]


def test_python_says_on_one_line_what_is_compiled_and_nothing_where_nothing_is(
    monkeypatch, tmp_path, capsys
):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(record_map, "KERNELS", [Fake("a"), Fake("b"), Fake("c", kept=True)])
    monkeypatch.setattr(record_map, "RecordMap", lambda *of: of)
    made = response.record_map(hpcsweep.Structure(1), 0.1)
    assert made == (hpcsweep.Structure(1), 0.1)
    said = capsys.readouterr().err
    assert said == "hpcsweep: compiling 2 kernels, once for this type of processor: 3 to 5 s each\n"
    response.record_map(*made)
    assert capsys.readouterr().err == ""


def command(*arguments, **variables) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "hpcsweep", *map(str, arguments)],
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=False,
    )


def test_warmup_refuses_no_processes():
    done = tools.hpcsweep(0, "warmup", "--jobs", "0")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "hpcsweep: error: --jobs 0: must be at least 1\n"


SMALL = """
[structure]
n_floors = 1

[sweep]
omega = 0.445
amplitude = {from = 0.02, to = 0.1, count = 3}
"""


LEFT_OUT = ("solvers/flow/layer/passage/passage", "solvers/flow/orbit/transient")
"""Modules of a kernel each that every run needs, compiled in seconds."""


@pytest.mark.slow
def test_warmup_fills_a_cache_that_is_only_read_later(tmp_path):
    cache = tmp_path / "cache"
    lost = tools.kernels_but(cache, *LEFT_OUT)
    job = tmp_path / "small.toml"
    job.write_text(SMALL)
    done = command("warmup", "--jobs", "2", NUMBA_CACHE_DIR=str(cache))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"compiling {lost} kernels")
    assert str(cache) in done.stdout.splitlines()[-1]
    kept = {path: path.stat().st_mtime_ns for path in cache.rglob("*")}
    names = {path.name.rpartition("-")[0] for path in kept if path.suffix == SUFFIX}
    assert names >= {kernel.__name__ for kernel in FLOW_KERNELS}
    for path in kept:
        path.chmod(path.stat().st_mode & ~0o222)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    variables = {"NUMBA_CACHE_DIR": str(cache), "TMPDIR": str(temporary)}
    done = command("run", job, "-o", tmp_path / "one.h5", **variables)
    assert done.returncode == 0, done.stderr
    assert "compil" not in done.stdout + done.stderr
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*")} == kept
    assert not list(temporary.rglob("*.kernel"))


COMPILED = """
from hpcsweep.model.contact import switch
switch(0.5, 3.0)
one = switch.dispatcher
print(sum(one._cache_hits.values()), sum(one._cache_misses.values()))
"""


def compiled_in(**variables) -> subprocess.CompletedProcess:
    return tools.python(COMPILED, **variables)


def test_a_cache_that_cannot_be_written_takes_one_line(tmp_path):
    # below a file no folder can be made, by root neither
    (tmp_path / "file").write_text("")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    cache = str(tmp_path / "file" / "cache")
    first = compiled_in(NUMBA_CACHE_DIR=cache, TMPDIR=str(temporary))
    own = temporary / f"hpcsweep-{os.getuid()}"
    assert first.stdout.split() == ["0", "1"]
    assert first.stderr == (
        f"hpcsweep: {cache} cannot be written (Not a directory): "
        f"compiled kernels are kept in {own}\n"
    )
    second = compiled_in(NUMBA_CACHE_DIR=cache, TMPDIR=str(temporary))
    assert (second.stdout.split(), second.stderr) == (["1", "0"], "")


@pytest.mark.parametrize(
    "kept", ["usual", *(pytest.param(one, marks=pytest.mark.slow) for one in ("own", "nowhere"))]
)
def test_where_kernels_are_kept_is_known(tmp_path, kept):
    (tmp_path / "file").write_text("")
    own = tmp_path / f"hpcsweep-{os.getuid()}"
    if kept == "nowhere":
        own.write_text("")
    usual = tmp_path / ("cache" if kept == "usual" else "file/cache")
    done = tools.python(
        COMPILED
        + "from hpcsweep.kernels.compile.cache import kept_in\nprint([*map(str, kept_in())])\n",
        NUMBA_CACHE_DIR=str(usual),
        TMPDIR=str(tmp_path),
    )
    found = ast.literal_eval(done.stdout.splitlines()[-1])
    below = {"usual": [usual], "own": [own], "nowhere": []}[kept]
    assert [Path(folder).parent for folder in found] == below


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["file", "open to all"])
def test_a_folder_that_may_be_another_users_is_not_used(tmp_path, kind):
    (tmp_path / "file").write_text("")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    own = temporary / f"hpcsweep-{os.getuid()}"
    if kind == "file":
        own.write_text("")
    else:
        own.mkdir()
        own.chmod(0o777)
    cache = str(tmp_path / "file" / "cache")
    done = compiled_in(NUMBA_CACHE_DIR=cache, TMPDIR=str(temporary))
    assert done.stdout.split() == ["0", "1"]
    assert done.stderr.endswith("compiled kernels are not kept\n")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.slow
def test_a_damaged_kernel_is_compiled_anew(tmp_path):
    cache = str(tmp_path)
    assert compiled_in(NUMBA_CACHE_DIR=cache).stdout.split() == ["0", "1"]
    (path,) = tmp_path.rglob("*.kernel")
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        done = compiled_in(NUMBA_CACHE_DIR=cache)
        assert (done.stdout.split(), done.stderr) == (["0", "1"], "")
        assert path.stat().st_size == len(whole)
    assert compiled_in(NUMBA_CACHE_DIR=cache).stdout.split() == ["1", "0"]


FULL = """
import errno, sys
from pathlib import Path
whole = Path.write_bytes

def write_bytes(path, data):
    if any(path.is_relative_to(full) for full in sys.argv[1:]):
        whole(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")
    return whole(path, data)

Path.write_bytes = write_bytes
"""


@pytest.mark.slow
@pytest.mark.parametrize("elsewhere", [pytest.param("with room", marks=pytest.mark.slow), "full"])
def test_a_disk_that_fills_up_in_mid_write_takes_one_line(tmp_path, elsewhere):
    cache, temporary = tmp_path / "cache", tmp_path / "temporary"
    cache.mkdir()
    temporary.mkdir()
    own = temporary / f"hpcsweep-{os.getuid()}"
    full = [cache, temporary] if elsewhere == "full" else [cache]
    place = f"compiled kernels are {'not kept' if elsewhere == 'full' else f'kept in {own}'}"
    said = f"hpcsweep: {cache} cannot be written (No space left on device): {place}\n"
    variables = {"NUMBA_CACHE_DIR": str(cache), "TMPDIR": str(temporary)}
    for hits in (0, 0 if elsewhere == "full" else 1):
        done = tools.python(FULL + COMPILED, *full, **variables)
        assert done.stdout.split() == [str(hits), str(1 - hits)]
        assert done.stderr == ("" if hits else said)
    assert not [path for path in cache.rglob("*") if path.is_file()], "half a file is left"


ON_A_SMALL_DISK = """
mount -t tmpfs -o size="$1"k tmpfs "$2" || exit 77
cp -r "$3"/. "$2" || exit 1
shift 3
exec "$@"
"""


def on_a_small_disk(
    room: int, disk: Path, *command, holds: Path, **variables
) -> subprocess.CompletedProcess:
    """Run a command with a new disk that holds a copy of a folder and has room for so many kB more.

    The test is skipped where none can be mounted.
    """
    disk.mkdir()
    pages = sum(-(-path.stat().st_size // 4096) for path in holds.rglob("*") if path.is_file())
    size = 4 * pages + room
    line = ["unshare", "--mount", "sh", "-c", ON_A_SMALL_DISK, "sh", size, disk, holds, *command]
    if not shutil.which("unshare"):
        pytest.skip("no unshare to mount a small disk with")
    done = subprocess.run(
        [str(word) for word in line],
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 77 or "unshare" in done.stderr:
        pytest.skip(f"no small disk can be mounted: {done.stderr.strip()}")
    return done


@pytest.mark.slow
def test_a_disk_that_is_too_small_takes_one_line(tmp_path):
    disk, temporary = tmp_path / "disk", tmp_path / "temporary"
    temporary.mkdir()
    done = on_a_small_disk(
        *(8, disk, sys.executable, "-c", COMPILED),
        holds=temporary,
        NUMBA_CACHE_DIR=str(disk / "cache"),
        TMPDIR=str(temporary),
    )
    assert done.stdout.split() == ["0", "1"]
    (line,) = done.stderr.splitlines()
    assert line.startswith(
        f"hpcsweep: {disk / 'cache'} cannot be written (No space left on device)"
    )


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("elsewhere", ["with room", "full"])
def test_a_run_works_whose_kernels_do_not_all_fit(tmp_path, elsewhere):
    disk, temporary, out = tmp_path / "disk", tmp_path / "temporary", tmp_path / "one.h5"
    temporary.mkdir()
    (tmp_path / "small.toml").write_text(SMALL)
    assert tools.kernels_but(tmp_path / "most" / "cache", LEFT_OUT[0]) == 1
    done = on_a_small_disk(
        *(40, disk, *tools.command(2, "run", tmp_path / "small.toml", "-o", out)),
        holds=tmp_path / "most",
        NUMBA_CACHE_DIR=str(disk / "cache"),
        TMPDIR=str(disk if elsewhere == "full" else temporary),
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("No space left on device") == 1
    assert f"{out}: complete" in done.stderr


def test_what_others_cannot_hand_over_is_compiled_here(reported, monkeypatch):
    class Pool:
        """Compiles nothing that could be kept, and says why."""

        def __init__(self, *arguments):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def submit(self, *arguments):
            future = Future()
            future.set_result(["the disk is full"])
            return future

        def shutdown(self, **options):
            pass

    said = []
    monkeypatch.setattr(warm, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(folders, "_said", [])
    monkeypatch.setattr(folders, "_way", [said.append])
    found = reported("abc", jobs=2)
    assert said == ["the disk is full"]
    assert [done for done, _ in found] == [0, 1, 2, 3]


HASWELL = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx2,+fma,+bmi,+bmi2,-avx512f"}


@pytest.mark.slow
def test_processors_keep_their_kernels_side_by_side(tmp_path):
    def started(**variables):
        done = subprocess.run(
            [sys.executable, "-c", COMPILED],
            env=environment(NUMBA_CACHE_DIR=str(tmp_path), **variables),
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    for variables in ({}, HASWELL):
        assert started(**variables) == ["0", "1"]
    for variables in ({}, HASWELL):
        assert started(**variables) == ["1", "0"]


@pytest.mark.slow
def test_results_do_not_depend_on_the_processor(tmp_path):
    """300 runs, every variable equal to the last bit between kernels for Haswell and for here."""
    import h5py

    found = {}
    for name, variables in (("here", {}), ("haswell", HASWELL)):
        out = tmp_path / f"{name}.h5"
        done = command("run", JOBS / "ci.toml", "-o", out, **variables)
        assert done.returncode == 0, done.stderr
        with h5py.File(out) as file:
            found[name] = str(file.attrs["processor"])
    assert found["haswell"].split()[0] == "haswell"
    assert "avx512f" not in found["haswell"].split()
    assert_same_datasets(tmp_path / "here.h5", tmp_path / "haswell.h5")
