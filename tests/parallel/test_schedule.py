"""The schedule against its bound, costs that are learnt, what a session reports of them."""

import heapq
import json
import re
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from together import together
from tools import JOBS, ROOT, SMALL, assert_same_datasets, hpcsweep, of_study, run_script

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import TaskCosts
from hpcsweep.campaign.forecast import useful_ranks
from hpcsweep.job import parse_job
from hpcsweep.parallel.schedule import Schedule, computing_ranks, report_interval
from hpcsweep.solvers.outcome import REMEDIES, Outcome
from hpcsweep.store.journal import BlockCost, PilotCost
from hpcsweep.studies.sweep.runs import AmplitudeSweep
from hpcsweep.studies.variables import empty_rows

MANY = """
[sweep]
omega = {from = 0.2, to = 2.0, count = 120}
amplitude = {from = 0.01, to = 0.4, count = 160}
[output]
block = 10
"""


def journal(path, kind: str) -> list[dict]:
    lines = path.with_name(path.name + ".journal").read_text().splitlines()
    return [record for record in map(json.loads, lines) if record["kind"] == kind]


def hundredfold(rng, n_tasks: int, n_pieces: int = 16) -> list[np.ndarray]:
    """Tasks of 1 to 100 s, their cost spread unevenly over their blocks."""
    shares = rng.dirichlet(np.full(n_pieces, 3.0), n_tasks)
    return list(10 ** rng.uniform(0, 2, n_tasks)[:, None] * shares)


class _Exact:
    """Costs that are known in advance."""

    def __init__(self, blocks):
        self._left = [float(block.sum()) for block in blocks]

    def done(self, task, position, seconds):
        del position
        self._left[task] -= seconds

    def left(self, task):
        return self._left[task]


def test_small_tasks_go_in_order_behind_the_costly_ones():
    costs = {1: 1.0, 3: 2.0, 2: 5e-4, 0: 6e-4, 5: 7e-4, 4: 3e-4}
    schedule = Schedule(costs, costs.get, 2)
    assert [schedule.take(0.0) for _ in costs] == [3, 1, 0, 2, 4, 5]


class Farmed(NamedTuple):
    """Time of the whole, over the least that any schedule takes, and tasks that moved."""

    makespan: float
    over_bound: float
    moved: int


def farmed(blocks, n_ranks: int, costs=None) -> Farmed:
    """Hand out blocks of known cost as the farm does, with messages that take no time."""
    costs = costs or _Exact(blocks)
    schedule = Schedule(range(len(blocks)), costs.left, n_ranks)
    position, recalled, moved = [0] * len(blocks), set(), 0
    idle, events, now = n_ranks, [], 0.0
    while True:
        while idle and len(schedule):
            idle -= 1
            task = schedule.take(now)
            heapq.heappush(events, (now + blocks[task][position[task]], task))
        if not events:
            break
        now, task = heapq.heappop(events)
        costs.done(task, position[task], blocks[task][position[task]])
        position[task] += 1
        schedule.progress(task, now)
        if position[task] == len(blocks[task]):
            schedule.end(task)
            idle += 1
        elif task in recalled:
            schedule.put_back(task)
            idle, moved = idle + 1, moved + 1
        else:
            heapq.heappush(events, (now + blocks[task][position[task]], task))
            task = None
        recalled.discard(task)
        recalled.update(schedule.recalls(now))
    tasks = [block.sum() for block in blocks]
    return Farmed(now, now / max(sum(tasks) / n_ranks, max(tasks)), moved)


@together("n_tasks", [5, 17, 60, 250])
def test_makespan_is_within_a_tenth_of_the_bound_for_costs_a_hundredfold_apart(n_tasks):
    rng = np.random.default_rng(n_tasks)
    worst = 0.0
    for _ in range(4):
        blocks = hundredfold(rng, n_tasks)
        limit = useful_ranks(np.array([block.sum() for block in blocks]))
        for n_ranks in sorted({2, 3, max(1, int(limit / 2)), int(limit), int(limit) + 1}):
            over = farmed(blocks, n_ranks).over_bound
            assert over >= 1 - 1e-12
            worst = max(worst, over)
    assert worst < 1.10


def test_equal_tasks_that_do_not_divide_by_the_ranks_are_shared():
    blocks = [np.full(40, 0.25)] * 3
    shared = farmed(blocks, 2)
    assert shared.over_bound < 1.03
    assert shared.moved > 0
    # the control: in one block each, costliest first is Graham's 4/3 of the bound
    whole = farmed([block.sum(keepdims=True) for block in blocks], 2)
    assert whole.over_bound == pytest.approx(4 / 3, rel=1e-12)


