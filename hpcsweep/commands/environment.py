"""Prepare the environment of a command: closed or full standard streams, unusable folders.

`prepare` is called first. A closed stream would leave its descriptor to the next opened file, and
printed text would then be written into the results.
"""

import contextlib
import os
import resource
import sys

from hpcsweep.campaign.progress import note
from hpcsweep.commands import CommandError
from hpcsweep.kernels import folders
from hpcsweep.parallel.mpi import launched_rank

LONGEST_DATE = 12
LEAST_SPACE = 500e6
"""Of addresses (bytes) for a small run with its libraries: with less some never end loading."""


def prepare() -> None:
    """Make the standard streams usable, and check variables and the cache of compiled kernels.

    Raises
    ------
    CommandError
        If SOURCE_DATE_EPOCH, which numpy and matplotlib read, is no time, or memory is limited to
        less than `LEAST_SPACE`.
    """
    _open_streams()
    space = resource.getrlimit(resource.RLIMIT_AS)[0]
    if space != resource.RLIM_INFINITY and space < LEAST_SPACE:
        limit = f"must be {LEAST_SPACE / 1024:.0f} kB at least, is {space // 1024}"
        raise CommandError(f"the limit of memory (ulimit -v) {limit}")
    date = os.environ.get("SOURCE_DATE_EPOCH", "0")
    if not (date.isascii() and date.isdigit() and len(date) < LONGEST_DATE):
        limit = f"must be seconds since 1970, a whole number of fewer than {LONGEST_DATE} digits"
        raise CommandError(f"environment variable SOURCE_DATE_EPOCH = {date!r}: {limit}")
    _look_at_cache()


def _open_streams() -> None:
    """Open closed standard streams on the null device."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor: this one
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", closefd=False))
        # file names need not be valid text
        with contextlib.suppress(AttributeError, OSError):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def _look_at_cache() -> None:
    """Report where kernels will be cached if not in the usual folder, which is still read."""
    if launched_rank() == 0:
        folders.set_printer(note)
        folders.is_writable()
    else:
        folders.set_printer(folders.say_nothing)
