"""Start campaigns, hurt them or their files, and look at what is left."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from tools import ROOT, SMALL, environment, mpirun

from hpcsweep.store import Layout
from hpcsweep.store.commit import Blocks
from hpcsweep.store.opening import job_of
from hpcsweep.store.rows import Offsets

HERE = Path(__file__).resolve().parent
JOB = (
    SMALL.replace("transient_cycles = 30", "transient_cycles = 500")
    .replace("[output]", '[solver]\nskip = "none"\n[output]')
    .replace("block = 4", "block = 2")
)
"""About a second of work on one core, in 48 blocks."""
MARK = "HPCSWEEP_TEST_CAMPAIGN"
RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK")
PATIENCE = 60.0
"""Seconds after which a campaign hangs."""


def read_state(pid: int) -> str:
    """Return a process's state letter, "" if there is none.

    A zombie counts as none once its last thread has ended: until then it holds its locks.
    """
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return ""
    state, threads = fields[0], int(fields[17])
    return "" if state in "ZX" and threads <= 1 else state


@dataclass
class Processes:
    """A started campaign: the launcher, or the only rank, and all that came of it."""

    launcher: subprocess.Popen
    mark: str
    begun: float = field(default_factory=time.monotonic)
    seen: set[int] = field(default_factory=set)
    """All that `all` has found: those that are ending have no environment any more."""

    def all(self) -> dict[int, dict[str, str]]:
        """Environment of each living process, by its id."""
        found = {}
        needle = f"{MARK}={self.mark}".encode()
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            with suppress(OSError):
                variables = (entry / "environ").read_bytes().split(b"\0")
                if needle in variables and read_state(int(entry.name)):
                    pairs = (v.decode(errors="replace").partition("=") for v in variables if v)
                    found[int(entry.name)] = {key: value for key, _, value in pairs}
        self.seen |= found.keys()
        return found

    def ranks(self) -> dict[int, int]:
        """Process id of each living rank."""
        found = {}
        for pid, variables in self.all().items():
            for name in RANKS:
                if name in variables:
                    found[int(variables[name])] = pid
        return found or {0: self.launcher.pid}

    def send(self, number: int, victim: str, rng: random.Random) -> None:
        """Send a signal to `launcher`, `master`, a `rank` or `all` processes."""
        ranks = self.ranks()
        if victim == "all":
            victims = list(self.all())
        elif victim == "launcher":
            victims = [self.launcher.pid]
        elif victim == "master":
            victims = [ranks.get(0, self.launcher.pid)]
        else:
            victims = [rng.choice(sorted(ranks.values()))]
        for pid in victims:
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def kill_after(self, path: Path, least: int, seed: int = 1) -> bool:
        """Kill all once blocks are committed, and wait for the end; return whether they were."""
        reached = wait_for_commits(self, path, least)
        self.send(signal.SIGKILL, "all", random.Random(seed))
        self.end()
        self.finish()
        return reached

    def finish(self, patience: float = PATIENCE) -> tuple[int | None, str, str]:
        """Wait for the end; exit code (None: it hung), output and errors."""
        try:
            out, err = self.launcher.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            self.end()
            out, err = self.launcher.communicate()
            return None, out, err
        return self.launcher.returncode, out, err

    def wait_for_orphans(self, seconds: float) -> list[int]:
        """Wait until every process is gone; give those that are not."""
        deadline = time.monotonic() + seconds
        while True:
            left = [pid for pid in {*self.all(), *self.seen} if read_state(pid)]
            if not left or time.monotonic() > deadline:
                return left
            time.sleep(0.02)

    def end(self) -> None:
        """Kill whatever is left of it, and wait until it is gone."""
        for pid in self.all():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.wait_for_orphans(PATIENCE)


def start(
    ranks: int,
    *arguments: object,
    sync: float = 0.0,
    transport: str = "",
    file_limit: int | None = None,
    **extra: str,
) -> Processes:
    """Start hpcsweep on ranks (0: without launcher), flushing every `sync` seconds."""
    mark = f"{os.getpid()}-{time.monotonic_ns()}"
    launcher = [mpirun(), "-n", str(ranks)] if ranks else []
    script = [sys.executable, str(HERE / "quick_commits.py"), str(sync), *map(str, arguments)]
    if file_limit is not None:
        extra["HPCSWEEP_TEST_FILE_LIMIT"] = str(file_limit)
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        launcher + script,
        env=environment(
            PYTHONPATH=os.pathsep.join(filter(None, paths)),
            HPCSWEEP_TRANSPORT=transport,
            **{MARK: mark},
            **extra,
        ),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    return Processes(process, mark)


def records(path: Path) -> list[dict]:
    """Journal of a campaign; lines cut off are left out."""
    found = []
    with suppress(FileNotFoundError):
        for line in Path(f"{path}.journal").read_text().splitlines():
            with suppress(json.JSONDecodeError):
                found.append(json.loads(line))
    return found


def computed(history: list[dict]) -> list[tuple[int, int, int]]:
    """Blocks computed in a part of the journal: (direction, frame, block)."""
    return [tuple(r["place"]) for r in history if r["kind"] == "block"]


def committed(path: Path) -> set[tuple[int, int, int]]:
    """Blocks that have a checksum now, good or bad."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            return set(map(tuple, np.argwhere(file["commit"][...] != 0).tolist()))
    except (OSError, KeyError):
        return set()


def valid(path: Path) -> set[tuple[int, int, int]]:
    """Blocks whose checksum holds.

    Raises
    ------
    StoreError
        If the file is no campaign file.
    """
    with Blocks(path, Layout(job_of(path))) as blocks:
        return {
            block.place
            for task in range(blocks.study.n_tasks)
            for block, good in blocks.verify(task)
            if good
        }


def wait_for_commits(process: Processes, path: Path, least: int) -> bool:
    """Wait until blocks are committed; return whether they were before the campaign ended."""
    deadline = time.monotonic() + PATIENCE
    while process.launcher.poll() is None and time.monotonic() < deadline:
        if len(committed(path)) >= least:
            return True
        time.sleep(0.005)
    return False


def flip_bit(path: Path, place: tuple[int, int, int], rng: random.Random) -> str:
    """Flip one bit of a committed block; return its variable."""
    with Blocks(path, Layout(job_of(path))) as blocks:
        block = blocks.study.block(place)
        name = rng.choice(blocks.variables)
        rows = blocks.read(block)[name]
    at = Offsets(path).at(name, block.first) + rng.randrange(rows.nbytes)
    with path.open("r+b") as file:
        file.seek(at)
        byte = file.read(1)[0]
        file.seek(at)
        file.write(bytes([byte ^ 1 << rng.randrange(8)]))
    return name
