"""Sessions that are stopped after their first commit: each gains a block, whatever the study."""

import pytest
from tools import RECORDS, assert_same_datasets

from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.run import COMPLETE, STOPPED
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag

QUICK = ("amplitude_sweep",)
SHORT = 20
"""Sessions."""
BUILDING = """
[structure]
n_floors = 1
stiffness_ratio = 100.0
[sweep]
transient_cycles = 30
sampling_cycles = 32
"""
SWEPT = "omega = 0.7\namplitude = {from = 0.1, to = 0.6, count = 20}\n"
POINT = "omega = 0.7\namplitude = 0.3\n"
STUDIES = {
    "amplitude_sweep": f'{BUILDING}{SWEPT}directions = ["up"]\n[output]\nblock = 1\n',
    "points": f'{BUILDING}{SWEPT}[study]\nkind = "points"\n',
    "attractors": f'{BUILDING}{SWEPT}[study]\nkind = "attractors"\nstarts = 20\n',
    "records": RECORDS.replace("block = 2", "block = 1"),
    "basins": f"""{BUILDING}{POINT}[study]
kind = "basins"
starts = 20
horizontal = {{from = -1.0, to = 1.0, count = 10}}
vertical = {{from = -1.0, to = 1.0, count = 20}}
""",
}


class StopsAfterACommit(StopFlag):
    """Is set a few looks after the first runs of a session are committed."""

    def __init__(self):
        super().__init__()
        self.runs, self.looks = 0, 0

    def advance(self, runs: int) -> None:
        """Count the calls of the progress display."""
        self.runs += runs

    def is_set(self) -> bool:
        self.looks += self.runs > 0
        return self.looks > 2


@pytest.mark.parametrize(
    "kind",
    [one if one in QUICK else pytest.param(one, marks=pytest.mark.slow) for one in STUDIES],
)
def test_twenty_short_sessions_in_a_row_finish_a_campaign(kind, tmp_path):
    job = parse_job(STUDIES[kind], "job", "job")
    assert job.study.n_runs == SHORT
    done, sessions, code = 0, 0, STOPPED
    while code == STOPPED and sessions < SHORT + 1:
        flag = StopsAfterACommit()
        display = type("Display", (Silent,), {"advance": lambda self, n, f=flag: f.advance(n)})
        code = campaign.run(
            job, tmp_path / "short.h5", Serial(), progress=lambda *_, d=display: d(), flag=flag
        )
        assert flag.runs > 0
        done, sessions = done + flag.runs, sessions + 1
    assert code == COMPLETE
    assert done == SHORT
    assert sessions > SHORT // 4
    assert campaign.run(job, tmp_path / "whole.h5", Serial()) == COMPLETE
    assert_same_datasets(tmp_path / "short.h5", tmp_path / "whole.h5")


def test_a_run_of_a_slow_solver_is_committed_by_itself():
    text = f"{BUILDING}{SWEPT}"
    assert parse_job(text, "job", "job").study.block_size == 50
    assert parse_job(f'{text}[solver]\nmethod = "bdf"\n', "job", "job").study.block_size == 1
