"""The script that compares pounding of buildings that yield with that of elastic ones."""

import subprocess
import sys

import numpy as np
import pytest
from tools import JOBS, hpcsweep

import hpcsweep as package


@pytest.mark.slow
def test_what_is_told_alone_is_the_building_that_yields_alone(tmp_path):
    job = JOBS / "earthquakes" / "yielding-pounding-spectra.toml"
    few = {
        'vary."building[0].period"': "[0.4, 1.2]",
        'vary."building[1].period"': "[0.5, 1.5]",
        'vary."pounding.gap"': "[0.02, 10.0]",
        "records.synthetic": "{count = 2, seed = 1, duration = 10.0, rms = 1.0}",
    }
    given = [part for key, value in few.items() for part in ("--set", f"{key}={value}")]
    strong = [part for k in (0, 1) for part in ("--set", f"building[{k}].yield_force=1e9")]
    for name, more in (("yielding", []), ("elastic", strong)):
        done = hpcsweep(0, "run", job, *given, *more, "-o", f"{name}.h5", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    script = str(JOBS / "earthquakes" / "yielding_spectra.py")
    command = [sys.executable, script, "yielding.h5", "elastic.h5"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "yielding-spectra.png").exists()
    alone = [
        package.response(
            package.Building(
                [1e6], period=T, yield_force=1.5e6, hardening=0.02, damping_ratio=0.03
            ).structure,
            record,
            2.0,
            tail=20.0,
        ).ductility[0]
        for record in package.synthetic_records(2, seed=1, duration=10.0, rms=1.0)
        for T in (0.4, 1.2, 0.5, 1.5)
    ]
    assert f"records times 2, ductility {np.median(alone):.1f} alone in the median" in done.stdout
