"""Processes that bear a mark in their environment, and a watch that ends them.

`slurm_watch.py NAME=VALUE` waits for the end of its standard input, that is for the
process at the other end of the pipe to end, be it killed; then it kills what bears the mark.
"""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path


def marked(mark: str) -> set[int]:
    """Living processes, but for this one, that were started with NAME=VALUE in the environment."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with contextlib.suppress(OSError):
                state = (entry / "stat").read_text().rsplit(")", 1)[1].split()[0]
                variables = (entry / "environ").read_bytes().split(b"\0")
                if state not in "ZX" and mark.encode() in variables:
                    found.add(int(entry.name))
    return found


def kill(mark: str, seconds: float = 10.0) -> None:
    """Kill what bears the mark, until nothing does, and unlink the shared memory it had."""
    deadline = time.monotonic() + seconds
    segments = set()
    while (found := marked(mark)) and time.monotonic() < deadline:
        for pid in found:
            with contextlib.suppress(OSError):
                segments.update(re.findall(r"/dev/shm/\S+", Path(f"/proc/{pid}/maps").read_text()))
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.05)
    for segment in segments:
        Path(segment).unlink(missing_ok=True)


def watch(mark: str) -> subprocess.Popen:
    """Start a watch over this process; closing the watch's `stdin` ends what bears the mark too."""
    return subprocess.Popen(
        [sys.executable, __file__, mark], stdin=subprocess.PIPE, start_new_session=True
    )


if __name__ == "__main__":
    sys.stdin.buffer.read()
    kill(sys.argv[1])
