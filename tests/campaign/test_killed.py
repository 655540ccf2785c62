"""Campaigns of every kind of study, killed again and again: no bit differs, nothing is repeated."""

import itertools
import os
import random
import signal
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import faults
import pytest
from tools import (
    ALONG,
    ATTRACTORS,
    BASINS,
    GRID,
    RECORDS,
    REFINED,
    SEEDS,
    VARY,
    YIELDING,
    YIELDING_RECORDS,
    assert_same_datasets,
    forked,
    hpcsweep,
    made,
)

from hpcsweep.campaign.status import status
from hpcsweep.store import commit
from hpcsweep.store.rows import Transport

KILLS = int(os.environ.get("KILLS", "2"))
"""Of a campaign, unless it is complete before."""
BRANCHES = """
[study]
kind = "branches"
[branches]
seeds = "seeds.h5"
steps = 300
max_points = 2000
max_seeds = 40
"""
LINES = SEEDS.replace("[0.9, 1.0, 1.1]", "{from = 0.9, to = 1.1, count = 12}")
ONE = """
[structure]
n_floors = 1
stiffness_ratio = 100.0
sharpness = inf
damping_ratio = 0.05
[sweep]
transient_cycles = 100
sampling_cycles = 32
"""
ONE_SWEEP = f"""{ONE}max_orbit_period = 1
omega = {{from = 1.1, to = 1.3, count = 8}}
amplitude = {{from = 0.1, to = 0.9, count = 9}}
"""
CURVES = f"""{ONE_SWEEP}{BRANCHES}max_curve_points = 600
curves = ["fold", "grazing"]
"""


def slow(text: str, old: int, cycles: int) -> str:
    """Have each run of a job take its time."""
    changed = text.replace(f"transient_cycles = {old}", f"transient_cycles = {cycles}")
    return changed.replace("[output]", '[solver]\nskip = "none"\n[output]')


class Case(NamedTuple):
    """A job, and what is there before it."""

    text: str
    before: Mapping[str, str] = MappingProxyType({})
    """Jobs that are run first, by the name of their files."""
    options: tuple[str, ...] = ()


POINTS = slow(REFINED, 30, 1500)
MAP = slow(
    f"""[study]
kind = "points"
refine = {{levels = 3, wrong = 0.2, curves = "curves.h5"}}
{ONE}omega = {{from = 1.08, to = 1.31, count = 41}}
amplitude = {{from = 0.06, to = 0.94, count = 34}}
[output]
poincare = false
""",
    100,
    1500,
)
STARTS = BASINS.replace("count = 9", "count = 81").replace("count = 7", "count = 72")
REUSE = ("--reuse", "old.h5")
CASES = {
    "amplitude_sweep": Case(faults.JOB),
    "along omega": Case(slow(ALONG, 30, 500).replace("block = 4", "block = 2")),
    "vary": Case(faults.JOB + VARY),
    "storeys that yield": Case(
        YIELDING.replace("= 100\n", "= 300\n").replace("block = 2", "block = 1")
    ),
    "records of storeys that yield": Case(YIELDING_RECORDS.replace("count = 5", "count = 80")),
    "points": Case(slow(GRID, 30, 5000)),
    "attractors": Case(ATTRACTORS),
    "attractors along omega": Case(
        ATTRACTORS.replace("[sweep]", '[sweep]\nalong = "omega"')
        .replace("[0.9, 1.0, 1.1]", "{from = 0.9, to = 1.1, count = 7}")
        .replace("{from = 0.6, to = 0.7, count = 6}", "[0.6, 0.7, 0.8]")
    ),
    "basins": Case(BASINS.replace("count = 7", "count = 60")),
    "records": Case(RECORDS.replace("count = 5", "count = 80")),
    "branches": Case(LINES + BRANCHES, {"seeds": LINES}),
    "curves": Case(CURVES, {"seeds": ONE_SWEEP}),
    "refined points": Case(POINTS),
    "refined starts": Case(
        STARTS.replace("starts = 16", "starts = 16\nrefine = {levels = 3, wrong = 0.05}")
    ),
    "points cut by curves": Case(MAP, {"seeds": ONE_SWEEP, "curves": CURVES}),
    "sweeps taken over": Case(
        faults.JOB.replace("count = 4", "count = 9"),
        {"old": faults.JOB.replace("count = 4", "count = 5")},
        REUSE,
    ),
    "points of a coarser map": Case(
        POINTS, {"old": POINTS.replace("count = 26", "count = 6")}, REUSE
    ),
}
VICTIMS = ("rank", "master", "launcher", "all")


