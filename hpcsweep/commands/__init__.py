"""The commands of `hpcsweep.commands.cli`, one module each.

Every module has ``add_to(commands)``, which adds its parser, and a function that does the work and
returns the exit code. What is slow to import is imported when it is used.
"""

import argparse
from pathlib import Path

USER_ERROR, FAILURE = 2, 1
RAW = argparse.RawDescriptionHelpFormatter


def complain(message: str, rank: int | None = None) -> None:
    """Say on one line, from one rank, what was wrong."""
    from hpcsweep.campaign.progress import say_line
    from hpcsweep.parallel.mpi import launched_rank

    if (launched_rank() if rank is None else rank) == 0:
        say_line(f"hpcsweep: error: {message}")


def whole_number(least: int, most: int | None = None):
    """Make the conversion of an argument that must be a whole number from `least` to `most`."""

    def convert(text: str) -> int:
        value = int(text)
        if value < least or (most is not None and value > most):
            limit = f"at least {least}" if most is None else f"from {least} to {most}"
            raise argparse.ArgumentTypeError(f"must be {limit}, is {text}")
        return value

    convert.__name__ = "whole number"
    return convert


def file_name(text: str) -> Path:
    """Convert an argument that must name a file."""
    if not text:
        raise argparse.ArgumentTypeError("must not be empty")
    return Path(text)


def positive(text: str) -> float:
    """Convert an argument that must be a finite number greater than 0."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be greater than 0, is {text}")
    return value
