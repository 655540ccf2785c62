"""Launchers: those that MPI does not know are refused, and no rank outlives its own."""

import os

import pytest
from tools import hpcsweep, refuse

from hpcsweep.parallel.stopping import LauncherLostError, StopFlag


def test_ranks_do_not_outlive_their_launcher(monkeypatch):
    monkeypatch.setattr(os, "getppid", lambda: 7)
    flag = StopFlag(launched=True)
    assert not flag.is_set()
    monkeypatch.setattr(os, "getppid", lambda: 1)
    assert flag.is_set()
    assert flag.reason == "the launcher died"
    monkeypatch.setattr("hpcsweep.parallel.stopping.LOST_GRACE", -1.0)
    with pytest.raises(LauncherLostError):
        flag.is_set()
    alone = StopFlag(launched=False)
    assert not alone.is_set()


@pytest.mark.parametrize(
    "variable",
    [
        "SLURM_STEP_NUM_TASKS",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMI_SIZE")
        ),
    ],
)
def test_a_launcher_that_mpi_does_not_know_is_refused_with_the_remedy(
    tmp_path, small_job, variable
):
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **{variable: "3"})
    refuse(done, "started 3 ranks", "sees 1", "mpirun", "srun --mpi=pmi2")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["small.toml"]


def test_mpich_under_open_mpis_launcher_is_refused_before_it_ends_the_process(tmp_path, small_job):
    place = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"}
    meeting = {"PMIX_NAMESPACE": "1", "PMIX_RANK": "0", "PMIX_SERVER_URI4": "none"}
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **place, **meeting)
    refuse(done, "started 2 ranks", "sees 1", "mpirun")
    silent = {**place, "OMPI_COMM_WORLD_RANK": "1"}
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **silent, **meeting)
    assert (done.returncode, done.stderr) == (2, "")