def session(path: Path, *arguments: object, ranks: int, least: int, victim: str, rng) -> bool:
    """Kill a campaign once so many more blocks are committed; return whether it was killed."""
    committed, begun = faults.committed(path), len(faults.records(path))
    process = faults.start(ranks, *arguments)
    reached = faults.wait_for_commits(process, path, len(committed) + least)
    if reached:
        # stopped first: on a busy machine the others would finish before the kill
        process.send(signal.SIGSTOP, "all", rng)
        process.send(signal.SIGKILL, victim, rng)
        process.send(signal.SIGCONT, "all", rng)
    process.finish()
    # ranks may outlive their launcher and commit what they were computing
    assert not process.wait_for_orphans(faults.PATIENCE)
    assert not committed & set(faults.computed(faults.records(path)[begun:]))
    return reached


def test_killed_within_a_write_it_goes_on_to_equal_bytes(tmp_path, monkeypatch, small_job):
    whole, path = made(small_job.read_text(), tmp_path / "whole.h5"), tmp_path / "cut.h5"
    monkeypatch.setattr(commit, "SYNC_INTERVAL", 0.0)  # a checksum after each block
    write = Transport.write
    # dies half-way through a variable of its third block; before its third checksum
    for variable, committed in (("poincare", 2), ("commit", 4)):
        left = itertools.count(2, -1)

        def dies(transport, name, start, rows, victim=variable, left=left):
            if name == victim and next(left) == 0:
                write(transport, name, start, rows[: len(rows) // 2])
                os.kill(os.getpid(), signal.SIGKILL)
            write(transport, name, start, rows)

        with monkeypatch.context() as patch:
            patch.setattr(Transport, "write", dies)
            assert forked("run", small_job, "-o", path).returncode == -signal.SIGKILL
        assert len(faults.committed(path)) == committed
    kept, begun = faults.committed(path), len(faults.records(path))
    done = hpcsweep(0, "run", small_job, "-o", path)
    assert done.returncode == 0, done.stderr
    again = set(faults.computed(faults.records(path)[begun:]))
    assert kept.isdisjoint(again)
    assert kept | again == faults.committed(whole)
    assert_same_datasets(whole, path)


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize("kind", CASES)
def test_it_equals_the_uninterrupted_one_and_repeats_no_committed_block(
    kind, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    case, rng, path = CASES[kind], random.Random(5), tmp_path / "cut.h5"
    for name, text in case.before.items():
        made(text, tmp_path / f"{name}.h5")
    given = {file: file.read_bytes() for file in tmp_path.iterdir()}
    reuse = [tmp_path / name for name in case.options[1:]]
    whole = made(case.text, tmp_path / "whole.h5", reuse=reuse)
    (tmp_path / "job.toml").write_text(case.text)
    command = ("run", "job.toml", "-o", path, *case.options)
    blocks, killed = len(faults.committed(whole)), 0
    complete = False
    while killed < KILLS and not complete:
        reached = session(
            path,
            *command,
            ranks=(3, 0, 2)[killed % 3],
            least=rng.randint(1, max(blocks // max(8, 2 * KILLS), 1)),
            victim=rng.choice(VICTIMS),
            rng=rng,
        )
        complete = path.exists() and status(path)["complete"]
        killed += reached and not complete
    assert killed
    print(f"{kind}: killed {killed} times, {len(faults.committed(path))} of {blocks} committed")
    committed, begun = faults.committed(path), len(faults.records(path))
    done = hpcsweep(0, *command)
    assert done.returncode == 0, done.stderr
    again = set(faults.computed(faults.records(path)[begun:]))
    assert not committed & again
    if not (case.options or "refine =" in case.text):  # a round has tasks of several blocks
        assert len(again) == blocks - len(committed)
    assert_same_datasets(whole, path)
    assert all(file.read_bytes() == content for file, content in given.items())
