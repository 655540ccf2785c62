"""The state of many files: as lines, as JSON, as a page."""

import json
import shutil

import pytest
from tools import SMALL, hpcsweep

from hpcsweep.campaign.overview import as_page, finished, overview
from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.run import COMPLETE, STOPPED, run
from hpcsweep.campaign.status import status
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store import read_history


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


def test_rows_agree_with_the_status_of_each_file(folder):
    for name, state in (("whole.h5", "complete"), ("half.h5", "stopped")):
        row, reported = overview(folder / name), status(folder / name)
        assert row["state"] == state
        for key in ("name", "runs_done", "runs_total", "n_failed", "core_seconds"):
            assert row[key] == reported[key], key
    assert 0 < overview(folder / "half.h5")["runs_done"] < 88
    assert overview(folder / "half.h5")["core_seconds_remaining"] > 0


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


def test_a_page_refreshes_itself_as_long_as_something_runs(folder, tmp_path):
    running = tmp_path / "running.h5"
    shutil.copyfile(folder / "half.h5", running)
    journal = (folder / "half.h5.journal").read_text().splitlines(keepends=True)
    (tmp_path / "running.h5.journal").write_text("".join(journal[:-1]))
    rows = [overview(running)]
    assert rows[0]["state"] == "running"
    assert not finished(rows)
    assert 'http-equiv="refresh"' in as_page(rows)
    page = tmp_path / "page.html"
    assert hpcsweep(0, "status", folder / "half.h5", "--html", page).returncode == 0
    assert "half.h5" in page.read_text()
    assert "refresh" not in page.read_text()
    refused = hpcsweep(0, "status", running, "--html", folder / "half.h5")
    assert refused.returncode == 2
    assert "is a results file" in refused.stderr


def test_a_file_of_many_names_is_escaped(folder, tmp_path):
    odd = tmp_path / "<i>.h5"
    shutil.copyfile(folder / "whole.h5", odd)
    assert "<i>" not in as_page([overview(odd)])


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


@pytest.mark.browser
def test_the_page_in_a_browser(browser, folder, tmp_path, monkeypatch):
    """A row a file, none wider than the window, the share as a bar; it comes again by itself."""
    monkeypatch.setattr("hpcsweep.campaign.overview.REFRESH", 1.0)
    rows = [overview(folder / name) for name in ("whole.h5", "half.h5", "text.h5")]
    path = tmp_path / "page.html"
    path.write_text(as_page([*rows, {**rows[1], "state": "running"}]))
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    errors: list[object] = []
    page.on("pageerror", lambda error: errors.append(error))
    page.on("console", lambda message: errors.append(message.text))
    page.goto(path.as_uri())
    states = page.locator("tbody tr td:nth-child(2)")
    assert states.all_inner_texts() == [
        "complete",
        "stopped",
        "unreadable",
        "running",
        "1 complete",
    ]
    wide = page.evaluate("[document.body.scrollWidth, document.body.clientWidth]")
    assert wide[0] <= wide[1]
    half = page.locator("tbody tr:nth-child(2) td.bar")
    shown = half.evaluate("one => getComputedStyle(one).backgroundSize")
    assert float(shown.split("%")[0]) == float(half.inner_text()) < 100
    path.write_text(as_page(rows))
    page.wait_for_function("document.querySelectorAll('tbody tr').length === 4")
    assert page.locator("meta[http-equiv]").count() == 0
    assert not errors
    page.close()
