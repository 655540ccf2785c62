"""Ranks: the only module that imports mpi4py, and only inside functions.

A serial run is a communicator of size 1 that needs no MPI. The launcher's environment says whether
there is more than one rank, so that a program started alone never initialises MPI.
"""

import array
import atexit
import contextlib
import fcntl
import os
import stat
import sys
import termios
import time
import warnings
from collections.abc import Callable
from typing import Any

from hpcsweep.parallel.one_line import on_one_line

SRUN = "SLURM_STEP_NUM_TASKS"
"""A variable of srun, also in a shell that it started."""

LAUNCHER_SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", SRUN, "MV2_COMM_WORLD_SIZE")
"""Variables in which launchers (MPICH's hydra, Open MPI, srun, MVAPICH) give the job's size."""

HYDRA = "MPI_LOCALNRANKS"
"""A variable that only Hydra sets."""

SLEEP = 5e-4
"""Seconds for which a rank that waits sleeps: little to a block of runs, no load of its core."""
LET_OUT_SECONDS = 5.0
"""Longest wait (s) for the launcher to read a rank's output before an abort ..."""
PASS_ON_SECONDS = 0.1
"""... and to pass it on."""


class LauncherError(RuntimeError):
    """Raised where the launcher and mpi4py's MPI do not match; the message is one line."""


class Serial:
    """A communicator of size 1."""

    rank = 0
    size = 1
    raw: Any = None
    library = "none (one rank)"

    def bcast(self, value):
        """Return rank 0's value."""
        return value

    def gather(self, value):
        """Return every rank's value on rank 0, None elsewhere."""
        return [value]

    def barrier(self) -> None:
        """Wait for all ranks."""

    def node_rank(self) -> int:
        """Return the rank within the node."""
        return 0

    def receive(self):
        """Return (rank, value) of a waiting message, or None if there is none."""

    def abort(self, code: int) -> None:
        """Abort all ranks at once."""
        raise SystemExit(code)

    def leave(self, code: int) -> int:
        """Finalize MPI in good order (collective); return the exit code of the job."""
        return code


def _let_out() -> None:
    """Wait until the launcher has read this rank's output: after an abort it may not."""
    deadline = time.monotonic() + LET_OUT_SECONDS
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
        with contextlib.suppress(OSError, ValueError):
            if stat.S_ISFIFO(os.fstat(stream.fileno()).st_mode):
                unread = array.array("i", [1])
                while unread[0] > 0 and time.monotonic() < deadline:
                    fcntl.ioctl(stream.fileno(), termios.FIONREAD, unread)
                    time.sleep(0.001)
    time.sleep(PASS_ON_SECONDS)


class Ranks:
    """The ranks of an MPI job; methods as `Serial`.

    A waiting rank sleeps: MPI's own waits keep a core busy and signals unheard.
    """

    def __init__(self, mpi, comm):
        self._mpi = mpi
        self.raw = comm
        self.rank = comm.Get_rank()
        self.size = comm.Get_size()
        self.library = mpi.Get_library_version().strip().split("\n")[0].rstrip("\x00")

    def bcast(self, value):
        """Return rank 0's value."""
        self.barrier()
        return self.raw.bcast(value, root=0)

    def gather(self, value):
        """Return every rank's value on rank 0, None elsewhere."""
        self.barrier()
        return self.raw.gather(value, root=0)

    def barrier(self) -> None:
        """Wait for all ranks."""
        arrived = self.raw.Ibarrier()
        while not arrived.Test():
            time.sleep(SLEEP)

    def node_rank(self) -> int:
        """Return the rank within the node."""
        node = self.raw.Split_type(self._mpi.COMM_TYPE_SHARED)
        rank = node.Get_rank()
        node.Free()
        return rank

    def send(self, value, rank: int) -> None:
        """Send a (small) value to another rank."""
        self.raw.send(value, dest=rank)

    def receive(self):
        """Return (rank, value) of a waiting message, or None if there is none."""
        status = self._mpi.Status()
        if not self.raw.iprobe(source=self._mpi.ANY_SOURCE, status=status):
            return None
        source = status.Get_source()
        return source, self.raw.recv(source=source)

    def abort(self, code: int) -> None:
        """Abort all ranks at once."""
        _let_out()
        self.raw.Abort(code)
        # where it returns, MPI must not be finalised: messages are in flight
        os._exit(code)

    def leave(self, code: int) -> int:
        """Return the exit code of the job (collective); may abort all ranks with it.

        Where a rank ends with a code other than 0, Hydra, MPICH's launcher, kills the remaining
        ranks and then returns 9 one time in three; after ``MPI_Abort`` it always returns that code.
        Nothing is lost: all ranks have closed their files before.
        """
        if code != 0 and self.size > 1 and HYDRA in os.environ:
            self.barrier()
            _let_out()
            self.barrier()
            if self.rank == 0:
                # MPICH prints that it was aborted, which the user knows
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
                self.raw.Abort(code)
            self.barrier()
        return code


