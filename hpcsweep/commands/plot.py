"""`hpcsweep plot`: draw a figure of the results."""

import argparse
import contextlib
import textwrap

from hpcsweep.commands import CommandError, add_at, add_file
from hpcsweep.commands.outputs import PICTURE, check_overwriting, writing
from hpcsweep.figures.options import Figure, figures, options_of, whole_number

NAME_WIDTH, HELP_WIDTH = 10, 100
INDENT = " " * (NAME_WIDTH + 3)
RESOLUTIONS = 50, 1200
"""Pixels an inch, least and most."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the description, of all figures, and the options of the command."""
    every = figures()
    default = _defaults(every)
    listed = (_describe(figure, default) for figure in every.values())
    parser.description = "\n".join(["Draw a results file.", "", *listed])
    add_file(parser, "PNG", "picture (default: FILE with .png)")
    parser.add_argument(
        "--kind",
        choices=tuple(every),
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
        meaning = f"limits of the {axis} axis of all panels, which must show one quantity there"
        parser.add_argument(f"--{name}lim", type=float, nargs=2, metavar=("A", "B"), help=meaning)
    add_at(parser)
    for option, kinds in options_of(every.values()).items():
        option.add(parser, f"; {kinds}")


def _defaults(every: dict[str, Figure]) -> dict[str, str]:
    """Return the default figure for each kind of results: the first that draws it."""
    drawn = [(what, name) for name, figure in every.items() for what in figure.draws]
    return dict(reversed(drawn))


def _default(job, every: dict[str, Figure]) -> str:
    """Return the default figure of a job: a map where single points are all there is to draw.

    Points of a list have no amplitudes in common, those of a refined map are not all computed, and
    of motions without their points there is nothing to draw over an amplitude. The attractors of a
    grid are one figure a frequency, or one map.
    """
    from hpcsweep.job import part_of

    study = part_of(job, (0,) * len(job.study.axes)).study
    if study.refine and study.content == "attractors":
        return "number"
    pointless = study.content == "motions" and "poincare" not in {v.name for v in study.variables}
    frame_and_along = study.run_dims[-2:]
    plane = study.content == "attractors" and {*frame_and_along} == {"omega", "amplitude"}
    plane &= min(study.dimensions[name] for name in frame_and_along) > 1
    in_map = study.content in ("motions", "attractors") and (study.is_list or study.refine)
    return "map" if in_map or pointless or plane else _defaults(every)[study.content]


def _describe(figure: Figure, default: dict[str, str]) -> str:
    """Return a figure's lines in the command's help."""
    is_default = figure.name in (default[what] for what in figure.draws)
    text = figure.help.removesuffix(".") + " (default)" * is_default
    text = text[:1].lower() + text[1:].replace("\n\n", " ")
    name = f"  {figure.name:{NAME_WIDTH}} "
    return textwrap.fill(text, HELP_WIDTH, initial_indent=name, subsequent_indent=INDENT)


def run(options) -> int:
    """Run the command."""
    from hpcsweep.figures.style import PlotError
    from hpcsweep.figures.view import save, viewing
    from hpcsweep.store import Frames, job_of
    from hpcsweep.studies.ground_motion.stripes import StripesError

    every = figures()
    kind = options.kind or _default(job_of(options.file), every)
    figure = every[kind]
    chosen = {}
    known = options_of(every.values())
    for option, kinds in known.items():
        value = getattr(options, option.keyword)
        if value is None:
            continue
        if option not in figure.options:
            flags = " or ".join(each.flag for each in known if each.keyword == option.keyword)
            raise CommandError(f"{flags} does not go with --kind {kind}, only with: {kinds}")
        chosen[option.keyword] = value
    output = options.output or options.file.with_suffix(".png")
    if not output.suffix:
        output = output.with_name(f"{output.name}.png")
    check_overwriting(output, PICTURE)
    frames = Frames(options.file, figure.draws, options.at)
    view = viewing(options.dpi, x=options.xlim, y=options.ylim)
    with contextlib.closing(frames), view, writing(output):
        try:
            save(figure.draw(figure.load(frames, **chosen), **chosen), output)
        except (PlotError, StripesError) as error:
            raise PlotError(f"{options.file}: {error}") from None
    print(output)
    return 0
