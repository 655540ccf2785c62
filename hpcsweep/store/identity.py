"""Whether a file is still the one that was opened."""

import os
from pathlib import Path

from hpcsweep.store.layout import WriteError
from hpcsweep.store.offsets import open_above


class Identity:
    """Which file lies under a name: what is written into one that was removed is lost."""

    def __init__(self, path: Path):
        self._path = path
        self._descriptor = open_above(path, os.O_RDONLY)
        self._size = os.fstat(self._descriptor).st_size

    def check(self) -> None:
        """Make sure that the file is the one that was opened, under its name and whole.

        Raises
        ------
        WriteError
        """
        if self._descriptor < 0:
            return
        mine = os.fstat(self._descriptor)
        try:
            there = self._path.stat()
        except OSError:
            there = None
        if there is None or (mine.st_dev, mine.st_ino) != (there.st_dev, there.st_ino):
            what = "removed, renamed or replaced"
        elif mine.st_size < self._size:
            what = "cut short"
        else:
            return
        raise WriteError(
            f"{self._path}: was {what} while it was being written; what was computed is not in it"
        )

    def close(self) -> None:
        """Forget the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
