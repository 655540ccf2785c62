"""A share of `bash benchmarks/run.sh kill_campaign`, and what it must see."""

from pathlib import Path

import faults
import kill_campaign
import pytest
from tools import SMALL


@pytest.mark.slow
@pytest.mark.mpi
def test_a_share_of_the_kill_campaign(capsys):
    kinds = ["disk full", "bit flipped", "orphaned rank"]  # for others see tests/campaign
    chosen = [argument for kind in kinds for argument in ("--kind", kind)]
    code = kill_campaign.main(["--runs", str(len(kinds)), "--seed", "11", *chosen])
    printed = capsys.readouterr().out
    assert code == 0, printed
    assert f"{len(kinds)} of {len(kinds)} passed" in printed
    for kind in kinds:
        assert kind in printed


@pytest.mark.slow
def test_the_kill_campaign_sees_damage(tmp_path):
    """It must be able to fail: a block that was computed again, a value that differs."""
    job = tmp_path / "small.toml"
    job.write_text(SMALL)
    reference = kill_campaign.make_reference(job, tmp_path / "whole.h5")
    total = len(faults.valid(tmp_path / "whole.h5"))
    name = next(name for name, values in reference["datasets"].items() if values.size)
    reference["datasets"][name] = reference["datasets"][name] ^ 1
    (tmp_path / "run").mkdir()
    run = kill_campaign.Run("kill rank", "pwrite", 1, 3)
    patient = kill_campaign.Patient(run, job, tmp_path / "run", reference, total + 1)
    Path(f"{patient.path}.new").write_text("left by somebody else")
    Path(f"{patient.path}.other").write_text("left by somebody else")
    patient.go_on()
    said = " | ".join(run.problems)
    assert f"differs from the uninterrupted run in ['{name}']" in said
    assert f"{total} blocks computed, {total + 1} missing" in said
    assert "left behind: ['campaign.h5.other']" in said
