"""What calls within the kernels of the flow map hand over.

A plain kernel that LLVM does not make part of its caller gets a placed tuple as three addresses
(`kernels.arena`). As its values, 250 to 470 words on the stack, that took as long as what most such
kernels do.
"""

import platform

import numba
import pytest

from hpcsweep.kernels.compile import entry_points
from hpcsweep.kernels.compile.inline import KernelDispatcher
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


def words_on_the_stack(kernel) -> int:
    """Compile a kernel anew; give the most words that are pushed for one call."""
    for one in entry_points.ALL:
        one.load()
    (signature,) = kernel.dispatcher.signatures
    fresh = KernelDispatcher(kernel.py_func, kernel.dispatcher.targetoptions)
    fresh.compile(signature)
    assembly = fresh.overloads[signature].library.get_asm_str()
    most = pushed = 0
    for line in assembly.splitlines():
        instruction = line.split(maxsplit=1)[0] if line.strip() else ""
        if instruction.startswith("push"):
            pushed += 1
        elif instruction in ("call", "callq"):
            most, pushed = max(most, pushed), 0
        elif instruction.endswith(":"):
            pushed = 0
    return most


@pytest.mark.slow
@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.name.rpartition(".")[2])
def test_calls_hand_over_little(kernel):
    # a run hands over the rows that it fills, once in hundreds of periods
    most = MOST_OF_A_RUN if kernel is follow_orbits else MOST
    assert words_on_the_stack(kernel) <= most
