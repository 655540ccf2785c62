"""`hpcsweep` for the tests of faults: quick_commits.py SECONDS ARGUMENT...

It writes checksums every so many seconds: a campaign flushes every `SYNC_INTERVAL` seconds, which
is longer than the campaigns of these tests last. ``HPCSWEEP_TEST_ORPHAN_WAIT`` shortens the wait
for orphaned ranks. ``HPCSWEEP_TEST_FILE_LIMIT`` ends the room on the disk: no file grows beyond
that many bytes, from the moment MPI, which has files of its own, has started.
"""

import os
import resource
import signal
import sys

from hpcsweep.commands import cli
from hpcsweep.parallel import mpi
from hpcsweep.store import commit, lock


def limit_files(size: int) -> None:
    """Limit the size of files once the communicator is there."""
    world = mpi.world

    def world_then_limit():
        comm = world()
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        return comm

    mpi.world = world_then_limit


if __name__ == "__main__":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # which tests send, also tests under nohup
    commit.SYNC_INTERVAL = float(sys.argv[1])
    lock.ORPHAN_WAIT = float(os.environ.get("HPCSWEEP_TEST_ORPHAN_WAIT", lock.ORPHAN_WAIT))
    if "HPCSWEEP_TEST_FILE_LIMIT" in os.environ:
        limit_files(int(os.environ["HPCSWEEP_TEST_FILE_LIMIT"]))
    sys.exit(cli.main(sys.argv[2:]))
