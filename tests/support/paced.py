"""hpcsweep with blocks that take a given time each: paced.py SECONDS ARGUMENT..."""

import sys
import time

from hpcsweep.commands import cli
from hpcsweep.studies.sweep import amplitude_sweep as sweep

SLICE = 0.002
"""Seconds between two polls: the master serves the others meanwhile."""


def main() -> int:
    """Wait out what a block's seconds leave over."""
    seconds, compute = float(sys.argv[1]), sweep.sweep_block

    def paced(structure, omega, amplitudes, state, settings, poll):
        begun = time.monotonic()
        result = compute(structure, omega, amplitudes, state, settings, poll)
        while time.monotonic() < begun + seconds:
            poll()
            time.sleep(SLICE)
        return result

    sweep.sweep_block = paced
    return cli.main(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
