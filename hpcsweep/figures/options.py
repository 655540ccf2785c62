"""All figures of `hpcsweep plot`, and options of figures, the film and the explorer.

A figure is a function under `figure_of`, in one of `MODULES`. It takes its colours from
`hpcsweep.figures.palette`, so that a motion, a contact set or a direction looks the same as
everywhere, and its labels from `hpcsweep.figures.style`. Nothing here is slow to import.
"""

import argparse
import inspect
import re
from collections.abc import Callable, Collection
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

MODULES = (
    "orbit_diagram phase sweep attractors maps metrics vary_map intensities storeys histories "
    "branches basins motion response"
)
"""Of `hpcsweep.figures.diagrams`; the first figure that draws what a file holds is the default."""


class Option:
    """An option of the command line.

    Parameters
    ----------
    flag : str
        Such as ``--omega``. Figures that share a flag share the whole option.
    help : str
        Meaning and default; the command adds the figures that know it.
    **arguments
        Further ones of `argparse.ArgumentParser.add_argument`; the figure takes the value under
        the name ``dest``, by default that of the flag.
    """

    def __init__(self, flag: str, help: str, **arguments: Any):
        self.flag, self.help, self.arguments = flag, help, arguments
        self.keyword = arguments.setdefault("dest", flag.removeprefix("--").replace("-", "_"))

    def add(self, parser: argparse.ArgumentParser, more: str = "") -> None:
        """Add the option to a parser, and `more` to its help."""
        parser.add_argument(self.flag, help=self.help + more, **self.arguments)


class Figure(NamedTuple):
    """One kind of figure of `hpcsweep plot`."""

    name: str
    """For ``--kind``."""
    draws: tuple[str, ...]
    """What a file must hold (`Study.content`), one of several."""
    options: tuple[Option, ...]
    load: Callable
    """Read what to draw, from `hpcsweep.store.Frames`: of one part, where keys are varied."""
    draw: Callable
    """Draw what `load` returned, or all results; its docstring begins with the command's help."""

    @property
    def help(self) -> str:
        """What is drawn."""
        return re.split(r"\n\n\w+\n-", inspect.getdoc(self.draw) or "")[0]


def figure_of(name: str, draws: str, load: Callable, *options: Option) -> Callable[..., Figure]:
    """Make a figure of the function below: of what a file `draws`, one or several words."""
    return lambda draw: Figure(name, tuple(draws.split()), options, load, draw)


def figures() -> dict[str, Figure]:
    """Return the figures by their names."""
    modules = (import_module(f"hpcsweep.figures.diagrams.{name}") for name in MODULES.split())
    every = (each for module in modules for each in vars(module).values())
    return {each.name: each for each in every if isinstance(each, Figure)}


def options_of(drawn: Collection[Figure]) -> dict[Option, str]:
    """Return the options of figures, and the names of the figures that know each."""
    every = dict.fromkeys(option for each in drawn for option in each.options)
    return {o: ", ".join(each.name for each in drawn if o in each.options) for o in every}


def whole_number(least: int, most: int | None = None):
    """Return a converter of an argument to a whole number from `least` to `most`."""

    def convert(text: str) -> int:
        value = int(text)
        if value < least or (most is not None and value > most):
            limit = f"at least {least}" if most is None else f"from {least} to {most}"
            raise argparse.ArgumentTypeError(f"must be {limit}, is {text}")
        return value

    convert.__name__ = "whole number"
    return convert


def file_name(text: str) -> Path:
    """Convert an argument to the name of a file."""
    if not text:
        raise argparse.ArgumentTypeError("must not be empty")
    if any(char < " " for char in text):
        raise argparse.ArgumentTypeError(f"must be a name on one line, is {text!r}")
    return Path(text)


def positive(text: str) -> float:
    """Convert an argument to a finite number greater than 0."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be greater than 0, is {text}")
    return value


OMEGA = Option("--omega", "frequency; the nearest frame is drawn (default: the first)", type=float)
AMPLITUDES = Option(
    "--amplitude",
    "amplitudes drawn; of a sweep along omega the frame nearest to it (default: the first)",
    dest="amplitudes",
    type=float,
    nargs="+",
    metavar="A",
)
ALONG = Option(
    "--along",
    "values of what the sweep is along, if not the amplitude; the nearest runs are drawn",
    type=float,
    nargs="+",
    metavar="X",
)
PERIOD = Option(
    "--period",
    "orbit periods; an example of each is found in the sweep",
    dest="periods",
    type=whole_number(1),
    nargs="+",
    metavar="P",
)
SWEEP = Option(
    "--sweep",
    "results of an amplitude sweep over the same points, or amplitudes",
    type=Path,
    metavar="FILE",
)
FLOORS = Option(
    "--floor",
    "floor shown, by number from 1 or name; may be given several times (default: all of up to 5; "
    "of more the first, the middle and the top)",
    dest="floors",
    action="append",
    metavar="FLOOR",
)
ROWS = Option(
    "--row",
    "another coordinate shown: a difference of two floors, 2-1, the row of a contact, contact:1, "
    "or of a drift, drift:1; may be given several times",
    dest="floors",
    action="append",
    metavar="ROW",
)
UNITS = Option(
    "--units",
    "g: intensities, and responses, that are accelerations in g (default: in the units of the job)",
    choices=("g",),
)
BRANCHES = Option(
    "--branches",
    "branches along the same parameter, of the same structure, laid beneath: stable full, unstable "
    "thin; over a map their special points and curves",
    type=Path,
    metavar="FILE",
)
MEANINGS = ("direction", "contact", "period")
COLOUR = Option("--color", "what the colours show (default: direction)", choices=MEANINGS)
CELLS = Option(
    "--cells",
    "outline the cells of a refined map from which points are inferred",
    action="store_true",
    default=None,
)
DIRECTION = Option("--direction", "sweep drawn (default: the first)", choices=("up", "down"))
RUN, COORDINATES = (OMEGA, AMPLITUDES, ALONG, DIRECTION), (FLOORS, ROWS)
"""Options that tell which run of a sweep is drawn, and which of its coordinates."""
