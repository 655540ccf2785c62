"""Ranks that wait for others leave the processor to them."""

import contextlib
import os
import pty
import subprocess
import sys

import pytest
from together import together
from tools import environment, run_script

from hpcsweep.parallel import mpi

WAITING = """
import time
from hpcsweep.parallel.mpi import world

comm = world()
waits = {"barrier": comm.barrier, "bcast": lambda: comm.bcast(0), "gather": lambda: comm.gather(0)}
for name, wait in waits.items():
    begun, used = time.monotonic(), time.process_time()
    comm.barrier()
    # from here on, which is after the other one's beginning
    late = 0 if name == "bcast" else 1
    if comm.rank == late:
        time.sleep(0.5)
    wait()
    if comm.rank != late:
        used, waited = time.process_time() - used, time.monotonic() - begun
        print(name, waited >= 0.5, used < 0.3 * waited, flush=True)
"""


@pytest.mark.slow
@pytest.mark.mpi
def test_who_waits_for_another_rank_sleeps(tmp_path):
    script = tmp_path / "waiting.py"
    script.write_text(WAITING)
    done = run_script(2, script)
    assert done.returncode == 0, done.stderr
    said = sorted(done.stdout.splitlines())
    assert said == [f"{name} True True" for name in ("barrier", "bcast", "gather")]


class Late:
    """A communicator whose other ranks arrive after some looks."""

    def __init__(self, looks: int):
        self.left = looks

    def Get_rank(self):
        return 0

    def Get_size(self):
        return 2

    def Ibarrier(self):
        return self

    def Test(self):
        self.left -= 1
        return self.left < 0


class Library:
    @staticmethod
    def Get_library_version():
        return "none"


@together("looks", [0, 1, 6])
def test_it_sleeps_between_two_looks(monkeypatch, looks):
    slept: list[float] = []
    monkeypatch.setattr(mpi.time, "sleep", slept.append)
    mpi.Ranks(Library, Late(looks)).barrier()
    assert slept == looks * [mpi.SLEEP]


STEP = {"SLURM_STEP_NUM_TASKS": "4", "SLURM_NTASKS": "4", "SLURM_PROCID": "0"}
"""Variables of ``srun --ntasks=4``, also in the shell of ``srun --ntasks=4 --pty bash``."""


@together("leads, terminal, ranks", [(False, True, "1"), (True, True, "4"), (False, False, "4")])
def test_a_shell_of_srun_is_no_launcher(leads, terminal, ranks):
    """What srun starts itself leads its session on the terminal, or has no terminal."""
    show = "from hpcsweep.parallel.mpi import launched_size; print('size', launched_size())"
    line = [sys.executable, "-c", show]
    if not leads:
        line = ["sh", "-c", f'"{sys.executable}" -c "{show}"; true']
    if terminal:
        child, stream = pty.fork()
        if child == 0:
            os.execvpe(line[0], line, environment(**STEP))
        said = ""
        with contextlib.suppress(OSError):  # Linux ends the stream of a terminal with an error
            while part := os.read(stream, 1000):
                said += part.decode()
        assert os.waitpid(child, 0)[1] == 0
        os.close(stream)
    else:
        said = subprocess.run(
            line,
            env=environment(**STEP),
            start_new_session=True,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    assert said.split() == ["size", ranks]


@pytest.mark.slow
@pytest.mark.parametrize(("more", "code"), [(("--dry-run",), 0), ((), 2)])
def test_a_launcher_of_another_mpi_keeps_nothing_but_runs_from_their_work(
    small_job, tmp_path, more, code
):
    command = [sys.executable, "-m", "hpcsweep", "run", str(small_job), *more]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=environment(**STEP),
        start_new_session=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert ("the launcher started 4 ranks" in done.stderr) == (code == 2)
    assert ("core-hours" in done.stdout) == (code == 0)
    assert [*tmp_path.iterdir()] == [small_job]
