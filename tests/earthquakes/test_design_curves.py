"""The script that draws responses against a varied key, and what its two jobs are to show."""

import subprocess
import sys

import numpy as np
import pytest
from tools import JOBS, hpcsweep

import hpcsweep as package


def drawn(folder, *arguments):
    """Run the script."""
    script = str(JOBS / "earthquakes" / "design_curves.py")
    command = [sys.executable, script, *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


@pytest.mark.slow
def test_the_best_strength_of_a_damper_grows_with_the_shaking(tmp_path):
    text = (JOBS / "earthquakes" / "friction-damper.toml").read_text()
    text = text.replace("count = 20, seed = 1, duration = 30.0", "count = 3, seed = 1")
    text = text.replace("values = [1.0, 2.0, 3.0]", "values = [1.0, 2.0]")
    text = text.replace(
        "{from = 4e4, to = 1.6e6, count = 40}", "{from = 1e5, to = 1e6, count = 10}"
    )
    (tmp_path / "few.toml").write_text(text)
    assert hpcsweep(0, "run", "few.toml", cwd=tmp_path).returncode == 0
    asked = ["few.h5", "--over", "slider_0_strength", "--by", "scale", "--show"]
    done = drawn(tmp_path, *asked, "storey_drift", "floor_acceleration=3", "-o", "few.png")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "few.png").stat().st_size > 10_000
    results = package.open_results(tmp_path / "few.h5")
    drift = results.storey_drift.max("storey").values  # strength, record, scale
    median = np.sort(drift, axis=1)[:, 1]
    weak, strong = median.argmin(axis=0)
    assert 0 < weak < strong < 9
    best = [f"least median {median[i, k]:.4g}" for k, i in ((0, weak), (1, strong))]
    lines = done.stdout.splitlines()
    assert [words in line for words, line in zip(best, lines, strict=False)] == [True, True]
    assert lines[0].startswith("peak drift, largest of all storeys  [m], PGA = 1 m/s²: least")
    refused = drawn(tmp_path, *asked, "storey_drift=9", "-o", "no.png")
    assert refused.returncode == 1
    assert refused.stderr == "--show storey_drift=9: must be one of 1, 2, 3\n"
    assert not (tmp_path / "no.png").exists()
