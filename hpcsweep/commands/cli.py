"""The command line: all commands of `hpcsweep.commands`.

Parameter studies of base-excited structures impacting a rigid stop.

Start it under mpirun or srun to use many ranks; otherwise it runs as one.

examples:
  hpcsweep new study.toml                       write a job to start from
  hpcsweep describe study.toml                  modes, units, grazing amplitude, number of runs
  mpirun -n 4 hpcsweep run jobs/paper/figure3.toml    compute, or resume, figure3.h5
  hpcsweep status figure3.h5                    how far it is, also while it runs
  hpcsweep validate figure3.h5                  is it sound? checksums, values, a recomputed sample
  hpcsweep summary figure3.h5                   what it cost, what kinds of motion it found
  hpcsweep plot figure3.h5 -o figure3.png       draw the orbit diagram
  mpirun -n 4 hpcsweep animate map.h5 -o m.mp4  film the orbit diagrams over Omega
  hpcsweep explore figure3.h5 -o figure3.html   explore it in a browser

exit codes:
  0   complete
  75  stopped in good order before the end (time limit or signal): run again to resume
  2   a mistake in what was asked: one line says which; nothing was written
  1   memory or disk are not enough, told on one line; anything else, with a traceback
  141 standard output was closed
"""

import argparse
import errno
import inspect
import re
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from hpcsweep.campaign.progress import silence
from hpcsweep.commands import FAILURE, NO_MEMORY, USER_ERROR, complain, environment, lacks_memory
from hpcsweep.commands import one_thread as one_thread  # before numpy is loaded
from hpcsweep.figures.options import file_name

NAMES = (
    "new describe run status summary fragility table split merge validate pack plot animate "
    "explore warmup"
)
COMMANDS = {name: import_module(f"hpcsweep.commands.{name}") for name in NAMES.split()}
"""Modules of the commands, by their names, in the order of the help."""

FOR_USERS = ["CommandError", "JobError", "LauncherError", "PlotError", "StoreError", "StripesError"]
"""Errors that tell users on one line what is wrong, by name: their modules may not be loaded."""
OPTIONAL = ("h5netcdf", "matplotlib", "shtab", "xarray")
"""Libraries without which campaigns are computed, but results are not read as tables or drawn."""
RAW = argparse.RawDescriptionHelpFormatter
CLOSED_PIPE = 141
"""Exit code when standard output is closed, as the shell gives it: 128 + SIGPIPE."""


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of the system for a write to a full device."""


class _Parser(argparse.ArgumentParser):
    """Argument parser that reports an error on one line, from one rank.

    Parameters
    ----------
    complete : callable, optional
        Adds the options to the parser of a command, once it is chosen.
    """

    def __init__(self, *arguments, complete: Callable | None = None, **options):
        super().__init__(*arguments, **options)
        self._complete = complete
        # argparse takes -1e-3 and -inf for options
        self._negative_number_matcher = re.compile(r"-(\.?\d|inf|nan)")

    def parse_known_args(self, args=None, namespace=None):
        if self._complete is not None:
            complete, self._complete = self._complete, None
            complete(self)
        return super().parse_known_args(args, namespace)

    def _print_message(self, message: str, file=None):
        # argparse drops errors of the stream
        print(message, end="", file=file, flush=True)

    def error(self, message: str):
        complain(f"{message} (see {self.prog} --help)")
        raise SystemExit(USER_ERROR)


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of all commands."""
    parser = _Parser(prog="hpcsweep", **_help_of(__doc__)[1])
    # argparse sizes the column of commands by the options: "-h, --help" leaves eight letters
    parser.add_argument(
        *("-V", "--version"),
        action="store_true",
        help="print the versions of hpcsweep and its libraries",
    )
    parser.add_argument(
        "--print-completion",
        choices=("bash", "zsh", "tcsh"),
        help="print a script by which this shell completes commands and options (needs shtab)",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    for name, command in COMMANDS.items():
        first, texts = _help_of(command.__doc__)
        commands.add_parser(
            name,
            help=first.partition(": ")[2].removesuffix("."),
            complete=command.configure,
            **texts,
        ).set_defaults(function=command.run)
    return parser


def _help_of(docstring: str | None) -> tuple[str, dict[str, Any]]:
    """Return the first line of a docstring, and its description and epilog for argparse."""
    first, _, text = inspect.cleandoc(docstring or "").partition("\n\n")
    text, *examples = re.split(r"\n\n(?=examples?:|exit codes:)", text)
    epilog = "\n\n".join(examples) or None
    return first, {"description": text or None, "epilog": epilog, "formatter_class": RAW}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    try:
        code = _call(arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        # the reader has gone (``| head``); print nothing more, not even at exit
        silence(sys.stdout)
        return CLOSED_PIPE
    except OSError as error:
        if error.filename is not None or error.errno not in FULL:
            raise
        silence(sys.stdout)
        complain(f"standard output: cannot be written: {error.strerror}")
        return FAILURE
    return code


def _call(arguments: list[str] | None) -> int:
    """Run a command; print an error for users on one line."""
    try:
        environment.prepare()
        parser = build_parser()
        options = parser.parse_args(arguments)
        if options.print_completion:
            return _print_completion(parser, options.print_completion)
        if options.command is None and not options.version:
            parser.error("a command is needed")
        return _version() if options.version else options.function(options)
    except (ImportError, OSError, MemoryError, ValueError, RuntimeError) as error:
        if lacks_memory(error):
            complain(NO_MEMORY)
            return FAILURE
        said = str(error)
        if isinstance(error, ImportError) and error.name in OPTIONAL:
            said = f"needs {error.name}, which is not installed: pip install {error.name}"
        elif not any(kind.__name__ in FOR_USERS for kind in type(error).__mro__):
            raise
        complain(said)
        return USER_ERROR


def _print_completion(parser: argparse.ArgumentParser, shell: str) -> int:
    """Print what a shell reads to complete command lines; files where files are meant."""
    import shtab

    commands: Any = next(each.choices for each in parser._actions if each.dest == "command")
    for name, command in COMMANDS.items():
        command.configure(commands[name])
        for action in commands[name]._actions:
            if action.type in (Path, file_name):
                action.complete = shtab.FILE
    print(shtab.complete(parser, shell))
    return 0


def _version() -> int:
    from hpcsweep.campaign.provenance import git_commit, library_versions, version

    commit = git_commit()
    print(f"hpcsweep {version()}{f' ({commit})' if commit else ''}")
    print(library_versions())
    return 0
