"""hpcsweep with blocks that take a given time each: paced.py SECONDS ARGUMENT..."""

import sys
import time

from hpcsweep.commands import cli
from hpcsweep.studies.sweep.runs import FrameRuns

SLICE = 0.002
"""Seconds between two polls: the master serves the others meanwhile."""


def main() -> int:
    """Wait out what a block's seconds leave over."""
    seconds, compute = float(sys.argv[1]), FrameRuns.follow

    def paced(runs, amplitudes, state, poll):
        begun = time.monotonic()
        result = compute(runs, amplitudes, state, poll)
        while time.monotonic() < begun + seconds:
            poll()
            time.sleep(SLICE)
        return result

    FrameRuns.follow = paced
    return cli.main(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
