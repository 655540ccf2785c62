"""The state of many files: as lines, as JSON."""

import json
import shutil

import pytest
from tools import SMALL, hpcsweep

from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.run import COMPLETE, STOPPED, run
from hpcsweep.campaign.status import overview, status
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store.journal import read_history


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A complete file, one stopped half way, and one that is none."""
    made = tmp_path_factory.mktemp("many")
    job = parse_job(SMALL, "small", "small")
    assert run(job, made / "whole.h5", Serial()) == COMPLETE
    flag = StopFlag()

    class Stopping(Silent):
        def advance(self, runs):
            flag.reason = "SIGTERM"

    assert (
        run(job, made / "half.h5", Serial(), flag=flag, progress=lambda *_: Stopping()) == STOPPED
    )
    (made / "text.h5").write_text("text")
    return made


def test_rows_agree_with_the_status_of_each_file(folder, tmp_path):
    for name, state in (("whole.h5", "complete"), ("half.h5", "stopped")):
        row, reported = overview(folder / name), status(folder / name)
        assert row["state"] == state
        for key in ("name", "runs_done", "runs_total", "n_failed", "core_seconds"):
            assert row[key] == reported[key], key
    assert 0 < overview(folder / "half.h5")["runs_done"] < 88
    assert overview(folder / "half.h5")["core_seconds_remaining"] > 0
    without_journal = shutil.copyfile(folder / "whole.h5", tmp_path / "whole.h5")
    assert overview(without_journal)["core_seconds_remaining"] == 0


def test_one_that_cannot_be_read_hides_no_other(folder):
    files = [folder / name for name in ("whole.h5", "half.h5", "text.h5")]
    reported = hpcsweep(0, "status", *files)
    assert reported.returncode == 2
    lines = reported.stdout.splitlines()
    assert [line.split()[1] for line in lines[1:4]] == ["complete", "stopped", "unreadable"]
    assert lines[4].startswith("3 files")
    assert "text.h5: not an HDF5 file" in lines[5]
    rows = json.loads(hpcsweep(0, "status", "--json", *files).stdout)
    assert [row["state"] for row in rows] == ["complete", "stopped", "unreadable"]


def test_one_whose_session_has_not_ended_is_running(folder, tmp_path):
    running = shutil.copyfile(folder / "half.h5", tmp_path / "running.h5")
    journal = (folder / "half.h5.journal").read_text().splitlines(keepends=True)
    (tmp_path / "running.h5.journal").write_text("".join(journal[:-1]))
    assert overview(running)["state"] == "running"


def test_a_journal_with_a_line_cut_in_two_is_read_around_it(folder, tmp_path):
    """Each part parses with its neighbour, not alone."""
    whole, path = read_history(folder / "whole.h5"), tmp_path / "cut.h5"
    lines = (folder / "whole.h5.journal").read_text().splitlines()
    third = lines[2]
    half = third.index(", ") + 1
    lines[2:3] = [third[:half].rstrip(","), third[half:]]
    (tmp_path / "cut.h5.journal").write_text("\n".join(lines) + "\n")
    cut = read_history(path)
    n_records = len(whole.costs) + len(whole.samples)
    assert len(cut.costs) + len(cut.samples) == n_records - 1
    assert cut.sessions[-1].ended == whole.sessions[-1].ended == "complete"