@together(
    "waiting, running, recalled",
    [
        (10.0, [9.0, 1.0], [2]),
        (9.0, [9.0, 1.0], []),  # below the fair share
        (10.0, [9.0, 0.6], [2]),
        (10.0, [9.0, 0.4], []),  # the rank is free soon
        (1.0, [0.96] * 20, []),  # as long, all but a little
        (1.0, [0.96] * 19 + [0.94], [20]),
    ],
)
def test_who_is_recalled_for_a_task_that_must_start(waiting, running, recalled):
    costs = {0: waiting, **{task: 100.0 + rest for task, rest in enumerate(running, 1)}}
    schedule = Schedule(costs, costs.get, len(running))
    for _ in running:
        schedule.take(0.0)
    costs |= {task: rest for task, rest in enumerate(running, 1)}
    assert schedule.recalls(0.0) == recalled


def test_many_ranks_have_a_master_that_only_serves_at_most_a_thousand_reports_a_second():
    assert [computing_ranks(n) for n in (1, 32, 33, 4096)] == [1, 32, 32, 4095]
    for n_ranks in (2, 500, 4096):
        assert n_ranks / report_interval(n_ranks) <= 1000


class _Believed:
    """A study's learnt costs, for `farmed`: what a campaign's rank 0 would know."""

    def __init__(self, study):
        self.costs, self._study = TaskCosts(study), study

    def done(self, task, position, seconds):
        block = self._study.path(task)[position]
        self.costs.measured(BlockCost(block.place, block.n_runs, seconds))
        self.costs.done(block.place)

    def left(self, task):
        return self.costs.left(task)


def test_a_rough_pilot_is_enough_because_costs_are_learnt():
    study = parse_job(MANY, "many", "many").study
    n_frames, n_blocks, size = study.omega.size, 16, study.block_size
    rng = np.random.default_rng(5)
    # a hundredfold over the frames, smooth but for noise; costlier at large amplitudes
    frame = 100 ** (0.5 + 0.5 * np.sin(np.linspace(0, 9, n_frames)))
    place = np.concatenate((np.linspace(0.2, 1.8, n_blocks), np.linspace(1.8, 0.2, n_blocks)))
    true = frame[:, None] * place * rng.lognormal(0, 0.3, (n_frames, 2 * n_blocks)) / 20
    believed = _Believed(study)
    n_samples = costs.n_samples(study)
    assert 3 * n_samples <= 0.01 * study.n_runs
    for index in range(n_samples):
        share, along = costs.sample_place(index)
        at = int(share * n_frames)
        rough = true[at, int(along * n_blocks)] / size * rng.lognormal(0, 0.7)
        believed.costs.sampled(PilotCost(at, along, 2, 2 * rough))
    limit = useful_ranks(true.sum(axis=1))
    for n_ranks in (2, 5, int(limit / 2)):
        assert farmed(list(true), n_ranks, believed).over_bound < 1.10, n_ranks
        believed = _Believed(study)
        for at in range(0, n_frames, 7):
            believed.costs.sampled(PilotCost(at, 0.5, 2, 2 * true[at].mean() / size))


def test_costs_are_interpolated_and_corrected_by_what_was_measured():
    study = parse_job(MANY, "many", "many").study
    known = TaskCosts(study)
    assert known.left(0) == study.amplitude.size * 2
    known.sampled(PilotCost(0, 0.5, 2, 2.0))
    known.sampled(PilotCost(100, 0.5, 2, 6.0))
    assert known.left(0) == pytest.approx(320 * 1.0)
    assert known.left(50) == pytest.approx(320 * 2.0)
    assert known.left(119) == pytest.approx(320 * 3.0)
    known.done((0, 50, 3))
    assert known.left(50) == pytest.approx(310 * 2.0)
    # twice as costly as the pilot said, here and therefore nearby, in this cell
    known.measured(BlockCost((0, 50, 3), 10, 40.0))
    known.measured(BlockCost((1, 60, 3), 10, 22.0))
    assert known.totals()[51] > 320 * 2.02
    exact = TaskCosts(study)
    for direction in range(2):
        for block in range(16):
            exact.measured(BlockCost((direction, 7, block), 10, 1.0 + block + direction))
    assert exact.totals()[7] == pytest.approx(sum(1.0 + b + d for d in (0, 1) for b in range(16)))


