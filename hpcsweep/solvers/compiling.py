"""Say that kernels are compiled, and how many are left: 3 to 5 s of processor time each, once."""

import sys
import time
from collections.abc import Callable
from typing import Any

from hpcsweep.kernels.compile.warm import load_all, missing

SILENCE = 10.0
"""Seconds between two lines."""


def announced(say: Callable[[str], None], kernels: str) -> Callable[[int, int], None]:
    """Return a callback that reports the progress of compilation, at its start and now and then."""
    last = time.monotonic()

    def tell(done: int, total: int) -> None:
        nonlocal last
        if done == 0:
            say(f"compiling {total} {kernels}, once for this type of processor: 3 to 5 s each")
        elif done < total and time.monotonic() - last >= SILENCE:
            last = time.monotonic()
            say(f"compiled {done} of {total} {kernels}")

    return tell


def load_aloud(wanted: list[Any]) -> None:
    """Load kernels, and say it on standard error if some have to be compiled."""
    if missing(wanted):
        load_all(wanted, announced(_print, "kernels"))


def _print(text: str) -> None:
    print(f"hpcsweep: {text}", file=sys.stderr, flush=True)
