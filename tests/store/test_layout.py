"""Files of another layout are refused; the job in a file gives the file again."""

import h5py
import pytest
from tools import assert_same_datasets, hpcsweep

from hpcsweep.store.layout import LAYOUT_VERSION


@pytest.mark.parametrize("version", [1, LAYOUT_VERSION + 1])
def test_another_layout_is_refused_with_both_numbers_and_who_reads_it(tmp_path, small_job, version):
    path = tmp_path / "other.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    with h5py.File(path, "r+") as file:
        file.attrs["layout_version"] = version
        file.attrs["hpcsweep_version"] = "9.8.7"
    for command in (("status",), ("plot",), ("run", small_job, "-o")):
        done = hpcsweep(0, *command, path, cwd=tmp_path)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        expected = f"layout version {version}, which hpcsweep 9.8.7 reads; this one reads version"
        assert f"{expected} {LAYOUT_VERSION}" in done.stderr


def test_the_job_written_back_out_of_the_file_gives_equal_data(tmp_path, small_job):
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    assert hpcsweep(0, "run", small_job, "-o", first).returncode == 0
    shown = hpcsweep(0, "status", first, "--job")
    assert shown.returncode == 0
    assert shown.stdout == small_job.read_text()
    back = tmp_path / "back.toml"
    back.write_text(shown.stdout)
    assert hpcsweep(0, "run", back, "-o", second).returncode == 0
    assert_same_datasets(first, second)
    both = hpcsweep(0, "status", first, "--job", "--json")
    assert both.returncode == 2
    assert "not allowed with" in both.stderr
