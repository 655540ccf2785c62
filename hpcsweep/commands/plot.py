"""`hpcsweep plot`: draw a results file."""

import argparse
import contextlib
from typing import TYPE_CHECKING

from hpcsweep.commands import CommandError, add_at, add_file
from hpcsweep.commands.outputs import PICTURE, check_overwriting, writing
from hpcsweep.figures.options import figures, options_of, whole_number

if TYPE_CHECKING:
    from hpcsweep.figures.diagrams.figure import Figure

SUMMARY = "draw a figure of the results"
NAME_WIDTH = 10
RESOLUTIONS = 50, 1200
"""Pixels an inch, least and most."""
MAPS = {"motions": "map", "attractors": "number"}
"""Default figure of scattered runs, by the kind of results."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the description, of all figures, and the options of the command."""
    known = figures()
    default = _defaults(known)
    parser.description = "\n".join(
        ["Draw a results file.", "", *(_describe(f, default) for f in known.values())]
    )
    add_file(parser, "PNG", "picture (default: FILE with .png)")
    parser.add_argument(
        "--kind",
        choices=tuple(known),
        help=f"figure (default: {', '.join(f'{name} of {h}' for h, name in default.items())})",
    )
    parser.add_argument(
        "--dpi",
        type=whole_number(*RESOLUTIONS),
        default=200,
        metavar="N",
        help="pixels an inch (default: %(default)s)",
    )
    for name, axis in zip("xy", ("horizontal", "vertical"), strict=True):
        told = f"limits of the {axis} axis of all panels, which must show one quantity there"
        ends = {"type": float, "nargs": 2, "metavar": ("A", "B")}
        parser.add_argument(f"--{name}lim", help=told, **ends)
    add_at(parser)
    for option, kinds in options_of(known.values()).items():
        option.add(parser, f"; {kinds}")


def _defaults(known: dict[str, "Figure"]) -> dict[str, str]:
    """Return the default figure for each kind of results: the first that draws it."""
    return {figure.DRAWS: name for name, figure in reversed(known.items())}


def _describe(figure, default: dict[str, str]) -> str:
    """Return a figure's lines in the command's help."""
    is_default = default[figure.DRAWS] == figure.NAME
    lines = (figure.HELP + (" (default)" if is_default else "")).splitlines()
    indent = " " * (NAME_WIDTH + 3)
    return f"  {figure.NAME:{NAME_WIDTH}} " + f"\n{indent}".join(lines)


def run(options) -> int:
    """Run the command."""
    from hpcsweep.figures.style import limits, resolution, save
    from hpcsweep.store import Frames, job_of

    known = figures()
    study = job_of(options.file).study
    # points of a list have no amplitudes in common, those of a refined map are not all computed,
    # and of motions without their points there is nothing to draw over an amplitude
    default = _defaults(known)[study.holds]
    pointless = study.holds == "motions" and "poincare" not in {v.name for v in study.variables}
    if study.is_list or study.refine or pointless:
        default = MAPS.get(study.holds, default)
    kind = options.kind or default
    figure = known[kind]
    given = {}
    for option, kinds in options_of(known.values()).items():
        value = getattr(options, option.keyword)
        if value is None:
            continue
        if option not in figure.OPTIONS:
            raise CommandError(f"{option.flag} does not go with --kind {kind}, only with: {kinds}")
        given[option.keyword] = value
    output = options.output or options.file.with_suffix(".png")
    if not output.suffix:
        output = output.with_name(f"{output.name}.png")
    check_overwriting(output, PICTURE)
    frames = Frames(options.file, figure.DRAWS, options.at)
    view = limits(x=options.xlim, y=options.ylim)
    with contextlib.closing(frames), resolution(options.dpi), view, writing(output):
        save(figure.draw(figure.load(frames, **given), **given), output)
    print(output)
    return 0
