"""A campaign where numpy, scipy, numba, h5py and mpi4py alone are: core.py HPCSWEEP MPIRUN.

As on a compute node: two ranks, killed and resumed, then all that needs no figure and no table.
`.ci/package` runs it in an environment of its own, with the Python of that.
"""

import contextlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
from smoke import Installed

LEFT_OUT = ("h5netcdf", "imageio_ffmpeg", "matplotlib", "pandas", "shtab", "tqdm", "xarray")
LONG = (
    "sweep.omega={from = 0.44, to = 0.45, count = 8}",
    "sweep.amplitude={from = 0.02, to = 0.25, count = 40}",
    "sweep.transient_cycles=3000",
    "sweep.sampling_cycles=32",
    'solver.skip="none"',
    "output.block=2",
)
"""Some ten seconds on two ranks."""
SETTINGS = [word for setting in LONG for word in ("--set", setting)]
REFUSED = {
    "plot": ("-o", "a.png"),
    "table": ("-o", "a.csv"),
    "explore": ("-o", "a.html"),
    "animate": ("-o", "a.gif"),
    "summary": (),
}
"""What needs more, with its options."""
PATIENCE = 300.0


def n_committed(path: Path) -> int:
    """Return how many blocks have a checksum now."""
    try:
        with h5py.File(path, locking=False) as file:
            return int((file["commit"][...] != 0).sum())
    except (OSError, KeyError):
        return 0


def kill_in_the_middle(program: str, mpirun: str, path: Path) -> int:
    """Kill a campaign of two ranks after its first blocks; return how many it has left."""
    line = [mpirun, "-n", "2", program, "run", "study.toml", *SETTINGS, "-o", str(path)]
    process = subprocess.Popen(
        line, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + PATIENCE
    while not n_committed(path) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert process.poll() is None, "it has ended before it could be killed"
    # ranks may be in groups of their own
    mine = [process.pid, *children(process.pid)]
    for pid in mine:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()
    return n_committed(path)


def children(pid: int) -> list[int]:
    """Return all that a process has started."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found += [child, *children(child)]
    return found


def same(first: Path, second: Path) -> bool:
    """Return whether two files hold the same results, to the last bit."""
    with h5py.File(first) as a, h5py.File(second) as b:
        return a.keys() == b.keys() and all(
            a[name].dtype == object or a[name][...].tobytes() == b[name][...].tobytes()
            for name in a
        )


def check(program: str, mpirun: str) -> None:
    """Compute, and try every command; AssertionError where one does not do what it is for."""
    there = [name for name in LEFT_OUT if importlib.util.find_spec(name)]
    assert not there, f"more is installed than the core needs: {there}"
    hpcsweep, killed, whole = Installed(program, mpirun), Path("killed.h5"), Path("whole.h5")
    hpcsweep("new", "study.toml", makes="study.toml")
    assert "mode 1" in hpcsweep("describe", "study.toml", *SETTINGS)
    assert "ready in" in hpcsweep("warmup", "--jobs", "2")
    left = kill_in_the_middle(program, mpirun, killed)
    state = json.loads(hpcsweep("status", str(killed), "--json"))
    assert not state["complete"]
    assert state["runs_done"] > 0
    hpcsweep("run", "study.toml", *SETTINGS, "-o", str(killed), ranks=2)
    state = json.loads(hpcsweep("status", str(killed), "--json"))
    assert state["complete"]
    assert len(state["sessions"]) == 2
    hpcsweep("split", "study.toml", *SETTINGS, "-n", "2", makes="study-2of2.toml")
    parts = [f"study-{k}of2.h5" for k in (1, 2)]
    for part in parts:
        hpcsweep("run", part.replace(".h5", ".toml"), ranks=2, makes=part)
    hpcsweep("merge", *parts, "-o", str(whole), makes=str(whole))
    assert same(killed, whole), "killed and resumed it is another than in two parts"
    assert "sound" in hpcsweep("validate", str(killed), "--samples", "4")
    hpcsweep("pack", str(killed))
    assert same(killed, whole), "packed it is another"
    assert "sound" in hpcsweep("validate", str(killed), "--samples", "0")
    for command, options in REFUSED.items():
        line = [program, command, str(whole), *options]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        print(done.stderr, end="")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), f"{command}: {done.stderr}"
        assert "pip install " in done.stderr
    print(f"killed after {left} blocks, resumed, merged and packed with five libraries")


if __name__ == "__main__":
    check(*sys.argv[1:])
