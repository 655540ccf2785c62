"""Ctrl-C in a long call is heard soon: the work is done in pieces of bounded time."""

import contextlib
import functools
import os
import signal
import time

import numba
import pytest
from reference import reference_points
from tools import fork

import hpcsweep
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.trajectory import trajectory

SOON = 10.0
"""Seconds; on an idle machine it takes some hundredths, and a second is what is promised."""
CALLS = {
    "stroboscopic_points": "hpcsweep.stroboscopic_points(one, 0.3, 0.445, [0.0] * 2, 10**8)",
    "bdf": "hpcsweep.stroboscopic_points(one, 0.3, 0.445, [0.0] * 2, 10**8, 'bdf', 1e-6)",
    "advance": "flow.advance(z, 0.0987, 10**9)",
    "advance, slow periods": "slow.advance([0.0] * 20, 0.3, 10**9)",
    "observe": "flow.observe(z, 0.0987, 10**8, modal_norm=True, growth=True)",
    "settle": "flow.settle(z, 0.0987, 10**9, 400, -1.0, 1e-6)",
    "monodromy": "flow.monodromy(z, 0.0987, 10**9)",
    "reference": "reference_points(three, 0.06, 0.445, z, 10**8)",
    "trajectory": "trajectory(three, 1.0, 1e-4, z, 10**6)",
}
INSIDE = 0.1
"""Seconds of processor time after which a call is in the middle of its work."""


@functools.cache
def names() -> dict[str, object]:
    """Return what the calls use, loaded or compiled once for all processes."""
    one, three = hpcsweep.Structure(1), hpcsweep.Structure()
    flow, slow, z = FlowMap(three, 0.445), FlowMap(hpcsweep.Structure(10), 0.01), [0.0] * 6
    hpcsweep.stroboscopic_points(one, 0.3, 0.445, [0.0] * 2, 2)
    hpcsweep.stroboscopic_points(one, 0.3, 0.445, [0.0] * 2, 2, "bdf", 1e-6)
    flow.monodromy(z, 0.0987, 1)
    reference_points(three, 0.06, 0.445, z, 1)
    trajectory(three, 0.06, 0.445, z, 2)
    return {**globals(), **locals()}


def be_interrupted(call: str, pipe: int) -> None:
    """Call until Ctrl-C is heard; write what happens into a pipe."""
    # a shell that starts something in the background has it ignore Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.write(pipe, b"started\n")
    try:
        eval(call, names())
    except KeyboardInterrupt:
        os.write(pipe, b"heard\n")


def seconds_to_hear(call: str) -> float:
    """Start a call, interrupt it while it computes, and return how long it goes on."""
    names()
    end, pipe = os.pipe()
    with os.fdopen(end) as reported:
        pid = fork(functools.partial(be_interrupted, call, pipe))
        os.close(pipe)
        try:
            assert reported.readline() == "started\n"
            before = cpu_seconds(pid)
            while cpu_seconds(pid) < before + INSIDE:
                assert os.waitpid(pid, os.WNOHANG) == (0, 0), "the call has ended by itself"
                time.sleep(0.01)
            begun = time.monotonic()
            os.kill(pid, signal.SIGINT)
            assert reported.readline() == "heard\n"
            return time.monotonic() - begun
        finally:
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process: what says that it is inside the call."""
    with open(f"/proc/{pid}/stat") as file:  # noqa: PTH123
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="plain Python hears at once")
@pytest.mark.parametrize("name", CALLS)
def test_a_long_call_hears_ctrl_c(name):
    assert seconds_to_hear(CALLS[name]) < SOON


if __name__ == "__main__":  # the real figures
    for name, call in CALLS.items():
        print(f"{name}: {max(seconds_to_hear(call) for _ in range(3)):.3f} s", flush=True)
