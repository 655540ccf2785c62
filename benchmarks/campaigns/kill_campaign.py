"""Hurt campaigns at random moments, run them again to the end, and look for damage.

    bash benchmarks/run.sh kill_campaign [--runs 50] [--seed S] [--transport offset]
        [--kind K] [--json]

Every run draws a kind of fault, 1 to 4 ranks (other numbers when it goes on) and a moment: before
the file exists, or after a random number of commits. It passes if

- after the fault the file is missing or readable, and every checksum in it holds;
- a signal to stop is obeyed within seconds, with exit code 75;
- running again exits with 0 and computes exactly the blocks that were not committed (those
  of the damaged ones that were), each once;
- every dataset equals that of an uninterrupted run, bit for bit;
- no process, lock or temporary file is left.

The exit code is 0 only if all runs pass. Commits are made more often than in real use, see
`quick_commits.py`; one run in five keeps the real interval.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

import faults
import h5py
import numpy as np
from tools import datasets

from hpcsweep.store import StoreError

STOP_SIGNALS = {"term": signal.SIGTERM, "int": signal.SIGINT, "usr1": signal.SIGUSR1}
STOP_SECONDS = 15.0
"""Longest time to stop in good order, on a machine with more ranks than cores."""
ORPHAN_SECONDS = 15.0
"""Longest time in which a rank ends whose launcher is dead."""
REAL_INTERVAL = 2.0


@dataclass
class Run:
    """One campaign that is hurt and goes on."""

    kind: str
    transport: str
    ranks: int
    seed: int
    committed_before: int = 0
    interrupted: bool = False
    orphaned: bool = False
    resumed_equal: bool = False
    seconds: float = 0.0
    problems: list[str] = field(default_factory=list)


class Patient:
    """The file of one run, and what is done to it."""

    def __init__(self, run: Run, job: Path, folder: Path, reference: dict, total: int):
        self.run = run
        self.rng = random.Random(run.seed)
        self.job = job
        self.path = folder / "campaign.h5"
        self.reference = reference
        self.total = total
        self.damaged: set[tuple[int, int, int]] = set()
        self.campaigns: list[faults.Processes] = []

    def start(self, **options) -> faults.Processes:
        """Start, or go on, on the run's ranks; one rank now and then without launcher."""
        ranks = self.run.ranks
        if ranks == 1 and self.rng.random() < 0.5:
            ranks = 0
        sync = REAL_INTERVAL if self.rng.random() < 0.2 else self.rng.choice([0.0, 0.0, 0.1])
        transport = "" if self.run.transport == "pwrite" else self.run.transport
        options = {"sync": sync, "transport": transport, **options}
        process = faults.start(ranks, "run", self.job, "-o", self.path, **options)
        self.campaigns.append(process)
        return process

    def wait(self, process: faults.Processes, early: float = 0.15, late: int = 0) -> bool:
        """Wait for a random moment; return whether the campaign has begun to compute.

        Parameters
        ----------
        process : Processes
        early : float
            Probability of a moment before anything is committed.
        late : int
            Commits after which it is surely over, most of all if 0.
        """
        if self.rng.random() < early:
            time.sleep(self.rng.uniform(0.0, 1.5))
        else:
            done = len(faults.committed(self.path))
            last = late or self.total - 6
            least = self.rng.randint(min(max(done, 1), last), last)
            faults.wait_for_commits(process, self.path, least)
            time.sleep(self.rng.uniform(0.0, 0.03))
        starts = sum(r["kind"] == "start" for r in faults.records(self.path))
        return starts == len(self.campaigns)

    def finish(self, process: faults.Processes) -> tuple[int | None, str]:
        """Wait for the end of a campaign and all its processes; exit code and errors."""
        code, _, errors = process.finish()
        if code is None:
            self.problem(f"hung: {errors[-300:]}")
        if left := process.wait_for_orphans(ORPHAN_SECONDS):
            self.problem(f"{len(left)} processes left")
            process.end()
        return code, errors

    def problem(self, text: str) -> None:
        """Note what must not be."""
        self.run.problems.append(" ".join(text.split()))

    def kill(self, victim: str) -> None:
        """Start, SIGKILL somebody at a random moment."""
        process = self.start()
        self.wait(process)
        process.send(signal.SIGKILL, victim, self.rng)
        self.finish(process)

    def kill_twice(self) -> None:
        """Kill it, and kill it again when it goes on."""
        for _ in range(2):
            self.kill(self.rng.choice(["rank", "master", "launcher", "all"]))
            self.check_file()

    def stop(self, number: int, victim: str) -> None:
        """Start, send a signal that asks to stop."""
        process = self.start()
        computing = self.wait(process)
        begun = time.monotonic()
        process.send(number, victim, self.rng)
        code, errors = self.finish(process)
        took = time.monotonic() - begun
        # Open MPI's mpirun says nothing of its ranks' exit codes when it is told to stop
        said = "stopped in good order" in errors or ": complete" in errors
        obeyed = code in (0, 75) or (self.run.transport == "mpio" and code and said)
        if computing and (not obeyed or took > STOP_SECONDS):
            self.problem(f"exit code {code} {took:.1f} s after the signal: {errors[-300:]}")
        if computing and code == 75 and Path(f"{self.path}.lock").exists():
            self.problem("stopped in good order, but left its lock")

    def fill_disk(self) -> None:
        """No room to create the file; no room to go on writing it."""
        size = self.reference["size"]
        code, errors = self.finish(self.start(file_limit=self.rng.randrange(size)))
        if code != 2 or errors.count("hpcsweep: error: ") != 1 or self.path.exists():
            self.problem(f"no room for the file: exit code {code}: {errors[-300:]}")
        self.kill("rank")
        limit = self.rng.randrange(self.reference["data"], size)
        code, errors = self.finish(self.start(file_limit=limit))
        if code not in (0, 1, 2):
            self.problem(f"no room to go on: exit code {code}: {errors[-600:]}")

    def truncate(self) -> None:
        """Kill it, cut off the file's end: refused, not written to, until a copy is put back."""
        self.kill_in_the_middle()
        if not self.path.exists():
            return
        whole = self.path.read_bytes()
        os.truncate(self.path, self.rng.randrange(len(whole)))
        short = self.path.read_bytes()
        code, errors = self.finish(self.start())
        if code != 2 or errors.count("hpcsweep: error: ") != 1 or self.path.read_bytes() != short:
            self.problem(f"cut short: exit code {code}: {errors[-300:]}")
        self.path.write_bytes(whole)

    def flip(self) -> None:
        """Kill it, flip a bit of a committed block."""
        self.kill_in_the_middle()
        good = sorted(faults.committed(self.path))
        if good:
            place = self.rng.choice(good)
            faults.flip_bit(self.path, place, self.rng)
            self.damaged = {place}
            if place in faults.valid(self.path):
                self.problem("a flipped bit is not noticed")

    def kill_in_the_middle(self) -> None:
        """Kill it after some commits."""
        process = self.start(sync=0.0)
        self.wait(process, early=0.0)
        process.send(signal.SIGKILL, "all", self.rng)
        self.finish(process)

    def orphan(self) -> None:
        """Freeze a rank, kill all others and the launcher, and go on while it is there."""
        process = self.start(sync=0.0)
        self.wait(process, early=0.0, late=self.total // 3)
        ranks = process.ranks()
        frozen = ranks[self.rng.choice([rank for rank in ranks if rank > 0] or [0])]
        os.kill(frozen, signal.SIGSTOP)
        # the launcher's daemon first, or it would end the frozen rank
        daemons = set(process.all()) - set(ranks.values()) - {process.launcher.pid}
        for pid in [*daemons, process.launcher.pid, *ranks.values()]:
            if pid != frozen:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        time.sleep(0.1)
        if faults.read_state(frozen) == "T" and len(faults.committed(self.path)) < self.total:
            self.run.orphaned = True
            before = self.path.read_bytes()
            code, errors = self.finish(self.start(HPCSWEEP_TEST_ORPHAN_WAIT="0.5"))
            named = f"process {frozen}," in errors
            if code != 2 or not named or self.path.read_bytes() != before:
                self.problem(f"beside an orphan: exit code {code}: {errors[-300:]}")
        # also where everything was committed before it froze: nobody else wakes it
        with suppress(ProcessLookupError):
            os.kill(frozen, signal.SIGCONT)
        self.finish(process)

    def check_file(self) -> None:
        """Look at the file as the fault has left it."""
        if not self.path.exists():
            return
        try:
            believed = faults.valid(self.path)
        except (StoreError, OSError) as error:
            self.problem(f"corrupt: {error}")
            return
        # the block after one whose end state was damaged cannot be checked before that is mended
        if not self.damaged and (torn := faults.committed(self.path) - believed):
            self.problem(f"{len(torn)} checksums do not hold")

    def go_on(self) -> None:
        """Run it to the end, compare."""
        run = self.run
        self.check_file()
        before = faults.committed(self.path) - self.damaged
        run.committed_before = len(before | self.damaged)
        run.interrupted = 0 < run.committed_before < self.total
        history = len(faults.records(self.path))
        run.ranks, first = self.rng.choice([1, 2, 3, 4]), run.ranks
        if run.transport == "pwrite":
            run.ranks = 1
        elif run.ranks == 1:
            run.ranks = 2
        code, errors = self.finish(self.start())
        run.ranks = first
        if code != 0:
            self.problem(f"going on: exit code {code}: {errors[-600:]}")
            return
        again = faults.computed(faults.records(self.path)[history:])
        if len(again) != len(set(again)):
            self.problem("a block was computed twice")
        if len(again) != self.total - len(before):
            self.problem(f"{len(again)} blocks computed, {self.total - len(before)} missing")
        if lost := before & set(again):
            self.problem(f"{len(lost)} committed blocks were computed again")
        if len(faults.valid(self.path)) != self.total:
            self.problem("not all checksums hold at the end")
        mine = datasets(self.path)
        other = self.reference["datasets"]
        different = [n for n in other if n not in mine or not np.array_equal(mine[n], other[n])]
        if different or mine.keys() != other.keys():
            self.problem(f"differs from the uninterrupted run in {different}")
        run.resumed_equal = not different
        left = {file.name for file in self.path.parent.iterdir()}
        if left := sorted(left - {self.path.name, self.path.name + ".journal"}):
            self.problem(f"left behind: {left}")


KINDS: dict[str, Callable[[Patient], None]] = {
    "kill rank": lambda p: p.kill("rank"),
    "kill master": lambda p: p.kill("master"),
    "kill launcher": lambda p: p.kill("launcher"),
    "kill all": lambda p: p.kill("all"),
    "kill twice": Patient.kill_twice,
    **{
        f"{name} to {victim}": lambda p, number=number, victim=victim: p.stop(number, victim)
        for name, number in STOP_SIGNALS.items()
        for victim in ("rank", "launcher")
    },
    "disk full": Patient.fill_disk,
    "truncated": Patient.truncate,
    "bit flipped": Patient.flip,
    "orphaned rank": Patient.orphan,
}
NEED_RANKS = {"orphaned rank"}


def transports() -> dict[str, bool]:
    """Return for each transport whether it is available here."""
    return {"pwrite": True, "offset": True, "mpio": bool(h5py.get_config().mpi)}


def plan(runs: int, seed: int, asked: list[str], kinds: list[str]) -> list[Run]:
    """Draw kinds (all equally often), transports and ranks."""
    rng = random.Random(seed)
    pairs = [(k, t) for k in kinds for t in asked if not (t == "pwrite" and k in NEED_RANKS)]
    drawn: list[Run] = []
    while len(drawn) < runs:
        rng.shuffle(pairs)
        # every kind once before any comes again
        pairs.sort(key=lambda pair: sum(run.kind == pair[0] for run in drawn))
        kind, transport = pairs[0]
        ranks = 1 if transport == "pwrite" else rng.randint(2, 4)
        drawn.append(Run(kind, transport, ranks, rng.getrandbits(32)))
    return drawn


def make_reference(job: Path, path: Path) -> dict:
    """Run the job undisturbed."""
    process = faults.start(0, "run", job, "-o", path)
    # the kernels may have to be compiled
    code, _, errors = process.finish(patience=600.0)
    if code != 0:
        raise SystemExit(f"the undisturbed run failed: {errors}")
    first = min(at for at, _, _ in faults.Offsets(path)._of.values())
    return {"datasets": datasets(path), "size": path.stat().st_size, "data": first}


def carry_out(runs: list[Run], say: Callable[[str], None]) -> None:
    """Do all runs, filling in what came of them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job = folder / "job.toml"
        job.write_text(faults.JOB)
        reference = make_reference(job, folder / "whole.h5")
        total = len(faults.valid(folder / "whole.h5"))
        for index, run in enumerate(runs):
            begun = time.monotonic()
            place = folder / f"run-{index}"
            place.mkdir()
            patient = Patient(run, job, place, reference, total)
            try:
                KINDS[run.kind](patient)
                patient.go_on()
            finally:
                for process in patient.campaigns:
                    process.end()
            run.seconds = round(time.monotonic() - begun, 2)
            shutil.rmtree(place)
            verdict = "; ".join(run.problems) or "passed"
            say(
                f"{index + 1:3d} {run.kind:16s} {run.transport:7s} {run.ranks} ranks "
                f"{run.committed_before:2d}/{total} committed, {run.seconds:4.1f} s: {verdict}"
            )


def table(runs: list[Run]) -> str:
    """Table by kind of fault."""
    lines = [
        f"{'fault':16s} {'runs':>5s} {'pwrite':>7s} {'offset':>6s} {'mpio':>5s} "
        f"{'in mid-run':>11s} {'committed before':>17s} {'equal':>6s} {'failed':>7s}"
    ]
    for kind in [*KINDS, "all"]:
        some = [run for run in runs if kind in (run.kind, "all")]
        if not some:
            continue
        counts = [sum(run.transport == t for run in some) for t in ("pwrite", "offset", "mpio")]
        lines.append(
            f"{kind:16s} {len(some):5d} {counts[0]:7d} {counts[1]:6d} {counts[2]:5d} "
            f"{sum(run.interrupted for run in some):11d} "
            f"{sum(run.committed_before for run in some):17d} "
            f"{sum(run.resumed_equal for run in some):6d} "
            f"{sum(bool(run.problems) for run in some):7d}"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the campaign of faults; return 0 if all runs passed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--transport", action="append", choices=list(transports()))
    parser.add_argument("--kind", action="append", choices=list(KINDS))
    parser.add_argument("--json", action="store_true", help="print every run as JSON")
    options = parser.parse_args(arguments)
    able = transports()
    asked = options.transport or [name for name, have in able.items() if have]
    if missing := [name for name in asked if not able[name]]:
        parser.error(f"transport {missing[0]}: this h5py was built without MPI")
    runs = plan(options.runs, options.seed, asked, options.kind or list(KINDS))
    say = (lambda text: print(text, file=sys.stderr, flush=True)) if options.json else print
    say(f"{len(runs)} runs, seed {options.seed}")
    carry_out(runs, lambda text: say(text))
    failed = sum(bool(run.problems) for run in runs)
    not_tried = [name for name in able if name not in asked]
    if options.json:
        report = {"seed": options.seed, "failed": failed, "transports_not_tried": not_tried}
        print(json.dumps({**report, "runs": [asdict(run) for run in runs]}, indent=1))
    else:
        print(table(runs))
        for name in not_tried:
            why = "not requested" if able[name] else "NOT TRIED: this h5py was built without MPI"
            print(f"transport {name}: {why}")
        print(f"{len(runs) - failed} of {len(runs)} passed")
    return 1 if failed or not runs else 0


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    sys.exit(main())
