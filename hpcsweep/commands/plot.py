"""`hpcsweep plot`: draw a results file."""

import argparse
from pathlib import Path

from hpcsweep.commands import RAW, USER_ERROR, complain, file_name

KINDS = {
    "orbit": ("omega", "color"),
    "phase": ("omega", "amplitude", "period", "direction"),
    "frames": ("direction", "frames", "floor"),
    "map": ("direction", "value"),
    "metrics": ("omega",),
    "benefit": ("direction",),
}
"""Kinds of figure and the options each knows."""

DESCRIPTION = """\
Draw a results file.

  orbit    stroboscopic displacement of each floor against the forcing amplitude, one frame, sweeps
           up and down, contact regions along the top (default)
  phase    phase portraits of all floors at --amplitude A ... or of orbit --period P ...
  frames   small orbit diagrams of several frames
  map      motion classes over amplitude and frequency, or --value of each run
  metrics  drift and mean modal norms against the amplitude, one frame
  benefit  where impact lowers and raises the drift, for chaos and for period 1"""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    plot = commands.add_parser(
        "plot", help="draw a figure of the results", description=DESCRIPTION, formatter_class=RAW
    )
    plot.add_argument("file", type=Path, metavar="FILE")
    plot.add_argument(
        "-o", "--output", type=file_name, metavar="PNG", help="picture (default: FILE with .png)"
    )
    plot.add_argument(
        "--kind", choices=tuple(KINDS), default="orbit", help="figure (default: %(default)s)"
    )
    plot.add_argument(
        "--omega",
        type=float,
        help="frequency; the nearest frame is drawn (default: the first); orbit, phase, metrics",
    )
    plot.add_argument(
        "--color",
        choices=("direction", "contact", "period"),
        help="what the colours tell (default: direction); orbit",
    )
    plot.add_argument(
        "--amplitude", type=float, nargs="+", metavar="A", help="amplitudes drawn; phase"
    )
    plot.add_argument(
        "--period",
        type=_period,
        nargs="+",
        metavar="P",
        help="orbit periods of which an example is found in the sweep; phase",
    )
    plot.add_argument(
        "--direction",
        choices=("up", "down"),
        help="sweep drawn (default: the first); phase, frames, map, benefit",
    )
    plot.add_argument("--frames", type=int, metavar="N", help="number of frames; frames")
    plot.add_argument("--floor", type=int, metavar="I", help="floor drawn (default: top); frames")
    plot.add_argument(
        "--value",
        choices=("period", "drift", "contact", "modal_norm", "lyapunov"),
        help="what the colours tell (default: period, the motion classes); map",
    )
    plot.set_defaults(function=_plot)


def _period(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, is {text}")
    return value


def _plot(options) -> int:
    given = {
        name: getattr(options, name)
        for name in dict.fromkeys(name for names in KINDS.values() for name in names)
        if getattr(options, name) is not None
    }
    for name in given:
        if name not in KINDS[options.kind]:
            kinds = ", ".join(kind for kind, names in KINDS.items() if name in names)
            complain(f"--{name} does not go with --kind {options.kind}, only with: {kinds}")
            return USER_ERROR
    from hpcsweep.figures.style import PlotError
    from hpcsweep.store import StoreError

    output = options.output or options.file.with_suffix(".png")
    try:
        _draw(options.kind, _read(options.kind, options.file, given), output, given)
    except (StoreError, PlotError) as error:
        complain(str(error))
        return USER_ERROR
    except OSError as error:
        complain(f"{output}: cannot be written: {error.strerror or error}")
        return USER_ERROR
    print(output)
    return 0


def _read(kind: str, file: Path, given: dict):
    """Read what a kind of figure is drawn of, of a file that may be larger than the memory."""
    from hpcsweep.figures.diagrams.frames import choose
    from hpcsweep.figures.diagrams.mesh import open_map
    from hpcsweep.figures.style import nearest_frame
    from hpcsweep.store import Frames

    if kind in ("map", "benefit"):
        return open_map(file, given.get("value"), given.get("direction"))
    frames = Frames(file)
    try:
        omegas = frames.job.omega
        if kind == "frames":
            chosen = choose(omegas, given.get("frames"))
        else:
            chosen = [nearest_frame(omegas, given.get("omega"))]
        return frames.gather([*frames], chosen)
    finally:
        frames.close()


def _draw(kind: str, results, output: Path, given: dict) -> None:
    """Draw one kind of figure with the options that were given."""
    from hpcsweep.figures.diagrams import benefit, frames, metrics, orbit_diagram, period_map, phase

    if kind == "phase":
        given = dict(given)
        given["amplitudes"] = given.pop("amplitude", ())
        given["periods"] = given.pop("period", ())
    modules = {
        "orbit": orbit_diagram,
        "phase": phase,
        "frames": frames,
        "map": period_map,
        "metrics": metrics,
        "benefit": benefit,
    }
    modules[kind].draw(results, output, **given)
