"""All figures of `hpcsweep plot`, and options of figures, the film and the explorer.

A figure is a module with a name, the results it draws, its help and its options (`Figure`), listed
in `FIGURES`. Nothing here is slow to import.
"""

import argparse
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

FIGURES = (
    "diagrams.orbit_diagram",
    "diagrams.phase",
    "diagrams.frames",
    "diagrams.attractor_diagram",
    "diagrams.period_map",
    "diagrams.metrics",
    "diagrams.measures",
    "diagrams.vary_map",
    "diagrams.benefit",
    "diagrams.shares",
    "diagrams.attractor_map",
    "diagrams.ida",
    "diagrams.fragility",
    "diagrams.amplification",
    "diagrams.separation",
    "diagrams.profile",
    "diagrams.portfolio",
    "diagrams.suite_spectra",
    "diagrams.floor_spectra",
    "diagrams.record_history",
    "diagrams.hysteresis",
    "diagrams.energy",
    "diagrams.branches",
    "diagrams.basins",
)
"""Modules of `hpcsweep.figures`, each a `diagrams.figure.Figure`; the first one that draws what a
file holds is the default."""


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


def figures() -> dict[str, Any]:
    """Return the figures by their names."""
    modules = (import_module(f"hpcsweep.figures.{name}") for name in FIGURES)
    return {module.NAME: module for module in modules}


def results_of(figure: Any) -> tuple[str, ...]:
    """Return what a file must hold for a figure, one of several."""
    return (figure.DRAWS,) if isinstance(figure.DRAWS, str) else figure.DRAWS


def options_of(drawn: Iterable[Any]) -> dict[Option, str]:
    """Return the options of figures, and the names of the figures that know each."""
    drawn = list(drawn)
    every = dict.fromkeys(option for figure in drawn for option in figure.OPTIONS)
    return {o: ", ".join(f.NAME for f in drawn if o in f.OPTIONS) for o in every}


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
UNITS = Option(
    "--units",
    "g: intensities that are accelerations in g (default: in the units of the job)",
    choices=("g",),
)
BRANCHES = Option(
    "--branches",
    "branches along the same parameter, of the same structure, laid beneath: stable full, unstable "
    "thin; over a map their special points and curves",
    type=Path,
    metavar="FILE",
)
CELLS = Option(
    "--cells",
    "outline the cells of a refined map from which points are inferred",
    action="store_true",
    default=None,
)
DIRECTION = Option("--direction", "sweep drawn (default: the first)", choices=("up", "down"))
