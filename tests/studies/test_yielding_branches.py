"""Branches through the motions of structures that yield: what the file tells."""

import numpy as np
import pytest
from tools import made

from hpcsweep import open_results
from hpcsweep.dynamics.classify import Shakedown
from hpcsweep.dynamics.continuation.events import Kind

SWEEP = """
[structure]
matrices = {mass = [1.0], stiffness = [[0.1]], damping = [[0.04]]}
[[structure.slider]]
direction = [1.0]
stiffness = 0.9
strength = 0.9
name = "spring"
[sweep]
omega = 0.8
amplitude = [0.2, 0.3, 0.42]
transient_cycles = 200
"""
BRANCHES = """
[study]
kind = "branches"
[branches]
seeds = "{seeds}"
largest_step = 0.3
steps = 200
max_points = 800
"""


@pytest.mark.slow
def test_all_motions_of_a_sweep_lie_on_one_branch_of_families(tmp_path):
    """On the way down p stays behind: those orbits are of the families that the way up passes."""
    swept = made(SWEEP + 'directions = ["up", "down"]\n', tmp_path / "swept.h5")
    path = made(BRANCHES.format(seeds=swept) + SWEEP, tmp_path / "branches.h5")
    left, line = open_results(swept), open_results(path).isel(direction=0, line=0, amplitude=0)
    down = left["final_state"].sel(direction="down").values[0, :2, 2]
    assert np.abs(down).max() > 1e-3
    assert (int(line["n_seeds"]), int(line["n_covered"]), int(line["n_branches"])) == (6, 6, 1)
    held = line["step_branch"].values > 0
    yields = line["shakedown"].values[held] == Shakedown.PLASTIC
    assert yields.tolist() == (line["ductility"].values[held, 0] > 1.0 + 1e-9).tolist()
    told = line["special_kind"].values[:2].tolist()
    assert told == [Kind.SLIP, 0]
    assert int(line["change"].values[0]) == 2
