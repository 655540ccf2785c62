"""Every study gives the same bytes on one, two and three ranks.

The campaigns of a number of ranks are run one after the other by one `mpirun`: its ranks load their
libraries once.
"""

import faults
import numpy as np
import pytest
from tools import (
    ATTRACTORS,
    BASINS,
    GRID,
    RECORDS,
    SMALL,
    assert_same_datasets,
    datasets,
    hpcsweep,
    run_script,
)

STUDIES = {
    "amplitude_sweep": SMALL,
    "points": GRID,
    "attractors": ATTRACTORS,
    "basins": BASINS,
    "records": RECORDS,
}
EACH = """
import sys
from hpcsweep.commands import cli
for name in sys.argv[2:]:
    if code := cli.main(["run", f"{sys.argv[1]}/{name}.toml", "-o", f"{name}.h5"]):
        sys.exit(code)
"""
RANKS = (0, 2, 3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of every study, in a folder for each number of ranks."""
    folder = tmp_path_factory.mktemp("ranks")
    script = folder / "each.py"
    script.write_text(EACH)
    for name, text in STUDIES.items():
        (folder / f"{name}.toml").write_text(text)
    for ranks in RANKS:
        own = folder / str(ranks)
        own.mkdir()
        if ranks:
            done = run_script(ranks, script, folder, *STUDIES, cwd=own)
            assert done.returncode == 0, done.stderr
            continue
        for name in STUDIES:
            done = hpcsweep(0, "run", folder / f"{name}.toml", cwd=own)
            assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.mpi
@pytest.mark.parametrize("study", STUDIES)
def test_every_number_of_ranks_gives_the_same_bytes(folder, study):
    for ranks in RANKS:
        path = folder / str(ranks) / f"{study}.h5"
        assert_same_datasets(folder / "0" / f"{study}.h5", path)
        records = faults.records(path)
        (start,) = (record for record in records if record["kind"] == "start")
        assert start["ranks"] == max(ranks, 1)
    blocks = [record for record in records if record["kind"] == "block"]
    assert len({record["rank"] for record in blocks}) > 1


def test_another_job_gives_other_bytes(folder, tmp_path):
    control = tmp_path / "control.toml"
    control.write_text(STUDIES["amplitude_sweep"].replace("300.0", "300.0000001"))
    assert hpcsweep(0, "run", control, "-o", tmp_path / "control.h5").returncode == 0
    left, right = datasets(folder / "0" / "amplitude_sweep.h5"), datasets(tmp_path / "control.h5")
    assert not np.array_equal(left["final_state"], right["final_state"])