def on_master(comm, action: Callable[[], Any], *errors: type[Exception]) -> Any:
    """Return on every rank what an action returns on rank 0; raise its errors there (collective).

    Parameters
    ----------
    comm : Serial or Ranks
    action : callable
        Called on rank 0.
    *errors
        Those that are raised on every rank; others on rank 0 alone.
    """
    value = problem = None
    if comm.rank == 0:
        try:
            value = action()
        except errors as error:
            problem = error
    value, problem = comm.bcast((value, problem))
    if problem is not None:
        raise problem
    return value


def launched_size() -> int:
    """Return the number of ranks the launcher says it started, 1 if there was none."""
    return _launched(LAUNCHER_SIZES, 1)


def _launched(names: tuple[str, ...], otherwise: int) -> int:
    """Return the first of these variables that a launcher has set to a number."""
    for name in names:
        value = os.environ.get(name, "")
        if value.isdigit() and not (name == SRUN and _in_shell()):
            return int(value)
    return otherwise


def _in_shell() -> bool:
    """Return whether this process belongs to a shell on a terminal.

    Of ``srun --pty bash`` it has the variables, but it is the shell that is the rank; what srun
    starts itself leads its session (the rank with the terminal) or has no terminal.
    """
    try:
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY))
    except OSError:
        return False
    return os.getsid(0) != os.getpid()


def world() -> Serial | Ranks:
    """Return the communicator of all ranks.

    Raises
    ------
    LauncherError
        If the launcher started several processes that MPI does not see as ranks of one job:
        each would take itself to be alone and write the same file.
    """
    expected = launched_size()
    if expected <= 1:
        return Serial()
    import mpi4py

    mpi4py.rc.recv_mprobe = False
    mpi4py.rc.initialize = False
    try:
        with warnings.catch_warnings():
            # mpi4py detects some mismatches too; the message below is one line and names the remedy
            warnings.simplefilter("ignore", RuntimeWarning)
            from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise LauncherError(
            f"the launcher started {expected} ranks but MPI cannot be loaded "
            f"({on_one_line(error)}); install an MPI that mpi4py finds, e.g. pip install mpich"
        ) from None
    library = on_one_line(MPI.Get_library_version().split("\n")[0].rstrip("\x00"))
    if "OMPI_COMM_WORLD_SIZE" in os.environ and "Open MPI" not in library:
        # before MPI starts: MPICH ends the process when it meets Open MPI's launcher
        raise _mismatch(expected, library, 1)
    if not MPI.Is_initialized():
        MPI.Init_thread()
        atexit.register(_finalize, MPI)
    if MPI.COMM_WORLD.Get_size() != expected:
        raise _mismatch(expected, library, MPI.COMM_WORLD.Get_size())
    return Ranks(MPI, MPI.COMM_WORLD)


def _mismatch(expected: int, library: str, seen: int) -> LauncherError:
    return LauncherError(
        f"the launcher started {expected} ranks but mpi4py's MPI ({library}) sees {seen}: start "
        "with the mpirun of that MPI, or under Slurm with srun --mpi=pmi2 (MPICH) or "
        "srun --mpi=pmix (Open MPI)"
    )


def _finalize(mpi) -> None:
    if not mpi.Is_finalized():
        mpi.Finalize()


def open_file(path):
    """Open a file for MPI-IO on this rank alone, so that no call waits for another rank."""
    from mpi4py import MPI

    return MPI.File.Open(MPI.COMM_SELF, str(path), MPI.MODE_RDWR)


def launched_rank() -> int:
    """Return this process's rank as the launcher says, 0 if there was none."""
    names = "PMI_RANK", "OMPI_COMM_WORLD_RANK", "SLURM_PROCID", "MV2_COMM_WORLD_RANK"
    return _launched(names, 0)
