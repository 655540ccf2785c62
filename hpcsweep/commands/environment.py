"""Prepare the environment of a command: closed or full standard streams, unusable folders.

`prepare` is called first. A closed stream would leave its descriptor to the next opened file, and
printed text would then be written into the results.
"""

import contextlib
import os
import sys

from hpcsweep.campaign.progress import note
from hpcsweep.kernels import folders
from hpcsweep.parallel.mpi import launched_rank


def prepare() -> None:
    """Make the standard streams usable, and check the cache of compiled kernels."""
    _open_streams()
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
