"""What commands write over, what they print to, and what they say of a list of points."""

import contextlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from together import together
from tools import environment, hpcsweep

from hpcsweep.commands import CommandError
from hpcsweep.commands.outputs import FILM, PAGE, PICTURE, TABLE, check_overwriting, kind_of

LIST = """
[structure]
n_floors = 1
[study]
kind = "points"
points = [[0.06, 0.445], [0.0987, 0.445], [0.2, 0.6]]
[sweep]
transient_cycles = 10
sampling_cycles = 40
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A job, its results and its journal."""
    made = tmp_path_factory.mktemp("outputs")
    (made / "a.toml").write_text(LIST)
    done = hpcsweep(0, "run", made / "a.toml", "-o", made / "a.h5")
    assert done.returncode == 0, done.stderr
    return made


WRITERS = {
    "plot": ("plot", "a.h5", "-o"),
    "explore": ("explore", "a.h5", "-o"),
}


@together(
    "command, name, through",
    [
        *(("plot", name, "itself") for name in ("b.h5", "a.h5.journal", "a.toml")),
        *((command, "b.h5", "a link") for command in WRITERS),
    ],
)
def test_results_jobs_and_journals_are_never_written_over(folder, tmp_path, command, name, through):
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    shutil.copy(tmp_path / "a.h5", tmp_path / "b.h5")
    output = tmp_path / name
    before = output.read_bytes()
    if through == "a link":
        output = tmp_path / f"link-{command}.png"
        output.symlink_to(name)
    done = hpcsweep(0, *WRITERS[command], output, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert str(output) in done.stderr
    assert "written over" in done.stderr
    assert (tmp_path / name).read_bytes() == before


def test_a_film_is_not_written_over_results(folder, tmp_path):
    job = (folder / "a.toml").read_text().replace('kind = "points"', "").split("[sweep]")[1]
    path = tmp_path / "sweep.toml"
    path.write_text(
        f"[structure]\nn_floors = 1\n[sweep]\nomega = [0.5, 0.6]\namplitude = [0.1, 0.2]\n{job}"
    )
    done = hpcsweep(0, "run", path, "-o", tmp_path / "sweep.h5")
    assert done.returncode == 0, done.stderr
    shutil.copy(folder / "a.h5", tmp_path / "old.mp4")
    done = hpcsweep(0, "animate", "sweep.h5", "-o", "old.mp4", cwd=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert "is a results file" in done.stderr
    assert (tmp_path / "old.mp4").read_bytes() == (folder / "a.h5").read_bytes()


def test_a_file_of_the_same_kind_is_replaced_and_the_name_that_is_told_is_the_one_written(
    folder, tmp_path
):
    for _ in range(2):
        done = hpcsweep(0, "plot", folder / "a.h5", "-o", tmp_path / "noext", "--dpi", "50")
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{tmp_path / 'noext.png'}\n"
        assert kind_of(tmp_path / "noext.png") == PICTURE
    assert [path.name for path in tmp_path.iterdir()] == ["noext.png"]


def test_kinds_are_told_by_the_first_bytes(tmp_path):
    path = tmp_path / "x"
    contents = {
        b"<!DOCTYPE html><p>": PAGE,
        b"\0\0\0\x18ftypmp42": FILM,
        b"GIF89a": FILM,
        b"%PDF-1.7": PICTURE,
        b"<?xml version": PICTURE,
        b"PAR1": TABLE,
        b"PK\3\4" + bytes(26) + b"docProps/app.xml": TABLE,
        b"PK\3\4" + bytes(26) + b"M.npy": "file",
        b"direction,omega [omega_0],gap [length],amplitude [length],n_points\n": TABLE,
        b"words": "file",
        b"": "",
    }
    for content, kind in contents.items():
        path.write_bytes(content)
        assert kind_of(path) == kind
        free = contextlib.nullcontext() if kind in ("", PICTURE) else pytest.raises(CommandError)
        with free:
            check_overwriting(path, PICTURE)
    check_overwriting(Path(os.devnull), FILM)
    check_overwriting(tmp_path / "nothing", FILM)


@pytest.mark.slow
def test_a_list_of_points_is_a_map_and_no_sweep(folder, tmp_path):
    done = hpcsweep(0, "plot", folder / "a.h5", "-o", tmp_path / "map.png", "--dpi", "50")
    assert done.returncode == 0, done.stderr
    for command in (
        *(("plot", folder / "a.h5", "--kind", kind) for kind in ("orbit", "frames", "metrics")),
        ("plot", folder / "a.h5", "--kind", "phase", "--amplitude", "0.06"),
        ("animate", folder / "a.h5", "-o", tmp_path / "film.mp4"),
    ):
        done = hpcsweep(0, *command)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert "list of points" in done.stderr


@pytest.mark.parametrize("unbuffered", [pytest.param("", marks=pytest.mark.slow), "1"])
@pytest.mark.parametrize("into", ["closed pipe", "full device"])
def test_what_prints_to_nobody_ends_without_a_traceback(folder, into, unbuffered):
    command = [sys.executable, "-m", "hpcsweep", "status", str(folder / "a.h5")]
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "wb") as pipe, open("/dev/full", "wb") as full:  # noqa: PTH123
        done = subprocess.run(
            command,
            stdout=pipe if into == "closed pipe" else full,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(PYTHONUNBUFFERED=unbuffered),
            preexec_fn=lambda: signal.signal(signal.SIGPIPE, signal.SIG_IGN),
            check=False,
        )
    if into == "closed pipe":
        assert (done.returncode, done.stderr) == (141, "")
    else:
        assert done.returncode == 1
        assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("name", ["a b.toml", "-a.toml"])
def test_the_command_that_new_prints_works(tmp_path, name):
    done = hpcsweep(0, "new", "--", name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    command = done.stdout.partition("run it with: hpcsweep")[2].strip()
    again = hpcsweep(0, *shlex.split(command), "--dry-run", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
