"""
A campaign that is killed, and resumed
======================================

Whatever ends a run (a time limit, a power cut, ``kill -9``), what was committed to the file stays,
and the next start goes on from there, on any number of ranks. The results equal those of an
uninterrupted run to the last bit.
"""

import subprocess
import time
from pathlib import Path

from shell import shell

import hpcsweep

Path("campaign.toml").write_text("""\
[structure]
n_floors = 3
stiffness_ratio = 1000.0

[sweep]
omega = {from = 0.3, to = 0.7, count = 8}
amplitude = {from = 0.01, to = 0.3, count = 100}

[solver]
skip = "none"    # every period is integrated, so that there is something to kill

[output]
poincare = false
block = 10
""")

# %%
# Start it, wait until something is committed, and kill it without warning.
campaign = subprocess.Popen(
    ["hpcsweep", "run", "campaign.toml", "-o", "killed.h5"], stderr=subprocess.DEVNULL
)


def committed() -> int:
    """Return how many runs are in the file."""
    if not Path("killed.h5").exists():
        return 0
    return int((hpcsweep.open_results("killed.h5").outcome > 0).sum())


while committed() < 200:
    time.sleep(0.05)
campaign.kill()
campaign.wait()
print(committed(), "runs survive")

# %%
# Resume it on two ranks, and compute it once more without interruption.
shell("mpirun -n 2 hpcsweep run campaign.toml -o killed.h5")
shell("hpcsweep run campaign.toml -o whole.h5")
killed, whole = hpcsweep.open_results("killed.h5"), hpcsweep.open_results("whole.h5")
print("equal to the last bit:", all(killed[name].equals(whole[name]) for name in whole))