def test_costs_of_single_points_are_told_apart():
    text = MANY.replace("[sweep]", '[study]\nkind = "points"\n[sweep]')
    study = parse_job(text, "points", "points").study
    known = TaskCosts(study)
    assert study.n_tasks == len(known.totals()) == study.n_runs // study.block_size
    known.sampled(PilotCost(0, 0.1, 1, 2.0))
    known.sampled(PilotCost(0, 0.9, 1, 6.0))
    last = study.path(study.n_tasks // study.n_frames - 1)[0]
    assert known.left(0) == pytest.approx(2.0 * study.block_size)
    assert known.left(last.task) == pytest.approx(6.0 * last.n_runs)
    known.done(last.place)
    assert known.left(last.task) == 0.0


def test_samples_fill_frames_and_amplitudes_for_any_number_of_them():
    places = np.array([costs.sample_place(index) for index in range(64)])
    assert places.min() >= 0
    assert places.max() < 1
    cells = {(int(4 * first), int(4 * second)) for first, second in places[:32].tolist()}
    assert len(cells) == 16
    one = parse_job("[sweep]\nomega = 0.5\namplitude = 0.1\n", "one", "one").study
    assert costs.n_samples(one) == 0
    sample = costs.time_sample(one, 5)
    assert (sample.frame, sample.runs) == (0, 1)
    assert sample.seconds > 0


@pytest.mark.slow
@pytest.mark.mpi
def test_frames_that_move_between_ranks_give_the_same_bytes(tmp_path):
    job = tmp_path / "equal.toml"
    text = SMALL.replace("{from = 0.5, to = 0.8, count = 4}", "[0.6, 0.6001, 0.6002, 0.6003]")
    job.write_text(text.replace("block = 4", "block = 1"))
    assert hpcsweep(0, "run", job, "-o", tmp_path / "one.h5").returncode == 0
    # four frames of 22 blocks of equal cost on three ranks: one must move
    paced = ROOT / "tests" / "support" / "paced.py"
    done = run_script(3, paced, 0.05, "run", job, "-o", tmp_path / "three.h5")
    assert done.returncode == 0, done.stderr
    ranks_of = {}
    for record in journal(tmp_path / "three.h5", "block"):
        ranks_of.setdefault(record["place"][1], set()).add(record["rank"])
    recalls = journal(tmp_path / "three.h5", "end")[0]["recalls"]
    assert recalls > 0
    assert max(map(len, ranks_of.values())) > 1
    assert_same_datasets(tmp_path / "one.h5", tmp_path / "three.h5")
    state = json.loads(hpcsweep(0, "status", tmp_path / "three.h5", "--json").stdout)
    assert state["master"]["tasks_moved"] == recalls
    assert state["master"]["messages"] > 0


def test_dry_run_states_the_bytes_the_memory_and_the_limit(tmp_path):
    job = JOBS / "ci.toml"
    reported = hpcsweep(0, "run", job, "--dry-run", cwd=tmp_path).stdout
    size = int(re.search(r"(\d+) bytes", reported)[1])
    memory = float(re.search(r"about (\d+) MB a rank", reported)[1])
    assert "core-hours" in reported
    assert re.search(r"no more than \d+ are of use", reported)
    assert list(tmp_path.iterdir()) == []
    path = tmp_path / "ci.h5"
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    assert size <= path.stat().st_size <= size + 64_000
    state = json.loads(hpcsweep(0, "status", path, "--json").stdout)
    assert state["peak_memory"][1] / 1e6 < 1.3 * memory


NO_PHYSICS = """
import sys
from pathlib import Path
from hpcsweep.campaign import run as campaign
from hpcsweep.job import load_job
from hpcsweep.parallel import mpi
from hpcsweep.studies.sweep.runs import AmplitudeSweep
from hpcsweep.studies.variables import empty_rows
from tools import of_study

class Nothing(AmplitudeSweep):
    def warm_up(self, say=None, n_ranks=None):
        pass

    def runs_at(self, frame, places, state, poll=None):
        result = empty_rows(self.structure, len(places), self.settings)
        result["final_state"][:], result["outcome"][:] = 0.0, 1
        return result

for name in sys.argv[2:]:
    job = load_job(name)
    job = of_study(job, Nothing) if sys.argv[1] == "none" else job
    if code := campaign.run(job, Path(name).with_suffix(".h5"), mpi.world()):
        sys.exit(code)
"""


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize(("physics", "frames"), [("none", 2000), ("flow", 800)])
def test_memory_of_a_rank_does_not_grow_with_the_frames(tmp_path, physics, frames):
    script = tmp_path / "run.py"
    script.write_text(NO_PHYSICS)
    jobs = []
    for count in (20, frames):
        jobs.append(tmp_path / f"{count}.toml")
        text = SMALL.replace("to = 0.8, count = 4", f"to = 0.52, count = {count}")
        jobs[-1].write_text(text.replace("to = 0.3, count = 11", "to = 0.021, count = 2"))
    # the peak of a process never falls: the second has what it needs beyond the first
    done = run_script(2, script, physics, *jobs)
    assert done.returncode == 0, done.stderr
    peaks = [journal(job.with_suffix(".h5"), "end")[0]["peak_memory"] for job in jobs]
    (few, few_largest), (many, many_largest) = peaks
    assert many_largest < few_largest + 16e6
    assert many < few + 16e6


class Failing(AmplitudeSweep):
    """Results of which some failed."""

    def runs_at(self, frame, places, state, poll=None):
        result = empty_rows(self.structure, len(places), self.settings)
        result["final_state"][:] = 0.0
        result["outcome"][:] = Outcome.COMPLETE
        result["outcome"][self.amplitude[places] > 0.2] = Outcome.STEP_LIMIT
        if self.omega[frame] > 0.75:
            result["outcome"][0] = Outcome.NON_FINITE
        return result


def test_failures_are_listed_with_what_to_do(tmp_path):
    from hpcsweep.campaign import run as campaign
    from hpcsweep.campaign.progress import Silent
    from hpcsweep.campaign.status import status
    from hpcsweep.parallel import mpi

    class Said(Silent):
        def __init__(self, total, done, unit):
            assert (done, unit) == (0, "run")
            self.lines = said

        def message(self, text):
            said.append(text)

    said: list[str] = []
    job = of_study(parse_job(SMALL, "small", "small"), Failing)
    path = tmp_path / "failing.h5"
    code = campaign.run(job, path, mpi.Serial(), progress=Said)
    assert code == 0
    state = status(path)
    assert state["n_failed"] == sum(kind["runs"] for kind in state["remedies"].values()) > 20
    assert said[0].startswith(f"{state['n_failed']} runs failed")
    for outcome in (Outcome.STEP_LIMIT, Outcome.NON_FINITE):
        line = f"  {outcome.name} ({state['remedies'][outcome.name]['runs']}): {REMEDIES[outcome]}"
        assert line in said
    assert any("Omega = " in line and "A = " in line for line in said)
    shown = subprocess.run(
        [sys.executable, "-m", "hpcsweep", "status", str(path)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert REMEDIES[Outcome.STEP_LIMIT] in shown
    assert f"and {state['n_failed'] - 20} more" in shown


def test_every_failure_has_a_remedy():
    assert set(REMEDIES) == set(Outcome) - {Outcome.NOT_COMPUTED, Outcome.COMPLETE}


def test_status_tells_rate_and_rest_of_an_unfinished_file(tmp_path):
    from hpcsweep.campaign import run as campaign
    from hpcsweep.campaign.status import status
    from hpcsweep.parallel import mpi
    from hpcsweep.parallel.stopping import Stop

    calls = []

    class UntilThe15th(AmplitudeSweep):
        def runs_at(self, *arguments):
            calls.append(1)
            if len(calls) > 15:
                raise Stop
            return super().runs_at(*arguments)

    job = parse_job(SMALL, "small", "small")
    path = tmp_path / "part.h5"
    assert campaign.run(of_study(job, UntilThe15th), path, mpi.Serial()) == 75
    state = status(path)
    seconds = sum(block["seconds"] for block in journal(path, "block"))
    assert not state["complete"]
    assert 0 < state["seconds_remaining"] < 20 * seconds
    assert state["runs_per_second"] > 0
    assert campaign.run(job, path, mpi.Serial()) == 0
    assert status(path)["seconds_remaining"] is None


def test_the_log_has_a_line_a_minute_without_any_news(monkeypatch, capsys):
    from hpcsweep.campaign import progress

    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    log = progress.Log(100, 0)
    log.advance(10)
    for clock[0] in range(0, 181, 5):
        log.tick()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 + 3
    assert "10/100 runs" in lines[1]


def test_what_a_run_gives_depends_on_the_path_so_a_frame_is_not_cut():
    from hpcsweep.studies.sweep.runs import frame_runs

    job = parse_job(
        "[sweep]\nomega = 0.445\namplitude = {from = 0.21, to = 0.25, step = 0.002}\n", "h", "h"
    )
    arguments = job.structure, 0.445
    up = frame_runs(*arguments, job.settings).follow(job.study.amplitude, job.study.initial_state)
    down = frame_runs(*arguments, job.settings).follow(
        job.study.amplitude[::-1], up["final_state"][-1]
    )
    other = up["contact"] != down["contact"][::-1]
    assert other.sum() >= 3
    # cut in the middle and started from rest, the rest of the path differs, if only in last bits
    middle = job.study.amplitude.size // 2
    cut = frame_runs(*arguments, job.settings).follow(
        job.study.amplitude[middle:], job.study.initial_state
    )
    assert not np.array_equal(cut["final_state"], up["final_state"][middle:])
