"""What calls within the kernels of the flow map hand over.

A plain kernel that LLVM does not make part of its caller gets a placed tuple as three addresses
(`kernels.arena`). As its values, 250 to 470 words on the stack, that took as long as what most such
kernels do.
"""

import pickle
import platform
import shutil
import subprocess
from pathlib import Path

import numba
import pytest

from hpcsweep.kernels.compile import entry_points
from hpcsweep.kernels.compile.cache import SUFFIX, cache_folder
from hpcsweep.kernels.folders import read_verified
from hpcsweep.solvers import flow
from hpcsweep.solvers.flow.orbit.batch import follow_orbits

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)
if platform.machine() not in ("x86_64", "AMD64"):
    pytest.skip("reads the machine code of x86-64", allow_module_level=True)

MOST = 60
"""Words; a state, a part of a step and some arrays."""
MOST_OF_A_RUN = 100
"""And the arrays of all that is stored of a run."""
KERNELS = [one for one in entry_points.ALL if one.name.startswith(flow.__name__)]


def words_on_the_stack(kernel, folder: Path) -> int:
    """Give the most words that are pushed for one call, by the machine code in the cache."""
    kernel.load()
    most = 0
    for path in cache_folder().rglob(f"{kernel.__name__}-*{SUFFIX}"):
        (_, _, (code, _)), *_ = pickle.loads(read_verified(path))
        (folder / "kernel.o").write_bytes(code)
        listing = subprocess.run(
            ["objdump", "--disassemble", "--no-show-raw-insn", folder / "kernel.o"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        pushed = 0
        for line in listing.splitlines():
            instruction = line.partition("\t")[2]
            if instruction.startswith("push"):
                pushed += 1
            elif instruction.startswith("call"):
                most, pushed = max(most, pushed), 0
            elif not instruction or instruction.startswith(("j", "ret")):
                pushed = 0
    assert "call" in listing
    return most


@pytest.mark.slow
def test_calls_hand_over_little(tmp_path):
    if not shutil.which("objdump"):
        pytest.skip("no objdump to read machine code with: install binutils")
    for kernel in KERNELS:
        # a run hands over the rows that it fills, once in hundreds of periods
        most = MOST_OF_A_RUN if kernel is follow_orbits else MOST
        assert words_on_the_stack(kernel, tmp_path) <= most, kernel.name
