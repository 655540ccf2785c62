"""Streams that are closed or full, folders that cannot be written, names that are no text."""

import os
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest
from together import together
from tools import SMALL, command, datasets, environment, hpcsweep

from hpcsweep.commands import abort, cli, describe, lacks_memory
from hpcsweep.commands import environment as environment_of_commands
from hpcsweep.kernels import folders
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store.rows import open_above


def shell(redirection: str, *arguments: object) -> subprocess.CompletedProcess:
    line = " ".join(f"'{part}'" for part in command(0, *arguments))
    return subprocess.run(
        ["/bin/sh", "-c", f"{line} {redirection}"],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Results of the small job, with all streams open."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "small.toml").write_text(SMALL)
    assert hpcsweep(0, "run", folder / "small.toml", cwd=folder).returncode == 0
    return folder / "small.h5"


@pytest.mark.parametrize(
    "redirection",
    [
        "0<&- 1>&- 2>&-",
        *(
            pytest.param(one, marks=pytest.mark.slow)
            for one in ("0<&-", "1>&-", "2>&-", "2>/dev/full", "1>/dev/full")
        ),
    ],
)
def test_streams_that_are_closed_or_full_do_not_reach_the_results(
    tmp_path, small_job, whole, redirection
):
    path = tmp_path / "out.h5"
    done = shell(redirection, "run", small_job, "-o", path)
    assert done.returncode == 0, done.stderr
    left, right = datasets(whole), datasets(path)
    assert all(np.array_equal(left[name], right[name]) for name in left)
    shown = shell(redirection, "status", path)
    assert "Traceback" not in shown.stderr
    if redirection == "1>/dev/full":
        assert shown.returncode == 1
        assert shown.stderr == (
            "hpcsweep: error: standard output: cannot be written: No space left on device\n"
        )
    else:
        assert shown.returncode == 0


def test_a_results_file_has_no_descriptor_of_a_stream(tmp_path):
    path = tmp_path / "file"
    path.write_text("x")
    kept = os.dup(0)
    os.close(0)
    try:
        descriptor = open_above(path, os.O_RDONLY)
    finally:
        os.dup2(kept, 0)
        os.close(kept)
    assert descriptor > 2
    os.close(descriptor)


def test_another_cache_is_taken_where_the_usual_one_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "other").mkdir()
    extra = {"NUMBA_CACHE_DIR": str(tmp_path / "file" / "x"), "TMPDIR": str(tmp_path / "other")}
    done = hpcsweep(0, "status", tmp_path / "none.h5", **extra)
    assert done.returncode == 2
    first, second = done.stderr.splitlines()
    assert "cannot be written (Not a directory): compiled kernels are kept in" in first
    assert "none.h5: cannot be read" in second
    assert [path.name for path in (tmp_path / "other").iterdir()] == [f"hpcsweep-{os.getuid()}"]
    folder = tmp_path / "other" / f"hpcsweep-{os.getuid()}"
    folder.chmod(0o777)  # others could put their kernels there
    done = hpcsweep(0, "status", tmp_path / "none.h5", **extra)
    assert str(folder) + "\n" not in done.stderr


