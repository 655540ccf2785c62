"""Ranks that wait for others leave the processor to them."""

import pytest
from tools import run_script

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


@pytest.mark.parametrize("looks", [0, 1, 6])
def test_it_sleeps_between_two_looks_and_longer_the_longer_it_waits(monkeypatch, looks):
    slept: list[float] = []
    monkeypatch.setattr(mpi.time, "sleep", slept.append)
    mpi.Ranks(Library, Late(looks)).barrier()
    assert slept == [1e-4, 2e-4, 4e-4, 8e-4, 1e-3, 1e-3][:looks]
