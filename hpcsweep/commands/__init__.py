"""The commands of `hpcsweep.commands.cli`, one module each.

The help of a command is the docstring of its module: a line for the list of all, a description, and
examples. Beside it there are ``configure(parser)``, which adds the options, and ``run(options)``,
which returns the exit code. Slow modules are imported when they are used.
"""

import argparse
import contextlib
import traceback
from collections.abc import Iterable, Iterator
from typing import Any

from hpcsweep.figures.options import file_name

USER_ERROR, FAILURE = 2, 1
Rows = Iterator[tuple[str, str]]
"""Names and texts of a table."""
NO_MEMORY = "there is not enough memory for this"
WIDEST = 34
"""Letters of the longest name beside its text; a longer one has a line of its own."""


class CommandError(ValueError):
    """A command cannot do what it was given; one line for the user."""


def listing(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Format rows of a name and a text, each in a column of its own, under a title."""
    rows = list(rows)
    width = max((len(name) for name, _ in rows if len(name) <= WIDEST), default=0)
    rows = [(name + f"\n  {'':{width}}" * (len(name) > WIDEST), text) for name, text in rows]
    return "\n".join([title, *(f"  {name:<{width}}  {text}".rstrip() for name, text in rows)])


def complain(message: str, rank: int | None = None) -> None:
    """Print an error on one line, whatever names are in it, from one rank."""
    from hpcsweep.campaign.progress import say_line
    from hpcsweep.parallel.mpi import launched_rank

    if (launched_rank() if rank is None else rank) == 0:
        shown = (letter if letter.isprintable() else repr(letter)[1:-1] for letter in message)
        say_line(f"hpcsweep: error: {''.join(shown)}")


def lacks_memory(error: BaseException) -> bool:
    """Return whether an error is that memory is not enough, for data or for a library."""
    words = "failed to map segment", "cannot allocate memory"
    return isinstance(error, MemoryError) or any(word in str(error).lower() for word in words)


def abort(comm, error: Exception) -> int:
    """Print the traceback of an error, or the line of one of memory, and end all ranks."""
    from hpcsweep.campaign.progress import say_line

    where = f" on rank {comm.rank}" if comm.size > 1 else ""
    if lacks_memory(error):
        complain(NO_MEMORY, 0)
    else:
        say_line(f"hpcsweep: failed{where}:\n{traceback.format_exc()}")
    comm.abort(FAILURE)
    return FAILURE


class AtAction(argparse.Action):
    """Collect ``KEY=VALUE`` of ``--at`` in a dict: numbers as numbers, words as words."""

    def __call__(self, parser, namespace, values, option_string=None):
        """Add one pair."""
        name, equals, text = str(values).partition("=")
        if not (name.strip() and equals and text.strip()):
            parser.error(f"{option_string} {values}: must be KEY=VALUE")
        value: float | str = text.strip().strip('"')
        with contextlib.suppress(ValueError):
            value = float(value)
        getattr(namespace, self.dest)[name.strip()] = value


def add_file(parser: argparse.ArgumentParser, output: str = "", meaning: str = "") -> None:
    """Add the results file of a command, and ``-o`` where it writes an `output`, `told` in help."""
    parser.add_argument("file", type=file_name, metavar="FILE")
    if output:
        parser.add_argument("-o", "--output", type=file_name, metavar=output, help=meaning)


def add_job(parser: argparse.ArgumentParser, name: str = "job", **arguments: Any) -> None:
    """Add a job, or several, and ``--set`` to the parser of a command that reads it."""
    parser.add_argument(name, type=file_name, metavar="JOB.toml", help="the job file", **arguments)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="TABLE.KEY=VALUE",
        help="replace what the job file gives, the value in TOML: structure.stiffness_ratio=100; "
        "may be given more than once",
    )


def add_at(parser: argparse.ArgumentParser, default: str = "the first values") -> None:
    """Add ``--at`` to the parser of a command that shows one part of a file, or `default`."""
    parser.add_argument(
        "--at",
        action=AtAction,
        default={},
        metavar="KEY=VALUE",
        help=f"value of a key that the job varies; may be given several times (default: {default})",
    )