def test_a_name_that_is_no_text(tmp_path, small_job):
    path = tmp_path / "na\udcffme.h5"
    done = hpcsweep(0, "run", small_job, "-o", path)
    assert done.returncode == 0, done.stderr
    assert "na\\udcffme.h5: complete" in done.stderr
    shown = hpcsweep(0, "status", path)
    assert shown.returncode == 0, shown.stderr
    assert "na\\udcffme.h5: complete" in shown.stdout
    job = tmp_path / "jo\udcffb.toml"
    job.write_bytes(small_job.read_bytes())
    done = hpcsweep(0, "run", job, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_cache_that_is_only_read_is_read_all_the_same(tmp_path, monkeypatch, capsys):
    # root can write anything: what the look finds is given here
    def refuse(path, data):
        raise OSError(f"{path}: read-only")

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(folders, "write_whole", refuse)
    monkeypatch.setattr(folders, "_said", [])
    monkeypatch.setattr(folders, "_way", list(folders._way))
    environment_of_commands._look_at_cache()
    assert folders.cache_root() == tmp_path
    assert len(capsys.readouterr().err.splitlines()) == 1
    folders.say_unwritable("said once already")
    assert capsys.readouterr().err == ""


def no_memory(options):
    raise ImportError("a.so: failed to map segment from shared object")


@together(
    "arguments, date, code, told",
    [
        (["describe", "a\nb.toml"], "0", 2, "must be a name on one line, is 'a\\nb.toml'"),
        (["plot", "a.h5", "--at", "\n"], "0", 2, "error: --at \\n: must be KEY=VALUE"),
        (["status", "a\nb.h5"], "0", 2, "must be a name on one line, is 'a\\nb.h5'"),
        (["run", "a.toml", "-o", "a\nb.h5"], "0", 2, "must be a name on one line"),
        (["status", "a.h5"], "abc", 2, "SOURCE_DATE_EPOCH = 'abc': must be seconds since 1970"),
        (["describe", "a.toml"], "0", 1, "not enough memory"),
        (["--help"], "0", 1, "standard output: cannot be written: No space left on device"),
        (["status", "--help"], "0", 1, "standard output: cannot be written: No space left"),
    ],
)
def test_what_a_command_cannot_do_is_told_on_one_line(
    monkeypatch, capsys, arguments, date, code, told
):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
    monkeypatch.setattr(environment_of_commands, "_look_at_cache", lambda: None)
    monkeypatch.setattr(describe, "run", no_memory)
    with open("/dev/full", "w") as full:  # noqa: PTH123
        monkeypatch.setattr(sys, "stdout", full)
        try:
            given = cli.main(arguments)
        except SystemExit as end:
            given = end.code
    error = capsys.readouterr().err
    assert (given, len(error.splitlines())) == (code, 1), error
    assert told in error


@together(
    "error, told",
    [
        (MemoryError(), "hpcsweep: error: there is not enough memory for this\n"),
        (OSError(12, "Cannot allocate memory"), "hpcsweep: error: there is not enough memory"),
        (ImportError("x.so: failed to map segment from shared object"), "hpcsweep: error: there"),
        (KeyError("x"), "hpcsweep: failed:\nNoneType: None"),
    ],
)
def test_a_run_that_lacks_memory_says_so_on_one_line(capsys, error, told):
    with pytest.raises(SystemExit) as end:
        abort(Serial(), error)
    shown = capsys.readouterr().err
    assert end.value.code == 1
    assert shown.startswith(told)
    assert lacks_memory(error) == (shown.count("\n") == 1)


def test_a_limit_of_memory_with_which_libraries_never_load_is_told(monkeypatch, capsys):
    for kilobytes, code in ((200_000, 2), (400_000, 2), (600_000, 0), (-1, 0)):
        limit = 1024 * kilobytes if kilobytes > 0 else resource.RLIM_INFINITY
        monkeypatch.setattr(resource, "getrlimit", lambda _, limit=limit: (limit, limit))
        assert cli.main(["--version"]) == code
        told = f"(ulimit -v) must be 488281 kB at least, is {kilobytes}\n" if code else ""
        assert capsys.readouterr().err.endswith(told)


@pytest.mark.parametrize(("before", "reason"), [("SIG_DFL", "SIGHUP"), ("SIG_IGN", None)])
def test_a_terminal_that_goes_stops_a_run_unless_nohup_ignores_it(before, reason):
    kept = signal.signal(signal.SIGHUP, getattr(signal, before))
    try:
        with StopFlag() as flag:
            os.kill(os.getpid(), signal.SIGHUP)
            assert flag.is_set() == (reason is not None)
        assert flag.reason == reason
    finally:
        signal.signal(signal.SIGHUP, kept)
